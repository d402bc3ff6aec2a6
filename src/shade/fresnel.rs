//! Fresnel reflectances, 16 lanes wide: exact for dielectrics, Schlick's approximation (1994) for the layers of
//! glTF's metallic-roughness model, and an infinite series of reflections for a thin slab.
//!
//! `eta` is always the relative index of refraction, transmitted over incident side; unpolarised light.

use crate::math::{Compare, Rgb, f32x16, splat};

/// What refraction of one direction gives.
#[derive(Clone, Copy, Debug)]
pub struct Dielectric {
    /// Reflected share, 1 on total internal reflection.
    pub reflectance: f32x16,
    /// Cosine of the refracted direction, not negative; 0 on total internal reflection.
    pub cos_t: f32x16,
}

/// Exact Fresnel reflectance for the cosine `cos_i` ≥ 0 of the incident direction.
#[inline(always)]
pub fn dielectric(cos_i: f32x16, eta: f32x16) -> Dielectric {
    let one = splat(1.0);
    let sin2_t = (one - cos_i * cos_i).fast_max(f32x16::ZERO) / (eta * eta);
    let cos_t = (one - sin2_t).fast_max(f32x16::ZERO).sqrt();
    let cos_t = eta.same(one).select(cos_i, cos_t);
    Dielectric { reflectance: sin2_t.ge(one).select(one, crossing(cos_i, cos_t, eta)), cos_t }
}

/// Exact Fresnel reflectance where both cosines of a refracted path are known; near the critical angle one of them
/// cannot be had from the other without loss.
#[inline(always)]
pub fn crossing(cos_i: f32x16, cos_t: f32x16, eta: f32x16) -> f32x16 {
    let s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    // Equal indices reflect nothing; at grazing incidence the quotients above would be 0 / 0.
    eta.same(splat(1.0)).select(f32x16::ZERO, splat(0.5) * (s * s + p * p))
}

/// Reflectance of a thin slab whose two faces each reflect `face`: all orders of inter-reflection summed,
/// R + T²R + T²R³ + … = 2R / (1 + R).
#[inline(always)]
pub fn thin(face: f32x16) -> f32x16 {
    splat(2.0) * face / (splat(1.0) + face)
}

/// (1 − cos)⁵, Schlick's weight between normal and grazing incidence.
#[inline(always)]
pub fn schlick_weight(cos: f32x16) -> f32x16 {
    let x = (splat(1.0) - cos).fast_max(f32x16::ZERO);
    let x2 = x * x;
    x2 * x2 * x
}

/// Hemispherical average of [`schlick_weight`], ∫ (1 − cos)⁵ cos dω / π.
pub const SCHLICK_MEAN: f32 = 1.0 / 21.0;

/// Schlick's reflectance for a [`schlick_weight`].
#[inline(always)]
pub fn schlick(f0: Rgb, f90: f32x16, weight: f32x16) -> Rgb {
    f0 * (splat(1.0) - weight) + Rgb::all(f90 * weight)
}
