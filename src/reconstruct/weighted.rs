//! The image of least squares with a weight for each row: one over its measured variance.
//!
//! Where the noise of the rows is independent this is the linear estimate of least variance (Gauss–Markov); seen from
//! a pixel, its differences are control variates (Rousselle, Jarosz, Novák 2016, "Image-space control variates for
//! rendering"). The variances are those of [`super::noise`]; the three channels share their weights.
//!
//! The weights know the noise they weigh, but only its square and the neighbours', so the bias is small, and it
//! vanishes with the noise. Given the weights the image is linear in the planes: half the difference of the halves,
//! solved with the weights of the whole, is what the noise of the whole may look like in the image.
//!
//! **Stopping rule:** conjugate gradients with a multigrid cycle until the residual of the normal equations is a given
//! share of their right-hand side.

use super::multigrid::{Multigrid, Weights};
use super::noise::Noise;
use super::rows::{NO_DX, NO_DY, NO_PRIMAL, Problem};
use super::{Found, l2};
use crate::film::Measured;
use rayon::prelude::*;

/// Limit of steps of a solve.
const MAX_STEPS: usize = 100;

/// The solver for one set of weights.
pub(super) struct Solver {
    multigrid: Multigrid,
    weights: [Vec<f32>; 3],
    /// α of the uniform problem whose image is the start.
    alpha: f32,
}

impl Solver {
    /// The solver for `problems` of one size, with the weights that the halves tell.
    pub fn new(problems: &[Problem; 2], halves: &[Measured; 2]) -> Self {
        let (w, h) = (problems[0].width, problems[0].height);
        let noise = Noise::new(halves);
        let alpha = noise.ratio().unwrap_or(1.0);
        let noise = noise.smoothed();
        let ((primal, w0), (x, wx), (y, wy)) =
            (noise.primal.weights(), noise.dx.weights(), noise.dy.weights());
        let unit = x.max(y).max(primal);
        let scale = |median: f32| if median > 0.0 { unit / median } else { 1.0 };
        let keep = |i: usize, bit: u8| problems.iter().all(|p| p.mask.is_empty() || p.mask[i] & bit == 0);
        let finish = |mut weights: Vec<f32>, median: f32, inside: &(dyn Fn(usize) -> bool + Sync)| {
            weights
                .par_iter_mut()
                .enumerate()
                .for_each(|(i, v)| *v = if inside(i) { *v * scale(median) } else { 0.0 });
            weights
        };
        let weights = [
            finish(w0, primal, &|i| keep(i, NO_PRIMAL)),
            finish(wx, x, &|i| i % w + 1 < w && keep(i, NO_DX)),
            finish(wy, y, &|i| i / w + 1 < h && keep(i, NO_DY)),
        ];
        let mut multigrid = Multigrid::new(w, h);
        multigrid.set_weights(|target: &mut Weights| {
            let planes = [&mut target.w0, &mut target.wx, &mut target.wy];
            planes.into_iter().zip(&weights).for_each(|(to, from)| to.copy_from_slice(from));
        });
        Self { multigrid, weights, alpha }
    }

    /// The image of a problem, until the residual is `tolerance` of the right-hand side.
    pub fn solve(&mut self, problem: &Problem, tolerance: f64) -> Found {
        let w = problem.width;
        let [_, wx, wy] = &self.weights;
        let weigh = |y: usize, ex: &mut [f32], ey: &mut [f32]| {
            for (e, weights) in [(ex, wx), (ey, wy)] {
                for channel in e.chunks_exact_mut(w) {
                    channel.iter_mut().zip(&weights[y * w..]).for_each(|(e, weight)| *e *= weight);
                }
            }
        };
        let mut r = problem.weighted_divergence::<f32>(1.0, &weigh);
        let scale = l2::norm_square(&r);
        let mut correction = l2::correction::<f32>(problem, self.alpha);
        self.multigrid.subtract_product(&correction, &mut r);
        let enough = scale * tolerance.powi(2);
        let (iterations, left) =
            self.multigrid.conjugate_gradients(&mut correction, &mut r, MAX_STEPS, enough);
        let residual = if scale > 0.0 { (left / scale).sqrt() } else { 0.0 };
        Found { image: problem.image(&correction), residual, iterations }
    }
}
