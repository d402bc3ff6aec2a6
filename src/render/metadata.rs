//! What decided an image, as text attributes of its file: equal attributes mean equal pixels. No host, clock,
//! timing or thread count.

use super::job::{CameraChoice, Job, Source};
use crate::error::{Error, Result};
use crate::integrate::{Filter, Kind};
use crate::reconstruct::Method;
use crate::store::Document;
use std::path::Path;

/// The word for an integrator on the command line and in files.
pub fn integrator_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Path => "pt",
        Kind::GradientPath => "gpt",
    }
}

/// The word for a filter.
pub fn filter_name(filter: Filter) -> &'static str {
    match filter {
        Filter::Box => "box",
        Filter::Gaussian => "gaussian",
        Filter::BlackmanHarris => "blackman-harris",
    }
}

/// The word for a norm.
pub fn method_name(method: Method) -> &'static str {
    match method {
        Method::L1 => "l1",
        Method::L2 => "l2",
        Method::None => "none",
    }
}

/// BLAKE3 of a file's bytes.
fn fingerprint(path: &Path) -> Result<String> {
    let failed = |source| Error::Io { path: path.to_owned(), source };
    let mut file = std::fs::File::open(path).map_err(failed)?;
    let mut hasher = blake3::Hasher::new();
    std::io::copy(&mut file, &mut hasher).map_err(failed)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// The fingerprint of the scene: of the file's bytes, or of the built-in scene's name.
fn scene_fingerprint(source: &Source) -> Result<String> {
    match source {
        Source::Builtin(_) => Ok(blake3::hash(source.name().as_bytes()).to_hex().to_string()),
        Source::File(path) => fingerprint(path),
    }
}

/// Every setting of `job` that decides the image, by name without the `gdpt/` in front.
pub fn settings(job: &Job) -> Vec<(&'static str, String)> {
    let s = &job.settings;
    let mut list = vec![
        ("integrator", integrator_name(s.kind).to_owned()),
        ("spp", s.spp.to_string()),
        ("samples", format!("{}..{}", s.first_sample, u64::from(s.first_sample) + u64::from(s.spp))),
        ("seed", s.seed.to_string()),
        ("size", format!("{}x{}", s.width, s.height)),
        ("max_depth", s.max_depth.to_string()),
        ("rr_depth", s.rr_depth.to_string()),
        ("filter", filter_name(s.filter).to_owned()),
        ("light_unit", format!("{:?}", job.load.light_unit).to_lowercase()),
        ("background", on_off(job.background)),
        ("backend", format!("{:?}", job.backend).to_lowercase()),
        ("robust", on_off(job.robust)),
    ];
    if s.kind == Kind::GradientPath {
        list.push(("shift_threshold", s.shift_threshold.to_string()));
        list.push(("pair_mis", on_off(s.pair_mis)));
    }
    if let Some([x0, y0, x1, y1]) = s.crop {
        list.push(("crop", format!("{x0},{y0},{x1},{y1}")));
    }
    if let CameraChoice::Named(name) = &job.camera {
        list.push(("camera", name.clone()));
    }
    if let Some(lens) = job.lens {
        list.push(("aperture", lens.f_number.to_string()));
        list.push(("focus", lens.focus.to_string()));
    }
    if let Some(environment) = &job.environment {
        list.push(("env_strength", environment.strength.to_string()));
        list.push(("env_rotate", environment.rotation.to_string()));
    }
    list
}

fn on_off(value: bool) -> String {
    (if value { "on" } else { "off" }).into()
}

fn set(document: &mut Document, name: &str, value: String) {
    document.attributes.insert(format!("gdpt/{name}"), value);
}

/// Adds version, fingerprints and settings.
pub(super) fn set_job(document: &mut Document, job: &Job) -> Result<()> {
    set(document, "version", env!("CARGO_PKG_VERSION").into());
    set(document, "scene", scene_fingerprint(&job.source)?);
    if let Some(environment) = &job.environment {
        set(document, "env", fingerprint(&environment.path)?);
    }
    for (name, value) in settings(job) {
        set(document, name, value);
    }
    Ok(())
}

/// Adds how the image was solved for.
pub(super) fn set_solve(document: &mut Document, method: Method, alpha: f32, residual: Option<f64>) {
    set(document, "norm", method_name(method).into());
    for name in ["gdpt/alpha", "gdpt/residual"] {
        document.attributes.remove(name);
    }
    if let Some(residual) = residual {
        set(document, "alpha", alpha.to_string());
        set(document, "residual", format!("{residual:e}"));
    }
}
