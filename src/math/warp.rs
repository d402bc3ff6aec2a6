//! Warps of the unit square to directions and points, with the pdf of each and, for tests, its inverse.

use super::{Compare, Vec3x, f32x16, splat};
use std::f32::consts::PI;

/// Concentric map of the unit square to the unit disk (Shirley and Chiu 1997). Returns (x, y); pdf 1/π (m⁻²).
#[inline(always)]
pub fn square_to_disk(u: f32x16, v: f32x16) -> (f32x16, f32x16) {
    let a = splat(2.0).mul_sub(u, splat(1.0));
    let b = splat(2.0).mul_sub(v, splat(1.0));
    let x_major = a.abs().gt(b.abs());
    let r = x_major.select(a, b);
    let divisor = r.same(f32x16::ZERO).select(splat(1.0), r);
    let quarter = splat(PI / 4.0);
    let ratio = x_major.select(b, a) / divisor;
    let phi = x_major.select(quarter * ratio, splat(PI / 2.0) - quarter * ratio);
    let (sin, cos) = phi.sin_cos();
    (r * cos, r * sin)
}

/// Cosine-weighted direction in the local upper hemisphere (Malley's method); pdf [`cosine_hemisphere_pdf`].
#[inline(always)]
pub fn square_to_cosine_hemisphere(u: f32x16, v: f32x16) -> Vec3x {
    let (x, y) = square_to_disk(u, v);
    let z2 = splat(1.0) - x * x - y * y;
    // A disk point on the rim gives a grazing direction of pdf zero; keep it just inside.
    let z = z2.fast_max(splat(1e-12)).sqrt();
    Vec3x::new(x, y, z)
}

/// pdf of [`square_to_cosine_hemisphere`], sr⁻¹.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos_theta: f32x16) -> f32x16 {
    cos_theta.fast_max(f32x16::ZERO) * splat(1.0 / PI)
}

/// Barycentric (u, v) of a uniformly distributed point of a triangle (Heitz 2019, "A Low-Distortion Map
/// Between Triangle and Square"); pdf 1/area (m⁻²).
#[inline(always)]
pub fn square_to_triangle(u: f32x16, v: f32x16) -> (f32x16, f32x16) {
    let half = splat(0.5);
    let first = v.gt(u);
    (first.select(u * half, u - v * half), first.select(v - u * half, v * half))
}
