//! A learned denoiser beside our own reconstruction: Intel Open Image Denoise, through the crate `oidn`, with albedo
//! and normals of the first hit as guides.
//!
//! It is fed the path-traced image and never a reconstructed one, whose noise is correlated between pixels: the
//! network was trained on independent noise. It is biased and stops improving with more samples; it is here for
//! comparison, and for those who want it. The guides count as noisy: the crate's `clean_aux` sets a parameter that
//! the library does not have.
//!
//! Compiled in with the feature `denoise`; the build then needs the library's folder in `OIDN_DIR` (README). Without
//! the feature everything here says so.

use crate::error::{Error, Result};
use crate::film::{Film, Half, Plane};

/// Whether the program was built with a denoiser.
pub const AVAILABLE: bool = cfg!(feature = "denoise");

/// The path-traced image of `film`, denoised, without very direct light; `film` must hold features.
pub fn primal(film: &Film) -> Result<Plane> {
    let Some(features) = &film.features else {
        return Err(Error::Usage("a denoiser needs albedo and normals: render with them".into()));
    };
    image(&film.primal(Half::Both), &features.albedo, &features.normal)
}

/// Denoises `image`, radiance in linear Rec.709, by `albedo` (0 to 1) and `normal` (unit, world space); all of one
/// size.
#[cfg(feature = "denoise")]
pub fn image(image: &Plane, albedo: &Plane, normal: &Plane) -> Result<Plane> {
    let device = oidn::Device::cpu().map_err(failed)?;
    let mut filter = oidn::RayTracing::try_new(&device).map_err(failed)?;
    filter.image_dimensions(image.width, image.height).hdr(true);
    filter.albedo_normal(albedo.data.as_flattened(), normal.data.as_flattened());
    let mut result = Plane::new(image.width, image.height);
    filter.filter(image.data.as_flattened(), result.data.as_flattened_mut()).map_err(failed)?;
    Ok(result)
}

#[cfg(feature = "denoise")]
fn failed(error: impl std::fmt::Display) -> Error {
    Error::Backend(format!("Open Image Denoise: {error}"))
}

/// Says that this build cannot.
#[cfg(not(feature = "denoise"))]
pub fn image(_: &Plane, _: &Plane, _: &Plane) -> Result<Plane> {
    Err(unavailable())
}

/// What to do for a denoiser.
pub fn unavailable() -> Error {
    Error::Usage("this gdpt was built without a denoiser: cargo build --release --features denoise".into())
}
