//! A point of a mesh read from the mesh itself: what only some hits need, and points on lights.

use super::ShadeScene;
use crate::accel::Hits;
use crate::math::{LANES, Mask, f32x16};
use crate::scene::{AlphaMode, Material, Mesh};
use glam::{Vec2, Vec3, Vec4};

/// A point of a mesh: triangle and barycentric weights of its corners.
#[derive(Clone, Copy)]
pub(super) struct MeshPoint<'a> {
    pub mesh: &'a Mesh,
    triangle: [u32; 3],
    weights: Vec3,
}

impl<'a> MeshPoint<'a> {
    #[inline(always)]
    pub(super) fn new(mesh: &'a Mesh, primitive: u32, u: f32, v: f32) -> Self {
        Self { mesh, triangle: mesh.triangles[primitive as usize], weights: Vec3::new(1.0 - u - v, u, v) }
    }

    /// What lane `lane` met.
    #[inline(always)]
    pub(super) fn of_hit(scene: &'a ShadeScene, hits: &Hits, lane: usize) -> Self {
        let instance = &scene.scene.instances[hits.instance[lane] as usize];
        let mesh = &scene.scene.meshes[instance.mesh as usize];
        Self::new(mesh, hits.primitive[lane], hits.u.as_array()[lane], hits.v.as_array()[lane])
    }

    #[inline(always)]
    pub(super) fn interpolate<T>(&self, values: &[T]) -> T
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let [a, b, c] = self.triangle.map(|i| values[i as usize]);
        a * self.weights.x + b * self.weights.y + c * self.weights.z
    }

    /// Both texture coordinate sets; zero where the mesh has none.
    #[inline(always)]
    pub(super) fn uv(&self) -> [Vec2; 2] {
        let set = |i: usize| self.mesh.uvs[i].as_ref().map_or(Vec2::ZERO, |uv| self.interpolate(uv));
        [set(0), set(1)]
    }

    #[inline(always)]
    pub(super) fn color(&self) -> Vec4 {
        self.mesh.colors.as_ref().map_or(Vec4::ONE, |c| self.interpolate(c))
    }
}

impl super::texture::Decoder {
    /// Base colour and alpha: factor × texture × vertex colour.
    #[inline(always)]
    fn base(&self, scene: &crate::scene::Scene, material: &Material, at: &MeshPoint, uv: [Vec2; 2]) -> Vec4 {
        let factor = material.base_color * at.color();
        material.base_color_texture.as_ref().map_or(factor, |t| factor * self.lookup_ref(scene, t, uv))
    }

    /// Emitted radiance and the coverage that lets it out.
    #[inline(always)]
    pub(super) fn emission(&self, scene: &crate::scene::Scene, at: &MeshPoint) -> (Vec3, f32) {
        let material = &scene.materials[at.mesh.material as usize];
        let coverage = if material.has_coverage() { self.coverage(scene, at) } else { 1.0 };
        let uv = at.uv();
        let emission = material
            .emission_texture
            .as_ref()
            .map_or(material.emission, |t| material.emission * self.lookup_ref(scene, t, uv).truncate());
        (emission, coverage)
    }

    /// Probability that a ray is stopped.
    #[inline(always)]
    fn coverage(&self, scene: &crate::scene::Scene, at: &MeshPoint) -> f32 {
        let material = &scene.materials[at.mesh.material as usize];
        let alpha = || self.base(scene, material, at, at.uv()).w;
        match material.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f32::from(u8::from(alpha() >= cutoff)),
            AlphaMode::Blend => alpha().clamp(0.0, 1.0),
        }
    }
}

/// Coverage of sixteen hits: the probability in 0..=1 that the surface stops the ray (0 or 1 for masked, 1 for
/// opaque materials); 0 in lanes that are not active or hit nothing.
pub fn alpha(scene: &ShadeScene, hits: &Hits, active: Mask) -> f32x16 {
    let mut coverage = [0.0; LANES];
    for lane in (active & hits.valid).iter() {
        coverage[lane] = scene.decoder.coverage(scene.scene, &MeshPoint::of_hit(scene, hits, lane));
    }
    f32x16::new(coverage)
}
