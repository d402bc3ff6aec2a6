//! What sixteen rays met: position, normals, material with its textures, emission.
//!
//! Attributes are gathered lane by lane from the mesh and worked on sixteen at a time. Positions come from the
//! barycentrics, whose rounding does not grow with the ray's length.

use super::{Bsdf, Parameters, ShadeScene, corners, offset_bound};
use crate::accel::Hits;
use crate::math::{Compare, Frame, LANES, Mask, Rgb, Vec3x, f32x16, splat};
use crate::scene::{AlphaMode, Material, Mesh};
use glam::{Vec2, Vec3, Vec4};

/// What sixteen rays met, geometry and material evaluated.
#[derive(Clone, Copy, Debug, Default)]
pub struct Surface {
    /// World position.
    pub p: Vec3x,
    /// Unit geometric normal on the front side, by winding; a mirroring instance keeps its front.
    pub ng: Vec3x,
    /// Unit direction to the previous vertex.
    pub wo: Vec3x,
    /// Scattering, with the mapped shading frame.
    pub bsdf: Bsdf,
    /// Radiance towards `wo`; unlit surfaces show their base colour.
    pub emission: Rgb,
    /// Radiance of the side that emits, whichever side `wo` is on.
    emitted: Rgb,
    /// Both sides emit.
    two_sided: Mask,
    /// On an emissive or unlit surface, whichever side.
    pub is_emitter: Mask,
    /// Base colour.
    pub albedo: Rgb,
    /// Bound on the rounding of `p`, m.
    offset: f32x16,
}

/// Sixteen floats that are filled lane by lane.
type Column = [f32; LANES];

/// Sixteen vectors that are filled lane by lane.
#[derive(Default)]
struct Column3([Column; 3]);

impl Column3 {
    #[inline(always)]
    fn set(&mut self, lane: usize, v: Vec3) {
        self.0[0][lane] = v.x;
        self.0[1][lane] = v.y;
        self.0[2][lane] = v.z;
    }

    #[inline(always)]
    fn wide(&self) -> Vec3x {
        Vec3x::new(f32x16::new(self.0[0]), f32x16::new(self.0[1]), f32x16::new(self.0[2]))
    }
}

/// What the lanes bring together.
#[derive(Default)]
struct Gathered {
    p: [Column3; 3],
    front: Column,
    normal: Column3,
    tangent: Column3,
    bitangent_sign: Column,
    mapped: Column3,
    offset: Column,
    base: Column3,
    metallic: Column,
    roughness: Column,
    specular: Column,
    specular_color: Column3,
    ior: Column,
    transmission: Column,
    absorption: Column3,
    emission: Column3,
    /// Bit sets over the lanes.
    bits: Flags,
}

#[derive(Default)]
struct Flags {
    smooth_shaded: u16,
    normal_mapped: u16,
    solid: u16,
    emitter: u16,
    unlit: u16,
    two_sided: u16,
}

#[inline(always)]
fn flag(bits: &mut u16, lane: usize, on: bool) {
    *bits |= u16::from(on) << lane;
}

/// A point of a mesh: triangle and barycentric weights of its corners.
#[derive(Clone, Copy)]
pub(super) struct MeshPoint<'a> {
    mesh: &'a Mesh,
    triangle: [u32; 3],
    weights: Vec3,
}

impl<'a> MeshPoint<'a> {
    #[inline(always)]
    pub(super) fn new(mesh: &'a Mesh, primitive: u32, u: f32, v: f32) -> Self {
        Self { mesh, triangle: mesh.triangles[primitive as usize], weights: Vec3::new(1.0 - u - v, u, v) }
    }

    #[inline(always)]
    fn interpolate<T>(&self, values: &[T]) -> T
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let [a, b, c] = self.triangle.map(|i| values[i as usize]);
        a * self.weights.x + b * self.weights.y + c * self.weights.z
    }

    /// Both texture coordinate sets; zero where the mesh has none.
    #[inline(always)]
    fn uv(&self) -> [Vec2; 2] {
        let set = |i: usize| self.mesh.uvs[i].as_ref().map_or(Vec2::ZERO, |uv| self.interpolate(uv));
        [set(0), set(1)]
    }

    #[inline(always)]
    fn color(&self) -> Vec4 {
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
    let (u, v) = (hits.u.as_array(), hits.v.as_array());
    for lane in (active & hits.valid).iter() {
        let instance = &scene.scene.instances[hits.instance[lane] as usize];
        let mesh = &scene.scene.meshes[instance.mesh as usize];
        let at = MeshPoint::new(mesh, hits.primitive[lane], u[lane], v[lane]);
        coverage[lane] = scene.decoder.coverage(scene.scene, &at);
    }
    f32x16::new(coverage)
}

impl Gathered {
    /// Gathers one lane.
    #[inline(always)]
    fn lane(&mut self, scene: &ShadeScene, hits: &Hits, lane: usize) {
        let (index, primitive) = (hits.instance[lane] as usize, hits.primitive[lane]);
        let instance = &scene.scene.instances[index];
        let placement = &scene.placements[index];
        let mesh = &scene.scene.meshes[instance.mesh as usize];
        let material = &scene.scene.materials[mesh.material as usize];
        let (u, v) = (hits.u.as_array()[lane], hits.v.as_array()[lane]);
        let at = MeshPoint::new(mesh, primitive, u, v);
        let uv = if scene.textured[mesh.material as usize] { at.uv() } else { [Vec2::ZERO; 2] };

        let corners = corners(instance, &mesh.positions, at.triangle);
        for (column, corner) in self.p.iter_mut().zip(corners) {
            column.set(lane, corner);
        }
        self.offset[lane] = offset_bound(corners);
        self.front[lane] = placement.handedness;
        if let Some(normals) = &mesh.normals {
            flag(&mut self.bits.smooth_shaded, lane, true);
            self.normal.set(lane, placement.normal * at.interpolate(normals));
        }
        if let (Some(map), Some(tangents)) = (&material.normal_texture, &mesh.tangents) {
            flag(&mut self.bits.normal_mapped, lane, true);
            let tangent = at.interpolate(tangents);
            self.tangent.set(lane, instance.to_world.transform_vector3(tangent.truncate()));
            self.bitangent_sign[lane] = placement.handedness * tangent.w.signum();
            let texel = scene.decoder.lookup_ref(scene.scene, map, uv).truncate() * 2.0 - Vec3::ONE;
            let s = material.normal_scale;
            self.mapped.set(lane, texel * Vec3::new(s, s, 1.0));
        }
        self.material(scene, material, &at, uv, lane);
    }

    /// Gathers the material's parameters of one lane.
    #[inline(always)]
    fn material(&mut self, scene: &ShadeScene, m: &Material, at: &MeshPoint, uv: [Vec2; 2], lane: usize) {
        let decoder = &scene.decoder;
        let scene = scene.scene;
        let texel = |t: &Option<crate::scene::TextureRef>| {
            t.as_ref().map_or(Vec4::ONE, |t| decoder.lookup_ref(scene, t, uv))
        };
        let base = decoder.base(scene, m, at, uv).truncate();
        self.base.set(lane, base);
        flag(&mut self.bits.two_sided, lane, m.double_sided || m.unlit);
        flag(&mut self.bits.emitter, lane, m.unlit || m.is_emissive());
        flag(&mut self.bits.unlit, lane, m.unlit);
        if m.unlit {
            self.emission.set(lane, base);
            return;
        }
        if m.is_emissive() {
            self.emission.set(lane, m.emission * texel(&m.emission_texture).truncate());
        }
        let metallic_roughness = texel(&m.metallic_roughness_texture);
        self.metallic[lane] = m.metallic * metallic_roughness.z;
        self.roughness[lane] = m.roughness * metallic_roughness.y;
        self.specular[lane] = m.specular * texel(&m.specular_texture).w;
        self.specular_color.set(lane, m.specular_color * texel(&m.specular_color_texture).truncate());
        self.ior[lane] = m.ior;
        self.transmission[lane] = m.transmission * texel(&m.transmission_texture).x;
        self.absorption.set(lane, m.absorption);
        flag(&mut self.bits.solid, lane, m.is_solid);
    }

    /// Unit shading normals on the side of `ng`.
    #[inline(always)]
    fn shading_normal(&self, ng: Vec3x) -> Vec3x {
        let zero = f32x16::ZERO;
        let mut n = ng;
        if self.bits.smooth_shaded != 0 {
            let interpolated = self.normal.wide().normalize();
            n = (Mask::from_bits(self.bits.smooth_shaded) & interpolated.is_finite()).select(interpolated, n);
        }
        if self.bits.normal_mapped != 0 {
            let tangent = self.tangent.wide();
            // Gram-Schmidt: interpolation leaves the tangent slightly off the plane of the normal.
            let t = (tangent - n * n.dot(tangent)).normalize();
            let b = n.cross(t) * f32x16::new(self.bitangent_sign);
            let map = self.mapped.wide();
            let mapped = (t * map.x + b * map.y + n * map.z).normalize();
            n = (Mask::from_bits(self.bits.normal_mapped) & mapped.is_finite()).select(mapped, n);
        }
        n.dot(ng).lt(zero).select(-n, n)
    }

    #[inline(always)]
    fn parameters(&self, base: Rgb) -> Parameters {
        let unit = |x: Column| f32x16::new(x).fast_max(f32x16::ZERO).fast_min(splat(1.0));
        Parameters {
            base,
            metallic: unit(self.metallic),
            roughness: unit(self.roughness),
            specular: unit(self.specular),
            specular_color: self.specular_color.wide(),
            ior: f32x16::new(self.ior),
            transmission: unit(self.transmission),
            absorption: self.absorption.wide(),
            solid: Mask::from_bits(self.bits.solid),
        }
    }
}

impl Surface {
    /// Evaluates the `active` lanes that hit something; the other lanes are default. `wo` points back along the rays.
    pub fn new(scene: &ShadeScene, hits: &Hits, active: Mask, wo: Vec3x) -> Self {
        let active = active & hits.valid;
        let mut g = Gathered::default();
        for lane in active.iter() {
            g.lane(scene, hits, lane);
        }
        let [p0, p1, p2] = [g.p[0].wide(), g.p[1].wide(), g.p[2].wide()];
        let (e1, e2) = (p1 - p0, p2 - p0);
        let p = p0 + e1 * hits.u + e2 * hits.v;
        let ng = (e1.cross(e2) * f32x16::new(g.front)).normalize();
        let unlit = Mask::from_bits(g.bits.unlit);
        let base = g.base.wide();
        let frame = Frame::from_normal(g.shading_normal(ng));
        let bsdf = unlit.select(Bsdf::black(frame), Bsdf::new(frame, &g.parameters(base)));
        let two_sided = Mask::from_bits(g.bits.two_sided);
        let lit_side = wo.dot(ng).gt(f32x16::ZERO) | two_sided;
        let emitted = g.emission.wide();
        active.keep(Self {
            p,
            ng,
            wo,
            bsdf,
            emission: lit_side.keep(emitted),
            emitted,
            two_sided,
            is_emitter: Mask::from_bits(g.bits.emitter),
            albedo: base,
            offset: f32x16::new(g.offset),
        })
    }

    /// Radiance towards `w`.
    #[inline(always)]
    pub fn emission_towards(&self, w: Vec3x) -> Rgb {
        (w.dot(self.ng).gt(f32x16::ZERO) | self.two_sided).keep(self.emitted)
    }

    /// Origin of a ray that leaves towards `w`: `p`, moved off the surface on the side of `w` beyond its rounding.
    #[inline(always)]
    pub fn spawn(&self, w: Vec3x) -> Vec3x {
        let behind = w.dot(self.ng).lt(f32x16::ZERO);
        self.ng.mul_add(behind.select(-self.offset, self.offset), self.p)
    }
}

crate::lanewise!(Surface { p, ng, wo, bsdf, emission, emitted, two_sided, is_emitter, albedo, offset });
