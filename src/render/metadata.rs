//! What decided an image, as text attributes of its file: equal attributes mean equal pixels. No host, clock,
//! timing or thread count.

use super::Solve;
use super::job::{CameraChoice, Job, Source};
use crate::error::{Error, Result};
use crate::integrate::{Filter, Kind};
use crate::reconstruct::Method;
use crate::scene::{Camera, Projection};
use crate::store::{Document, layers};
use glam::{Mat4, Vec3, Vec4};
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
        Method::Weighted => "weighted",
        Method::Guided => "guided",
        Method::Auto => "auto",
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
        ("spp", s.samples_taken().to_string()),
        ("samples", format!("{}..{}", s.first_sample, u64::from(s.first_sample) + u64::from(s.spp))),
        ("seed", s.seed.to_string()),
        ("size", format!("{}x{}", s.width, s.height)),
        ("max_depth", s.max_depth.to_string()),
        ("rr_depth", s.rr_depth.to_string()),
        ("filter", filter_name(s.filter).to_owned()),
        ("light_unit", format!("{:?}", job.load.light_unit).to_lowercase()),
        ("double_sided_emission", on_off(job.load.double_sided_emission)),
        ("background", on_off(job.background)),
        ("backend", format!("{:?}", job.backend).to_lowercase()),
        ("robust", on_off(job.robust)),
    ];
    if s.kind == Kind::GradientPath {
        list.push(("shift_threshold", s.shift_threshold.to_string()));
        list.push(("pair_mis", on_off(s.pair_mis)));
    }
    if s.common_random_numbers {
        list.push(("common_random_numbers", on_off(true)));
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
pub(super) fn set_solve(document: &mut Document, solve: &Solve) {
    set(document, "norm", method_name(solve.method).into());
    for name in ["gdpt/alpha", "gdpt/residual"] {
        document.attributes.remove(name);
    }
    if let Some(alpha) = solve.alpha {
        set(document, "alpha", alpha.to_string());
    }
    if solve.method != Method::None {
        set(document, "residual", format!("{:e}", solve.residual));
    }
}

/// Adds that the image is the sampled one, denoised.
pub(super) fn set_denoised(document: &mut Document) {
    set(document, "norm", method_name(Method::None).into());
    set(document, "denoiser", "oidn".into());
}

/// Adds the camera's matrices, for a film of `width`×`height` (the whole picture).
pub(super) fn set_camera(document: &mut Document, camera: &Camera, width: u32, height: u32) {
    // Camera space of the files: y up, z forward; ours looks along −z.
    let to_camera = Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0)) * Mat4::from(camera.to_world).inverse();
    let aspect = width as f32 / height as f32;
    let to_ndc = match camera.projection {
        Projection::Perspective { yfov } => {
            let scale = 1.0 / (0.5 * yfov).tan();
            // w = z; the z of normalised coordinates runs from 0 at NEAR to 1 at infinity.
            const NEAR: f32 = 0.01;
            Mat4::from_cols(
                Vec4::new(scale / aspect, 0.0, 0.0, 0.0),
                Vec4::new(0.0, scale, 0.0, 0.0),
                Vec4::new(0.0, 0.0, 1.0, 1.0),
                Vec4::new(0.0, 0.0, -NEAR, 0.0),
            )
        }
        Projection::Orthographic { ymag } => {
            Mat4::from_scale(Vec3::new(1.0 / (ymag * aspect), 1.0 / ymag, 1.0 / layers::FAR))
        }
    };
    // Columns of a matrix for column vectors are rows of the one for row vectors.
    document.world_to_camera = Some(to_camera.to_cols_array());
    document.world_to_ndc = Some((to_ndc * to_camera).to_cols_array());
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    #[test]
    fn matrices_agree_with_the_camera() {
        let camera = Camera {
            name: String::new(),
            to_world: Affine3A::from_rotation_y(0.7) * Affine3A::from_translation(Vec3::new(1.0, 2.0, 3.0)),
            projection: Projection::Perspective { yfov: 0.8 },
            lens_radius: 0.0,
            focus_distance: 1.0,
        };
        let mut document = Document::new(64, 48);
        set_camera(&mut document, &camera, 64, 48);
        // Pixel (16, 12) of 64×48: half-way to the upper left corner.
        use crate::math::splat;
        let rays = camera.rays(splat(16.0), splat(12.0), 64, 48, splat(0.5), splat(0.5));
        let pick = |v: crate::math::Vec3x| Vec3::new(v.x.to_array()[0], v.y.to_array()[0], v.z.to_array()[0]);
        let point = pick(rays.origin) + 3.0 * pick(rays.direction);
        let ndc = Mat4::from_cols_array(&document.world_to_ndc.expect("set")) * Vec4::from((point, 1.0));
        assert!((ndc.x / ndc.w + 0.5).abs() < 1e-5 && (ndc.y / ndc.w - 0.5).abs() < 1e-5, "{ndc}");
        let local = Mat4::from_cols_array(&document.world_to_camera.expect("set")).transform_point3(point);
        assert!(local.z > 0.0 && local.x < 0.0 && local.y > 0.0, "{local}");
    }
}
