//! Before the first ray: the scene with its environment, the camera, the budget.

use super::Monitor;
use super::job::{CameraChoice, EnvironmentOptions, Job, Source};
use crate::error::{Error, Result};
use crate::scene::{self, Camera, Environment, Projection, Scene};
use glam::Affine3A;

/// The scene and the camera that look at each other.
pub(super) fn load(job: &Job, monitor: &dyn Monitor) -> Result<(Scene, Camera)> {
    let mut scene = open(&job.source, &job.load)?;
    if let Some(options) = &job.environment {
        let EnvironmentOptions { path, strength, rotation } = options;
        let report = &mut scene.report;
        scene.environment =
            Some(Environment::load_reporting(path, *strength, *rotation, job.background, report)?);
    }
    if let Some(environment) = &mut scene.environment {
        environment.visible = job.background;
    }
    for warning in &scene.report.warnings {
        monitor.warn(warning);
    }
    if !has_light(&scene) {
        monitor
            .warn(&format!("{}: no light in it, the image is black; add one with --env", job.source.name()));
    }
    if job.strict {
        check_load(job, &scene)?;
    }
    let mut camera = choose_camera(&scene, &job.camera, monitor)?;
    if let Some(lens) = job.lens {
        camera.focus_distance = lens.focus;
        camera.lens_radius = match camera.projection {
            // Half the film's height over the tangent is the focal length; aperture = focal length / f-number.
            Projection::Perspective { yfov } => 0.012 / (0.5 * yfov).tan() / (2.0 * lens.f_number),
            Projection::Orthographic { .. } => {
                return Err(Error::Usage("--aperture needs a perspective camera".into()));
            }
        };
    }
    Ok((scene, camera))
}

/// Reads a scene.
pub fn open(source: &Source, options: &scene::LoadOptions) -> Result<Scene> {
    match source {
        Source::Builtin(name) => scene::builtin(name).ok_or_else(|| Error::Input {
            path: source.path(),
            what: format!("is not built in; there is builtin:{}", scene::BUILTIN_NAMES.join(", builtin:")),
        }),
        Source::File(path) => scene::load(path, options),
    }
}

/// Whether anything emits.
fn has_light(scene: &Scene) -> bool {
    let shows = |m: &crate::scene::Material| m.is_emissive() || m.unlit;
    let emits = |i: &crate::scene::Instance| {
        let mesh = scene.meshes.get(i.mesh as usize);
        mesh.and_then(|m| scene.materials.get(m.material as usize)).is_some_and(shows)
    };
    !scene.lights.is_empty() || scene.environment.is_some() || scene.instances.iter().any(emits)
}

fn check_load(job: &Job, scene: &Scene) -> Result<()> {
    let counts = [
        (scene.report.dropped_triangles, "triangles dropped"),
        (scene.report.missing_textures, "textures missing"),
    ];
    let said: Vec<_> = counts.iter().filter(|c| c.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
    if said.is_empty() {
        return Ok(());
    }
    Err(strict(job, &said.join(", ")))
}

/// The error that `--strict` makes of a count.
pub(super) fn strict(job: &Job, what: &str) -> Error {
    Error::Scene { path: job.source.path(), at: "--strict".into(), what: what.into() }
}

fn choose_camera(scene: &Scene, choice: &CameraChoice, monitor: &dyn Monitor) -> Result<Camera> {
    let CameraChoice::Named(name) = choice else {
        return Ok(scene.cameras.first().cloned().unwrap_or_else(|| {
            monitor.warn("no camera and nothing to fit one to: looking along -z from the origin");
            Camera {
                name: String::new(),
                to_world: Affine3A::IDENTITY,
                projection: Projection::Perspective { yfov: 0.8 },
                lens_radius: 0.0,
                focus_distance: 1.0,
            }
        }));
    };
    let by_index = || name.parse().ok().and_then(|i: usize| scene.cameras.get(i));
    let found = scene.cameras.iter().find(|c| c.name == *name).or_else(by_index);
    found.cloned().ok_or_else(|| {
        let has: Vec<_> =
            scene.cameras.iter().enumerate().map(|(i, c)| format!("{i} \"{}\"", c.name)).collect();
        Error::Usage(format!("no camera {name:?}; the scene has {}", has.join(", ")))
    })
}

/// Bytes a pixel of the film and of what is made of it, rounded up: sums and features (204, twice where passes are
/// added up), the planes that are solved for (164), the solver's own (250), encoding.
const BYTES_PER_PIXEL: u64 = 900;

/// Refuses a film that cannot fit, before it is allocated.
pub(super) fn check_memory(job: &Job) -> Result<()> {
    let [width, height] = job.film_size();
    let need = u64::from(width) * u64::from(height) * BYTES_PER_PIXEL;
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    if let Some(budget) = job.max_memory.filter(|&budget| need > budget) {
        let (need, budget) = (mib(need), mib(budget));
        return Err(Error::OutOfMemory(format!(
            "a film of {width}x{height} needs {need} MiB, --max-memory is {budget} MiB"
        )));
    }
    let too_much = || Error::OutOfMemory(format!("a film of {width}x{height} needs {} MiB", mib(need)));
    let bytes = usize::try_from(need).map_err(|_| too_much())?;
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| too_much())
}
