//! Packets of rays of four kinds and the ways to trace them, on one thread: Embree one, eight and sixteen rays at a
//! time, told that rays run alike or not, and obvhs one ray at a time.
//!
//! The kinds: from the camera in blocks of 4×4 pixels, after one diffuse bounce, after two, and shadow rays towards an
//! area below the top of the scene.

use crate::measure::{Rounds, Side, cost};
use crate::shapes::unit;
use embree4::{
    BuildQuality, Coherence as Hint, Device, DeviceConfig, INVALID_ID, Ray1, Ray8, RayHit1, RayHit8,
    SceneBuilder, SceneOptions, Valid8,
};
use gdpt::accel::{Accel, Coherence, EmbreeAccel, ObvhsAccel, Rays, Visible};
use gdpt::math::warp::square_to_cosine_hemisphere;
use gdpt::math::{Frame, Mask, Select, Vec3x, f32x16, lanes, splat};
use gdpt::scene::Scene;
use glam::Vec3;

/// How rays are traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Embree, one at a time.
    Embree1,
    /// Embree, eight at a time.
    Embree8(Hint),
    /// Embree as the renderer uses it.
    Embree16(Coherence),
    /// obvhs as the renderer uses it.
    Obvhs,
}

/// All methods by name; the first is what the others are compared with.
pub const METHODS: [(&str, Method); 6] = [
    ("embree 1", Method::Embree1),
    ("embree 8 incoherent", Method::Embree8(Hint::Incoherent)),
    ("embree 8 coherent", Method::Embree8(Hint::Coherent)),
    ("embree 16 incoherent", Method::Embree16(Coherence::Incoherent)),
    ("embree 16 coherent", Method::Embree16(Coherence::Coherent)),
    ("obvhs", Method::Obvhs),
];

/// Packets of one kind.
pub struct Kind {
    /// What they are.
    pub name: &'static str,
    /// The rays and their active lanes.
    pub packets: Vec<(Rays, Mask)>,
    is_shadow: bool,
}

impl Kind {
    /// Active lanes of all packets.
    pub fn rays(&self) -> u64 {
        self.packets.iter().map(|(_, active)| u64::from(active.count())).sum()
    }
}

/// A scene, built for every method, and the rays to trace in it.
pub struct Bed {
    embree: embree4::Scene,
    wide: EmbreeAccel,
    obvhs: ObvhsAccel,
    /// The rays of all kinds.
    pub kinds: Vec<Kind>,
}

/// Origins a little off the surfaces hit and their unit normals, on the side the rays came from.
fn surfaces(scene: &Scene, accel: &ObvhsAccel, rays: &Rays, active: Mask, off: f32) -> (Mask, Vec3x, Vec3x) {
    let hits = accel.intersect16(rays, active, Visible::All, Coherence::Incoherent);
    let normal = Vec3x::lanes(|i| {
        if !hits.valid.get(i) {
            return Vec3::Y;
        }
        let placed = &scene.instances[hits.instance[i] as usize];
        let mesh = &scene.meshes[placed.mesh as usize];
        let [a, b, c] = mesh.triangles[hits.primitive[i] as usize]
            .map(|k| Vec3::from(placed.to_world.transform_point3a(mesh.positions[k as usize])));
        let n = (b - a).cross(c - a).normalize_or(Vec3::Y);
        if n.dot(rays.direction.lane(i)) > 0.0 { -n } else { n }
    });
    (hits.valid, rays.direction.mul_add(hits.t, rays.origin) + normal * splat(off), normal)
}

/// The rays of all kinds.
fn kinds(scene: &Scene, accel: &ObvhsAccel, [width, height]: [u32; 2]) -> Vec<Kind> {
    let (lower, upper) = scene.bounds().expect("scenes with triangles");
    let size = upper - lower;
    let off = 1e-5 * size.max_element();
    let mut packets: [Vec<(Rays, Mask)>; 4] = Default::default();
    for block in 0..(width / 4) * (height / 4) {
        let (x0, y0) = (block % (width / 4) * 4, block / (width / 4) * 4);
        let random = |what: u32| lanes(|i| unit(block * 16 + i as u32, what));
        let half = splat(0.5);
        let x = lanes(|i| (x0 + i as u32 % 4) as f32) + half;
        let y = lanes(|i| (y0 + i as u32 / 4) as f32) + half;
        let camera = scene.cameras[0].rays(x, y, width, height, half, half);
        let mut rays = Rays::new(camera.origin, camera.direction);
        let mut active = Mask::ALL;
        packets[0].push((rays, active));
        for bounce in 1..=2 {
            let (hit, origin, normal) = surfaces(scene, accel, &rays, active, off);
            let local = square_to_cosine_hemisphere(random(2 * bounce), random(2 * bounce + 1));
            active = hit;
            if bounce == 1 {
                let light = Vec3x::lanes(|i| {
                    let (u, v) = (random(10).as_array()[i], random(11).as_array()[i]);
                    lower + size * Vec3::new(0.3 + 0.4 * u, 0.97, 0.3 + 0.4 * v)
                });
                let mut shadow = Rays::new(origin, light - origin);
                shadow.tfar = splat(0.9999);
                packets[3].push((shadow, active));
            }
            let direction = Frame::from_normal(normal).to_world(local);
            rays = Rays::new(Vec3x::select(hit, origin, Vec3x::ZERO), direction);
            packets[bounce as usize].push((rays, active));
        }
    }
    let names = ["primary", "first bounce", "second bounce", "shadow"];
    let named = names.into_iter().zip(packets);
    named.map(|(name, packets)| Kind { name, packets, is_shadow: name == "shadow" }).collect()
}

/// The scene as Embree's own, for the widths that the renderer does not use.
fn embree_scene(scene: &Scene) -> embree4::Result<embree4::Scene> {
    let device = Device::new(DeviceConfig::default())?;
    let options = SceneOptions { quality: BuildQuality::High, robust: false };
    let mut top = SceneBuilder::new(&device, options)?;
    for (id, placed) in (0..).zip(&scene.instances) {
        let mesh = &scene.meshes[placed.mesh as usize];
        if placed.is_identity {
            top.triangles(id, mesh.positions.clone(), mesh.triangles.clone(), u32::MAX)?;
        } else {
            let mut child = SceneBuilder::new(&device, options)?;
            child.triangles(0, mesh.positions.clone(), mesh.triangles.clone(), u32::MAX)?;
            top.instance(id, &child.commit()?, placed.to_world, u32::MAX)?;
        }
    }
    top.commit()
}

/// Eight lanes of sixteen.
fn eight(x: &f32x16, half: usize) -> [f32; 8] {
    std::array::from_fn(|i| x.as_array()[8 * half + i])
}

impl Bed {
    /// Builds the scene for every method; `size` is columns and rows of the image whose rays are traced.
    pub fn new(scene: &Scene, size: [u32; 2]) -> Self {
        let obvhs = ObvhsAccel::new(scene).expect("the scene fits");
        Self {
            kinds: kinds(scene, &obvhs, size),
            embree: embree_scene(scene).expect("Embree is installed"),
            wide: EmbreeAccel::new(scene, 0, false, None).expect("Embree is installed"),
            obvhs,
        }
    }

    /// Traces one packet; how many lanes hit.
    fn trace(&self, method: Method, kind: &Kind, rays: &Rays, active: Mask) -> u32 {
        let through = |accel: &dyn Accel, hint| {
            if kind.is_shadow {
                accel.occluded16(rays, active, Visible::All, hint).count()
            } else {
                accel.intersect16(rays, active, Visible::All, hint).valid.count()
            }
        };
        match method {
            Method::Embree16(hint) => through(&self.wide, hint),
            Method::Obvhs => through(&self.obvhs, Coherence::Incoherent),
            Method::Embree1 => active.iter().map(|i| self.trace_one(kind, rays, i)).sum(),
            Method::Embree8(hint) => {
                (0..2).map(|half| self.trace_eight(kind, rays, active, half, hint)).sum()
            }
        }
    }

    fn trace_one(&self, kind: &Kind, rays: &Rays, i: usize) -> u32 {
        let (tnear, tfar) = (rays.tnear.as_array()[i], rays.tfar.as_array()[i]);
        let (origin, direction) = (rays.origin.lane(i).to_array(), rays.direction.lane(i).to_array());
        let mut ray = Ray1::new(origin, direction, tnear, tfar, u32::MAX);
        if kind.is_shadow {
            self.embree.occluded1(&mut ray, Hint::Incoherent);
            u32::from(ray.tfar() < 0.0)
        } else {
            let mut hit = RayHit1::new(ray);
            self.embree.intersect1(&mut hit, Hint::Incoherent);
            u32::from(hit.geometry() != INVALID_ID)
        }
    }

    fn trace_eight(&self, kind: &Kind, rays: &Rays, active: Mask, half: usize, hint: Hint) -> u32 {
        let bits = (active.bits() >> (8 * half)) as u8;
        if bits == 0 {
            return 0;
        }
        let lanes_of = |v: &Vec3x| [eight(&v.x, half), eight(&v.y, half), eight(&v.z, half)];
        let (tnear, tfar) = (eight(&rays.tnear, half), eight(&rays.tfar, half));
        let mut ray = Ray8::new(lanes_of(&rays.origin), lanes_of(&rays.direction), tnear, tfar, u32::MAX);
        let valid = Valid8::from_bits(bits);
        if kind.is_shadow {
            self.embree.occluded8(&valid, &mut ray, hint);
            (0..8).filter(|&i| bits >> i & 1 != 0 && ray.tfar()[i] < 0.0).count() as u32
        } else {
            let mut hit = RayHit8::new(ray);
            self.embree.intersect8(&valid, &mut hit, hint);
            (0..8).filter(|&i| bits >> i & 1 != 0 && hit.geometry()[i] != INVALID_ID).count() as u32
        }
    }

    /// Traces all packets of a kind; how many rays hit.
    pub fn trace_all<'a>(
        &self,
        method: Method,
        kind: &Kind,
        packets: impl Iterator<Item = &'a (Rays, Mask)>,
    ) -> u64 {
        packets.map(|(rays, active)| u64::from(self.trace(method, kind, rays, *active))).sum()
    }

    /// Lets the methods trace all packets of a kind in turn; the sides are in the order of [`METHODS`].
    ///
    /// # Panics
    /// Where the methods disagree on more than one ray in ten thousand.
    pub fn rounds(&self, kind: &Kind, rounds: usize) -> Rounds {
        let trace = |method| self.trace_all(method, kind, kind.packets.iter());
        let hits = METHODS.map(|(_, method)| trace(method));
        let spread = hits.iter().max().zip(hits.iter().min()).map_or(0, |(most, least)| most - least);
        assert!(spread as f64 <= 1e-4 * kind.rays() as f64, "{}: methods disagree: {hits:?}", kind.name);
        let side = |(_, method)| -> Side<'_> { Box::new(move || cost(|| trace(method))) };
        Rounds::alternate(rounds, METHODS.map(side).into())
    }
}
