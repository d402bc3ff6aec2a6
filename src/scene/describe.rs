//! A scene in words, for `gdpt info`.

use super::budget::mib;
use super::{AlphaMode, Material, Mesh, Projection, PunctualKind, Scene};
use std::fmt::{Result, Write};

/// What is in the scene, a few lines of text.
pub fn describe(scene: &Scene) -> String {
    let mut out = String::new();
    write_all(scene, &mut out).expect("writing to a string cannot fail");
    out
}

fn write_all(scene: &Scene, out: &mut String) -> Result {
    let unique: u64 = scene.meshes.iter().map(|m| m.triangles.len() as u64).sum();
    let vertices: u64 = scene.meshes.iter().map(|m| m.positions.len() as u64).sum();
    if !scene.report.generator.is_empty() {
        writeln!(out, "generator    {}", scene.report.generator)?;
    }
    writeln!(out, "triangles    {} ({unique} unique, {vertices} vertices)", scene.triangle_count())?;
    writeln!(out, "meshes       {} in {} instances", scene.meshes.len(), scene.instances.len())?;
    if let Some((lower, upper)) = scene.bounds() {
        writeln!(out, "bounds       {lower} to {upper} m")?;
    }
    materials(scene, out)?;
    lights(scene, out)?;
    cameras(scene, out)?;
    textures(scene, out)?;
    writeln!(
        out,
        "memory       {} geometry, {} textures",
        mib(geometry_bytes(scene)),
        mib(texture_bytes(scene))
    )?;
    let report = &scene.report;
    if !report.extensions_honoured.is_empty() {
        writeln!(out, "honoured     {}", report.extensions_honoured.join(", "))?;
    }
    if !report.extensions_ignored.is_empty() {
        writeln!(out, "not honoured {}", report.extensions_ignored.join(", "))?;
    }
    if report.dropped_triangles > 0 {
        writeln!(out, "dropped      {} triangles", report.dropped_triangles)?;
    }
    if report.missing_textures > 0 {
        writeln!(out, "missing      {} textures", report.missing_textures)?;
    }
    for warning in &report.warnings {
        writeln!(out, "warning      {warning}")?;
    }
    Ok(())
}

/// What a material mostly is.
fn kind(m: &Material) -> &'static str {
    if m.unlit {
        "unlit"
    } else if m.is_emissive() {
        "emissive"
    } else if m.transmission > 0.0 {
        if m.is_solid { "solid dielectric" } else { "thin dielectric" }
    } else if m.metallic_roughness_texture.is_some() && m.metallic > 0.0 {
        "metallic by texture"
    } else if m.metallic >= 1.0 {
        "metal"
    } else if m.specular == 0.0 && m.metallic == 0.0 {
        "diffuse"
    } else {
        "coated diffuse"
    }
}

fn materials(scene: &Scene, out: &mut String) -> Result {
    let mut kinds: Vec<(&str, usize)> = Vec::new();
    let mut covers = 0;
    for m in &scene.materials {
        covers += usize::from(m.alpha_mode != AlphaMode::Opaque);
        match kinds.iter_mut().find(|(name, _)| *name == kind(m)) {
            Some((_, n)) => *n += 1,
            None => kinds.push((kind(m), 1)),
        }
    }
    let mut list: Vec<String> = kinds.iter().map(|(name, n)| format!("{n} {name}")).collect();
    if covers > 0 {
        list.push(format!("{covers} with alpha"));
    }
    writeln!(
        out,
        "materials    {}{}{}",
        scene.materials.len(),
        if list.is_empty() { "" } else { ": " },
        list.join(", ")
    )
}

fn lights(scene: &Scene, out: &mut String) -> Result {
    let is_emissive = |m: &Mesh| scene.materials.get(m.material as usize).is_some_and(Material::is_emissive);
    let emissive = |mesh: u32| scene.meshes.get(mesh as usize).filter(|m| is_emissive(m));
    let triangles: usize =
        scene.instances.iter().filter_map(|i| emissive(i.mesh)).map(|m| m.triangles.len()).sum();
    let count = |test: fn(&PunctualKind) -> bool| scene.lights.iter().filter(|l| test(&l.kind)).count();
    let mut list = Vec::new();
    let mut add = |n: usize, what: &str| {
        if n > 0 {
            list.push(format!("{n} {what}"));
        }
    };
    add(triangles, "emissive triangles");
    add(count(|k| *k == PunctualKind::Point), "point");
    add(count(|k| matches!(k, PunctualKind::Spot { .. })), "spot");
    add(count(|k| *k == PunctualKind::Directional), "directional");
    if let Some(e) = &scene.environment {
        list.push(format!("environment {}×{}", e.width, e.height));
    }
    writeln!(out, "lights       {}", if list.is_empty() { "none".into() } else { list.join(", ") })
}

fn cameras(scene: &Scene, out: &mut String) -> Result {
    for (i, camera) in scene.cameras.iter().enumerate() {
        let lens = match camera.projection {
            Projection::Perspective { yfov } => format!("{:.1}° high", yfov.to_degrees()),
            Projection::Orthographic { ymag } => format!("orthographic, {} m high", 2.0 * ymag),
        };
        writeln!(out, "camera {i:<5} {}: {lens}", camera.name)?;
    }
    Ok(())
}

fn textures(scene: &Scene, out: &mut String) -> Result {
    let mut sizes: Vec<((u32, u32), usize)> = Vec::new();
    for t in &scene.textures {
        match sizes.iter_mut().find(|(size, _)| *size == (t.width, t.height)) {
            Some((_, n)) => *n += 1,
            None => sizes.push(((t.width, t.height), 1)),
        }
    }
    sizes.sort_by_key(|&((w, h), _)| std::cmp::Reverse(u64::from(w) * u64::from(h)));
    let list: Vec<String> = sizes.iter().take(8).map(|((w, h), n)| format!("{n} of {w}×{h}")).collect();
    let more = if sizes.len() > 8 { ", …" } else { "" };
    let colon = if list.is_empty() { "" } else { ": " };
    writeln!(out, "textures     {}{colon}{}{more}", scene.textures.len(), list.join(", "))
}

fn geometry_bytes(scene: &Scene) -> u64 {
    let bytes = |m: &Mesh| {
        let n = m.positions.len();
        let per_vertex = 16
            + 12 * usize::from(m.normals.is_some())
            + 16 * usize::from(m.tangents.is_some())
            + 8 * m.uvs.iter().flatten().count()
            + 16 * usize::from(m.colors.is_some());
        (n * per_vertex + 12 * m.triangles.len()) as u64
    };
    scene.meshes.iter().map(bytes).sum::<u64>()
        + (scene.instances.len() * size_of::<super::Instance>()) as u64
}

fn texture_bytes(scene: &Scene) -> u64 {
    // Textures share images: each image is counted once.
    let mut seen = std::collections::BTreeSet::new();
    let own = scene.textures.iter().filter(|t| seen.insert(t.texels.as_ptr() as usize));
    own.map(|t| 4 * t.texels.len() as u64).sum()
}
