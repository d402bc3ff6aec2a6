//! The image of least absolute residuals: iteratively reweighted least squares.
//!
//! Minimises Σ ‖α (x − g)‖ + ‖Dx x − dx‖ + ‖Dy x − dy‖, the norm of a row being the Euclidean norm of its RGB
//! residual: the channels share their weights. Each outer iteration solves the least-squares problem with the weights
//! ω = 1/(‖residual‖ + reg_k) of the iterate before (Lehtinen et al. 2013; Kettunen et al. 2015).
//!
//! The start is the exact L2 image. reg_k is a multiple of the median row residual of that start, which makes the
//! result independent of the exposure and the schedule independent of the noise. A reweighted system is not solved
//! to the end: a few steps of conjugate gradients with a multigrid cycle, continued from the iterate before.
//!
//! **Stopping rule:** after 8 reweightings, or when the objective fell by less than 5·10⁻⁴ (relative) in one; that
//! leaves it within 0.5 % (the tests hold it to that) of what 64 reweightings solved to the end reach. Rows without a
//! measurement have the weight zero.

use super::multigrid::{Multigrid, Weights};
use super::rows::{BAND, NO_DX, NO_DY, NO_PRIMAL, Problem};
use super::{Found, l2};
use rayon::prelude::*;

/// How a solve is run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schedule {
    /// Most reweightings.
    pub outer: usize,
    /// Conjugate-gradient steps in each.
    pub steps: usize,
    /// First regulariser, in median row residuals.
    pub reg: f64,
    /// Its factor from one reweighting to the next.
    pub decay: f64,
    /// Relative decrease of the objective that ends the solve.
    pub tolerance: f64,
}

/// The schedule of [`solve`].
pub(super) const DEFAULT: Schedule = Schedule { outer: 8, steps: 3, reg: 0.1, decay: 0.6, tolerance: 5e-4 };

/// The rows of the problem, α-rows included, seen from the correction y = x − g.
struct Rows<'a> {
    problem: &'a Problem<'a>,
    alpha: f32,
    /// Residuals of the primal: pixel row y is ex (3 W values), then ey.
    data: Vec<f32>,
}

/// One pixel row of residuals D y − e and their RGB norms.
struct RowResidual {
    x: Vec<f32>,
    y: Vec<f32>,
    norm: [Vec<f32>; 3],
}

impl RowResidual {
    fn new(width: usize) -> Self {
        let plane = |n: usize| vec![0.0; n];
        Self { x: plane(3 * width), y: plane(3 * width), norm: std::array::from_fn(|_| plane(width)) }
    }
}

/// `out` = scale · Euclidean norm of the three channels of `row`.
fn channel_norm(row: &[f32], scale: f32, out: &mut [f32]) {
    let w = out.len();
    let (r, g, b) = (&row[..w], &row[w..2 * w], &row[2 * w..3 * w]);
    for x in 0..w {
        out[x] = scale * (r[x] * r[x] + g[x] * g[x] + b[x] * b[x]).sqrt();
    }
}

impl<'a> Rows<'a> {
    fn new(problem: &'a Problem, alpha: f32) -> Self {
        let stride = problem.stride();
        let mut data = vec![0.0; 2 * stride * problem.height];
        data.par_chunks_mut(2 * stride).enumerate().for_each(|(y, row)| {
            let (ex, ey) = row.split_at_mut(stride);
            problem.residuals(y, ex, ey);
        });
        Self { problem, alpha, data }
    }

    /// Residuals of pixel row `y` for the correction `v`.
    fn residual(&self, v: &[f32], y: usize, out: &mut RowResidual) {
        let (w, stride) = (self.problem.width, self.problem.stride());
        let (ex, ey) = self.data[2 * y * stride..2 * (y + 1) * stride].split_at(stride);
        let here = &v[y * stride..(y + 1) * stride];
        let below = if y + 1 < self.problem.height { &v[(y + 1) * stride..(y + 2) * stride] } else { here };
        for c in 0..3 {
            let part = c * w..(c + 1) * w;
            let (here, ex, out) = (&here[part.clone()], &ex[part.clone()], &mut out.x[part]);
            for (out, (e, v)) in out.iter_mut().zip(ex.iter().zip(here.windows(2))) {
                *out = v[1] - v[0] - e;
            }
        }
        for (out, (e, (a, b))) in out.y.iter_mut().zip(ey.iter().zip(here.iter().zip(below))) {
            *out = b - a - e;
        }
        channel_norm(here, self.alpha, &mut out.norm[0]);
        channel_norm(&out.x, 1.0, &mut out.norm[1]);
        channel_norm(&out.y, 1.0, &mut out.norm[2]);
    }

    /// Median of the positive row norms, from at most about 10⁵ rows; zero where all rows are zero.
    fn median(&self, v: &[f32]) -> f32 {
        let (w, h) = (self.problem.width, self.problem.height);
        let mut residual = RowResidual::new(w);
        let mut norms = Vec::new();
        for y in (0..h).step_by((w * h).div_ceil(1 << 15).min(h).max(1)) {
            self.residual(v, y, &mut residual);
            norms.extend(residual.norm.iter().flatten().filter(|n| **n > 0.0 && n.is_finite()));
        }
        if norms.is_empty() {
            return 0.0;
        }
        let middle = norms.len() / 2;
        *norms.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// Sets the weights for the correction `v` and `r` to the residual of the weighted normal equations; returns the
    /// objective. Weights are in units of 1/`reg`.
    fn reweight(&self, v: &[f32], reg: f32, weights: &mut Weights, r: &mut [f32]) -> f64 {
        let (w, stride) = (self.problem.width, self.problem.stride());
        let bands = weights.w0.par_chunks_mut(BAND * w).zip(weights.wx.par_chunks_mut(BAND * w));
        let bands = bands.zip(weights.wy.par_chunks_mut(BAND * w)).zip(r.par_chunks_mut(BAND * stride));
        let sums = bands.enumerate().map_init(
            || (RowResidual::new(w), vec![0.0; stride], vec![0.0; w]),
            |(row, above, wy_above), (band, (((w0, wx), wy), r))| {
                above.fill(0.0);
                if band > 0 {
                    let y = band * BAND - 1;
                    self.residual(v, y, row);
                    self.row_weights(y, NO_DY, reg, 1.0, &row.norm[2], wy_above);
                    weigh(wy_above, &row.y, above);
                }
                let mut sum = 0.0;
                for (i, r) in r.chunks_exact_mut(stride).enumerate() {
                    let (y, part) = (band * BAND + i, i * w..(i + 1) * w);
                    self.residual(v, y, row);
                    let square = self.alpha * self.alpha;
                    sum += self.row_weights(y, NO_PRIMAL, reg, square, &row.norm[0], &mut w0[part.clone()]);
                    sum += self.row_weights(y, NO_DX, reg, 1.0, &row.norm[1], &mut wx[part.clone()]);
                    sum += self.row_weights(y, NO_DY, reg, 1.0, &row.norm[2], &mut wy[part.clone()]);
                    normal_residual(
                        row,
                        &v[y * stride..][..stride],
                        [&w0[part.clone()], &wx[part.clone()], &wy[part]],
                        above,
                        r,
                    );
                }
                sum
            },
        );
        sums.collect::<Vec<_>>().iter().sum()
    }

    /// `out` = `factor` · reg/(norm + reg) in measured rows, else zero; returns the sum of the norms of those rows.
    fn row_weights(&self, y: usize, bit: u8, reg: f32, factor: f32, norm: &[f32], out: &mut [f32]) -> f64 {
        let (w, h) = (self.problem.width, self.problem.height);
        let (inside, count) = match bit {
            NO_DX => (true, w - 1),
            NO_DY => (y + 1 < h, w),
            _ => (true, w),
        };
        out.fill(0.0);
        if !inside {
            return 0.0;
        }
        let scale = factor * reg;
        for (out, norm) in out[..count].iter_mut().zip(norm) {
            *out = scale / (norm + reg);
        }
        let mut sum = norm[..count].iter().map(|n| f64::from(*n)).sum::<f64>();
        if !self.problem.mask.is_empty() {
            for x in (0..count).filter(|x| self.problem.mask[y * w + x] & bit != 0) {
                out[x] = 0.0;
                sum -= f64::from(norm[x]);
            }
        }
        sum
    }
}

/// `out` = weight · value in all channels.
fn weigh(weight: &[f32], value: &[f32], out: &mut [f32]) {
    let w = weight.len();
    for (value, out) in value.chunks_exact(w).zip(out.chunks_exact_mut(w)) {
        for x in 0..w {
            out[x] = weight[x] * value[x];
        }
    }
}

/// One row of −Kᵀ ω (K v − b); `above` is the weighted vertical residual of the row above, then of this one.
fn normal_residual(
    row: &RowResidual,
    v: &[f32],
    [w0, wx, wy]: [&[f32]; 3],
    above: &mut [f32],
    r: &mut [f32],
) {
    let w = w0.len();
    for c in 0..3 {
        let part = c * w..(c + 1) * w;
        let (rx, ry, v) = (&row.x[part.clone()], &row.y[part.clone()], &v[part.clone()]);
        let (above, r) = (&mut above[part.clone()], &mut r[part]);
        for x in 0..w {
            let down = wy[x] * ry[x];
            r[x] = down - above[x] - w0[x] * v[x] + wx[x] * rx[x];
            above[x] = down;
        }
        for (r, (weight, rx)) in r[1..].iter_mut().zip(wx.iter().zip(rx)) {
            *r -= weight * rx;
        }
    }
}

/// The objective Σ ‖α (x − g)‖ + ‖Dx x − dx‖ + ‖Dy x − dy‖ of the correction `v`.
#[cfg(test)]
pub(super) fn objective(problem: &Problem, alpha: f32, v: &[f32]) -> f64 {
    let mut weights = Weights::new(problem.width, problem.height);
    Rows::new(problem, alpha).reweight(v, 1.0, &mut weights, &mut vec![0.0; v.len()])
}

/// The L1 image.
pub(super) fn solve(problem: &Problem, alpha: f32) -> Found {
    solve_with(problem, alpha, DEFAULT)
}

/// The L1 image by a schedule of one's own.
pub(super) fn solve_with(problem: &Problem, alpha: f32, schedule: Schedule) -> Found {
    let mut v = l2::correction::<f32>(problem, alpha);
    let done = |v: &[f32], residual, iterations| Found { image: problem.image(v), residual, iterations };
    if v.is_empty() {
        return done(&v, 0.0, 0);
    }
    let rows = Rows::new(problem, alpha);
    let scale = f64::from(rows.median(&v));
    if scale == 0.0 {
        return done(&v, 0.0, 0);
    }
    let mut multigrid = Multigrid::new(problem.width, problem.height);
    let mut r = vec![0.0; v.len()];
    let (mut before, mut change) = (f64::INFINITY, f64::INFINITY);
    for outer in 0..schedule.outer {
        let reg = (scale * schedule.reg * schedule.decay.powi(outer as i32)) as f32;
        let objective = multigrid.set_weights(|weights| rows.reweight(&v, reg, weights, &mut r));
        change = (before - objective) / objective;
        if change < schedule.tolerance {
            return done(&v, change, outer);
        }
        before = objective;
        multigrid.conjugate_gradients(&mut v, &mut r, schedule.steps, 0.0);
    }
    done(&v, change, schedule.outer)
}
