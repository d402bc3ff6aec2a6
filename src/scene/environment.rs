//! Light from infinity: a lat-long image, y up, with importance sampling by texel.
//!
//! Direction d maps to u = atan2(d.x, −d.z) / 2π (mod 1), v = acos(d.y) / π, row 0 at the zenith.

use glam::Vec3;

/// An environment of radiance, W·m⁻²·sr⁻¹.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB radiance, row by row, not negative, finite; strength already applied.
    pub texels: Vec<Vec3>,
    /// Rotation about y, rad: the sampled direction is the world direction turned by −`rotation`.
    pub rotation: f32,
    /// Whether the camera sees it (it lights the scene in any case).
    pub visible: bool,
}
