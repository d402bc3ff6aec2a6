//! glTF 2.0 to a [`Scene`]: the order of the steps; each step has its own file.

use super::document::{Document, one_line};
use super::geometry::{self, Context};
use super::lights::{place_camera, place_light, read_lights, read_projections};
use super::material::MaterialReader;
use super::texture::TextureTable;
use super::{Instance, LoadOptions, LoadReport, Material, Scene, TextureRef, fit, nodes};
use crate::error::Result;
use glam::Affine3A;
use rayon::prelude::*;
use std::path::Path;

/// Reads the file at `path`.
pub(super) fn read(path: &Path, options: &LoadOptions) -> Result<Scene> {
    let mut report = LoadReport::default();
    let document = &Document::open(path, options.max_memory, &mut report)?;
    warn_of_skins(document, &mut report);

    // Materials name the textures that have to be decoded.
    let mut reader = MaterialReader { document, textures: TextureTable::default() };
    let mut materials = Vec::with_capacity(document.root.materials.len() + 1);
    for (i, entry) in document.root.materials.iter().enumerate() {
        materials.push(reader.read(i, entry, &mut report)?);
    }
    let default_material = materials.len() as u32;
    let textures = reader.textures;

    let placed = nodes::walk(document, &mut report)?;
    let placements = mesh_placements(document, &placed)?;

    // Images and geometry are decoded side by side.
    let context = Context { document, materials: &materials, default_material };
    let mut image_report = LoadReport::default();
    let (images, built) =
        rayon::join(|| textures.load(document, &mut image_report), || build_meshes(&context, &placements));
    let (textures, present) = images?;
    report.absorb(image_report);
    drop_missing_data(&mut materials, &textures, &present);

    let mut scene = Scene { textures, ..Scene::default() };
    for (i, mesh_parts) in built?.into_iter().enumerate() {
        let places = placements.get(i).map_or(&[][..], Vec::as_slice);
        for (mesh, part_report) in mesh_parts {
            report.absorb(part_report);
            let Some(mesh) = mesh.filter(|_| !places.is_empty()) else { continue };
            let bytes = places.len() as u64 * size_of::<Instance>() as u64;
            document.budget.take(bytes, "instances")?;
            place_mesh(&mut scene, mesh, places, &mut report);
        }
    }
    if scene.meshes.iter().any(|m| m.material == default_material) {
        materials.push(Material { name: "default".into(), ..Material::default() });
    }
    if !options.double_sided_emission {
        materials.iter_mut().for_each(|material| material.double_sided = false);
    }
    scene.materials = materials;

    let models = read_lights(document, options.light_unit, &mut report)?;
    let projections = read_projections(document)?;
    for node in &placed {
        scene.lights.extend(place_light(document, node.node, &node.to_world, &models, &mut report)?);
        let Some(entry) = document.root.nodes.get(node.node) else { continue };
        let Some((name, projection)) = entry.camera.and_then(|c| projections.get(c.value())) else {
            continue;
        };
        let name = name.clone().or_else(|| entry.name.as_deref().map(one_line));
        let name = name.unwrap_or_else(|| format!("camera {}", scene.cameras.len()));
        match place_camera(name, *projection, &node.to_world) {
            Some(camera) => scene.cameras.push(camera),
            None => {
                report.warn(format!("nodes[{}]: its camera has no orientation; it is left out", node.node))
            }
        }
    }
    scene.report = report;
    fit::ensure_camera(&mut scene);
    Ok(scene)
}

fn warn_of_skins(document: &Document, report: &mut LoadReport) {
    if document.root.nodes.iter().any(|n| n.skin.is_some()) {
        report.warn("skins are not honoured: meshes are shown in their bind pose".into());
    }
}

/// For every mesh of the file, where it stands.
fn mesh_placements(document: &Document, placed: &[nodes::Placed]) -> Result<Vec<Vec<Affine3A>>> {
    let mut placements = vec![Vec::new(); document.root.meshes.len()];
    for node in placed {
        let mesh = document.root.nodes.get(node.node).and_then(|n| n.mesh);
        if let Some(places) = mesh.and_then(|mesh| placements.get_mut(mesh.value())) {
            places.extend(nodes::mesh_placements(document, node)?);
        }
    }
    Ok(placements)
}

/// A primitive and what was said about it.
type Part = (Option<super::Mesh>, LoadReport);

/// Reads every primitive, also of meshes that stand nowhere: a broken file is told whatever it shows.
fn build_meshes(context: &Context, placements: &[Vec<Affine3A>]) -> Result<Vec<Vec<Part>>> {
    let read_mesh = |(i, places): (usize, &Vec<Affine3A>)| {
        let bake = if let [one] = places.as_slice() { Some(one) } else { None };
        let count = context.document.root.meshes.get(i).map_or(0, |m| m.primitives.len());
        let read = |k| {
            let mut report = LoadReport::default();
            let mesh = geometry::read(context, i, k, bake, &mut report)?;
            // Warnings of a mesh that is not shown would only puzzle.
            Ok(if places.is_empty() { (None, LoadReport::default()) } else { (mesh, report) })
        };
        (0..count).into_par_iter().map(read).collect::<Result<Vec<Part>>>()
    };
    placements.par_iter().enumerate().map(read_mesh).collect()
}

fn place_mesh(scene: &mut Scene, mesh: super::Mesh, places: &[Affine3A], report: &mut LoadReport) {
    let index = scene.meshes.len() as u32;
    if places.len() == 1 {
        scene.instances.push(Instance { mesh: index, to_world: Affine3A::IDENTITY, is_identity: true });
        scene.meshes.push(mesh);
        return;
    }
    let before = scene.instances.len();
    for &to_world in places {
        // A flattened instance has no area and no inverse.
        if to_world.matrix3.determinant() == 0.0 || !to_world.inverse().is_finite() {
            report.dropped_triangles += mesh.triangles.len() as u64;
            report.warn(format!("an instance of {} is flattened to nothing; it is dropped", mesh.name));
            continue;
        }
        let is_identity = to_world == Affine3A::IDENTITY;
        scene.instances.push(Instance { mesh: index, to_world, is_identity });
    }
    if scene.instances.len() > before {
        scene.meshes.push(mesh);
    }
}

/// Takes textures that are data and could not be read out of the materials: magenta is no normal.
fn drop_missing_data(materials: &mut [Material], textures: &[super::Texture], present: &[bool]) {
    let is_there = |r: &TextureRef| {
        let i = r.texture as usize;
        present.get(i) == Some(&true) || textures.get(i).is_some_and(|t| t.srgb)
    };
    for material in materials {
        for slot in material.texture_slots() {
            *slot = slot.filter(is_there);
        }
    }
}
