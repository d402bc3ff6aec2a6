//! One scene on the bench: renders with their CPU time, solves, and the reference that all is held against.

use super::usage;
use super::{Plan, Subject};
use crate::accel::{Accel, EmbreeAccel};
use crate::analyze::flip;
use crate::analyze::metrics::{self, Comparison};
use crate::error::{Error, Result};
use crate::film::{Film, Half, Plane};
use crate::integrate::{self, Kind, Settings, ShadeScene};
use crate::reconstruct::{Alpha, Input, Method, reconstruct};
use crate::render::{Monitor, open, sum};
use crate::scene::{Camera, Environment, LoadOptions, Scene};
use crate::store::png;
use std::sync::atomic::{AtomicBool, Ordering};

/// Weight of the primal in the solves that have one for all pixels, as `render` has it.
pub const ALPHA: f32 = 0.2;

/// Distance of the reference's seeds from those of the methods.
const REFERENCE_SEED: u64 = 1 << 32;

/// A measured image.
#[derive(Clone, Debug)]
pub struct Shot {
    /// Radiance without very direct light.
    pub image: Plane,
    /// Very direct light.
    pub direct: Plane,
    /// CPU time of the render, s.
    pub render_seconds: f64,
    /// CPU time from the samples to the image, s.
    pub solve_seconds: f64,
    /// relMSE that the solver expects; NaN where it expects nothing.
    pub estimate: f64,
}

impl Shot {
    /// The whole image.
    pub fn whole(&self) -> Plane {
        sum(&self.image, &self.direct)
    }
}

/// What everything is held against.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Radiance without very direct light.
    pub image: Plane,
    /// Very direct light.
    pub direct: Plane,
    /// relMSE that its own noise adds to every comparison.
    pub noise: f64,
    /// Stops at which pictures are shown and compared.
    pub exposure: f32,
    /// The picture, 8-bit sRGB.
    pub picture: Vec<u8>,
}

/// The error of an image.
#[derive(Clone, Copy, Debug)]
pub struct Score {
    /// The reference's noise subtracted; not positive where there is nothing left to see.
    pub rel_mse: f64,
    /// Of the whole pictures.
    pub flip: f64,
    /// Mean of the image over the reference's, less one.
    pub energy: f64,
}

/// The scene of a subject.
pub fn load(subject: &Subject, monitor: &dyn Monitor) -> Result<Scene> {
    monitor.stage(&format!("{}: load", subject.name()));
    let mut scene = open(&subject.source, &LoadOptions::default())?;
    if let Some(path) = &subject.environment {
        let report = &mut scene.report;
        scene.environment = Some(Environment::load_reporting(path, 1.0, 0.0, true, report)?);
    }
    for warning in &scene.report.warnings {
        monitor.warn(warning);
    }
    Ok(scene)
}

/// A scene prepared for any number of renders.
pub struct Bench<'a> {
    pub plan: &'a Plan,
    pub name: String,
    scene: ShadeScene<'a>,
    accel: EmbreeAccel,
    camera: Camera,
    monitor: &'a dyn Monitor,
    cancel: &'a AtomicBool,
}

impl<'a> Bench<'a> {
    /// Builds what the loaded `scene` of `subject` needs.
    pub fn new(
        plan: &'a Plan,
        subject: &Subject,
        scene: &'a Scene,
        monitor: &'a dyn Monitor,
        cancel: &'a AtomicBool,
    ) -> Result<Self> {
        let name = subject.name();
        let camera = scene.cameras.first().cloned().ok_or_else(|| Error::Scene {
            path: subject.source.path(),
            at: String::new(),
            what: "has no camera and nothing to fit one to".into(),
        })?;
        let accel = EmbreeAccel::new(scene, plan.threads, false, None)?;
        Ok(Self { plan, name, scene: ShadeScene::new(scene), accel, camera, monitor, cancel })
    }

    /// Says what begins.
    pub fn stage(&self, what: &str) {
        self.monitor.stage(&format!("{}: {what}", self.name));
    }

    /// A film and the CPU seconds it took.
    pub fn film(&self, settings: &Settings) -> Result<(Film, f64)> {
        let ((film, _), seconds) = usage::timed(|| self.integrate(settings, &self.accel));
        if self.cancel.load(Ordering::Relaxed) { Err(Error::Interrupted(0)) } else { Ok((film, seconds)) }
    }

    fn integrate<A: Accel>(&self, settings: &Settings, accel: &A) -> (Film, integrate::Statistics) {
        let on_progress = |done, total| self.monitor.progress(done, total);
        integrate::run(&self.scene, accel, &self.camera, settings, &on_progress, self.cancel)
    }

    /// The settings of a run.
    pub fn settings(&self, kind: Kind, spp: u32, seed: u64) -> Settings {
        let [width, height] = self.plan.size;
        let max_depth = self.plan.max_depth;
        Settings { kind, width, height, spp, seed, max_depth, ..Settings::default() }
    }

    /// Path tracing.
    pub fn path(&self, spp: u32, seed: u64) -> Result<Shot> {
        let (film, seconds) = self.film(&self.settings(Kind::Path, spp, seed))?;
        Ok(Shot {
            image: film.primal(Half::Both),
            direct: film.direct(),
            render_seconds: seconds,
            solve_seconds: 0.0,
            estimate: f64::NAN,
        })
    }

    /// The film of gradient-domain path tracing, with the features that a solver may use.
    pub fn gradients(&self, spp: u32, seed: u64) -> Result<(Film, f64)> {
        self.film(&Settings { features: true, ..self.settings(Kind::GradientPath, spp, seed) })
    }

    /// The film of path tracing whose differences are those of a second film, in which all pixels draw the same
    /// random numbers: twice the samples.
    pub fn common(&self, spp: u32, seed: u64) -> Result<(Film, f64)> {
        let settings = Settings { features: true, ..self.settings(Kind::Path, spp, seed) };
        let (film, first) = self.film(&settings)?;
        let (other, second) = self.film(&Settings { common_random_numbers: true, ..settings })?;
        Ok((film.with_differences_of(&other), first + second))
    }

    /// The reference.
    pub fn reference(&self) -> Result<Reference> {
        let spp = self.plan.reference_spp.div_ceil(2);
        let half = |i: u64| {
            self.stage(&format!("reference {} of 2", i + 1));
            self.path(spp, self.plan.seed + REFERENCE_SEED + i)
        };
        let (first, second) = (half(0)?, half(1)?);
        let mean = |a: &Plane, b: &Plane| {
            let data = sum(a, b).data.into_iter().map(|v| v.map(|v| 0.5 * v)).collect();
            Plane { width: a.width, height: a.height, data }
        };
        let (image, direct) = (mean(&first.image, &second.image), mean(&first.direct, &second.direct));
        // The halves differ by 4 times the variance of their mean.
        let square = |(i, r): (usize, &[f32; 3])| {
            let grey = r.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
            let (a, b) = (first.image.data[i], second.image.data[i]);
            let square = (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>() / 3.0;
            0.25 * square / (grey * grey + metrics::REL_MSE_EPSILON)
        };
        let noise = image.data.iter().enumerate().map(square).sum::<f64>() / image.data.len() as f64;
        let whole = sum(&image, &direct);
        let exposure = self.plan.exposure.unwrap_or_else(|| automatic_exposure(&whole));
        let picture = png::rgb8(&whole, exposure, self.plan.tone_map);
        Ok(Reference { image, direct, noise, exposure, picture })
    }

    /// The error of a shot.
    pub fn score(&self, shot: &Shot, reference: &Reference) -> Score {
        let (width, height) = (reference.image.width, reference.image.height);
        let Comparison { rel_mse, mean_difference, .. } =
            metrics::compare(&shot.image, &reference.image).expect("all images of a study have one size");
        // What `render` would write as PNG.
        let picture = png::rgb8(&shot.whole(), reference.exposure, self.plan.tone_map);
        let flip = flip::mean(&picture, &reference.picture, width, height);
        Score {
            rel_mse: rel_mse - reference.noise,
            flip: flip.expect("all images of a study have one size and a pixel"),
            energy: mean_difference,
        }
    }
}

/// The stops, to a tenth, that bring the median luminance of what is not black to middle grey; 0 for a black image.
fn automatic_exposure(image: &Plane) -> f32 {
    let luminance = |v: &[f32; 3]| 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
    let mut values: Vec<f32> =
        image.data.iter().map(luminance).filter(|l| *l > 0.0 && l.is_finite()).collect();
    values.sort_by(f32::total_cmp);
    let stops = values.get(values.len() / 2).map_or(0.0, |median| (0.18 / median).log2());
    (stops.clamp(-30.0, 30.0) * 10.0).round() / 10.0
}

/// The image of a film of gradients that took `render_seconds`.
pub fn solve(film: &Film, method: Method, render_seconds: f64) -> Shot {
    let (solution, solve_seconds) = usage::timed(|| {
        let buffers = film.buffers();
        reconstruct(&Input::from(&buffers), method, Alpha::Fixed(ALPHA))
    });
    let estimate = solution.error.as_ref().map_or(f64::NAN, |e| e.rel_mse);
    Shot { image: solution.image, direct: film.direct(), render_seconds, solve_seconds, estimate }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_brings_the_median_of_what_is_lit_to_middle_grey() {
        let image = Plane::from_fn(5, 1, |x, _| [[0.0, 0.0, 0.045, 0.045, 90.0][x]; 3]);
        assert_eq!(automatic_exposure(&image), 2.0);
        assert_eq!(automatic_exposure(&Plane::new(4, 4)), 0.0);
    }
}
