//! The GGX microfacet distribution (Walter et al. 2007), isotropic, with the separable Smith shadowing
//! G(wi, wo) = G1(wi) G1(wo), sampled by visible normals (Heitz 2018, "Sampling the GGX Distribution of Visible
//! Normals") by way of the spherical cap (Dupuy and Benyoub 2023), which has the same density with less work.
//!
//! Local coordinates, z is the macro normal. `alpha` is the square of glTF's roughness.

use crate::math::{Vec3x, f32x16, splat};
use std::f32::consts::PI;

/// Density of normals D(h), sr⁻¹, for a unit `h` with h.z > 0.
///
/// Written with the slopes of h rather than with 1 − cos², which would cancel for small alpha.
#[inline(always)]
pub fn distribution(h: Vec3x, alpha: f32x16) -> f32x16 {
    let a2 = alpha * alpha;
    let sin2 = h.x.mul_add(h.x, h.y * h.y);
    let t = h.z.mul_add(h.z, sin2 / a2);
    splat(1.0) / (splat(PI) * a2 * t * t)
}

/// Smith's masking G1 of a unit direction whose cosine is `cos` > 0.
#[inline(always)]
pub fn smith_g1(cos: f32x16, alpha: f32x16) -> f32x16 {
    let one = splat(1.0);
    let cos2 = cos * cos;
    let sin2 = (one - cos2).fast_max(f32x16::ZERO);
    // 2 / (1 + sqrt(1 + α² tan²)), multiplied through by cos.
    splat(2.0) * cos / (cos + (alpha * alpha).mul_add(sin2, cos2).sqrt())
}

/// A normal visible from `wo` (unit, wo.z > 0), of density D(h) G1(wo) (wo·h) / wo.z, sr⁻¹.
#[inline(always)]
pub fn sample_visible_normal(wo: Vec3x, alpha: f32x16, u: f32x16, v: f32x16) -> Vec3x {
    let one = splat(1.0);
    let stretched = Vec3x::new(wo.x * alpha, wo.y * alpha, wo.z).normalize();
    let (sin_phi, cos_phi) = (splat(2.0 * PI) * u).sin_cos();
    let z = (one - v).mul_add(one + stretched.z, -stretched.z);
    let r = (one - z * z).fast_max(f32x16::ZERO).sqrt();
    let h = Vec3x::new(r * cos_phi, r * sin_phi, z) + stretched;
    Vec3x::new(h.x * alpha, h.y * alpha, h.z.fast_max(f32x16::ZERO)).normalize()
}
