//! KHR_lights_punctual and cameras: what hangs on nodes besides meshes.
//!
//! Units: a file gives candela and lux, exporters often radiometric numbers; see [`LightUnit`].

use super::document::{Document, one_line};
use super::raw::{Fields, clamped, clamped3};
use super::{Camera, LightUnit, LoadReport, Projection, PunctualKind, PunctualLight};
use crate::error::Result;
use glam::{Affine3A, Mat3A, Vec3, Vec3A};
use gltf::json::camera::Type;
use gltf::json::validation::Checked;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Luminous efficacy that exporters use for white light, lm·W⁻¹.
const LUMENS_PER_WATT: f32 = 683.0;
const MAX_INTENSITY: f32 = 1e15;

/// A light before it has a place.
#[derive(Clone, Copy)]
pub(super) struct LightModel {
    kind: PunctualKind,
    intensity: Vec3,
}

/// Reads the lights that the file defines.
pub(super) fn read_lights(
    document: &Document,
    unit: LightUnit,
    report: &mut LoadReport,
) -> Result<Vec<Option<LightModel>>> {
    let others = document.root.extensions.as_ref().map(|e| &e.others);
    let Some(fields) = Fields::extension(document, others, "", "KHR_lights_punctual")? else {
        return Ok(Vec::new());
    };
    let is_photometric = match unit {
        LightUnit::Photometric => true,
        LightUnit::Radiometric => false,
        LightUnit::Auto => report.generator.contains("Blender"),
    };
    let scale = if is_photometric { 1.0 / LUMENS_PER_WATT } else { 1.0 };
    let lights = fields.children("lights")?;
    lights.iter().map(|f| read_light(document, f, scale, report)).collect()
}

fn read_light(
    document: &Document,
    f: &Fields,
    scale: f32,
    report: &mut LoadReport,
) -> Result<Option<LightModel>> {
    let color = clamped3(report, &f.at("color"), f.vec3("color", Vec3::ONE)?, 0.0, MAX_INTENSITY);
    let value = f.number("intensity", 1.0)?;
    let intensity = clamped(report, &f.at("intensity"), value, 0.0, MAX_INTENSITY) * scale;
    if f.has("range") {
        report.warn(
            "KHR_lights_punctual range is not honoured: light falls off with the square of distance".into(),
        );
    }
    let kind = match f.text("type") {
        Some("point") => PunctualKind::Point,
        Some("directional") => PunctualKind::Directional,
        Some("spot") => {
            let Some(spot) = f.child("spot")? else {
                return Err(document.reject(f.at("spot"), "is missing; a spot light needs its angles"));
            };
            let value = spot.number("outerConeAngle", FRAC_PI_4)?;
            let outer = clamped(report, &spot.at("outerConeAngle"), value, 0.01, FRAC_PI_2);
            let value = spot.number("innerConeAngle", 0.0)?;
            let inner = clamped(report, &spot.at("innerConeAngle"), value, 0.0, outer);
            // A hard edge is common; the falloff divides by the difference of the two cosines.
            let cos_outer = outer.cos();
            PunctualKind::Spot { cos_inner: inner.cos().max(cos_outer + 1e-6), cos_outer }
        }
        other => {
            let shown = one_line(other.unwrap_or("nothing"));
            report.warn(format!(
                "{}: {shown} is none of point, spot, directional; it is left out",
                f.at("type")
            ));
            return Ok(None);
        }
    };
    let intensity = (color * intensity).min(Vec3::splat(MAX_INTENSITY));
    if intensity == Vec3::ZERO {
        report.warn(format!("{}: emits nothing; it is left out", f.at("intensity")));
        return Ok(None);
    }
    Ok(Some(LightModel { kind, intensity }))
}

/// The light that a node names, placed.
pub(super) fn place_light(
    document: &Document,
    node: usize,
    to_world: &Affine3A,
    models: &[Option<LightModel>],
    report: &mut LoadReport,
) -> Result<Option<PunctualLight>> {
    let at = format!("nodes[{node}]");
    let others = document.root.nodes.get(node).and_then(|n| n.extensions.as_ref()).map(|e| &e.others);
    let Some(f) = Fields::extension(document, others, &at, "KHR_lights_punctual")? else { return Ok(None) };
    let index = f.integer("light")?.and_then(|i| usize::try_from(i).ok());
    let Some(model) = index.and_then(|i| models.get(i)) else {
        let what = format!("names no light; there are {}: export the file again", models.len());
        return Err(document.reject(f.at("light"), what));
    };
    let Some(model) = model else { return Ok(None) };
    let direction = Vec3::from(-to_world.matrix3.z_axis).try_normalize();
    if direction.is_none() && model.kind != PunctualKind::Point {
        report.warn(format!("{at}: its light has no direction (scale 0); it is left out"));
        return Ok(None);
    }
    Ok(Some(PunctualLight {
        kind: model.kind,
        position: to_world.translation.into(),
        direction: direction.unwrap_or(Vec3::NEG_Z),
        intensity: model.intensity,
    }))
}

/// Reads the projections that the file defines.
pub(super) fn read_projections(document: &Document) -> Result<Vec<(Option<String>, Projection)>> {
    let read = |(i, camera): (usize, &gltf::json::Camera)| {
        let at = format!("cameras[{i}]");
        let name = camera.name.as_deref().map(one_line);
        let missing =
            |part: &str| document.reject(format!("{at}.{part}"), "is missing; export the file again");
        let projection = match camera.type_ {
            Checked::Valid(Type::Perspective) => {
                let yfov = camera.perspective.as_ref().ok_or_else(|| missing("perspective"))?.yfov;
                if !(yfov > 0.0 && yfov < PI) {
                    let what = format!("{yfov} rad is not between 0 and π; set the field of view");
                    return Err(document.reject(format!("{at}.perspective.yfov"), what));
                }
                Projection::Perspective { yfov }
            }
            Checked::Valid(Type::Orthographic) => {
                let ymag = camera.orthographic.as_ref().ok_or_else(|| missing("orthographic"))?.ymag.abs();
                if !(ymag > 0.0 && ymag < f32::INFINITY) {
                    return Err(
                        document.reject(format!("{at}.orthographic.ymag"), "is 0 or not finite; set it")
                    );
                }
                Projection::Orthographic { ymag }
            }
            Checked::Invalid => {
                return Err(document.reject(format!("{at}.type"), "is neither perspective nor orthographic"));
            }
        };
        Ok((name, projection))
    };
    document.root.cameras.iter().enumerate().map(read).collect()
}

/// A camera without the scale, shear and mirroring of its node; `None` where the node has no orientation.
pub(super) fn place_camera(name: String, projection: Projection, node: &Affine3A) -> Option<Camera> {
    let unit = |v: Vec3A| v.try_normalize();
    let z = unit(node.matrix3.z_axis)?;
    let x = unit(node.matrix3.y_axis.cross(z))?;
    // A mirrored node would turn the picture over: x follows from y and z in any case.
    let y = z.cross(x);
    let to_world = Affine3A { matrix3: Mat3A::from_cols(x, y, z), translation: node.translation };
    Some(Camera { name, to_world, projection, lens_radius: 0.0, focus_distance: 1.0 })
}
