//! Lights: emissive triangles, point, spot and directional lights, the environment.
//!
//! An alias table selects among the environment (probability 1/2 beside others), each directional light and all
//! lights that have a place (by power); a light tree then selects one of these by what it gives to the receiver
//! (`tree`, `build`). So the pdf of a light point belongs to the receiver it was drawn for; another receiver that uses
//! the same point, as the paths of a gradient do, asks for its own with [`Lights::pdf_from`]. `seen_from` says what
//! a receiver gets from a point. Estimator: radiance · geometry · f / pdf. As a solid-angle density at the receiver,
//! pdf / geometry.

mod build;
mod collect;
mod tree;

use super::ShadeScene;
use super::env::EnvironmentTable;
use super::mesh_point::MeshPoint;
use super::surface::Surface;
use crate::accel::Hits;
use crate::math::alias::AliasTable;
use crate::math::warp::square_to_triangle;
use crate::math::{Compare, LANES, Mask, Rgb, Vec3x, f32x16, splat};
use crate::scene::{PunctualKind, PunctualLight};
use glam::Vec3;
use tree::LightTree;

/// Everything that emits, and how one is selected.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// The first lights of the tree.
    triangles: Vec<LightTriangle>,
    /// The other lights of the tree: points and spots.
    placed: Vec<PunctualLight>,
    directional: Vec<PunctualLight>,
    environment: Option<EnvironmentTable>,
    tree: LightTree,
    /// The tree, the directional lights, the environment; empty where nothing emits.
    table: AliasTable,
    /// First entry of each instance in `of_triangle`; `None` where its material does not emit.
    first: Vec<Option<u32>>,
    /// The light of each triangle of the emissive instances, or [`NO_LIGHT`].
    of_triangle: Vec<u32>,
}

/// The outcome of `Lights::table` that stands for all lights of the tree.
const TREE: usize = 0;

/// A triangle that is not sampled.
const NO_LIGHT: u32 = u32::MAX;

/// Sixteen points that receive light.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Position.
    pub p: Vec3x,
    /// Unit shading normal; light counts that arrives on its side.
    pub n: Vec3x,
    /// Light counts from both sides.
    pub both_sides: Mask,
}

impl Receiver {
    /// The vertices of paths.
    #[inline(always)]
    pub fn new(surface: &Surface) -> Self {
        let n = surface.bsdf.frame.n;
        let behind = surface.wo.dot(n).lt(f32x16::ZERO);
        Self { p: surface.p, n: behind.select(-n, n), both_sides: surface.bsdf.transmits() }
    }

    /// −1 where light counts from both sides, else 1.
    #[inline(always)]
    fn mirror(&self) -> f32x16 {
        self.both_sides.select(splat(-1.0), splat(1.0))
    }
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
    /// 1 / area, m⁻².
    inverse_area: f32,
    /// Radiance, where no texture and no coverage make it vary.
    constant: Option<Vec3>,
}

/// Sixteen points on lights, or directions to infinite ones, drawn for sixteen receivers.
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
    /// m⁻² (area), sr⁻¹ (environment), probability (Dirac): selection by the receiver it was drawn for included.
    pub pdf: f32x16,
    /// The light in the tree; unspecified for infinite ones.
    light: [u32; LANES],
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

impl Lights {
    /// Whether nothing can be sampled.
    pub fn is_empty(&self) -> bool {
        self.table.is_empty()
    }

    /// Probability that the environment is selected.
    #[inline(always)]
    fn environment_selection(&self) -> f32 {
        if self.environment.is_some() { self.table.pdf(self.table.len() - 1) } else { 0.0 }
    }

    /// Selects a light for each `active` receiver by `u_select` and a point on it by (u, v), all in [0, 1).
    pub fn sample(
        &self,
        s: &ShadeScene,
        from: &Receiver,
        active: Mask,
        u_select: f32x16,
        u: f32x16,
        v: f32x16,
    ) -> LightPoint {
        let mut point = LightPoint::default();
        if self.is_empty() {
            return point;
        }
        let (mut outcome, mut rest) = ([TREE; LANES], u_select);
        let mut in_tree = active;
        if self.table.len() > 1 {
            let mut u = rest.to_array();
            for lane in active.iter() {
                (outcome[lane], u[lane]) = self.table.sample(u[lane]);
            }
            rest = f32x16::new(u);
            in_tree = active & Mask::from_fn(|lane| outcome[lane] == TREE);
        }
        let (light, selection) = self.tree.select(from, rest, in_tree);
        point.light = light;

        let (b1, b2) = square_to_triangle(u, v);
        let (b1, b2) = (b1.to_array(), b2.to_array());
        let mut gather = Gather::default();
        for lane in in_tree.iter() {
            if let Some(triangle) = self.triangles.get(light[lane] as usize) {
                gather.triangle(s, triangle, b1[lane], b2[lane], lane);
            } else {
                gather.punctual(&self.placed[light[lane] as usize - self.triangles.len()], lane);
                gather.density[lane] = 1.0;
            }
        }
        for lane in active.and_not(in_tree).iter() {
            gather.density[lane] = self.table.pdf(outcome[lane]);
            match self.directional.get(outcome[lane] - TREE - 1) {
                Some(light) => gather.punctual(light, lane),
                None => gather.env |= 1 << lane,
            }
        }
        gather.finish(&mut point);
        let density = f32x16::new(gather.density);
        point.pdf = in_tree.select(density * (selection * splat(self.table.pdf(TREE))), density);
        if let Some(environment) = self.environment.as_ref().filter(|_| point.is_env.any()) {
            let (direction, pdf, radiance) = environment.sample(u, v);
            point.p = point.is_env.select(direction, point.p);
            point.pdf = point.is_env.select(point.pdf * pdf, point.pdf);
            point.emission = point.is_env.select(radiance, point.emission);
        }
        point.valid = active & point.pdf.gt(f32x16::ZERO);
        point
    }

    /// The pdf `point` would have had if it had been drawn for `from`, in the measure of `point.pdf`; asked for the
    /// `active` lanes.
    #[inline(always)]
    pub fn pdf_from(&self, point: &LightPoint, from: &Receiver, active: Mask) -> f32x16 {
        let asked = (active & point.valid).and_not(point.is_infinite);
        if !self.tree.looks_at_receiver() || asked.none() {
            return point.pdf;
        }
        let mut density = [1.0; LANES];
        for lane in (asked & point.is_area).iter() {
            density[lane] = self.triangles[point.light[lane] as usize].inverse_area;
        }
        let selection = self.tree.probability(from, &point.light, asked) * splat(self.table.pdf(TREE));
        asked.select(f32x16::new(density) * selection, point.pdf)
    }

    /// Solid-angle pdf, sr⁻¹, with which light sampling for `from` finds the points `hits` in direction `wi`; 0 where
    /// they are not on a sampled light. If distance and direction are those of another vertex, the density is in
    /// that vertex's solid angle.
    #[inline(always)]
    pub fn hit_pdf(&self, from: &Receiver, hits: &Hits, wi: Vec3x, active: Mask) -> f32x16 {
        let mut on_light = 0;
        for lane in (active & hits.valid).iter() {
            on_light |= u16::from(self.first[hits.instance[lane] as usize].is_some()) << lane;
        }
        if on_light == 0 { f32x16::ZERO } else { self.emitter_pdf(from, hits, wi, Mask::from_bits(on_light)) }
    }

    /// [`Lights::hit_pdf`] for `active` lanes that are on emissive instances.
    fn emitter_pdf(&self, from: &Receiver, hits: &Hits, wi: Vec3x, active: Mask) -> f32x16 {
        let mut on_light = 0;
        let mut light = [0; LANES];
        for lane in active.iter() {
            let first = self.first[hits.instance[lane] as usize].unwrap_or(0);
            light[lane] = self.of_triangle[(first + hits.primitive[lane]) as usize];
            on_light |= u16::from(light[lane] != NO_LIGHT) << lane;
        }
        let on_light = Mask::from_bits(on_light);
        let (mut inverse_area, mut normal) = ([0.0; LANES], [Vec3::ZERO; LANES]);
        for lane in on_light.iter() {
            let triangle = &self.triangles[light[lane] as usize];
            (inverse_area[lane], normal[lane]) = (triangle.inverse_area, triangle.normal);
        }
        let selection = self.tree.probability(from, &light, on_light) * splat(self.table.pdf(TREE));
        let cos = wi.dot(Vec3x::lanes(|lane| normal[lane]));
        on_light.keep(solid_angle_pdf(selection * f32x16::new(inverse_area), hits.t * hits.t, cos))
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
    density: [f32; LANES],
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
        self.emission[lane] = t.constant.unwrap_or_else(|| {
            let instance = &s.scene.instances[t.instance as usize];
            let mesh = &s.scene.meshes[instance.mesh as usize];
            let (emission, coverage) = s.decoder.emission(s.scene, &MeshPoint::new(mesh, t.primitive, u, v));
            emission * coverage
        });
        self.p[lane] = t.corner + t.edges[0] * u + t.edges[1] * v;
        self.ng[lane] = t.normal;
        self.offset[lane] = t.offset;
        self.density[lane] = t.inverse_area;
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
        point.spot_scale = f32x16::new(self.spot_scale);
        point.spot_shift = f32x16::new(self.spot_shift);
        point.offset = f32x16::new(self.offset);
    }
}
