//! Rays a second on one thread: Embree one, eight and sixteen rays at a time, told that rays run alike or not, and
//! obvhs one ray at a time.
//!
//! Four kinds of rays: from the camera in blocks of 4×4 pixels, after one diffuse bounce, after two, and shadow rays
//! towards an area below the top of the scene. Two scenes: 1.3 million triangles of dented balls in a box, and Sponza
//! where `../shared/scenes` has it. A table printed first takes the methods in turn, five times, and gives medians
//! and the ratio to Embree one ray at a time; criterion then times the same work packet by packet.

use criterion::{Criterion, criterion_group, criterion_main};
use embree4::{
    BuildQuality, Coherence as Hint, Device, DeviceConfig, INVALID_ID, Ray1, Ray8, RayHit1, RayHit8,
    SceneBuilder, SceneOptions, Valid8,
};
use gdpt::accel::{Accel, Coherence, EmbreeAccel, ObvhsAccel, Rays, Visible};
use gdpt::math::sampler::hash;
use gdpt::math::warp::square_to_cosine_hemisphere;
use gdpt::math::{Frame, LANES, Mask, Select, Vec3x, f32x16, lanes, splat};
use gdpt::scene::{self, Camera, Instance, Material, Mesh, Projection, Scene};
use glam::{Affine3A, Mat3, Vec3, Vec3A};
use std::f32::consts::{PI, TAU};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;
const REPEATS: usize = 5;
/// Of the packets of the table, every so manieth is timed by criterion.
const THINNING: usize = 8;
/// Balls along an edge of their grid, and columns and rows of each ball.
const GRID: u32 = 4;
const COLUMNS: u32 = 142;
const ROWS: u32 = 72;

/// How rays are traced.
#[derive(Clone, Copy, PartialEq)]
enum Method {
    Embree1,
    Embree8(Hint),
    Embree16(Coherence),
    Obvhs,
}

const METHODS: [(&str, Method); 6] = [
    ("embree 1", Method::Embree1),
    ("embree 8 incoherent", Method::Embree8(Hint::Incoherent)),
    ("embree 8 coherent", Method::Embree8(Hint::Coherent)),
    ("embree 16 incoherent", Method::Embree16(Coherence::Incoherent)),
    ("embree 16 coherent", Method::Embree16(Coherence::Coherent)),
    ("obvhs", Method::Obvhs),
];

/// Packets of one kind.
struct Kind {
    name: &'static str,
    packets: Vec<(Rays, Mask)>,
    is_shadow: bool,
}

/// A scene, built for every method, and the rays to trace in it.
struct Bed {
    name: &'static str,
    embree: embree4::Scene,
    wide: EmbreeAccel,
    obvhs: ObvhsAccel,
    kinds: Vec<Kind>,
}

/// A number in [0, 1) for (what, which).
fn unit(a: u32, b: u32) -> f32 {
    (hash(a, b) >> 8) as f32 / (1u32 << 24) as f32
}

/// Dented balls on a jittered grid in a box.
fn balls() -> Scene {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for ball in 0..GRID.pow(3) {
        let cell = [ball % GRID, ball / GRID % GRID, ball / GRID.pow(2)].map(|i| i as f32);
        let jitter = Vec3A::from_array([0, 1, 2].map(|axis| unit(ball, axis) - 0.5));
        let centre = Vec3A::from_array(cell) + 0.3 * jitter;
        let first = positions.len() as u32;
        for row in 0..=ROWS {
            for column in 0..=COLUMNS {
                let (theta, phi) = (PI * row as f32 / ROWS as f32, TAU * column as f32 / COLUMNS as f32);
                let n = Vec3A::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                let dent = (9.0 * n.x + ball as f32).sin() * (8.0 * n.y).sin() * (7.0 * n.z).cos();
                positions.push(centre + n * (0.36 + 0.05 * dent));
            }
        }
        for row in 0..ROWS {
            for column in 0..COLUMNS {
                let a = first + row * (COLUMNS + 1) + column;
                let b = a + COLUMNS + 1;
                triangles.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
            }
        }
    }
    let first = positions.len() as u32;
    let (low, size) = (-1.0, GRID as f32 + 1.0);
    positions.extend(
        (0..8)
            .map(|corner| Vec3A::from_array([0, 1, 2].map(|axis| low + size * (corner >> axis & 1) as f32))),
    );
    for [a, b, c, d] in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
        triangles.extend([[first + a, first + b, first + c], [first + a, first + c, first + d]]);
    }
    let mesh = Mesh {
        name: "balls".into(),
        positions: positions.into(),
        triangles: triangles.into(),
        normals: None,
        tangents: None,
        uvs: [None, None],
        colors: None,
        material: 0,
    };
    let middle = Vec3::splat(0.5 * (GRID as f32 - 1.0));
    let eye = Vec3::new(low + 0.1, middle.y + 0.7, GRID as f32 - 0.2);
    let back = (eye - middle).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let camera = Camera {
        name: String::new(),
        to_world: Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), eye),
        projection: Projection::Perspective { yfov: 1.1 },
        lens_radius: 0.0,
        focus_distance: 1.0,
    };
    Scene {
        meshes: vec![mesh],
        instances: vec![Instance { mesh: 0, to_world: Affine3A::IDENTITY, is_identity: true }],
        materials: vec![Material::default()],
        cameras: vec![camera],
        ..Scene::default()
    }
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
fn kinds(scene: &Scene, accel: &ObvhsAccel) -> Vec<Kind> {
    let (lower, upper) = scene.bounds().expect("scenes with triangles");
    let size = upper - lower;
    let off = 1e-5 * size.max_element();
    let mut packets: [Vec<(Rays, Mask)>; 4] = Default::default();
    for block in 0..(WIDTH / 4) * (HEIGHT / 4) {
        let (x0, y0) = (block % (WIDTH / 4) * 4, block / (WIDTH / 4) * 4);
        let random = |what: u32| lanes(|i| unit(block * 16 + i as u32, what));
        let half = splat(0.5);
        let x = lanes(|i| (x0 + i as u32 % 4) as f32) + half;
        let y = lanes(|i| (y0 + i as u32 / 4) as f32) + half;
        let camera = scene.cameras[0].rays(x, y, WIDTH, HEIGHT, half, half);
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

fn bed(name: &'static str, scene: &Scene) -> Bed {
    let built = |what: &str, started: Instant| {
        println!("{name}: {} triangles, {what} built in {:.2?}", scene.triangle_count(), started.elapsed());
    };
    let started = Instant::now();
    let obvhs = ObvhsAccel::new(scene).expect("finite scene");
    built("obvhs", started);
    let started = Instant::now();
    let wide = EmbreeAccel::new(scene, 0, false, None).expect("finite scene");
    built("embree", started);
    let kinds = kinds(scene, &obvhs);
    Bed { name, embree: embree_scene(scene).expect("finite scene"), wide, obvhs, kinds }
}

/// Eight lanes of sixteen.
fn eight(x: &f32x16, half: usize) -> [f32; 8] {
    std::array::from_fn(|i| x.as_array()[8 * half + i])
}

impl Bed {
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
    fn trace_all<'a>(
        &self,
        method: Method,
        kind: &Kind,
        packets: impl Iterator<Item = &'a (Rays, Mask)>,
    ) -> u64 {
        packets.map(|(rays, active)| u64::from(self.trace(method, kind, rays, *active))).sum()
    }

    /// Medians of rounds that take the methods in turn.
    fn print_table(&self) {
        println!("\n{}: million rays a second on one thread (ratio to embree 1)", self.name);
        let header: Vec<String> = METHODS.iter().map(|(name, _)| format!("{name:>22}")).collect();
        println!("{:14}{}   rays that hit", "", header.concat());
        for kind in &self.kinds {
            let rays: u64 = kind.packets.iter().map(|(_, active)| u64::from(active.count())).sum();
            let mut seconds = [const { Vec::new() }; METHODS.len()];
            let mut hits = [0; METHODS.len()];
            for _ in 0..REPEATS {
                for (m, &(_, method)) in METHODS.iter().enumerate() {
                    let started = Instant::now();
                    hits[m] = black_box(self.trace_all(method, kind, kind.packets.iter()));
                    seconds[m].push(started.elapsed().as_secs_f64());
                }
            }
            let medians = seconds.map(|mut s| {
                s.sort_by(f64::total_cmp);
                s[REPEATS / 2]
            });
            let cell = |&s: &f64| format!("{:>14.2} ({:5.2})", rays as f64 * 1e-6 / s, medians[0] / s);
            let cells: Vec<String> = medians.iter().map(cell).collect();
            let share = hits[0] as f64 / rays as f64;
            println!("{:14}{}   {:.1} %", kind.name, cells.concat(), 100.0 * share);
            let most = hits.iter().max().zip(hits.iter().min()).map_or(0, |(a, b)| a - b);
            assert!(most as f64 <= 1e-4 * rays as f64, "{}: methods disagree: {hits:?}", kind.name);
        }
    }
}

fn benches(criterion: &mut Criterion) {
    let mut beds = vec![bed("balls", &balls())];
    let sponza = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/sponza.glb");
    if sponza.exists() {
        match scene::load(&sponza, &scene::LoadOptions::default()) {
            Ok(scene) => beds.push(bed("sponza", &scene)),
            Err(error) => println!("skipped: {error}"),
        }
    } else {
        println!("skipped: ../shared/scenes/sponza.glb absent");
    }
    beds.iter().for_each(Bed::print_table);
    for bed in &beds {
        for kind in &bed.kinds {
            let mut group = criterion.benchmark_group(format!("accel/{}/{}", bed.name, kind.name));
            let packets = || kind.packets.iter().step_by(THINNING);
            group.throughput(criterion::Throughput::Elements((packets().count() * LANES) as u64));
            group.sample_size(10).measurement_time(std::time::Duration::from_millis(500));
            group.warm_up_time(std::time::Duration::from_millis(100));
            for (name, method) in METHODS {
                group.bench_function(name, |b| b.iter(|| black_box(bed.trace_all(method, kind, packets()))));
            }
        }
    }
}

criterion_group!(accel, benches);
criterion_main!(accel);
