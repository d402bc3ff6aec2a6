//! From a noisy image and its noisy differences to the image that fits both: the screened Poisson problem.
//!
//! Given the primal estimate g and the differences dx(x, y) = I(x+1, y) − I(x, y), dy(x, y) = I(x, y+1) − I(x, y)
//! (y down), find x that minimises ‖α (x − g)‖ + ‖Dx x − dx‖ + ‖Dy x − dy‖: squared norms for [`Method::L2`], sums of
//! the RGB norms of the rows for [`Method::L1`] (Kettunen et al. 2015, "Gradient-domain path tracing"; Lehtinen et
//! al. 2013 for L1), squared norms with a weight for each row for
//! [`Method::Weighted`] and [`Method::Guided`]. Borders are natural: the last
//! column of dx and the last row of dy are never read.
//!
//! All planes are radiance, W·m⁻²·sr⁻¹, α has no unit. The result may be negative and is not clamped; very direct
//! light is no part of the problem and is added by the caller.
//!
//! **Missing data.** A value that is not finite, or whose magnitude exceeds [`LIMIT`], is no measurement. The row of
//! the problem it belongs to gets the weight zero, in all three channels: the rows around it decide, nothing spreads.

mod choice;
mod dct;
mod estimate;
mod guided;
mod l1;
mod l2;
mod multigrid;
mod noise;
mod regression;
mod rows;
#[cfg(test)]
mod tests;
mod weighted;

pub use estimate::{BLOCK, ErrorEstimate};

use crate::film::{Buffers, Features, Measured, Plane};

/// Magnitude beyond which a value counts as missing: squares and sums of smaller ones over a film stay finite in f32.
pub const LIMIT: f32 = 1e15;

/// What is solved for.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a> {
    /// Means over all samples: the planes that the image fits.
    pub all: &'a Measured,
    /// The same over two independent halves of the samples. They tell the noise: [`Method::Weighted`] and
    /// [`Alpha::Auto`] need them, and so does an estimate of the error.
    pub halves: Option<&'a [Measured; 2]>,
    /// What the camera rays meet first.
    pub features: Option<&'a Features>,
}

impl<'a> Input<'a> {
    /// A problem of which nothing but the means is known.
    pub fn new(all: &'a Measured) -> Self {
        Self { all, halves: None, features: None }
    }
}

impl<'a> From<&'a Buffers> for Input<'a> {
    fn from(buffers: &'a Buffers) -> Self {
        Self { all: &buffers.all, halves: buffers.halves.as_ref(), features: buffers.features.as_ref() }
    }
}

/// How the image is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Sum of RGB norms: robust against outliers, slightly biased.
    L1,
    /// Sum of squares: linear, hence unbiased; exact by cosine transform.
    L2,
    /// Sum of squares, each row weighed by its measured noise. Without halves: [`Method::L1`].
    #[default]
    Weighted,
    /// The weighted image, single pixels mended after their neighbours as far as their noise asks for it: consistent.
    /// Without features: [`Method::Weighted`].
    Guided,
    /// The one of the above with the least estimated error. Without halves: [`Method::L1`].
    Auto,
    /// The primal as it is.
    None,
}

/// The weight of the primal against the differences.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Alpha {
    /// A number above zero.
    Fixed(f32),
    /// The square root of the mean noise of a difference over that of the primal, from the halves: the best one where
    /// noise is white (Kettunen et al. 2015, section 5). Without halves: 0.2.
    Auto,
}

/// A reconstructed image and how it was found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The image, without very direct light.
    pub image: Plane,
    /// How it was found, [`Method::Auto`] and missing halves resolved.
    pub method: Method,
    /// The weight α of [`Method::L1`] and [`Method::L2`]; `None` where the method has none.
    pub alpha: Option<f32>,
    /// What is left to do, relative: L2 and weighted, norm of the normal equations' residual over that of their
    /// right-hand side; L1, the relative decrease of the objective in the last reweighting; None, zero.
    pub residual: f64,
    /// Reweightings (L1), conjugate-gradient steps (weighted; L2 with missing data), else 0.
    pub iterations: usize,
    /// Rows without a measurement: pixels of the primal and differences that are not finite.
    pub missing: usize,
    /// The estimated error of the image; `None` without halves.
    pub error: Option<ErrorEstimate>,
}

/// Solves for the image.
///
/// # Panics
/// Where the planes differ in size or `alpha` is not positive: both are mistakes of the caller.
pub fn reconstruct(input: &Input, method: Method, alpha: Alpha) -> Solution {
    let size = |m: &Measured| [&m.primal, &m.dx, &m.dy].map(|p| (p.width, p.height));
    let all = size(input.all);
    assert!(all.iter().all(|s| *s == all[0]), "planes of one size");
    assert!(
        input.halves.is_none_or(|h| size(&h[0]) == all && size(&h[1]) == all),
        "halves of the size of the whole"
    );
    match method {
        Method::L1 | Method::L2 => choice::uniform(input, method, alpha),
        Method::Weighted | Method::Guided => choice::weighted(input, alpha, method),
        Method::Auto => choice::best(input, alpha),
        Method::None => choice::primal(input),
    }
}

/// What a solver found.
struct Found {
    image: Plane,
    residual: f64,
    iterations: usize,
}
