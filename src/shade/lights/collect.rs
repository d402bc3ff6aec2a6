//! Collecting the lights of a scene, with their powers.

use super::build::Emitter;
use super::tree::LightTree;
use super::{LightTriangle, Lights, NO_LIGHT};
use crate::math::alias::AliasTable;
use crate::scene::{Material, PunctualKind, PunctualLight, Scene};
use crate::shade::env::EnvironmentTable;
use crate::shade::texture::Decoder;
use crate::shade::{corners, offset_bound};
use glam::Vec3;
use std::f64::consts::PI;

fn luminance(c: Vec3) -> f64 {
    f64::from(c.dot(Vec3::new(0.2126, 0.7152, 0.0722)))
}

/// Power of a punctual light, W; a directional one shines through the disk that covers the scene.
fn power(light: &PunctualLight, scene_radius: f32) -> f64 {
    let solid_angle = match light.kind {
        PunctualKind::Point => 4.0 * PI,
        PunctualKind::Spot { cos_inner, cos_outer } => {
            2.0 * PI * (1.0 - 0.5 * f64::from(cos_inner + cos_outer))
        }
        PunctualKind::Directional => PI * f64::from(scene_radius * scene_radius),
    };
    luminance(light.intensity) * solid_angle
}

/// A point or a spot to the tree.
fn emitter(light: &PunctualLight) -> Emitter {
    let axis = match light.kind {
        PunctualKind::Spot { cos_outer, .. } if cos_outer >= 0.0 => light.direction,
        _ => Vec3::ZERO,
    };
    Emitter { corners: [light.position; 3], axis, weight: luminance(light.intensity) }
}

/// Whether a light of this power can be selected.
fn counts(power: f64) -> bool {
    power > 0.0 && power.is_finite()
}

impl Lights {
    /// Collects the lights of a scene; `handedness` is the sign of each instance's determinant.
    pub(in crate::shade) fn new(scene: &Scene, decoder: &Decoder, handedness: &[f32]) -> Self {
        let mut lights = Self::default();
        let mut emitters = Vec::new();
        let mut in_tree = lights.collect_triangles(scene, decoder, handedness, &mut emitters);
        let diagonal = scene.bounds().map_or(2.0, |(lower, upper)| (upper - lower).length());
        let mut weights = vec![0.0];
        for light in &scene.lights {
            let power = power(light, 0.5 * diagonal);
            if !counts(power) {
                continue;
            }
            if light.kind == PunctualKind::Directional {
                lights.directional.push(*light);
                weights.push(power);
            } else {
                lights.placed.push(*light);
                emitters.push(emitter(light));
                in_tree += power;
            }
        }
        weights[super::TREE] = in_tree;
        lights.tree = LightTree::new(&emitters, diagonal);
        lights.environment = scene.environment.as_ref().and_then(EnvironmentTable::new);
        if lights.environment.is_some() {
            let others: f64 = weights.iter().sum();
            weights.push(if others > 0.0 { others } else { 1.0 });
        }
        lights.table = AliasTable::new(weights).unwrap_or_default();
        lights
    }

    /// Fills the triangle list; returns the sum of the powers, W.
    fn collect_triangles(
        &mut self,
        scene: &Scene,
        decoder: &Decoder,
        handedness: &[f32],
        emitters: &mut Vec<Emitter>,
    ) -> f64 {
        let mut sum = 0.0;
        let mut means = vec![None; scene.textures.len()];
        for (index, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh as usize];
            let material = &scene.materials[mesh.material as usize];
            if !material.is_emissive() {
                self.first.push(None);
                continue;
            }
            let first = self.of_triangle.len();
            self.first.push(Some(first as u32));
            self.of_triangle.resize(first + mesh.triangles.len(), NO_LIGHT);
            let mean = material.emission_texture.as_ref().map_or(Vec3::ONE, |t| {
                let i = t.texture as usize;
                *means[i].get_or_insert_with(|| decoder.mean(&scene.textures[i]).truncate())
            });
            let radiance = luminance(material.emission * mean);
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            for (primitive, &triangle) in mesh.triangles.iter().enumerate() {
                let corners = corners(instance, &mesh.positions, triangle);
                let mut light = LightTriangle::new(corners, handedness[index], material);
                let area = 0.5 * f64::from(light.edges[0].cross(light.edges[1]).length());
                let power = radiance * PI * sides * area;
                if !counts(power) {
                    continue;
                }
                sum += power;
                self.of_triangle[first + primitive] = self.triangles.len() as u32;
                (light.instance, light.primitive) = (index as u32, primitive as u32);
                self.triangles.push(light);
                let axis = if material.double_sided { Vec3::ZERO } else { light.normal };
                emitters.push(Emitter { corners, axis, weight: radiance * area });
            }
        }
        sum
    }
}

impl LightTriangle {
    /// An emissive triangle; whose it is comes later.
    fn new(corners: [Vec3; 3], handedness: f32, material: &Material) -> Self {
        let edges = [corners[1] - corners[0], corners[2] - corners[0]];
        let cross = edges[0].cross(edges[1]) * handedness;
        Self {
            corner: corners[0],
            edges,
            normal: cross.normalize_or_zero(),
            instance: 0,
            primitive: 0,
            two_sided: material.double_sided,
            offset: offset_bound(corners),
            inverse_area: 2.0 / cross.length(),
            constant: (material.emission_texture.is_none() && !material.has_coverage())
                .then_some(material.emission),
        }
    }
}
