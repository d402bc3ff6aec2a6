//! Renders as the benches time them: path length 8, both backends, a given number of threads.

use crate::measure::{Cost, Side, cost};
use gdpt::accel::embree::flush_denormals;
use gdpt::accel::{Accel, EmbreeAccel, ObvhsAccel};
use gdpt::film::Film;
use gdpt::integrate::{self, Kind, Settings, ShadeScene, Statistics};
use gdpt::scene::Scene;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::AtomicBool;

/// Longest path in vertices after the camera, here and in the other renderer.
pub const MAX_DEPTH: u32 = 8;

/// CPUs of this machine.
pub fn cpus() -> usize {
    std::thread::available_parallelism().map_or(1, |n| n.get())
}

/// Workers as in the renderer itself.
pub fn pool(threads: usize) -> ThreadPool {
    let builder = ThreadPoolBuilder::new().num_threads(threads).start_handler(|_| flush_denormals());
    builder.build().expect("a few threads can be started")
}

/// Settings of a bench.
pub fn settings(kind: Kind, [width, height]: [u32; 2], spp: u32, seed: u64) -> Settings {
    Settings { kind, width, height, spp, seed, max_depth: MAX_DEPTH, ..Settings::default() }
}

/// Renders through the first camera on the threads of the current pool.
pub fn render<A: Accel>(scene: &Scene, accel: &A, settings: &Settings) -> (Film, Statistics) {
    integrate::run(
        &ShadeScene::new(scene),
        accel,
        &scene.cameras[0],
        settings,
        &|_, _| {},
        &AtomicBool::new(false),
    )
}

/// A scene built for both backends.
pub struct Bed<'a> {
    scene: &'a Scene,
    embree: EmbreeAccel,
    obvhs: ObvhsAccel,
}

/// Which ray tracing library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// Sixteen rays at a time.
    Embree,
    /// One ray at a time.
    Obvhs,
}

impl<'a> Bed<'a> {
    /// Builds both.
    pub fn new(scene: &'a Scene) -> Self {
        let embree = EmbreeAccel::new(scene, cpus(), false, None).expect("Embree is installed");
        Self { scene, embree, obvhs: ObvhsAccel::new(scene).expect("the scene fits") }
    }

    /// Renders.
    pub fn render(&self, backend: Backend, settings: &Settings) -> (Film, Statistics) {
        match backend {
            Backend::Embree => render(self.scene, &self.embree, settings),
            Backend::Obvhs => render(self.scene, &self.obvhs, settings),
        }
    }

    /// A side of a comparison: renders on `pool`, each time with another seed.
    pub fn side<'b>(&'b self, backend: Backend, settings: Settings, pool: &'b ThreadPool) -> Side<'b> {
        let mut settings = settings;
        Box::new(move || -> Cost {
            settings.seed += 1;
            pool.install(|| cost(|| self.render(backend, &settings)))
        })
    }

    /// Embree's structure.
    pub fn embree(&self) -> &EmbreeAccel {
        &self.embree
    }
}

/// Millions of samples of one render.
pub fn megasamples([width, height]: [u32; 2], spp: u32) -> f64 {
    f64::from(width) * f64::from(height) * f64::from(spp) * 1e-6
}
