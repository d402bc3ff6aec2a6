//! From a noisy image and its noisy differences to the image that fits both: the screened Poisson problem.
//!
//! Given the primal estimate g and the differences dx(x, y) = I(x+1, y) − I(x, y), dy(x, y) = I(x, y+1) − I(x, y)
//! (y down), find x that minimises ‖α (x − g)‖ + ‖Dx x − dx‖ + ‖Dy x − dy‖: squared norms for [`Method::L2`], sums of
//! the RGB norms of the rows for [`Method::L1`] (Kettunen et al. 2015, "Gradient-domain path tracing"; Lehtinen et
//! al. 2013 for L1). Borders are natural: the last column of dx and the last row of dy are never read.
//!
//! All planes are radiance, W·m⁻²·sr⁻¹, α has no unit. The result may be negative and is not clamped; very direct
//! light is no part of the problem and is added by the caller.
//!
//! **Missing data.** A value that is not finite, or whose magnitude exceeds [`LIMIT`], is no measurement. The row of
//! the problem it belongs to gets the weight zero, in all three channels: the rows around it decide, nothing spreads.

mod dct;
mod l1;
mod l2;
mod multigrid;
mod rows;
#[cfg(test)]
mod tests;

use crate::film::Plane;

/// Magnitude beyond which a value counts as missing: squares and sums of smaller ones over a film stay finite in f32.
pub const LIMIT: f32 = 1e15;

/// The measured planes, all of one size.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Radiance without very direct light.
    pub primal: &'a Plane,
    /// Horizontal differences; the last column is not read.
    pub dx: &'a Plane,
    /// Vertical differences, y down; the last row is not read.
    pub dy: &'a Plane,
}

/// Which norm the image minimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Sum of RGB norms: robust against outliers, slightly biased.
    #[default]
    L1,
    /// Sum of squares: linear, hence unbiased; exact by cosine transform.
    L2,
    /// The primal as it is.
    None,
}

/// A reconstructed image and how it was found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The image, without very direct light.
    pub image: Plane,
    /// What is left to do, relative: L2, norm of the normal equations' residual over that of their right-hand side;
    /// L1, the relative decrease of the objective in the last reweighting; None, zero.
    pub residual: f64,
    /// Reweightings (L1), conjugate-gradient steps (L2 with missing data), else 0.
    pub iterations: usize,
    /// Rows without a measurement: pixels of the primal and differences that are not finite.
    pub missing: usize,
}

/// Solves for the image with the screening weight `alpha` > 0.
///
/// # Panics
/// Where the planes differ in size or `alpha` is not positive: both are mistakes of the caller.
pub fn reconstruct(input: &Input, method: Method, alpha: f32) -> Solution {
    let size = |p: &Plane| (p.width, p.height);
    assert!(
        size(input.primal) == size(input.dx) && size(input.primal) == size(input.dy),
        "planes of one size"
    );
    assert!(alpha > 0.0, "alpha must be positive");
    let problem = rows::Problem::new(input);
    match method {
        Method::L1 => l1::solve(&problem, alpha),
        Method::L2 => l2::solve(&problem, alpha),
        Method::None => Solution {
            image: problem.primal.into_owned(),
            residual: 0.0,
            iterations: 0,
            missing: problem.missing,
        },
    }
}
