//! The table of contents: load, build, integrate, reconstruct, write. Reading [`run`] from top to bottom is reading
//! the program.

pub mod job;
pub mod metadata;
mod prepare;
pub mod resolve;

pub use self::job::{Backend, CameraChoice, EnvironmentOptions, Format, Job, Lens, Output, Source};
pub use self::prepare::open;
use self::prepare::{check_memory, load};

use crate::accel::embree::flush_denormals;
use crate::accel::{Accel, EmbreeAccel, ObvhsAccel};
use crate::denoise;
use crate::error::{Error, Result};
use crate::film::{Film, Half, Plane};
use crate::integrate::{self, Statistics};
use crate::reconstruct::{Input, Method, reconstruct};
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
    /// Samples over all pixels.
    pub samples: u64,
    /// Root of the variance of the mean primal, averaged over pixels and channels, W·m⁻²·sr⁻¹; `None` below two
    /// samples.
    pub error_estimate: Option<f64>,
    /// Relative residual of the solve; `None` without one.
    pub residual: Option<f64>,
    /// Samples dropped because they were not finite.
    pub dropped_samples: u64,
    /// Measurements the solve did without because they were not finite.
    pub missing: usize,
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
    let work = Work { job, monitor, cancel, pool: pool(job.threads)? };
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
    let (solved, time) = timed(|| work.pool.install(|| solve(&film, job.method, job.alpha)));
    seconds.reconstruct = time;
    work.go_on()?;

    monitor.stage("write");
    let (written, time) = timed(|| work.pool.install(|| write(job, &film, &camera, &solved)));
    written?;
    seconds.write = time;

    Ok(Report {
        seconds,
        statistics,
        load: scene.report.clone(),
        size: [film.width as u32, film.height as u32],
        triangles: scene.triangle_count(),
        samples: film.width as u64 * film.height as u64 * u64::from(film.samples(Half::Both)),
        error_estimate: error_estimate(&film),
        residual: solved.residual,
        dropped_samples: film.dropped_samples,
        missing: solved.missing,
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
        let (accel, time) = timed(build);
        let accel = accel?;
        seconds.build = time;
        self.go_on()?;

        self.monitor.stage("render");
        let settings = &self.job.settings;
        let on_progress = |done, total| self.monitor.progress(done, total);
        let integrate = || integrate::run(scene, &accel, camera, settings, &on_progress, self.cancel);
        let (result, time) = timed(|| self.pool.install(integrate));
        seconds.render = time;
        self.go_on()?;
        Ok(result)
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
    if job.strict && (dropped > 0 || report.missing > 0) {
        let what = format!("{dropped} samples dropped, {} measurements missing", report.missing);
        return Err(prepare::strict(job, &what));
    }
    Ok(())
}

/// The finished image and how well it solves its equations.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Very direct light included.
    pub image: Plane,
    /// Relative residual; `None` where nothing was solved.
    pub residual: Option<f64>,
    /// Measurements that were not finite and had no say.
    pub missing: usize,
}

/// The image of a film: solved for, or primal plus very direct light.
fn solve(film: &Film, method: Method, alpha: f32) -> Solved {
    let both = Half::Both;
    if film.has_gradients {
        solve_planes(&film.primal(both), &film.dx(both), &film.dy(both), &film.direct(), method, alpha)
    } else {
        Solved { image: sum(&film.primal(both), &film.direct()), residual: None, missing: 0 }
    }
}

/// The image of buffers.
fn solve_planes(
    primal: &Plane,
    dx: &Plane,
    dy: &Plane,
    direct: &Plane,
    method: Method,
    alpha: f32,
) -> Solved {
    if method == Method::None {
        return Solved { image: sum(primal, direct), residual: None, missing: 0 };
    }
    let solution = reconstruct(&Input { primal, dx, dy }, method, alpha);
    Solved {
        image: sum(&solution.image, direct),
        residual: Some(solution.residual),
        missing: solution.missing,
    }
}

fn sum(a: &Plane, b: &Plane) -> Plane {
    let add = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| a[c] + b[c]);
    Plane { width: a.width, height: a.height, data: a.data.iter().zip(&b.data).map(add).collect() }
}

/// Root of the mean variance of the primal.
fn error_estimate(film: &Film) -> Option<f64> {
    let variance = film.variance();
    let sum: f64 = variance.data.iter().flatten().map(|&v| f64::from(v)).sum();
    (film.samples(Half::Both) > 1).then(|| (sum / (3 * variance.data.len()).max(1) as f64).sqrt())
}

fn write(job: &Job, film: &Film, camera: &Camera, solved: &Solved) -> Result<()> {
    for output in &job.outputs {
        write_image(job, film, camera, output, &solved.image, |document| {
            metadata::set_solve(document, job.method, job.alpha, solved.residual);
        })?;
    }
    if let Some(output) = &job.denoised {
        let image = denoise::film(film)?;
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
