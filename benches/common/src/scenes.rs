//! The scenes that renders are measured on: the built-in Cornell box always, others where `../shared/scenes` has them.

use gdpt::scene::{self, Environment, LoadOptions, Scene};
use std::path::PathBuf;

/// A scene with what a render of it needs.
#[derive(Debug)]
pub struct BenchScene {
    /// As in the table.
    pub name: &'static str,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Samples a pixel of one timed render.
    pub spp: u32,
    /// The scene, its environment in place.
    pub scene: Scene,
    /// The files it was read from: scene and environment.
    pub files: Option<(PathBuf, Option<PathBuf>)>,
}

/// The built-in one and the shared ones: name, size, samples a pixel, environment.
const SCENES: [(&str, [u32; 2], u32, Option<&str>); 5] = [
    (BUILTIN, [512, 512], 16, None),
    ("cornell-box", [512, 512], 16, None),
    ("sponza", [512, 384], 8, None),
    ("living-room", [512, 288], 8, Some("living-room-sky.exr")),
    ("veach-ajar", [512, 288], 8, None),
];

/// The scene that is always there.
pub const BUILTIN: &str = "builtin:cornell-box";

/// The names of all scenes, whether they are there or not.
pub fn names() -> impl Iterator<Item = &'static str> {
    SCENES.iter().map(|scene| scene.0)
}

/// A scene by name; where it is absent, a line that says so.
pub fn open(name: &str) -> Result<BenchScene, String> {
    let &(name, size, spp, environment) =
        SCENES.iter().find(|scene| scene.0 == name).ok_or_else(|| format!("{name}: no such scene"))?;
    if let Some(builtin) = name.strip_prefix("builtin:") {
        let scene = scene::builtin(builtin).ok_or_else(|| format!("{name}: no such scene"))?;
        return Ok(BenchScene { name, size, spp, scene, files: None });
    }
    let folder = shared().join("scenes");
    let path = folder.join(format!("{name}.glb"));
    let environment = environment.map(|file| folder.join(file));
    for file in [Some(&path), environment.as_ref()].into_iter().flatten() {
        if !file.exists() {
            return Err(format!("{name}: {} absent", file.display()));
        }
    }
    let mut scene = scene::load(&path, &LoadOptions::default()).map_err(|e| e.to_string())?;
    if let Some(file) = &environment {
        scene.environment = Some(Environment::load(file, 1.0, 0.0, true).map_err(|e| e.to_string())?);
    }
    Ok(BenchScene { name, size, spp, scene, files: Some((path, environment)) })
}

/// The root of the project.
pub fn root() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// The folder of shared material beside the project.
pub fn shared() -> PathBuf {
    root().join("../shared")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_builtin_scene_is_always_there_and_absent_ones_are_named() {
        assert!(open(BUILTIN).is_ok_and(|scene| scene.scene.has_light()));
        assert!(open("nowhere").is_err_and(|why| why.contains("nowhere")));
    }
}
