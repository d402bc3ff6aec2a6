//! The table of contents: load, build, integrate, reconstruct, write. Reading [`run`] from top to bottom is reading
//! the program.

pub mod job;
pub mod metadata;
mod passes;
mod prepare;
pub mod resolve;

pub use self::job::{Backend, CameraChoice, EnvironmentOptions, Format, Job, Lens, Output, Source, Stop};
pub use self::prepare::open;
use self::prepare::{check_memory, load};

use crate::accel::embree::flush_denormals;
use crate::accel::{Accel, EmbreeAccel, ObvhsAccel};
use crate::denoise;
use crate::error::{Error, Result};
use crate::film::{Buffers, Film, Half, Plane};
use crate::integrate::{self, Settings, ShadeScene, Statistics};
use crate::reconstruct::{Alpha, Input, Method, Solution, reconstruct};
use crate::scene::{Camera, LoadReport, Scene};
use crate::store::{Document, Window, atomic, exr, layers, png};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Who watches a render: the terminal, or a test.
pub trait Monitor: Sync {
    /// Something the user should know and that does not end the run.
    fn warn(&self, message: &str);
    /// A stage begins.
    fn stage(&self, name: &str);
    /// `done` of `total` work items of the stage are finished.
    fn progress(&self, done: u64, total: u64);
}

/// Wall seconds of each stage.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seconds {
    /// Reading and decoding the scene.
    pub load: f64,
    /// Building the acceleration structure.
    pub build: f64,
    /// Integrating.
    pub render: f64,
    /// Solving for the image.
    pub reconstruct: f64,
    /// Encoding and writing the files.
    pub write: f64,
}

impl Seconds {
    /// Sum over the stages.
    pub fn total(&self) -> f64 {
        self.load + self.build + self.render + self.reconstruct + self.write
    }
}

/// How an image was found, without the image.
#[derive(Clone, Copy, Debug)]
pub struct Solve {
    /// The method, `auto` resolved.
    pub method: Method,
    /// α, where the method has one.
    pub alpha: Option<f32>,
    /// Relative residual.
    pub residual: f64,
    /// Steps or reweightings.
    pub iterations: usize,
    /// Measurements the solve did without because they were not finite.
    pub missing: usize,
    /// Estimated relMSE of the image; `None` below two samples.
    pub rel_mse: Option<f64>,
}

impl Solve {
    fn of(solution: &Solution) -> Self {
        let Solution { method, alpha, residual, iterations, missing, error, .. } = solution;
        Self {
            method: *method,
            alpha: *alpha,
            residual: *residual,
            iterations: *iterations,
            missing: *missing,
            rel_mse: error.as_ref().map(|e| e.rel_mse),
        }
    }
}

/// What a finished render has to say.
#[derive(Clone, Debug)]
pub struct Report {
    /// Where the time went.
    pub seconds: Seconds,
    /// Rays, shifts and dropped samples.
    pub statistics: Statistics,
    /// What the loader dropped and did not honour.
    pub load: LoadReport,
    /// Columns and rows that were rendered.
    pub size: [u32; 2],
    /// Triangles over all instances.
    pub triangles: u64,
    /// Samples a pixel, fewer than asked for where the job was to stop.
    pub spp: u32,
    /// Samples over all pixels.
    pub samples: u64,
    /// How the image was found.
    pub solve: Solve,
    /// Samples dropped because they were not finite.
    pub dropped_samples: u64,
    /// Threads that worked.
    pub threads: usize,
}

/// Renders `job`. When `cancel` becomes true the run ends with [`Error::Interrupted`] and writes nothing; its
/// signal number is for the caller to fill in.
pub fn run(job: &Job, monitor: &dyn Monitor, cancel: &AtomicBool) -> Result<Report> {
    for output in job.outputs.iter().chain(&job.denoised) {
        atomic::probe(&output.path, &job.inputs())?;
    }
    check_memory(job)?;
    let work = Work { job, monitor, cancel, pool: pool(job.threads)?, start: Instant::now() };
    let mut seconds = Seconds::default();

    monitor.stage("load");
    let (loaded, time) = timed(|| work.pool.install(|| load(job, monitor)));
    let (scene, camera) = loaded?;
    seconds.load = time;
    work.go_on()?;

    let rendered = match job.backend {
        // Embree builds with threads of its own.
        Backend::Embree => work.integrate(&scene, &camera, &mut seconds, || {
            EmbreeAccel::new(&scene, job.threads, job.robust, job.max_memory)
        }),
        Backend::Obvhs => {
            work.integrate(&scene, &camera, &mut seconds, || work.pool.install(|| ObvhsAccel::new(&scene)))
        }
    };
    let (film, statistics) = rendered?;

    monitor.stage("reconstruct");
    let (solved, time) = timed(|| work.pool.install(|| solve(&film.buffers(), job.method, job.alpha)));
    seconds.reconstruct = time;
    work.go_on()?;

    monitor.stage("write");
    let done = job.with_samples(film.samples(Half::Both));
    let (written, time) = timed(|| work.pool.install(|| write(&done, &film, &camera, &solved)));
    written?;
    seconds.write = time;

    Ok(Report {
        seconds,
        statistics,
        load: scene.report.clone(),
        size: [film.width as u32, film.height as u32],
        triangles: scene.triangle_count(),
        spp: done.settings.spp,
        samples: film.width as u64 * film.height as u64 * u64::from(done.settings.samples_taken()),
        solve: Solve::of(&solved.solution),
        dropped_samples: film.dropped_samples,
        threads: job.threads,
    })
}

/// Workers that flush denormals to zero: they are slow, and darker than any image.
pub(crate) fn pool(threads: usize) -> Result<ThreadPool> {
    ThreadPoolBuilder::new()
        .num_threads(threads)
        .start_handler(|_| flush_denormals())
        .build()
        .map_err(|e| Error::OutOfMemory(format!("cannot start {threads} threads: {e}")))
}

/// A job under way.
struct Work<'a> {
    job: &'a Job,
    monitor: &'a dyn Monitor,
    cancel: &'a AtomicBool,
    pool: ThreadPool,
    start: Instant,
}

impl Work<'_> {
    /// Fails once the work is cancelled.
    fn go_on(&self) -> Result<()> {
        go_on(self.cancel)
    }

    /// Builds one backend and integrates with it, dispatched statically.
    fn integrate<A: Accel>(
        &self,
        scene: &Scene,
        camera: &Camera,
        seconds: &mut Seconds,
        build: impl FnOnce() -> Result<A>,
    ) -> Result<(Film, Statistics)> {
        self.monitor.stage("build");
        let (built, time) =
            timed(|| build().map(|accel| (accel, self.pool.install(|| ShadeScene::new(scene)))));
        let (accel, scene) = built?;
        seconds.build = time;
        self.go_on()?;

        let (settings, stop) = (&self.job.settings, &self.job.stop);
        let mut renderer = Renderer { work: self, scene: &scene, accel: &accel, camera };
        let (result, time) = timed(|| passes::run(settings, stop, self.start, &mut renderer));
        seconds.render = time;
        self.go_on()?;
        result.ok_or(Error::Interrupted(0))
    }
}

/// A scene before one backend.
struct Renderer<'a, A> {
    work: &'a Work<'a>,
    scene: &'a ShadeScene<'a>,
    accel: &'a A,
    camera: &'a Camera,
}

impl<A: Accel> Renderer<'_, A> {
    /// Integrates; the work is part `part` of `parts`.
    fn integrate(&self, settings: &Settings, part: u64, parts: u64) -> (Film, Statistics) {
        let &Work { monitor, cancel, start, job, .. } = self.work;
        let on_progress = |done: u64, total: u64| match job.stop.seconds {
            Some(limit) => {
                let milliseconds = |seconds: f64| (1e3 * seconds) as u64;
                monitor.progress(milliseconds(start.elapsed().as_secs_f64().min(limit)), milliseconds(limit));
            }
            None => monitor.progress(part * total + done, parts * total),
        };
        let run = || integrate::run(self.scene, self.accel, self.camera, settings, &on_progress, cancel);
        self.work.pool.install(run)
    }
}

impl<A: Accel> passes::Passes for Renderer<'_, A> {
    fn pass(&mut self, settings: &Settings) -> Option<(Film, Statistics)> {
        if self.work.job.stop.seconds.is_none()
            || settings.first_sample == self.work.job.settings.first_sample
        {
            self.work.monitor.stage("render");
        }
        let common = settings.common_random_numbers;
        let own = Settings { common_random_numbers: false, ..*settings };
        let (mut film, mut statistics) = self.integrate(&own, 0, if common { 2 } else { 1 });
        if common {
            let (other, more) = self.integrate(settings, 1, 2);
            film = film.with_differences_of(&other);
            statistics.add(&more);
        }
        self.work.go_on().ok().map(|()| (film, statistics))
    }

    fn trial(&mut self, film: &Film) -> Option<f64> {
        let job = self.work.job;
        let solved = self.work.pool.install(|| solve(&film.buffers(), job.method, job.alpha));
        Solve::of(&solved.solution).rel_mse
    }
}

/// The result of `f` and the seconds it took.
fn timed<T>(f: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let value = f();
    (value, start.elapsed().as_secs_f64())
}

fn go_on(cancel: &AtomicBool) -> Result<()> {
    if cancel.load(Ordering::Relaxed) { Err(Error::Interrupted(0)) } else { Ok(()) }
}

/// Fails where the job is strict and its render left something out; the images are written nevertheless.
pub fn check_strict(job: &Job, report: &Report) -> Result<()> {
    let dropped = report.dropped_samples;
    if job.strict && (dropped > 0 || report.solve.missing > 0) {
        let what = format!("{dropped} samples dropped, {} measurements missing", report.solve.missing);
        return Err(prepare::strict(job, &what));
    }
    Ok(())
}

/// The finished image and how it was found.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Very direct light included.
    pub image: Plane,
    /// How the image without it was found.
    pub solution: Solution,
}

/// The image of a film's means: solved for, or the primal, plus very direct light.
fn solve(buffers: &Buffers, method: Method, alpha: Alpha) -> Solved {
    let solution = reconstruct(&Input::from(buffers), method, alpha);
    Solved { image: sum(&solution.image, &buffers.direct), solution }
}

/// `a` + `b`, planes of one size.
pub(crate) fn sum(a: &Plane, b: &Plane) -> Plane {
    let add = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| a[c] + b[c]);
    Plane { width: a.width, height: a.height, data: a.data.iter().zip(&b.data).map(add).collect() }
}

fn write(job: &Job, film: &Film, camera: &Camera, solved: &Solved) -> Result<()> {
    for output in &job.outputs {
        write_image(job, film, camera, output, &solved.image, |document| {
            metadata::set_solve(document, &Solve::of(&solved.solution));
        })?;
    }
    if let Some(output) = &job.denoised {
        let image = sum(&denoise::primal(film)?, &film.direct());
        write_image(job, film, camera, output, &image, metadata::set_denoised)?;
    }
    Ok(())
}

/// Writes one image; `set_origin` says in its metadata how it was found.
fn write_image(
    job: &Job,
    film: &Film,
    camera: &Camera,
    output: &Output,
    image: &Plane,
    set_origin: impl FnOnce(&mut Document),
) -> Result<()> {
    if output.format == Format::Png {
        return png::write(&output.path, image, job.exposure, job.tone_map);
    }
    let mut document = layers::document(film, image, &job.layers, job.buffers, !job.background);
    let settings = &job.settings;
    document.window = settings
        .crop
        .map(|[x0, y0, ..]| Window { full: [settings.width, settings.height], origin: [x0, y0] });
    metadata::set_camera(&mut document, camera, settings.width, settings.height);
    metadata::set_job(&mut document, job)?;
    set_origin(&mut document);
    exr::write(&output.path, &document)
}
