//! The noise of the rows, from two independent halves of the samples: half the square of half their difference is the
//! variance of the mean of both, with one degree of freedom a channel; the mean over the channels is taken.
//!
//! One pixel's figure is far too noisy to be a weight, so the neighbours' are averaged with Gaussian weights: those of
//! the primal in both directions, those of a difference *along the edge it crosses* alone, dx down the column and dy
//! along the row. A silhouette is one pixel wide: across it the noise of the differences jumps by orders of magnitude,
//! along it it does not.

use super::rows::{BAND, measured};
use crate::film::{Measured, Plane};
use rayon::prelude::*;

/// Standard deviation of the Gaussian along a difference's edge, pixels.
const EDGE_SIGMA: f32 = 1.5;
/// The same for the primal, both directions.
const PRIMAL_SIGMA: f32 = 2.5;

/// Variances of one kind of row, one a pixel.
#[derive(Clone, Debug)]
pub(super) struct Variances {
    width: usize,
    /// Zero where unknown.
    values: Vec<f32>,
    /// 1 where known, 0 where not; empty where all are known.
    known: Vec<f32>,
}

/// The noise of all rows.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    pub primal: Variances,
    pub dx: Variances,
    pub dy: Variances,
}

impl Noise {
    /// The variances of the mean of two halves, unsmoothed.
    pub fn new(halves: &[Measured; 2]) -> Self {
        let [a, b] = halves;
        let (w, h) = (a.primal.width, a.primal.height);
        Self {
            primal: Variances::new(&a.primal, &b.primal, |_| true),
            dx: Variances::new(&a.dx, &b.dx, |i| i % w + 1 < w),
            dy: Variances::new(&a.dy, &b.dy, |i| i / w + 1 < h),
        }
    }

    /// The mean over neighbours, as the file's text says.
    pub fn smoothed(self) -> Self {
        Self {
            primal: self.primal.smoothed(PRIMAL_SIGMA, PRIMAL_SIGMA),
            dx: self.dx.smoothed(0.0, EDGE_SIGMA),
            dy: self.dy.smoothed(EDGE_SIGMA, 0.0),
        }
    }

    /// The root of the mean variance of a difference over that of the primal; `None` where either is zero.
    pub fn ratio(&self) -> Option<f32> {
        let (primal, n0) = self.primal.sum();
        let ((dx, nx), (dy, ny)) = (self.dx.sum(), self.dy.sum());
        let square = (dx + dy) / (nx + ny) / (primal / n0);
        (square > 0.0 && square.is_finite()).then(|| square.sqrt() as f32)
    }
}

impl Variances {
    fn new(a: &Plane, b: &Plane, inside: impl Fn(usize) -> bool + Sync) -> Self {
        let known = |i: usize| inside(i) && measured(&a.data[i]) && measured(&b.data[i]);
        let one = |i: usize| {
            let square = |c: usize| (0.5 * (a.data[i][c] - b.data[i][c])).powi(2);
            if known(i) { (square(0) + square(1) + square(2)) / 3.0 } else { 0.0 }
        };
        let range = || (0..a.data.len()).into_par_iter();
        let all = range().all(known);
        Self {
            width: a.width,
            values: range().map(one).collect(),
            known: if all { Vec::new() } else { range().map(|i| f32::from(u8::from(known(i)))).collect() },
        }
    }

    /// The sum of the known variances, and their number.
    fn sum(&self) -> (f64, f64) {
        let sum = |v: &[f32]| {
            v.par_chunks(1 << 14).map(|v| v.iter().map(|v| f64::from(*v)).sum::<f64>()).collect::<Vec<_>>()
        };
        let count = if self.known.is_empty() {
            self.values.len() as f64
        } else {
            sum(&self.known).iter().sum::<f64>()
        };
        (sum(&self.values).iter().sum(), count)
    }

    /// Means over neighbours with Gaussian weights of deviations `sigma_x` and `sigma_y` pixels; known everywhere
    /// but where nothing near is.
    fn smoothed(&self, sigma_x: f32, sigma_y: f32) -> Self {
        let mut values = smooth(&self.values, self.width, sigma_x, sigma_y);
        if !self.known.is_empty() {
            let shares = smooth(&self.known, self.width, sigma_x, sigma_y);
            values.par_iter_mut().zip(&shares).for_each(|(v, s)| *v = if *s > 0.0 { *v / s } else { 0.0 });
        }
        Self { width: self.width, values, known: Vec::new() }
    }

    /// The weights 1/(v + floor), in units of the median variance, and that median.
    pub fn weights(&self) -> (f32, Vec<f32>) {
        let mut positive: Vec<f32> = self.values.iter().copied().filter(|v| *v > 0.0).collect();
        if positive.is_empty() {
            return (0.0, vec![1.0; self.values.len()]);
        }
        let middle = positive.len() / 2;
        let median = *positive.select_nth_unstable_by(middle, f32::total_cmp).1;
        let weight = |v: &f32| median / (v + FLOOR * median);
        (median, self.values.par_iter().map(weight).collect())
    }
}

/// Added to every variance, in medians: what one pair of halves says of a quiet row is not to be believed, and weights
/// of one order of magnitude are solved for sooner.
const FLOOR: f32 = 0.4;

/// Gaussian weights of offsets 0 to 3 `sigma`.
fn kernel(sigma: f32) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil() as usize;
    (0..=radius).map(|i| if i == 0 { 1.0 } else { (-0.5 * (i as f32 / sigma).powi(2)).exp() }).collect()
}

/// Means over neighbours with Gaussian weights of deviations `sigma_x` and `sigma_y` pixels; nothing is outside.
pub(super) fn smooth(values: &[f32], width: usize, sigma_x: f32, sigma_y: f32) -> Vec<f32> {
    if values.is_empty() {
        return Vec::new();
    }
    smooth_rows(smooth_columns(values, width, &kernel(sigma_y)), width, &kernel(sigma_x))
}

fn smooth_columns(values: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let height = values.len() / width;
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(BAND * width).enumerate().for_each(|(band, rows)| {
        for (i, row) in rows.chunks_exact_mut(width).enumerate() {
            let y = band * BAND + i;
            let near = y.saturating_sub(kernel.len() - 1)..(y + kernel.len()).min(height);
            let norm = 1.0 / near.clone().map(|other| kernel[y.abs_diff(other)]).sum::<f32>();
            for other in near {
                let weight = norm * kernel[y.abs_diff(other)];
                row.iter_mut().zip(&values[other * width..]).for_each(|(out, v)| *out += weight * v);
            }
        }
    });
    out
}

fn smooth_rows(values: Vec<f32>, width: usize, kernel: &[f32]) -> Vec<f32> {
    if kernel.len() == 1 {
        return values;
    }
    let sums = |row: &[f32], out: &mut [f32]| {
        out.iter_mut().zip(row).for_each(|(out, v)| *out = kernel[0] * v);
        for (i, weight) in kernel.iter().enumerate().skip(1).take(width - 1) {
            out.iter_mut().zip(&row[i..]).for_each(|(out, v)| *out += weight * v);
            out[i..].iter_mut().zip(row).for_each(|(out, v)| *out += weight * v);
        }
    };
    let mut norm = vec![0.0; width];
    sums(&vec![1.0; width], &mut norm);
    let mut out = vec![0.0; values.len()];
    out.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(out, row)| {
        sums(row, out);
        out.iter_mut().zip(&norm).for_each(|(out, norm)| *out /= norm);
    });
    out
}
