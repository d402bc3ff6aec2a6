//! The families of work and how one point of each is measured, in the process that calls it.

use gdpt::accel::EmbreeAccel;
use gdpt::film::{Film, Half};
use gdpt::integrate::{Kind, Settings};
use gdpt::reconstruct::{Input, Method, reconstruct};
use gdpt::scene::{Scene, builtin};
use gdpt::study::usage::peak_memory;
use gdpt_bench::kernels::ALPHA;
use gdpt_bench::measure::{Cost, timed};
use gdpt_bench::render::{cpus, pool, render, settings};
use gdpt_bench::shapes;
use serde::{Deserialize, Serialize};

/// What one process measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Point {
    /// How much work it was.
    pub x: f64,
    build_cpu: f64,
    render_cpu: f64,
    render_wall: f64,
    solve_cpu: f64,
    /// 0 where the system does not say.
    peak_megabytes: f64,
    /// Variance of one sample over the squared mean of the image.
    variance: f64,
}

/// A curve of a family.
pub struct Curve {
    /// What.
    pub name: &'static str,
    /// In which unit.
    pub unit: &'static str,
    /// Of a point.
    pub value: fn(&Point) -> f64,
}

const RENDER: Curve = Curve { name: "render", unit: "s CPU", value: |p| p.render_cpu };
const SOLVE: Curve = Curve { name: "L1 solve", unit: "s CPU", value: |p| p.solve_cpu };
const BUILD: Curve = Curve { name: "build", unit: "s CPU", value: |p| p.build_cpu };
const WALL: Curve = Curve { name: "render", unit: "s wall", value: |p| p.render_wall };
const MEMORY: Curve = Curve { name: "peak memory", unit: "MB", value: |p| p.peak_megabytes };
/// What a given error costs.
const INEFFICIENCY: Curve =
    Curve { name: "relative variance × time", unit: "s CPU", value: |p| p.variance * p.render_cpu };

/// Points that differ in one thing.
pub struct Family {
    /// As on the command line.
    pub name: &'static str,
    /// What x is.
    pub axis: &'static str,
    /// What is drawn.
    pub curves: &'static [Curve],
    /// How many points.
    pub count: fn() -> usize,
    /// Measures point `index`.
    pub measure: fn(usize) -> Point,
}

/// All families.
pub const FAMILIES: [Family; 5] = [
    Family {
        name: "spp",
        axis: "samples a pixel (Cornell box 128×128, G-PT)",
        curves: &[RENDER, SOLVE, MEMORY],
        count: || 9,
        measure: |i| cornell(128, 1 << i, cpus(), f64::from(1 << i)),
    },
    Family {
        name: "pixels",
        axis: "pixels (Cornell box, 4 samples a pixel, G-PT)",
        curves: &[RENDER, SOLVE, MEMORY],
        count: || 6,
        measure: |i| cornell(64 << i, 4, cpus(), f64::from(64 << i).powi(2)),
    },
    Family {
        name: "triangles",
        axis: "triangles, instanced (dented balls 128×128, 32 samples a pixel, G-PT)",
        curves: &[BUILD, RENDER, MEMORY],
        count: || BALLS.len(),
        measure: |i| {
            let [count, columns, rows] = BALLS[i];
            let scene = shapes::instanced_balls(count, columns, rows);
            measure(
                &scene,
                settings(Kind::GradientPath, [128, 128], 32, 0),
                cpus(),
                scene.triangle_count() as f64,
            )
        },
    },
    Family {
        name: "lights",
        axis: "emissive triangles (room 128×128, 32 samples a pixel, path tracing)",
        curves: &[RENDER, INEFFICIENCY, MEMORY],
        count: || 6,
        measure: |i| {
            let lamps = 10_u32.pow(i as u32);
            let settings = settings(Kind::Path, [128, 128], 32, 0);
            measure(&shapes::lamps(lamps), settings, cpus(), f64::from(lamps))
        },
    },
    Family {
        name: "threads",
        axis: "threads (Cornell box 256×256, 32 samples a pixel, G-PT)",
        curves: &[WALL, MEMORY],
        count: cpus,
        measure: |i| cornell(256, 32, i + 1, (i + 1) as f64),
    },
];

/// Balls and the columns and rows of each: 38 to 5.1 million triangles.
const BALLS: [[u32; 3]; 7] =
    [[1, 6, 2], [1, 16, 8], [1, 32, 32], [8, 32, 32], [64, 32, 32], [512, 32, 32], [2500, 32, 32]];

fn cornell(side: u32, spp: u32, threads: usize, x: f64) -> Point {
    let scene = builtin("cornell-box").expect("it is built in");
    measure(&scene, settings(Kind::GradientPath, [side, side], spp, 0), threads, x)
}

fn measure(scene: &Scene, settings: Settings, threads: usize, x: f64) -> Point {
    let build = || EmbreeAccel::new(scene, threads, false, None).expect("Embree is installed");
    let (accel, build) = timed(build);
    let pool = pool(threads);
    let (film, rendered) = pool.install(|| timed(|| render(scene, &accel, &settings).0));
    let solve = if film.has_gradients { pool.install(|| solve(&film)) } else { Cost::default() };
    Point {
        x,
        build_cpu: build.cpu,
        render_cpu: rendered.cpu,
        render_wall: rendered.wall,
        solve_cpu: solve.cpu,
        peak_megabytes: peak_memory().map_or(0.0, |bytes| bytes as f64 * 1e-6),
        variance: variance(&film),
    }
}

fn solve(film: &Film) -> Cost {
    let measured = film.measured(Half::Both);
    timed(|| reconstruct(&Input::new(&measured), Method::L1, ALPHA)).1
}

/// Variance of one sample, averaged over the image, over the squared mean of the image.
fn variance(film: &Film) -> f64 {
    let mean = |plane: &[[f32; 3]]| {
        plane.iter().flatten().map(|&v| f64::from(v)).sum::<f64>() / (3 * plane.len()) as f64
    };
    let samples = f64::from(film.samples(Half::Both));
    samples * mean(&film.variance().data) / mean(&film.primal(Half::Both).data).powi(2)
}
