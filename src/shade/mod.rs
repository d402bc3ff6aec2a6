//! Shading, sixteen lanes wide: what a ray met (`surface`), how it scatters (`bsdf`, with `microfacet` and
//! `fresnel`), what lights it (`lights`, `env`), and the textures of all of them (`texture`).
//!
//! Radiance W·m⁻²·sr⁻¹, distances m, directions unit vectors in world space that point away from the surface.

mod bsdf;
mod env;
pub mod fresnel;
mod lights;
mod mesh_point;
pub mod microfacet;
mod records;
mod surface;
pub mod texture;

pub use bsdf::{Bsdf, BsdfSample, DiracEval, Parameters};
pub use env::EnvironmentTable;
pub use lights::{LightPoint, LightSeen, Lights, solid_angle_pdf};
pub use mesh_point::alpha;
pub use surface::Surface;

use crate::scene::{Instance, Scene};
use glam::{Mat3A, Vec3, Vec3A};
use records::Records;
use texture::Decoder;

/// A scene prepared for shading: the scene itself, light tables and what instances need. Built once.
#[derive(Debug)]
pub struct ShadeScene<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Everything that emits.
    pub lights: Lights,
    /// Byte to linear tables.
    decoder: Decoder,
    /// One for each instance.
    placements: Vec<Placement>,
    /// Triangles and materials, laid out for hits.
    records: Records,
}

/// How directions of an instance reach the world.
#[derive(Clone, Copy, Debug)]
struct Placement {
    /// Normals to world: the cofactors of the transform, which for a positive determinant are its inverse transpose
    /// but for a scale and exist for a singular one; signed so that the front stays the front.
    normal: Mat3A,
    /// −1 where the transform mirrors, else 1.
    handedness: f32,
}

impl Placement {
    fn new(instance: &Instance) -> Self {
        let m = instance.to_world.matrix3;
        let handedness = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactors =
            Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
        Self { normal: cofactors * handedness, handedness }
    }
}

impl<'a> ShadeScene<'a> {
    /// Prepares a scene.
    pub fn new(scene: &'a Scene) -> Self {
        let decoder = Decoder::default();
        let placements: Vec<_> = scene.instances.iter().map(Placement::new).collect();
        let signs: Vec<_> = placements.iter().map(|p| p.handedness).collect();
        let lights = Lights::new(scene, &decoder, &signs);
        Self { scene, lights, decoder, placements, records: Records::new(scene) }
    }
}

/// World-space corners of a triangle.
#[inline(always)]
fn corners(instance: &Instance, positions: &[Vec3A], triangle: [u32; 3]) -> [Vec3; 3] {
    triangle.map(|i| {
        let p = positions[i as usize];
        Vec3::from(if instance.is_identity { p } else { instance.to_world.transform_point3a(p) })
    })
}

/// How far the rounding of a point on a triangle with these corners may reach, m; rays start and end this far off.
#[inline(always)]
fn offset_bound(corners: [Vec3; 3]) -> f32 {
    // About 80 units in the last place: barycentric interpolation, the transform and the traversal each take a few.
    const RELATIVE: f32 = 5e-6;
    let [a, b, c] = corners.map(Vec3::abs);
    RELATIVE * a.max(b).max(c).max_element()
}
