//! Integrators: what turns a camera, a scene and random numbers into a film.
//!
//! An [`Integrator`] runs a tile for a range of samples into a private [`FilmTile`]; tiles merge in index order, and
//! every random number is a function of (seed, pixel or block, sample, dimension), so the film is the same for any
//! number of threads.

mod block;
mod gradient_path;
mod head;
mod path;
mod wave;

pub use crate::shade::ShadeScene;
pub use gradient_path::GradientPath;
pub use path::Path;
pub use wave::{Region, Scratch, TILE};

use crate::accel::Accel;
use crate::film::{Film, FilmTile};
use crate::path::Limits;
use crate::path::trace::{RayCounts, Tracer};
use crate::scene::Camera;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Which integrator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Path tracing: the primal image alone.
    Path,
    /// Gradient-domain path tracing: the primal image and its differences.
    GradientPath,
}

/// The pixel filter, applied by importance sampling of the sub-pixel position (no splats).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// One pixel wide, constant.
    Box,
    /// Gaussian of standard deviation 0.5 pixels, cut at 2 pixels.
    Gaussian,
    /// Blackman–Harris window of radius 1.65 pixels.
    BlackmanHarris,
}

/// Everything that decides the image, beside the scene.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Which integrator.
    pub kind: Kind,
    /// Columns of the whole film.
    pub width: u32,
    /// Rows of the whole film.
    pub height: u32,
    /// Part of the film to render, [x0, y0, x1, y1) in pixels.
    pub crop: Option<[u32; 4]>,
    /// Index of the first sample.
    pub first_sample: u32,
    /// Samples a pixel.
    pub spp: u32,
    /// Longest path in vertices after the camera: 1 is emitters seen directly, 2 direct light.
    pub max_depth: u32,
    /// First vertex after which Russian roulette may end a path.
    pub rr_depth: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Whether all pixels draw the same random numbers; a render takes its differences from such a film.
    pub common_random_numbers: bool,
    /// Pixel filter.
    pub filter: Filter,
    /// GGX alpha at or below which a smooth lobe is glossy for the shift (section 3).
    pub shift_threshold: f32,
    /// Whether pairs of base and offset path share multiple importance sampling weights.
    pub pair_mis: bool,
    /// Whether to measure feature layers.
    pub features: bool,
}

impl Settings {
    /// Samples a pixel: with common random numbers there are as many again, for the differences.
    pub fn samples_taken(&self) -> u32 {
        if self.common_random_numbers { 2 * self.spp } else { self.spp }
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            kind: Kind::GradientPath,
            width: 512,
            height: 512,
            crop: None,
            first_sample: 0,
            spp: 64,
            max_depth: 12,
            rr_depth: 5,
            seed: 0,
            common_random_numbers: false,
            filter: Filter::Box,
            shift_threshold: 0.001,
            pair_mis: true,
            features: false,
        }
    }
}

/// How a shift to one neighbour ended or went on, one count a bounce or event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum ShiftOutcome {
    /// Connected to the base's next vertex or to its direction into the environment.
    Reconnected,
    /// The connection is blocked.
    Occluded,
    /// The offset's BSDF is zero towards the base's next vertex.
    ZeroBsdf,
    /// Half-vector copied; the offset has a new vertex of its own.
    HalfVector,
    /// Half-vector copy leaves the valid domain: total internal reflection, other side, other kind of event.
    HalfVectorDomain,
    /// The offset's next vertex would be reconnected to from the other side, or one of the two left the scene.
    HalfVectorMismatch,
    /// Smooth event between a diffuse and a glossy vertex.
    Mixed,
    /// The neighbour's camera ray meets nothing.
    NoPrimaryHit,
}

impl ShiftOutcome {
    /// Number of outcomes.
    pub const COUNT: usize = 8;
    /// Names in the order of the indices, as in the statistics file.
    pub const NAMES: [&'static str; Self::COUNT] = [
        "reconnected",
        "occluded",
        "zero_bsdf",
        "half_vector",
        "half_vector_domain",
        "half_vector_mismatch",
        "mixed_materials",
        "no_primary_hit",
    ];
}

/// What was done for an image.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Rays and packets.
    pub rays: RayCounts,
    /// Shifts by [`ShiftOutcome`].
    pub shifts: [u64; ShiftOutcome::COUNT],
}

impl Statistics {
    /// Adds what another tile did.
    pub fn add(&mut self, other: &Self) {
        self.rays.add(&other.rays);
        for (sum, count) in self.shifts.iter_mut().zip(other.shifts) {
            *sum += count;
        }
    }
}

/// A method that estimates the film of a tile.
pub trait Integrator: Sync {
    /// Whether the film gets gradients.
    const HAS_GRADIENTS: bool;

    /// Renders samples `wave` of the pixels of `region` into `tile`.
    fn wave<A: Accel>(
        &self,
        view: &View<'_>,
        tracer: &mut Tracer<'_, A>,
        region: &Region,
        wave: std::ops::Range<u32>,
        tile: &mut FilmTile,
        scratch: &mut Scratch,
        statistics: &mut Statistics,
    );
}

/// What every wave looks at.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// The settings.
    pub settings: &'a Settings,
    /// Path length bounds, from the settings.
    pub limits: Limits,
}

/// Renders `scene`, which is prepared once for any number of renders, through `camera` on the threads of the current
/// rayon pool. Calls `on_progress` with (done, total) work items; stops early, with what is complete, once `cancel` is
/// set.
pub fn run<A: Accel>(
    scene: &ShadeScene,
    accel: &A,
    camera: &Camera,
    settings: &Settings,
    on_progress: &(dyn Fn(u64, u64) + Sync),
    cancel: &AtomicBool,
) -> (Film, Statistics) {
    let limits = Limits { max_depth: settings.max_depth, rr_depth: settings.rr_depth };
    let view = View { camera, settings, limits };
    match settings.kind {
        Kind::Path => tiles(&Path, scene, accel, &view, on_progress, cancel),
        Kind::GradientPath => tiles(&GradientPath, scene, accel, &view, on_progress, cancel),
    }
}

fn tiles<I: Integrator, A: Accel>(
    integrator: &I,
    scene: &ShadeScene,
    accel: &A,
    view: &View<'_>,
    on_progress: &(dyn Fn(u64, u64) + Sync),
    cancel: &AtomicBool,
) -> (Film, Statistics) {
    let settings = view.settings;
    let [x0, y0, x1, y1] = settings.crop.unwrap_or([0, 0, settings.width, settings.height]);
    let regions = Region::tiles(x0, y0, x1, y1);
    let total = regions.len() as u64;
    let done = AtomicU64::new(0);
    let (width, height) = ((x1 - x0) as usize, (y1 - y0) as usize);
    let film = Film::new(width, height, I::HAS_GRADIENTS, settings.features);

    // Tiles of a batch are rendered in any order and merged in index order.
    const BATCH: usize = 256;
    let mut result = (film, Statistics::default());
    for batch in regions.chunks(BATCH) {
        let finished: Vec<_> = batch
            .par_iter()
            .map_init(Scratch::default, |scratch, region| {
                if cancel.load(Ordering::Relaxed) {
                    return None;
                }
                let mut tile = region.film_tile(x0, y0);
                let mut statistics = Statistics::default();
                let mut tracer = Tracer::new(scene, accel);
                for wave in wave::waves(settings.first_sample, settings.spp) {
                    if cancel.load(Ordering::Relaxed) {
                        return None;
                    }
                    integrator.wave(view, &mut tracer, region, wave, &mut tile, scratch, &mut statistics);
                }
                statistics.rays = tracer.counts;
                on_progress(done.fetch_add(1, Ordering::Relaxed) + 1, total);
                Some((tile, statistics))
            })
            .collect();
        for (tile, statistics) in finished.into_iter().flatten() {
            result.0.merge(&tile);
            result.1.add(&statistics);
        }
    }
    result.0.add_samples(settings.first_sample, settings.spp);
    result
}
