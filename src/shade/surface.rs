//! What sixteen rays met: position, normals, material with its textures, emission.
//!
//! A lane brings whole cache lines, its triangle, its attributes and its material; transposed they are worked on
//! sixteen at a time. Textures and normal maps are looked up lane by lane. Positions come from the barycentrics,
//! whose rounding does not grow with the ray's length.

use super::mesh_point::MeshPoint;
use super::records::{self, HANDEDNESS, NO_TRIANGLE, OFFSET, UV, flag};
use super::texture::Footprint;
use super::{Bsdf, Parameters, ShadeScene};
use crate::accel::Hits;
use crate::math::transpose::{Line, columns};
use crate::math::{Compare, Frame, LANES, Mask, Rgb, Vec3x, f32x16, splat};
use crate::scene::TextureRef;
use glam::{Vec2, Vec3, Vec4};
use wide::u32x16;

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

/// Sixteen vectors that are filled lane by lane.
#[derive(Default)]
struct Column3([[f32; LANES]; 3]);

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

/// Three columns from `from` on.
#[inline(always)]
fn vector(columns: &[f32x16; LANES], from: usize) -> Vec3x {
    Vec3x::new(columns[from], columns[from + 1], columns[from + 2])
}

/// What the lanes bring together.
struct Gathered {
    geometry: [f32x16; LANES],
    attributes: [f32x16; LANES],
    /// Base colour, metallic, roughness, specular, specular colour, ior, transmission, absorption.
    material: [f32x16; LANES],
    flags: u32x16,
}

impl Gathered {
    #[inline(always)]
    fn new(scene: &ShadeScene, hits: &Hits, active: Mask) -> Self {
        let records = &scene.records;
        let mut geometry = [NO_TRIANGLE; LANES];
        let mut attributes = [Line::ZERO; LANES];
        let mut material = [Line::ZERO; LANES];
        let mut flags = [0; LANES];
        for lane in active.iter() {
            let index = hits.instance[lane] as usize;
            let place = &records.places[index];
            let at = place.line(hits.primitive[lane]);
            flags[lane] = place.flags;
            material[lane] = records.materials[place.material];
            let line = &records.lines[at];
            if place.flags & flag::MOVED == 0 {
                geometry[lane] = *line;
                if place.flags & flag::ATTRIBUTES != 0 {
                    attributes[lane] = records.lines[at + 1];
                }
                continue;
            }
            let placement = &scene.placements[index];
            geometry[lane] = records::moved_geometry(line, &scene.scene.instances[index], placement);
            if place.flags & flag::ATTRIBUTES != 0 {
                attributes[lane] = records::moved_attributes(&records.lines[at + 1], placement);
            }
        }
        let mut gathered = Self {
            geometry: columns(&geometry),
            attributes: [f32x16::ZERO; LANES],
            material: columns(&material),
            flags: u32x16::new(flags),
        };
        if gathered.has(flag::ATTRIBUTES).any() {
            gathered.attributes = columns(&attributes);
        }
        gathered
    }

    /// Lanes with a flag.
    #[inline(always)]
    fn has(&self, flag: u32) -> Mask {
        let flag = u32x16::splat(flag);
        Mask(bytemuck::cast((self.flags & flag).simd_eq(flag)))
    }

    /// Texture coordinates of the first set.
    #[inline(always)]
    fn uv(&self, weights: [f32x16; 3]) -> [f32x16; 2] {
        std::array::from_fn(|c| {
            let corner = |i: usize| self.attributes[UV + 2 * i + c] * weights[i];
            corner(0) + corner(1) + corner(2)
        })
    }

    /// Unit shading normals on the side of `ng`.
    #[inline(always)]
    fn shading_normal(&self, ng: Vec3x, weights: [f32x16; 3], map: Option<&NormalMap>) -> Vec3x {
        let mut n = ng;
        let smooth = self.has(flag::SMOOTH);
        if smooth.any() {
            let corner = |i: usize| vector(&self.attributes, 3 * i) * weights[i];
            let interpolated = (corner(0) + corner(1) + corner(2)).normalize();
            n = (smooth & interpolated.is_finite()).select(interpolated, n);
        }
        if let Some(map) = map {
            let mapped = map.apply(n);
            n = (self.has(flag::MAPPED) & mapped.is_finite()).select(mapped, n);
        }
        n.dot(ng).lt(f32x16::ZERO).select(-n, n)
    }

    #[inline(always)]
    fn parameters(&self) -> Parameters {
        let m = &self.material;
        let unit = |x: f32x16| x.fast_max(f32x16::ZERO).fast_min(splat(1.0));
        Parameters {
            base: vector(m, 0),
            metallic: unit(m[3]),
            roughness: unit(m[4]),
            specular: unit(m[5]),
            specular_color: vector(m, 6),
            ior: m[9],
            transmission: unit(m[10]),
            absorption: vector(m, 11),
            solid: self.has(flag::SOLID),
        }
    }
}

/// Multiplies base colour textures into the columns of the material.
fn apply_base_textures(
    scene: &ShadeScene,
    hits: &Hits,
    lanes: Mask,
    uv: [f32x16; 2],
    material: &mut [f32x16; LANES],
) {
    if lanes.none() {
        return;
    }
    let [u, v] = uv.map(f32x16::to_array);
    // First all reads, none of which waits for another: the texels are rarely in the nearest cache.
    let mut footprints = [Footprint::default(); LANES];
    for lane in lanes.iter() {
        let place = &scene.records.places[hits.instance[lane] as usize];
        let Some(t) = &scene.scene.materials[place.material].base_color_texture else { continue };
        let uv = if t.uv_set == 0 {
            Vec2::new(u[lane], v[lane])
        } else {
            MeshPoint::of_hit(scene, hits, lane).uv()[1]
        };
        let texture = &scene.scene.textures[t.texture as usize];
        footprints[lane] = Footprint::new(texture, t.transform.transform_point2(uv));
    }
    let mut texel = Column3([[1.0; LANES]; 3]);
    for lane in lanes.iter() {
        texel.set(lane, scene.decoder.filter(&footprints[lane]).truncate());
    }
    let base = vector(material, 0) * texel.wide();
    [material[0], material[1], material[2]] = [base.x, base.y, base.z];
}

/// Multiplies what other textures and vertex colours say into the columns of the material.
fn apply_textures(
    scene: &ShadeScene,
    hits: &Hits,
    lanes: Mask,
    uv: [f32x16; 2],
    material: &mut [f32x16; LANES],
) {
    if lanes.none() {
        return;
    }
    let [u, v] = uv.map(f32x16::to_array);
    let mut columns = material.map(f32x16::to_array);
    for lane in lanes.iter() {
        let at = MeshPoint::of_hit(scene, hits, lane);
        let m = &scene.scene.materials[at.mesh.material as usize];
        let second = if at.mesh.uvs[1].is_some() { at.uv()[1] } else { Vec2::ZERO };
        let uv = [Vec2::new(u[lane], v[lane]), second];
        let mut multiply = |from: usize, factors: &[f32]| {
            for (column, factor) in columns[from..].iter_mut().zip(factors) {
                column[lane] *= factor;
            }
        };
        let texel = |t: &Option<TextureRef>| t.as_ref().map(|t| scene.decoder.lookup_ref(scene.scene, t, uv));
        if at.mesh.colors.is_some() {
            multiply(0, &at.color().truncate().to_array());
        }
        if let Some(t) = texel(&m.metallic_roughness_texture) {
            multiply(3, &[t.z, t.y]);
        }
        if let Some(t) = texel(&m.specular_texture) {
            multiply(5, &[t.w]);
        }
        if let Some(t) = texel(&m.specular_color_texture) {
            multiply(6, &[t.x, t.y, t.z]);
        }
        if let Some(t) = texel(&m.transmission_texture) {
            multiply(10, &[t.x]);
        }
    }
    *material = columns.map(f32x16::new);
}

/// Normal maps with the tangents they lie in.
#[derive(Default)]
struct NormalMap {
    tangent: Column3,
    bitangent_sign: [f32; LANES],
    texel: Column3,
}

impl NormalMap {
    fn new(scene: &ShadeScene, hits: &Hits, lanes: Mask) -> Self {
        let mut map = Self::default();
        for lane in lanes.iter() {
            let index = hits.instance[lane] as usize;
            let at = MeshPoint::of_hit(scene, hits, lane);
            let material = &scene.scene.materials[at.mesh.material as usize];
            let (Some(texture), Some(tangents)) = (&material.normal_texture, &at.mesh.tangents) else {
                continue;
            };
            let tangent: Vec4 = at.interpolate(tangents);
            let to_world = &scene.scene.instances[index].to_world;
            map.tangent.set(lane, to_world.transform_vector3(tangent.truncate()));
            map.bitangent_sign[lane] = scene.placements[index].handedness * tangent.w.signum();
            let texel = scene.decoder.lookup_ref(scene.scene, texture, at.uv()).truncate() * 2.0 - Vec3::ONE;
            let s = material.normal_scale;
            map.texel.set(lane, texel * Vec3::new(s, s, 1.0));
        }
        map
    }

    /// The mapped normals for shading normals `n`.
    fn apply(&self, n: Vec3x) -> Vec3x {
        let tangent = self.tangent.wide();
        // Gram-Schmidt: interpolation leaves the tangent slightly off the plane of the normal.
        let t = (tangent - n * n.dot(tangent)).normalize();
        let b = n.cross(t) * f32x16::new(self.bitangent_sign);
        let map = self.texel.wide();
        (t * map.x + b * map.y + n * map.z).normalize()
    }
}

/// Radiance of the lanes on emissive or unlit surfaces; `base` is their base colour.
fn emission(scene: &ShadeScene, hits: &Hits, emitters: Mask, base: Rgb) -> Rgb {
    let mut radiance = Column3::default();
    for lane in emitters.iter() {
        let at = MeshPoint::of_hit(scene, hits, lane);
        let material = &scene.scene.materials[at.mesh.material as usize];
        if material.unlit {
            radiance.set(lane, base.lane(lane));
            continue;
        }
        let texture = material.emission_texture.as_ref();
        let texel = texture.map_or(Vec4::ONE, |t| scene.decoder.lookup_ref(scene.scene, t, at.uv()));
        radiance.set(lane, material.emission * texel.truncate());
    }
    radiance.wide()
}

impl Surface {
    /// Evaluates the `active` lanes that hit something; the other lanes lie at the origin and scatter and emit nothing.
    /// `wo` points back along the rays.
    pub fn new(scene: &ShadeScene, hits: &Hits, active: Mask, wo: Vec3x) -> Self {
        let active = active & hits.valid;
        let mut g = Gathered::new(scene, hits, active);
        let (e1, e2) = (vector(&g.geometry, 3), vector(&g.geometry, 6));
        let p = vector(&g.geometry, 0) + e1 * hits.u + e2 * hits.v;
        let ng = (e1.cross(e2) * g.geometry[HANDEDNESS]).normalize();
        let weights = [splat(1.0) - hits.u - hits.v, hits.u, hits.v];
        let (base_textured, textured) = (g.has(flag::BASE_TEXTURED), g.has(flag::TEXTURED));
        if (base_textured | textured).any() {
            let uv = g.uv(weights);
            apply_base_textures(scene, hits, base_textured, uv, &mut g.material);
            apply_textures(scene, hits, textured, uv, &mut g.material);
        }
        let mapped = g.has(flag::MAPPED);
        let map = mapped.any().then(|| NormalMap::new(scene, hits, mapped));
        let frame = Frame::from_normal(g.shading_normal(ng, weights, map.as_ref()));
        let parameters = g.parameters();
        let base = parameters.base;
        let mut bsdf = Bsdf::new(frame, &parameters);
        let is_emitter = g.has(flag::EMITTER);
        let mut emitted = Rgb::ZERO;
        if is_emitter.any() {
            emitted = emission(scene, hits, is_emitter, base);
            bsdf = g.has(flag::UNLIT).select(Bsdf::black(frame), bsdf);
        }
        let two_sided = g.has(flag::TWO_SIDED);
        let lit_side = wo.dot(ng).gt(f32x16::ZERO) | two_sided;
        Self {
            p: active.keep(p),
            ng: active.keep(ng),
            wo,
            bsdf,
            emission: lit_side.keep(emitted),
            emitted,
            two_sided,
            is_emitter,
            albedo: base,
            offset: g.geometry[OFFSET],
        }
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
