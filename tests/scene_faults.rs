//! What the scene loader makes of broken and hostile files: an error of one line or a repaired scene, never a panic.

mod gltf_builder;

use gdpt::scene::{self, LoadOptions};
use gltf_builder::{Builder, error_text, load_bytes, load_checked, shared};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Changes the JSON of a good file and loads it; the error has to name the place.
fn rejected(change: impl Fn(&mut Value), place: &str) {
    let mut b = Builder::textured_square();
    change(&mut b.json);
    let text = error_text(b.load(), 65);
    assert!(text.contains(place), "`{place}` is not in: {text}");
}

#[test]
fn files_that_are_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let load = |name: &str| load_checked(&folder.path().join(name));
    assert!(error_text(load("absent.glb"), 66).contains("no such file"));
    assert!(error_text(load(""), 66).contains("folder"));
    assert!(error_text(load_checked(Path::new("/dev/zero")), 66).contains("regular file"));
    assert!(error_text(load_bytes(b"", "a.glb"), 65).contains("empty"));
    assert!(error_text(load_bytes(b"hello", "a.gltf"), 65).contains("neither"));
    assert!(error_text(load_bytes(b"{\"a\": 1}", "a.gltf"), 65).contains("asset"));
    assert!(error_text(load_bytes(b"{\"a\": ", "a.gltf"), 65).contains("JSON is broken"));
    assert!(error_text(load_bytes(&[b'['; 100_000], "a.gltf"), 65).contains("neither"));
    let deep = [br#"{"asset":{"version":"2.0"},"extras":"#.to_vec(), vec![b'['; 100_000]].concat();
    error_text(load_bytes(&deep, "a.gltf"), 65);
}

#[test]
fn each_fault_names_its_place() {
    rejected(|j| j["meshes"][0]["primitives"][0]["material"] = json!(7), "meshes[0].primitives[0].material");
    rejected(|j| j["meshes"][0]["primitives"][0]["indices"] = json!(99), "meshes[0].primitives[0].indices");
    rejected(|j| j["nodes"][0]["mesh"] = json!(1), "nodes[0].mesh");
    rejected(|j| j["accessors"][0]["bufferView"] = json!(4_294_967_296u64), "accessors[0].bufferView");
    rejected(|j| j["bufferViews"][0]["byteLength"] = json!(u64::MAX), "bufferViews[0]");
    rejected(|j| j["accessors"][0]["count"] = json!(1u64 << 40), "accessors[0].count");
    rejected(|j| j["accessors"][0]["count"] = json!(5), "accessors[0]");
    rejected(|j| j["accessors"][0]["byteOffset"] = json!(u64::MAX - 15), "accessors[0]");
    rejected(|j| j["accessors"][0]["componentType"] = json!(5124), "accessors[0].componentType");
    rejected(|j| j["bufferViews"][0]["byteStride"] = json!(4), "accessors[0]");
    rejected(|j| j["materials"][0]["normalTexture"]["index"] = json!(1), "materials[0].normalTexture.index");
    rejected(|j| j["textures"][0]["source"] = json!(1), "textures[0].source");
    rejected(|j| j["materials"][0]["alphaMode"] = json!("BLENT"), "materials[0].alphaMode");
    rejected(|j| j["asset"]["version"] = json!("1.0"), "asset.version");
    rejected(
        |j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
        "KHR_draco_mesh_compression",
    );
    rejected(|j| j["nodes"][0]["scale"] = json!([1e39, 1, 1]), "nodes[0].scale");
    rejected(
        |j| j["materials"][0]["extensions"] = json!({"KHR_materials_ior": {"ior": "x"}}),
        "materials[0].extensions.KHR_materials_ior.ior",
    );
    rejected(
        |j| {
            j["accessors"][0]["sparse"] = json!({"count": 9, "values": {"bufferView": 0},
            "indices": {"bufferView": 0, "componentType": 5121}})
        },
        "accessors[0].sparse",
    );
    rejected(
        |j| j["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 0, "znear": 1}}]),
        "cameras[0].perspective.yfov",
    );
    let mut b = Builder::triangle();
    let indices = b.indices(&[0, 1, 3]);
    b.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
    let text = error_text(b.load(), 65);
    assert!(text.contains("meshes[0].primitives[0].indices") && text.contains("index 3"), "{text}");
}

#[test]
fn hierarchies_that_are_no_trees() {
    rejected(|j| j["nodes"] = json!([{"children": [1]}, {"children": [0]}]), "ancestor");
    rejected(|j| j["nodes"] = json!([{"children": [0]}]), "ancestor");
    rejected(|j| j["nodes"] = json!([{"children": [2]}, {"children": [2]}, {}]), "nodes[1].children[0]");
    rejected(|j| j["scenes"] = json!([{"nodes": [0, 0]}]), "scenes[0].nodes[1]");
    // A hundred thousand levels are no fault.
    let mut b = Builder::triangle();
    let depth = 100_000;
    let mut nodes: Vec<Value> = (1..depth).map(|i| json!({"children": [i]})).collect();
    nodes.push(json!({"mesh": 0}));
    b.json["nodes"] = json!(nodes);
    assert_eq!(b.load().unwrap().triangle_count(), 1);
    // Scales that overflow on the way down are.
    let mut nodes: Vec<Value> = (1..40).map(|i| json!({"children": [i], "scale": [1e3, 1e3, 1e3]})).collect();
    nodes.push(json!({"mesh": 0}));
    b.json["nodes"] = json!(nodes);
    assert!(error_text(b.load(), 65).contains("not finite"));
}

#[test]
fn a_budget_bounds_what_a_small_file_can_ask_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.glb");
    let options = LoadOptions { max_memory: 16 << 20, ..LoadOptions::default() };
    let out_of_memory = |b: &Builder| {
        std::fs::write(&path, b.glb()).unwrap();
        let start = Instant::now();
        error_text(scene::load(&path, &options), 33);
        assert!(start.elapsed() < Duration::from_secs(2));
    };
    // Zeros without a buffer.
    let mut b = Builder::triangle();
    b.json["accessors"][0] = json!({"componentType": 5126, "type": "VEC3", "count": 1u64 << 31});
    out_of_memory(&b);
    // One accessor read by many primitives.
    let mut b = Builder::triangle();
    let large = b.floats(&vec![[0.0f32; 3]; 10_000]);
    b.json["meshes"] = json!([{"primitives": vec![json!({"attributes": {"POSITION": large}}); 1000]}]);
    out_of_memory(&b);
    // A small file with a large picture.
    let mut b = Builder::textured_square();
    let view = b.view(&gltf_builder::png(&vec![[0; 4]; 3000 * 3000], 3000));
    b.json["images"] = json!([{"bufferView": view}]);
    out_of_memory(&b);
    // Many nodes times many primitives.
    let mut b = Builder::triangle();
    let primitive = b.json["meshes"][0]["primitives"][0].clone();
    b.json["meshes"] = json!([{"primitives": vec![primitive; 600]}]);
    b.json["nodes"] = json!(vec![json!({"mesh": 0}); 600]);
    out_of_memory(&b);
}

#[test]
fn uris_stay_in_the_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("scene");
    std::fs::create_dir_all(inside.join("folder")).unwrap();
    let b = Builder::triangle();
    // The file outside would load if it were reached.
    std::fs::write(folder.path().join("outside.bin"), &b.binary).unwrap();
    std::fs::write(inside.join("inside.bin"), &b.binary).unwrap();
    std::os::unix::fs::symlink("../outside.bin", inside.join("escape.bin")).unwrap();
    std::os::unix::fs::symlink("inside.bin", inside.join("link.bin")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", inside.join("zero.bin")).unwrap();
    let made = std::process::Command::new("mkfifo").arg(inside.join("pipe.bin")).status().unwrap();
    assert!(made.success());
    let absolute = folder.path().join("outside.bin");
    let absolute = absolute.to_str().unwrap();
    let path = inside.join("scene.gltf");
    let load = |uri: &str, as_image: bool| {
        let mut b = Builder::textured_square();
        let text = if as_image {
            b.json["images"] = json!([{"uri": uri}]);
            b.inline_gltf()
        } else {
            Builder::triangle().gltf_with_uri(uri)
        };
        std::fs::write(&path, text).unwrap();
        load_checked(&path)
    };
    for uri in ["inside.bin", "./inside.bin", "link.bin", "%69nside.bin", "folder/../inside.bin"] {
        let result = load(uri, false);
        // `..` is refused even where it would stay inside.
        assert_eq!(result.is_ok(), !uri.contains(".."), "{uri}");
    }
    let file_scheme = format!("file://{absolute}");
    for uri in [
        "../outside.bin",
        "folder/../../outside.bin",
        absolute,
        &file_scheme,
        "http://localhost/x.bin",
        "%2e%2e/outside.bin",
        "%2e%2e%2foutside.bin",
        "%FF",
        "a%00.bin",
        "C:\\x",
        "..\\outside.bin",
        "escape.bin",
        "pipe.bin",
        "zero.bin",
        "folder",
        "",
        "//host/x",
    ] {
        for as_image in [false, true] {
            let text = error_text(load(uri, as_image), 65);
            let place = if as_image { "images[0].uri" } else { "buffers[0].uri" };
            assert!(text.contains(place), "{uri}: {text}");
        }
    }
    assert!(error_text(load("absent.bin", false), 66).contains("no such file"));
    assert_eq!(load("absent.png", true).unwrap().report.missing_textures, 1);
}

#[test]
fn odd_factors_are_clamped_with_a_warning() {
    let mut b = Builder::textured_square();
    b.json["materials"][0] = json!({
        "pbrMetallicRoughness": {"baseColorFactor": [2, -1, 1e300, 1], "metallicFactor": 1e39, "roughnessFactor": -5},
        "emissiveFactor": [-1, 1e39, 0], "alphaMode": "MASK", "alphaCutoff": -1,
        "extensions": {"KHR_materials_ior": {"ior": 0}, "KHR_materials_transmission": {"transmissionFactor": 9},
            "KHR_materials_volume": {"thicknessFactor": 1, "attenuationDistance": 0, "attenuationColor": [0, 2, -1]}}});
    let scene = b.load().unwrap();
    assert!(scene.report.warnings.len() >= 9, "{:#?}", scene.report.warnings);
    let mut b = Builder::triangle();
    b.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "spot", "intensity": -4, "color": [1, 1, 1], "spot": {"innerConeAngle": 3, "outerConeAngle": 9}},
        {"type": "spot", "intensity": 1e38, "color": [1e38, 1, 1], "spot": {"innerConeAngle": 1, "outerConeAngle": 0}},
    ]}});
    let light = |i: u32| json!({"extensions": {"KHR_lights_punctual": {"light": i}}});
    b.json["nodes"] = json!([{"mesh": 0}, light(0), light(1)]);
    assert_eq!(b.load().unwrap().lights.len(), 1);
}

#[test]
fn every_truncation_is_refused() {
    for (b, name) in [(Builder::triangle(), "triangle"), (Builder::textured_square(), "square")] {
        let bytes = b.glb();
        let folder = tempfile::tempdir().unwrap();
        let load = |n: usize| {
            let path = folder.path().join(format!("{n}.glb"));
            std::fs::write(&path, &bytes[..n]).unwrap();
            load_checked(&path)
        };
        (0..bytes.len()).into_par_iter().for_each(|n| drop(error_text(load(n), 65)));
        assert!(load(bytes.len()).is_ok(), "{name}");
    }
}

/// A step of the SplitMix64 generator.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (*state ^ (*state >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[test]
fn five_thousand_mutations_do_no_harm() {
    let mut b = Builder::textured_square();
    b.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [{"type": "spot", "spot": {}}]}});
    b.json["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]);
    b.json["nodes"] = json!([{"mesh": 0, "children": [1, 2]}, {"mesh": 0, "scale": [1, 2, 3]},
        {"camera": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}]);
    let bytes = b.glb();
    let folder = tempfile::tempdir().unwrap();
    // Little memory, so that a count that grew is refused and not filled in.
    let options = LoadOptions { max_memory: 64 << 20, ..LoadOptions::default() };
    let still_loads = |round: u64| {
        let mut state = round;
        let mut mutated = bytes.clone();
        for _ in 0..1 + next(&mut state) % 4 {
            let at = next(&mut state) as usize % mutated.len();
            mutated[at] = match next(&mut state) % 3 {
                0 => next(&mut state) as u8,
                1 => mutated[at] ^ (1 << (next(&mut state) % 8)),
                _ => b"0123456789-eE.,:[]{}\"n\\"[next(&mut state) as usize % 23],
            };
        }
        let path = folder.path().join(format!("{round}.glb"));
        std::fs::write(&path, &mutated).unwrap();
        let result = catch_unwind(|| scene::load(&path, &options).map(|s| s.validate()))
            .unwrap_or_else(|_| panic!("round {round} panicked"));
        std::fs::remove_file(&path).unwrap();
        match result {
            Ok(valid) => valid.unwrap_or_else(|fault| panic!("round {round} breaks the promise: {fault}")),
            Err(_) => return false,
        }
        true
    };
    let accepted = (0..5000u64).into_par_iter().filter(|&round| still_loads(round)).count();
    println!("{accepted} of 5000 mutated files still load");
    assert!(accepted > 100 && accepted < 4900);
}

fn corpus_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            corpus_files(&path, files);
        } else if path.extension().is_some_and(|e| e == "gltf" || e == "glb") {
            files.push(path);
        }
    }
}

/// Kinds of error in the corpus's reports that the loader depends on: files with one of them are rejected.
const FATAL: [&str; 20] = [
    "ACCESSOR_INDEX_OOB",
    "ACCESSOR_SMALL_BYTESTRIDE",
    "ACCESSOR_SPARSE_COUNT_OUT_OF_RANGE",
    "ASSET_MIN_VERSION_GREATER_THAN_VERSION",
    "BUFFER_VIEW_TOO_LONG",
    "GLB_CHUNK_TOO_BIG",
    "GLB_EMPTY_CHUNK",
    "GLB_INVALID_MAGIC",
    "GLB_INVALID_VERSION",
    "GLB_LENGTH_MISMATCH",
    "GLB_LENGTH_TOO_SMALL",
    "GLB_UNEXPECTED_END_OF_CHUNK_DATA",
    "GLB_UNEXPECTED_END_OF_CHUNK_HEADER",
    "GLB_UNEXPECTED_END_OF_HEADER",
    "GLB_UNEXPECTED_FIRST_CHUNK",
    "INVALID_JSON",
    "NODE_LOOP",
    "NODE_PARENT_OVERRIDE",
    "SCENE_NON_ROOT_NODE",
    "UNKNOWN_ASSET_MAJOR_VERSION",
];

/// Files without an error that are rejected all the same, and why.
const REFUSED: [(&str, &str); 5] = [
    ("base/data/asset/min_version_valid.gltf", "asset.minVersion"),
    ("base/data/buffer/non_relative_uri.gltf", "scheme"),
    ("base/data/camera/perspective_yfov.gltf", "between 0 and π"),
    ("base/data/root/named_objects.gltf", "buffers[0]: has no data"),
    ("base/data/root/unused_objects.gltf", "buffers[0]: has no data"),
];

#[test]
fn the_corpus_of_the_khronos_validator() {
    let Some(folder) = shared("corpus/gltf-validator") else { return };
    let mut files = Vec::new();
    corpus_files(&folder, &mut files);
    files.sort();
    assert_eq!(files.len(), 372);
    let (mut rejected, mut wrong) = (0, Vec::new());
    for file in &files {
        let name = file.strip_prefix(&folder).unwrap().display().to_string();
        let start = Instant::now();
        let result = catch_unwind(|| load_checked(file)).unwrap_or_else(|_| panic!("{name} panicked"));
        assert!(start.elapsed() < Duration::from_secs(1), "{name} takes too long");
        if let Err(error) = &result {
            assert!(!error.to_string().contains('\n'), "{name}: {error}");
            rejected += 1;
        }
        let report = std::fs::read(format!("{}.report.json", file.display())).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        let messages = report["issues"]["messages"].as_array().cloned().unwrap_or_default();
        let errors: Vec<&str> =
            messages.iter().filter(|m| m["severity"] == 0).filter_map(|m| m["code"].as_str()).collect();
        let is_fatal = errors.iter().any(|code| FATAL.contains(code));
        match result {
            Ok(_) if is_fatal => wrong.push(format!("{name}: accepted in spite of {errors:?}")),
            Err(error)
                if REFUSED.iter().any(|(file, why)| *file == name && error.to_string().contains(why)) => {}
            Err(error) if errors.is_empty() => wrong.push(format!("{name}: rejected though good: {error}")),
            Err(error) if std::env::var_os("VERBOSE").is_some() => println!("{name} {errors:?}\n    {error}"),
            _ => {}
        }
    }
    println!("{rejected} of {} files rejected", files.len());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
