//! The least-squares image: exact by cosine transform.
//!
//! (α² + L) y = Dᵀ (d − D g), x = g + y, divided by 1 + α² so that neither α → 0 nor α → ∞ overflows. The mean of y
//! is zero by construction: the mean of the primal is preserved, α → ∞ gives the primal. The solve is linear in the
//! planes, so it is unbiased where they are.
//!
//! With missing rows the operator is no longer diagonal. The same problem with the weight zero for those rows is
//! then solved by conjugate gradients to [`TOLERANCE`], started from the transform.

use super::Found;
use super::dct::{DctSolver, Real};
use super::multigrid::{Multigrid, Weights};
use super::rows::{BAND, NO_DX, NO_DY, NO_PRIMAL, Problem};
use rayon::prelude::*;

/// Relative residual at which the solve around missing rows stops.
const TOLERANCE: f64 = 1e-6;
/// Its limit of steps.
const MAX_STEPS: usize = 100;

/// Weights of the primal's rows and of the differences' rows, squared: α²/(1 + α²) and 1/(1 + α²).
pub(super) fn row_weights(alpha: f32) -> (f64, f64) {
    let square = f64::from(alpha).powi(2);
    if square.is_finite() { (square / (1.0 + square), 1.0 / (1.0 + square)) } else { (1.0, 0.0) }
}

/// The correction y of the primal, missing rows counting as rows of value zero.
pub(super) fn correction<T: Real>(problem: &Problem, alpha: f32) -> Vec<T> {
    let (primal, gradient) = row_weights(alpha);
    let mut field = problem.divergence(gradient);
    DctSolver::new(problem.width, problem.height, primal, gradient).solve(&mut field);
    field
}

/// The least-squares image.
pub(super) fn solve(problem: &Problem, alpha: f32) -> Found {
    let mut y = correction::<f32>(problem, alpha);
    let (primal, gradient) = row_weights(alpha);
    if problem.missing == 0 {
        let residual = uniform_residual(problem, primal as f32, gradient as f32, &y);
        return Found { image: problem.image(&y), residual, iterations: 0 };
    }
    let mut r = problem.divergence::<f32>(gradient);
    let scale = norm_square(&r);
    let mut multigrid = Multigrid::new(problem.width, problem.height);
    multigrid.set_weights(|weights| set_weights(problem, alpha, weights));
    multigrid.subtract_product(&y, &mut r);
    let (iterations, left) =
        multigrid.conjugate_gradients(&mut y, &mut r, MAX_STEPS, scale * TOLERANCE.powi(2));
    let residual = if scale > 0.0 { (left / scale).sqrt() } else { 0.0 };
    Found { image: problem.image(&y), residual, iterations }
}

/// Sum of squares, in an order that does not depend on the threads.
pub(super) fn norm_square(values: &[f32]) -> f64 {
    let sum = |part: &[f32]| part.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    values.par_chunks(1 << 14).map(sum).collect::<Vec<_>>().iter().sum()
}

/// Norm of b − (primal + gradient L) y over that of b, both formed row by row.
fn uniform_residual(problem: &Problem, primal: f32, gradient: f32, y: &[f32]) -> f64 {
    let (w, h, stride) = (problem.width, problem.height, problem.stride());
    if w == 0 || h == 0 {
        return 0.0;
    }
    let row = |i: usize| &y[i * stride..(i + 1) * stride];
    let sums = (0..h.div_ceil(BAND)).into_par_iter().map(|band| {
        let mut sums = (0.0, 0.0);
        problem.divergence_band(gradient, band, &mut vec![0.0; stride], &|_, _, _| (), |i, b| {
            let (above, here, below) = (row(i.saturating_sub(1)), row(i), row((i + 1).min(h - 1)));
            for c in 0..3 {
                let part = c * w..(c + 1) * w;
                let [above, here, below, b] = [above, here, below, b].map(|r| &r[part.clone()]);
                let (mut left, mut all) = (0.0f32, 0.0f32);
                for x in 0..w {
                    let beside = here[x.saturating_sub(1)] + here[(x + 1).min(w - 1)];
                    let laplacian = 4.0 * here[x] - (above[x] + below[x] + beside);
                    left += (b[x] - primal * here[x] - gradient * laplacian).powi(2);
                    all += b[x] * b[x];
                }
                sums = (sums.0 + f64::from(left), sums.1 + f64::from(all));
            }
        });
        sums
    });
    let add = |a: (f64, f64), b: &(f64, f64)| (a.0 + b.0, a.1 + b.1);
    let (left, all) = sums.collect::<Vec<_>>().iter().fold((0.0, 0.0), add);
    if all > 0.0 { (left / all).sqrt() } else { 0.0 }
}

/// Sets the operator with weight zero in missing rows.
fn set_weights(problem: &Problem, alpha: f32, weights: &mut Weights) {
    let (w, h) = (problem.width, problem.height);
    let (primal, gradient) = row_weights(alpha);
    let keep = |i: usize, bit: u8, weight: f64| if problem.mask[i] & bit == 0 { weight as f32 } else { 0.0 };
    for i in 0..w * h {
        weights.w0[i] = keep(i, NO_PRIMAL, primal);
        weights.wx[i] = if i % w + 1 < w { keep(i, NO_DX, gradient) } else { 0.0 };
        weights.wy[i] = if i / w + 1 < h { keep(i, NO_DY, gradient) } else { 0.0 };
    }
}
