//! The seam to ray tracing: packets of sixteen rays in, distances, barycentrics and ids out. Nothing above this
//! module knows which backend runs. Normals, uv and materials come later, from the mesh.
//!
//! All backends see the same sanitised meshes and use the same ids: `instance` indexes `Scene::instances`,
//! `primitive` the triangles of its mesh.

pub mod brute;
pub mod embree;
mod flat;
pub mod obvhs;

pub use brute::BruteAccel;
pub use embree::EmbreeAccel;
pub use obvhs::ObvhsAccel;

use crate::math::{LANES, Mask, Vec3x, f32x16, splat};

/// Sixteen rays; `direction` need not be normalised, distances are in units of its length.
#[derive(Clone, Copy, Debug)]
pub struct Rays {
    /// World-space origins.
    pub origin: Vec3x,
    /// World-space directions.
    pub direction: Vec3x,
    /// Hits at or before this distance do not count.
    pub tnear: f32x16,
    /// Hits beyond this distance do not count.
    pub tfar: f32x16,
}

impl Rays {
    /// Rays from `origin` along `direction` to infinity.
    #[inline(always)]
    pub fn new(origin: Vec3x, direction: Vec3x) -> Self {
        Self { origin, direction, tnear: f32x16::ZERO, tfar: splat(f32::INFINITY) }
    }
}

/// Sixteen closest hits.
#[derive(Clone, Copy, Debug)]
pub struct Hits {
    /// Lanes that hit something.
    pub valid: Mask,
    /// Distance in units of the direction's length.
    pub t: f32x16,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32x16,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32x16,
    /// Index into `Scene::instances`; unspecified where not `valid`.
    pub instance: [u32; LANES],
    /// Triangle of the instance's mesh; unspecified where not `valid`.
    pub primitive: [u32; LANES],
}

impl Hits {
    /// No lane hit anything.
    pub const NONE: Self = Self {
        valid: Mask::NONE,
        t: f32x16::ZERO,
        u: f32x16::ZERO,
        v: f32x16::ZERO,
        instance: [0; LANES],
        primitive: [0; LANES],
    };
}

/// Whether the rays of a packet start close together and run alike. A hint: it decides speed, never the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Primary rays of a block, rays towards one shared point.
    Coherent,
    /// Everything after a random bounce.
    Incoherent,
}

/// Which geometry a ray sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visible {
    /// All of it.
    All,
    /// Only what alpha cannot open (`Material::has_coverage` is false).
    Opaque,
    /// Only what alpha can open.
    Coverage,
}

/// A committed acceleration structure.
pub trait Accel: Send + Sync {
    /// Closest hits of the `active` lanes. Every active ray must be finite.
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits;

    /// Which of the `active` rays hit anything. Every active ray must be finite.
    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Mask;
}
