//! Lights: emissive triangles, point, spot and directional lights, the environment.
//!
//! One alias table selects among them: triangles and punctual lights by power; the environment with probability 1/2
//! beside others. A light point is chosen without looking at the receiver, so that the paths of a gradient share it;
//! `seen_from` then says what a receiver gets from it. Estimator: radiance · geometry · f / pdf. As a solid-angle
//! density at the receiver, pdf / geometry.

use super::env::EnvironmentTable;
use super::mesh_point::MeshPoint;
use super::texture::Decoder;
use super::{ShadeScene, corners, offset_bound};
use crate::math::alias::AliasTable;
use crate::math::warp::square_to_triangle;
use crate::math::{Compare, LANES, Mask, Rgb, Vec3x, f32x16, splat};
use crate::scene::{PunctualKind, PunctualLight, Scene};
use glam::Vec3;
use std::f32::consts::PI;

/// Everything that emits, and the table that selects from it: triangles first, then punctual lights, then the
/// environment.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    triangles: Vec<LightTriangle>,
    punctual: Vec<PunctualLight>,
    environment: Option<EnvironmentTable>,
    table: AliasTable,
    /// First entry of each instance in `area_pdf`; `None` where its material does not emit.
    first: Vec<Option<u32>>,
    /// Area pdf of each triangle of the emissive instances, m⁻².
    area_pdf: Vec<f32>,
}

/// An emissive triangle in world space.
#[derive(Clone, Copy, Debug)]
struct LightTriangle {
    corner: Vec3,
    edges: [Vec3; 2],
    /// Unit normal of the front.
    normal: Vec3,
    instance: u32,
    primitive: u32,
    two_sided: bool,
    offset: f32,
    /// Where in `Lights::area_pdf`.
    slot: u32,
}

/// Sixteen points on lights, or directions to infinite ones, chosen without looking at a receiver.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightPoint {
    /// On an emissive triangle.
    pub is_area: Mask,
    /// A direction of the environment.
    pub is_env: Mask,
    /// A point, spot or directional light.
    pub is_dirac: Mask,
    /// There is a light and `pdf` > 0.
    pub valid: Mask,
    /// Position (area, point, spot); the unit direction towards the light (environment, directional).
    pub p: Vec3x,
    /// Unit geometric normal of an area light's front; axis of a spot.
    pub ng: Vec3x,
    /// m⁻² (area), sr⁻¹ (environment), probability (Dirac): selection included.
    pub pdf: f32x16,
    /// Environment or directional: `p` is a direction.
    is_infinite: Mask,
    /// Emits on both sides.
    two_sided: Mask,
    /// Radiance (area, coverage applied; environment), intensity or irradiance (Dirac).
    emission: Rgb,
    /// Spot falloff is clamp(cos · scale + shift)².
    spot_scale: f32x16,
    spot_shift: f32x16,
    offset: f32x16,
}

/// Light points as sixteen receivers see them.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightSeen {
    /// Unit direction towards the light.
    pub wi: Vec3x,
    /// Distance, m; infinite for the environment and directional lights.
    pub distance: f32x16,
    /// End of the shadow ray, off the light's surface on the receiver's side; unused for infinite lights.
    pub target: Vec3x,
    /// Radiance towards the receiver; for Dirac lights irradiance on a plane that faces them.
    pub radiance: Rgb,
    /// |cosθ| / d² at an area light, m⁻²; 1 for all others.
    pub geometry: f32x16,
}

crate::lanewise!(LightSeen { wi, distance, target, radiance, geometry });

/// Solid-angle pdf at the receiver, sr⁻¹, of light sampling for a point of area pdf `light_pdf` on a light, at squared
/// distance `d2` and under the cosine `cos_light` at the light.
#[inline(always)]
pub fn solid_angle_pdf(light_pdf: f32x16, d2: f32x16, cos_light: f32x16) -> f32x16 {
    let cos = cos_light.abs();
    cos.gt(f32x16::ZERO).select(light_pdf * d2 / cos, f32x16::ZERO)
}

fn luminance(c: Vec3) -> f64 {
    f64::from(c.dot(Vec3::new(0.2126, 0.7152, 0.0722)))
}

/// Power of a punctual light, W; a directional one shines through the disk that covers the scene.
fn power(light: &PunctualLight, scene_radius: f32) -> f64 {
    let solid_angle = match light.kind {
        PunctualKind::Point => 4.0 * PI,
        PunctualKind::Spot { cos_inner, cos_outer } => 2.0 * PI * (1.0 - 0.5 * (cos_inner + cos_outer)),
        PunctualKind::Directional => PI * scene_radius * scene_radius,
    };
    luminance(light.intensity) * f64::from(solid_angle)
}

impl Lights {
    /// Collects the lights of a scene; `handedness` is the sign of each instance's determinant.
    pub(super) fn new(scene: &Scene, decoder: &Decoder, handedness: &[f32]) -> Self {
        let mut lights = Self { punctual: scene.lights.clone(), ..Self::default() };
        let mut weights = lights.collect_triangles(scene, decoder, handedness);
        let radius = scene.bounds().map_or(1.0, |(lower, upper)| 0.5 * (upper - lower).length());
        weights.extend(lights.punctual.iter().map(|light| power(light, radius)));
        lights.environment = scene.environment.as_ref().and_then(EnvironmentTable::new);
        if lights.environment.is_some() {
            let others: f64 = weights.iter().filter(|w| w.is_finite()).sum();
            weights.push(if others > 0.0 { others } else { 1.0 });
        }
        lights.table = AliasTable::new(weights).unwrap_or_default();
        if !lights.table.is_empty() {
            for (i, triangle) in lights.triangles.iter().enumerate() {
                let area = 0.5 * triangle.edges[0].cross(triangle.edges[1]).length();
                lights.area_pdf[triangle.slot as usize] = lights.table.pdf(i) / area;
            }
        }
        lights
    }

    /// Fills the triangle list; returns the powers.
    fn collect_triangles(&mut self, scene: &Scene, decoder: &Decoder, handedness: &[f32]) -> Vec<f64> {
        let mut weights = Vec::new();
        let mut means = vec![None; scene.textures.len()];
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh as usize];
            let material = &scene.materials[mesh.material as usize];
            if !material.is_emissive() {
                self.first.push(None);
                continue;
            }
            let first = self.area_pdf.len();
            self.first.push(Some(first as u32));
            self.area_pdf.resize(first + mesh.triangles.len(), 0.0);
            let mean = material.emission_texture.as_ref().map_or(Vec3::ONE, |t| {
                let i = t.texture as usize;
                *means[i].get_or_insert_with(|| decoder.mean(&scene.textures[i]).truncate())
            });
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            let exitance = luminance(material.emission * mean) * std::f64::consts::PI * sides;
            for (primitive, &triangle) in mesh.triangles.iter().enumerate() {
                let corners = corners(instance, &mesh.positions, triangle);
                let edges = [corners[1] - corners[0], corners[2] - corners[0]];
                let cross = edges[0].cross(edges[1]) * handedness[index];
                let power = exitance * 0.5 * f64::from(cross.length());
                if !(power > 0.0 && power.is_finite()) {
                    continue;
                }
                weights.push(power);
                self.triangles.push(LightTriangle {
                    corner: corners[0],
                    edges,
                    normal: cross.normalize_or_zero(),
                    instance: index as u32,
                    primitive: primitive as u32,
                    two_sided: material.double_sided,
                    offset: offset_bound(corners),
                    slot: (first + primitive) as u32,
                });
            }
        }
        weights
    }

    /// Whether nothing can be sampled.
    pub fn is_empty(&self) -> bool {
        self.table.is_empty()
    }

    /// Area pdf of a triangle of an instance, m⁻²; 0 where it is not sampled.
    #[inline(always)]
    pub(super) fn triangle_pdf(&self, instance: usize, primitive: u32) -> f32 {
        self.first[instance].map_or(0.0, |first| self.area_pdf[(first + primitive) as usize])
    }

    /// Probability that the environment is selected.
    #[inline(always)]
    fn environment_selection(&self) -> f32 {
        if self.environment.is_some() { self.table.pdf(self.table.len() - 1) } else { 0.0 }
    }

    /// Selects a light by `u_select` and a point on it by (u, v), all in [0, 1).
    pub fn sample(&self, s: &ShadeScene, u_select: f32x16, u: f32x16, v: f32x16) -> LightPoint {
        let mut point = LightPoint::default();
        if self.is_empty() {
            return point;
        }
        let select = u_select.as_array();
        let (b1, b2) = square_to_triangle(u, v);
        let (b1, b2) = (b1.to_array(), b2.to_array());
        let mut gather = Gather::default();
        for lane in 0..LANES {
            let (light, _) = self.table.sample(select[lane]);
            let probability = self.table.pdf(light);
            if let Some(triangle) = self.triangles.get(light) {
                gather.triangle(s, triangle, b1[lane], b2[lane], lane);
                gather.pdf[lane] = self.area_pdf[triangle.slot as usize];
            } else if let Some(light) = self.punctual.get(light - self.triangles.len()) {
                gather.punctual(light, lane);
                gather.pdf[lane] = probability;
            } else {
                gather.env |= 1 << lane;
                gather.pdf[lane] = probability;
            }
        }
        gather.finish(&mut point);
        if let Some(environment) = self.environment.as_ref().filter(|_| point.is_env.any()) {
            let (direction, pdf, radiance) = environment.sample(u, v);
            point.p = point.is_env.select(direction, point.p);
            point.pdf = point.is_env.select(point.pdf * pdf, point.pdf);
            point.emission = point.is_env.select(radiance, point.emission);
        }
        point.valid = point.pdf.gt(f32x16::ZERO);
        point
    }

    /// What the receivers at `p` get from `point`; black where it is not valid.
    pub fn seen_from(&self, _s: &ShadeScene, point: &LightPoint, p: Vec3x) -> LightSeen {
        let (zero, one) = (f32x16::ZERO, splat(1.0));
        let to_light = point.p - p;
        let d2 = to_light.length_squared();
        let apart = d2.gt(zero);
        let distance = d2.sqrt();
        let wi = point.is_infinite.select(point.p, to_light * (one / distance));
        let cos = -wi.dot(point.ng);
        let geometry = point.is_area.select(cos.abs() / d2, one);

        let spot = (cos * point.spot_scale + point.spot_shift).fast_max(zero).fast_min(one);
        let finite_dirac = point.is_dirac.and_not(point.is_infinite);
        let scale = finite_dirac.select(spot * spot / d2, one);
        let faces = cos.gt(zero) | point.two_sided;
        let lit = point.valid & (apart | point.is_infinite) & (faces | !point.is_area);
        let side = cos.lt(zero).select(-point.offset, point.offset);
        LightSeen {
            wi,
            distance: point.is_infinite.select(splat(f32::INFINITY), distance),
            target: point.is_area.select(point.ng.mul_add(side, point.p), point.p),
            radiance: lit.keep(point.emission * scale),
            geometry: (apart | !point.is_area).keep(geometry),
        }
    }

    /// Radiance of the environment from `dir`; black without one.
    pub fn environment(&self, dir: Vec3x) -> Rgb {
        self.environment.as_ref().map_or(Rgb::ZERO, |e| e.radiance(dir))
    }

    /// Radiance of the environment from `dir`, and the pdf in solid angle with which [`Lights::sample`] finds it,
    /// selection included, sr⁻¹.
    pub fn environment_with_pdf(&self, dir: Vec3x) -> (Rgb, f32x16) {
        let Some(environment) = &self.environment else { return (Rgb::ZERO, f32x16::ZERO) };
        let (radiance, pdf) = environment.radiance_and_pdf(dir);
        (radiance, pdf * splat(self.environment_selection()))
    }

    /// Whether there is an environment that is not black.
    pub fn has_environment(&self) -> bool {
        self.environment.is_some()
    }
}

/// Sixteen light points that are filled lane by lane.
#[derive(Default)]
struct Gather {
    p: [Vec3; LANES],
    ng: [Vec3; LANES],
    emission: [Vec3; LANES],
    pdf: [f32; LANES],
    spot_scale: [f32; LANES],
    spot_shift: [f32; LANES],
    offset: [f32; LANES],
    area: u16,
    env: u16,
    dirac: u16,
    directional: u16,
    two_sided: u16,
}

impl Gather {
    fn triangle(&mut self, s: &ShadeScene, t: &LightTriangle, u: f32, v: f32, lane: usize) {
        let instance = &s.scene.instances[t.instance as usize];
        let mesh = &s.scene.meshes[instance.mesh as usize];
        let (emission, coverage) = s.decoder.emission(s.scene, &MeshPoint::new(mesh, t.primitive, u, v));
        self.p[lane] = t.corner + t.edges[0] * u + t.edges[1] * v;
        self.ng[lane] = t.normal;
        self.emission[lane] = emission * coverage;
        self.offset[lane] = t.offset;
        self.area |= 1 << lane;
        self.two_sided |= u16::from(t.two_sided) << lane;
    }

    fn punctual(&mut self, light: &PunctualLight, lane: usize) {
        self.dirac |= 1 << lane;
        self.emission[lane] = light.intensity;
        self.p[lane] = light.position;
        self.ng[lane] = light.direction;
        match light.kind {
            PunctualKind::Point => self.spot_shift[lane] = 1.0,
            PunctualKind::Spot { cos_inner, cos_outer } => {
                // The least width of the falloff is the extension's own.
                let scale = 1.0 / (cos_inner - cos_outer).max(0.001);
                self.spot_scale[lane] = scale;
                self.spot_shift[lane] = -cos_outer * scale;
            }
            PunctualKind::Directional => {
                self.directional |= 1 << lane;
                self.p[lane] = -light.direction;
            }
        }
    }

    fn finish(&self, point: &mut LightPoint) {
        point.is_area = Mask::from_bits(self.area);
        point.is_env = Mask::from_bits(self.env);
        point.is_dirac = Mask::from_bits(self.dirac);
        point.is_infinite = Mask::from_bits(self.env | self.directional);
        point.two_sided = Mask::from_bits(self.two_sided);
        point.p = Vec3x::lanes(|i| self.p[i]);
        point.ng = Vec3x::lanes(|i| self.ng[i]);
        point.emission = Vec3x::lanes(|i| self.emission[i]);
        point.pdf = f32x16::new(self.pdf);
        point.spot_scale = f32x16::new(self.spot_scale);
        point.spot_shift = f32x16::new(self.spot_shift);
        point.offset = f32x16::new(self.offset);
    }
}
