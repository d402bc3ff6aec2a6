//! Kernels whose instructions are counted by callgrind: always the same work, on one thread, without the ray tracing
//! library, whose instructions are not ours.
//!
//! Each kernel prepares, then does its work inside [`counted_region`], the one function that callgrind is told to
//! collect in. Renders trace with obvhs first, which is compiled with the rest and therefore answers the same
//! everywhere, and are then repeated on the recorded answers.

use crate::fixtures::{fields, hits, materials, noisy_buffers, sample, uniform, vertex};
use crate::render::{render, settings};
use crate::replay::Recorder;
use crate::shapes;
use gdpt::accel::ObvhsAccel;
use gdpt::film::{Film, FilmTile};
use gdpt::integrate::Kind;
use gdpt::math::{Mask, Vec3x, lanes};
use gdpt::path::shift::{PairWeights, half_vector, reconnect};
use gdpt::reconstruct::{Alpha, Input, Method, reconstruct};
use gdpt::scene::{Material, Scene, builtin};
use gdpt::shade::{Receiver, ShadeScene, Surface};
use glam::Vec3;
use rayon::ThreadPoolBuilder;
use std::hint::black_box;

/// Every way to solve for the image.
pub const SOLVERS: [(&str, Method); 3] =
    [("L2", Method::L2), ("L1", Method::L1), ("weighted", Method::Weighted)];

/// The weight of the primal in every solve.
pub const ALPHA: Alpha = Alpha::Fixed(0.2);

/// Numbers a kernel knows without callgrind, by name: they are compared like the instructions.
pub type Facts = Vec<(String, f64)>;

/// A kernel.
pub struct Kernel {
    /// As in the stored counts.
    pub name: &'static str,
    /// Does the work.
    pub run: fn() -> Facts,
}

/// All kernels.
pub const KERNELS: [Kernel; 14] = [
    Kernel { name: "path tracing, diffuse tile", run: || tile(Kind::Path, diffuse_box()) },
    Kernel { name: "path tracing, mixed tile", run: || tile(Kind::Path, mixed_box()) },
    Kernel { name: "gradient-domain, diffuse tile", run: || tile(Kind::GradientPath, diffuse_box()) },
    Kernel { name: "gradient-domain, mixed tile", run: || tile(Kind::GradientPath, mixed_box()) },
    Kernel { name: "path tracing, 1000 lamps", run: || tile(Kind::Path, shapes::lamps(1000)) },
    Kernel { name: "surface", run: surface },
    Kernel { name: "BSDF", run: bsdf },
    Kernel {
        name: "light sampling, 4096 triangles and sky",
        run: || light(fields(Material::default(), Vec3::ONE)),
    },
    Kernel { name: "light sampling, sky", run: || light(fields(Material::default(), Vec3::ZERO)) },
    Kernel { name: "shift", run: shift },
    Kernel { name: "L2 solve", run: || solve(Method::L2) },
    Kernel { name: "L1 solve", run: || solve(Method::L1) },
    Kernel { name: "weighted solve", run: || solve(Method::Weighted) },
    Kernel { name: "film", run: film },
];

/// Repetitions of what is too short to count once.
const REPEATS: usize = 200;

/// What callgrind collects, by `--toggle-collect`; hence never inlined.
#[inline(never)]
pub fn counted_region<T>(work: impl FnOnce() -> T) -> T {
    black_box(work())
}

fn repeated<T>(work: impl Fn() -> T) -> Facts {
    counted_region(|| (0..REPEATS).for_each(|_| drop(black_box(work()))));
    Facts::new()
}

fn diffuse_box() -> Scene {
    builtin("cornell-box").expect("it is built in")
}

/// The Cornell box with one block of glass and one of brushed metal.
fn mixed_box() -> Scene {
    let mut scene = diffuse_box();
    let glass =
        Material { transmission: 1.0, is_solid: true, metallic: 0.0, roughness: 0.0, ..Material::default() };
    let metal = Material { roughness: 0.4, ..Material::default() };
    for (block, material) in [("short block", glass), ("tall block", metal)] {
        let index = scene.materials.len() as u32;
        scene.materials.push(material);
        scene.meshes.iter_mut().filter(|m| m.name == block).for_each(|m| m.material = index);
    }
    scene
}

/// A tile of 16×16 pixels that shows the whole scene, 8 samples a pixel: one wave of paths.
fn tile(kind: Kind, scene: Scene) -> Facts {
    let obvhs = ObvhsAccel::new(&scene).expect("the scene fits");
    let settings = settings(kind, [16, 16], 8, 0);
    let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    let recorder = Recorder::new(&obvhs);
    let (replay, coherent, statistics) = pool.expect("this thread is there").install(|| {
        let (_, statistics) = render(&scene, &recorder, &settings);
        let (coherent, replay) = (recorder.coherent_packets(), recorder.replay());
        counted_region(|| render(&scene, &replay, &settings));
        (replay, coherent, statistics)
    });
    assert!(replay.is_finished(), "a render repeats itself");
    let rays = statistics.rays;
    let packets = rays.intersect_packets + rays.occluded_packets;
    let facts = [("rays", rays.total), ("packets", packets), ("coherent packets", coherent)];
    facts.map(|(name, count)| (name.to_owned(), count as f64)).into()
}

/// Directions at a surface.
fn directions() -> [Vec3x; 2] {
    [Vec3::new(0.6, 0.7, 0.374), Vec3::new(-0.3, 0.8, 0.1)].map(|w| Vec3x::splat(w.normalize()))
}

fn surface() -> Facts {
    let [wo, _] = directions();
    let scenes = materials().map(|(_, material)| fields(material, Vec3::ZERO));
    let prepared = scenes.each_ref().map(ShadeScene::new);
    repeated(|| prepared.each_ref().map(|scene| Surface::new(scene, black_box(&hits()), Mask::ALL, wo)))
}

fn bsdf() -> Facts {
    let [wo, wi] = directions();
    let [u, v, w] = [0.618, 0.755, 0.57].map(uniform);
    let bsdfs = materials().map(|(_, material)| {
        let scene = fields(material, Vec3::ZERO);
        Surface::new(&ShadeScene::new(&scene), &hits(), Mask::ALL, wo).bsdf
    });
    repeated(|| {
        bsdfs.each_ref().map(|bsdf| {
            let bsdf = black_box(bsdf);
            (bsdf.sample(wo, u, v, w, Mask::ALL), bsdf.eval(wo, wi))
        })
    })
}

fn light(scene: Scene) -> Facts {
    let prepared = ShadeScene::new(&scene);
    let [u, v, w] = [0.618, 0.755, 0.57].map(uniform);
    let p = Vec3x::splat(Vec3::new(3.0, 0.0, 4.0));
    let from = Receiver { p, n: Vec3x::splat(Vec3::Y), both_sides: Mask::NONE };
    repeated(|| {
        let point = prepared.lights.sample(&prepared, &from, Mask::ALL, black_box(u), v, w);
        prepared.lights.seen_from(&prepared, &point, p)
    })
}

fn shift() -> Facts {
    let (x, y, z) = (vertex(0.0), vertex(0.02), vertex(3.0));
    let wi = Vec3x::new(lanes(|_| -0.2), lanes(|_| 0.1), lanes(|_| 0.9)).normalize();
    let weights = PairWeights { mis: true };
    repeated(|| {
        let (x, y, z) = (black_box(&x), black_box(&y), black_box(&z));
        let reflection = half_vector(x, wi, y, Mask::NONE);
        let transmission = half_vector(x, -wi, y, Mask::ALL);
        let reconnection = reconnect(x, y, z);
        let weight = weights.weight(reconnection.jacobian, reflection.jacobian);
        (transmission, weight)
    })
}

/// A small image: many steps of the solvers, few instructions each.
fn solve(method: Method) -> Facts {
    let buffers = noisy_buffers(96, 64);
    let input = Input::from(&buffers);
    let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
    let solution = pool
        .expect("this thread is there")
        .install(|| counted_region(|| reconstruct(black_box(&input), method, ALPHA)));
    vec![("iterations".into(), solution.iterations as f64)]
}

/// Samples into a tile, the tile into a film, the differences of the film.
fn film() -> Facts {
    const SIDE: usize = 16;
    let samples: Vec<_> = (0..SIDE * SIDE * 8).map(sample).collect();
    let mut film = Film::new(SIDE, SIDE, true, true);
    counted_region(|| {
        let mut tile = FilmTile::new(0, 0, SIDE, SIDE);
        for (i, sample) in samples.iter().enumerate() {
            let (pixel, index) = (i % (SIDE * SIDE), i / (SIDE * SIDE));
            tile.add(pixel % SIDE, pixel / SIDE, index as u32, black_box(sample));
        }
        film.merge(&tile);
        film.add_samples(0, 8);
        let half = gdpt::film::Half::Both;
        (film.primal(half), film.dx(half), film.dy(half), film.variance())
    });
    Facts::new()
}
