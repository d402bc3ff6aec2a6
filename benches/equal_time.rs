//! What a gradient costs and what it buys: path tracing against gradient-domain path tracing on both backends.
//!
//! Criterion times the renders; a table printed first gives, from one run with the sides alternating, CPU seconds,
//! their ratios and the relMSE (definition in `analyze::metrics`) against a path-traced reference of another seed,
//! its own noise subtracted. Scenes: the built-in Cornell box, and Sponza where `../shared/scenes` has it.

use criterion::{Criterion, criterion_group, criterion_main};
use gdpt::accel::{Accel, EmbreeAccel, ObvhsAccel};
use gdpt::analyze::metrics::compare;
use gdpt::film::{Film, Half, Plane};
use gdpt::integrate::{self, Kind, Settings};
use gdpt::reconstruct::{self, Method};
use gdpt::scene::{self, Scene};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

const REPEATS: usize = 5;
const REFERENCE_SPP: u32 = 2048;

fn settings(kind: Kind, size: (u32, u32), spp: u32, seed: u64) -> Settings {
    Settings { kind, width: size.0, height: size.1, spp, seed, max_depth: 8, ..Settings::default() }
}

fn render<A: Accel>(scene: &Scene, accel: &A, settings: &Settings) -> Film {
    integrate::run(scene, accel, &scene.cameras[0], settings, &|_, _| {}, &AtomicBool::new(false)).0
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn scenes() -> Vec<(&'static str, Scene, (u32, u32))> {
    let mut scenes = Vec::new();
    if let Some(cornell) = scene::builtin("cornell-box") {
        scenes.push(("cornell-box", cornell, (256, 256)));
    }
    let sponza = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes/sponza.glb");
    match scene::load(&sponza, &scene::LoadOptions::default()) {
        Ok(sponza) => scenes.push(("sponza", sponza, (256, 192))),
        Err(error) => println!("skipped: sponza: {error}"),
    }
    scenes
}

fn rel_mse(image: &Plane, reference: &Plane) -> f64 {
    compare(image, reference).expect("images of one size").rel_mse
}

/// relMSE without the reference's own noise, which is that of `reference_noise`.
fn error(image: &Plane, reference: &Plane, reference_noise: f64) -> f64 {
    rel_mse(image, reference) - reference_noise
}

fn table(name: &str, scene: &Scene, size: (u32, u32), spp: u32) {
    let threads = rayon::current_num_threads();
    let embree = EmbreeAccel::new(scene, threads, false, None).expect("Embree is installed");
    let obvhs = ObvhsAccel::new(scene).expect("the scene fits");
    let mut seconds = [const { Vec::new() }; 4];
    for repeat in 0..REPEATS as u64 {
        let mut time = |side: usize, run: &dyn Fn() -> Film| {
            let start = Instant::now();
            let film = run();
            seconds[side].push(start.elapsed().as_secs_f64());
            film
        };
        time(0, &|| render(scene, &embree, &settings(Kind::Path, size, spp, repeat)));
        time(1, &|| render(scene, &embree, &settings(Kind::GradientPath, size, spp, repeat)));
        time(2, &|| render(scene, &obvhs, &settings(Kind::Path, size, spp, repeat)));
        time(3, &|| render(scene, &obvhs, &settings(Kind::GradientPath, size, spp, repeat)));
    }
    let [pt, gpt, pt_obvhs, gpt_obvhs] = seconds.map(median);

    let primal = |seed: u64, spp: u32| {
        render(scene, &embree, &settings(Kind::Path, size, spp, seed)).primal(Half::Both)
    };
    let (first, second) = (primal(1001, REFERENCE_SPP / 2), primal(1002, REFERENCE_SPP / 2));
    let reference = Plane::from_fn(first.width, first.height, |x, y| {
        std::array::from_fn(|c| 0.5 * (first.at(x, y)[c] + second.at(x, y)[c]))
    });
    // Two independent halves differ by 4 times the variance of their mean.
    let noise = rel_mse(&first, &second) / 4.0;
    let film = render(scene, &embree, &settings(Kind::GradientPath, size, spp, 7));
    let buffers = film.buffers();
    let input = reconstruct::Input::from(&buffers);
    let pt_error = error(&buffers.all.primal, &reference, noise);
    println!("\n{name}, {}x{}, {spp} spp, depth 8, median of {REPEATS}", size.0, size.1);
    println!("  wall seconds: Embree PT {pt:.3}, G-PT {gpt:.3}; obvhs PT {pt_obvhs:.3}, G-PT {gpt_obvhs:.3}");
    println!(
        "  cost of G-PT over PT {:.2}; Embree over obvhs: PT {:.2}, G-PT {:.2}",
        gpt / pt,
        pt_obvhs / pt,
        gpt_obvhs / gpt
    );
    for method in [Method::L2, Method::L1, Method::Weighted] {
        let solution = reconstruct::reconstruct(&input, method, reconstruct::Alpha::Fixed(0.2));
        let gain = pt_error / error(&solution.image, &reference, noise);
        println!(
            "  relMSE of PT over {method:?}: {gain:.1} at equal spp, {:.1} at equal time (PT {pt_error:.3e})",
            gain * pt / gpt
        );
    }
}

fn equal_time(c: &mut Criterion) {
    let measuring = std::env::args().any(|a| a == "--bench");
    for (name, scene, size) in scenes() {
        if measuring {
            table(name, &scene, size, 64);
        }
        let embree =
            EmbreeAccel::new(&scene, rayon::current_num_threads(), false, None).expect("Embree is installed");
        let obvhs = ObvhsAccel::new(&scene).expect("the scene fits");
        let mut group = c.benchmark_group(format!("equal_time/{name}"));
        group.sample_size(10);
        for (kind, label) in [(Kind::Path, "PT"), (Kind::GradientPath, "G-PT")] {
            let settings = settings(kind, (128, 128), 4, 0);
            group
                .bench_function(format!("{label} embree"), |b| b.iter(|| render(&scene, &embree, &settings)));
            group.bench_function(format!("{label} obvhs"), |b| b.iter(|| render(&scene, &obvhs, &settings)));
        }
        group.finish();
    }
}

criterion_group!(benches, equal_time);
criterion_main!(benches);
