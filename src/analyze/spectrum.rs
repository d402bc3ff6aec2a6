//! Power spectra, averaged over directions.
//!
//! Images are transformed by the DCT-II, horizontal differences by the DST-I along x and the DCT-II along y, vertical
//! ones the other way round: those are the bases in which the forward difference with natural borders is diagonal, so
//! that the differences of white noise of power σ² have the power (λ_x + λ_y) σ² exactly ([`super::model`]). All
//! transforms are orthonormal: white noise of variance σ² has the power σ² at every frequency. The mean of an image,
//! frequency zero, is left out.

use super::model::eigenvalue;
use crate::film::Plane;
use rustdct::DctPlanner;

/// Width of a bin, cycles a pixel.
const BIN: f64 = 1.0 / 32.0;
/// Bins up to the corner of the spectrum, √½ cycles a pixel.
pub const BINS: usize = 23;

/// What a plane holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A value a pixel.
    Image,
    /// Differences to the right; the last column is not read.
    Dx,
    /// Differences downwards; the last row is not read.
    Dy,
}

/// Middle of a bin, cycles a pixel.
pub fn frequency(bin: usize) -> f64 {
    (bin as f64 + 0.5) * BIN
}

/// Mean power a bin.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spectrum {
    sums: Vec<f64>,
    counts: Vec<f64>,
}

impl Spectrum {
    /// Power of `plane`, mean over its channels; values that are not finite count as zero.
    pub fn of(plane: &Plane, kind: Kind) -> Self {
        let mut spectrum = Self { sums: vec![0.0; BINS], counts: vec![0.0; BINS] };
        let (w, h) = (plane.width, plane.height);
        let (columns, rows) = match kind {
            Kind::Image => (w, h),
            Kind::Dx => (w.saturating_sub(1), h),
            Kind::Dy => (w, h.saturating_sub(1)),
        };
        if columns == 0 || rows == 0 {
            return spectrum;
        }
        let mut planner = DctPlanner::new();
        for c in 0..3 {
            let value = |x: usize, y: usize| f64::from(plane.at(x, y)[c]);
            let finite = |v: f64| if v.is_finite() { v } else { 0.0 };
            let field: Vec<f64> =
                (0..columns * rows).map(|i| finite(value(i % columns, i / columns))).collect();
            let field = transposed(transform(&mut planner, field, columns, kind == Kind::Dx), columns);
            let field = transform(&mut planner, field, rows, kind == Kind::Dy);
            for (i, v) in field.iter().enumerate() {
                let (kx, ky) = index(i / rows, i % rows, kind);
                spectrum.add(radius(kx, ky, w, h), v * v / 3.0, 1.0 / 3.0);
            }
        }
        spectrum
    }

    /// What a model predicts for an image of `width`×`height`: the mean of `power(λ_x + λ_y)` over the frequencies
    /// of each bin.
    pub fn predicted(width: usize, height: usize, power: impl Fn(f64) -> f64) -> Self {
        let mut spectrum = Self { sums: vec![0.0; BINS], counts: vec![0.0; BINS] };
        for ky in 0..height {
            for kx in 0..width {
                let lambda = eigenvalue(kx, width) + eigenvalue(ky, height);
                spectrum.add(radius(kx, ky, width, height), power(lambda), 1.0);
            }
        }
        spectrum
    }

    fn add(&mut self, radius: f64, power: f64, count: f64) {
        if radius > 0.0 {
            let bin = ((radius / BIN) as usize).min(BINS - 1);
            self.sums[bin] += power;
            self.counts[bin] += count;
        }
    }

    /// Adds another one's powers, so that the mean is over both.
    pub fn merge(&mut self, other: &Self) {
        if self.sums.is_empty() {
            *self = other.clone();
            return;
        }
        for (mine, theirs) in [(&mut self.sums, &other.sums), (&mut self.counts, &other.counts)] {
            mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        }
    }

    /// Multiplies the power.
    pub fn scale(&mut self, factor: f64) {
        self.sums.iter_mut().for_each(|s| *s *= factor);
    }

    /// (middle frequency, mean power) of each bin that has a frequency in it.
    pub fn points(&self) -> Vec<(f64, f64)> {
        let bins = self.sums.iter().zip(&self.counts).enumerate();
        bins.filter(|(_, (_, n))| **n > 0.0).map(|(i, (s, n))| (frequency(i), s / n)).collect()
    }
}

/// Indices of a coefficient: the sine transform begins at 1.
fn index(x: usize, y: usize, kind: Kind) -> (usize, usize) {
    (x + usize::from(kind == Kind::Dx), y + usize::from(kind == Kind::Dy))
}

/// Distance from frequency zero, cycles a pixel.
fn radius(kx: usize, ky: usize, width: usize, height: usize) -> f64 {
    (kx as f64 / (2 * width) as f64).hypot(ky as f64 / (2 * height) as f64)
}

/// Orthonormal DST-I (`sine`) or DCT-II of every line of `length` values.
fn transform(planner: &mut DctPlanner<f64>, mut field: Vec<f64>, length: usize, sine: bool) -> Vec<f64> {
    if sine {
        let dst = planner.plan_dst1(length);
        let scale = (2.0 / (length + 1) as f64).sqrt();
        for line in field.chunks_exact_mut(length) {
            dst.process_dst1(line);
            line.iter_mut().for_each(|v| *v *= scale);
        }
    } else {
        let dct = planner.plan_dct2(length);
        let scale = (2.0 / length as f64).sqrt();
        for line in field.chunks_exact_mut(length) {
            dct.process_dct2(line);
            line.iter_mut().for_each(|v| *v *= scale);
            if let Some(constant) = line.first_mut() {
                *constant *= std::f64::consts::FRAC_1_SQRT_2;
            }
        }
    }
    field
}

/// Columns as lines.
fn transposed(field: Vec<f64>, columns: usize) -> Vec<f64> {
    let rows = field.len() / columns;
    (0..field.len()).map(|i| field[i % rows * columns + i / rows]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::noise::tests::{difference, noise};

    #[test]
    fn white_noise_is_flat_in_every_basis() {
        let plane = noise(96, 64, 0.3, 5);
        for kind in [Kind::Image, Kind::Dx, Kind::Dy] {
            let spectrum = Spectrum::of(&plane, kind);
            let total: f64 = spectrum.counts.iter().sum();
            let want = if kind == Kind::Image {
                96 * 64 - 1
            } else {
                96 * 64 - if kind == Kind::Dx { 64 } else { 96 }
            };
            assert!((total - want as f64).abs() < 1e-6, "{kind:?}: {total} coefficients");
            for ((frequency, power), count) in spectrum.points().into_iter().zip(&spectrum.counts) {
                // The mean of n squares of normal numbers deviates by √(2/n); three channels, four deviations.
                let tolerance = 4.0 * (2.0 / (3.0 * count)).sqrt();
                assert!((power / 0.09 - 1.0).abs() < tolerance, "{kind:?} at {frequency}: {power}");
            }
        }
    }

    #[test]
    fn differences_rise_as_the_eigenvalues_exactly() {
        let (w, h) = (48, 36);
        let plane = noise(w, h, 0.3, 6);
        let mut planner = DctPlanner::new();
        let mut want = [0.0; BINS];
        for c in 0..3 {
            let field = plane.data.iter().map(|v| f64::from(v[c])).collect();
            let rows = transform(&mut planner, field, w, false);
            let field = transform(&mut planner, transposed(rows, w), h, false);
            for (i, v) in field.iter().enumerate().skip(1) {
                let (kx, ky) = (i / h, i % h);
                let bin = ((radius(kx, ky, w, h) / BIN) as usize).min(BINS - 1);
                want[bin] += v * v / 3.0 * (eigenvalue(kx, w) + eigenvalue(ky, h));
            }
        }
        let dx = Spectrum::of(&difference(&plane, (1, 0)), Kind::Dx);
        let dy = Spectrum::of(&difference(&plane, (0, 1)), Kind::Dy);
        for (bin, want) in want.iter().enumerate() {
            let sum = dx.sums[bin] + dy.sums[bin];
            assert!((sum - want).abs() < 1e-5 * want.max(1e-3), "bin {bin}: {sum}, theory {want}");
        }
    }
}
