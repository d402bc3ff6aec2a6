//! A camera for scenes without one: it sees the whole scene from the front, a little from the right and above.

use super::{Camera, Projection, Scene};
use glam::{Affine3A, Mat3A, Vec3, Vec3A};

/// Vertical field of view, rad.
const FIELD_OF_VIEW: f32 = 0.7;

/// Adds the camera where there is none, and says so.
pub(super) fn ensure_camera(scene: &mut Scene) {
    if !scene.cameras.is_empty() {
        return;
    }
    scene.cameras.push(fitted_camera(scene.bounds()));
    scene.report.warn("the file has no camera; one that sees the whole scene is used".into());
}

/// A camera whose cone touches the sphere around the bounds.
pub fn fitted_camera(bounds: Option<(Vec3, Vec3)>) -> Camera {
    let (lower, upper) = bounds.unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
    let centre = 0.5 * (lower + upper);
    let radius = (0.5 * (upper - lower).length()).max(1e-6);
    let distance = 1.02 * radius / (0.5 * FIELD_OF_VIEW).sin();
    let back = Vec3A::new(0.4, 0.3, 1.0).normalize();
    let right = Vec3A::Y.cross(back).normalize();
    let matrix3 = Mat3A::from_cols(right, back.cross(right), back);
    Camera {
        name: "fitted".into(),
        to_world: Affine3A { matrix3, translation: Vec3A::from(centre) + distance * back },
        projection: Projection::Perspective { yfov: FIELD_OF_VIEW },
        lens_radius: 0.0,
        focus_distance: distance,
    }
}
