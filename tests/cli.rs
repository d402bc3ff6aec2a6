//! The program as a user runs it: real processes in private folders. Every failure is one line on stderr with the
//! exit status of the README, leaves no hidden file, and does not touch a file that was there.

mod process;

use assert_cmd::cargo::cargo_bin;
use gdpt::store::{Document, exr};
use process::{assert_no_hidden_files, assert_refused, folder, stderr};
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program in `folder`.
fn gdpt(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(cargo_bin!("gdpt"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null()).output().expect("the program starts")
}

/// Renders the built-in box, small, and asserts success.
fn render(folder: &Path, more: &[&str]) {
    let mut arguments = vec!["render", "builtin:cornell-box", "--spp", "8", "-q"];
    if !more.contains(&"--size") {
        arguments.extend(["--size", "32x24"]);
    }
    arguments.extend(more);
    let output = gdpt(folder, &arguments);
    assert!(output.status.success() && output.stderr.is_empty(), "{more:?}: {}", stderr(&output));
}

fn read(folder: &Path, name: &str) -> Document {
    exr::read_file(&folder.join(name)).expect("an image of our own")
}

/// A glTF of one triangle whose buffer lies beside it; `change` edits the text.
fn triangle(
    folder: &Path,
    name: &str,
    positions: [f32; 9],
    indices: [u16; 3],
    change: impl Fn(String) -> String,
) {
    let mut bytes: Vec<u8> = positions.iter().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend(indices.iter().flat_map(|v| v.to_le_bytes()));
    fs::write(folder.join(name).with_extension("bin"), &bytes).expect("writable");
    let text = serde_json::json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 0.0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "buffers": [{"byteLength": 42, "uri": format!("{}.bin", name.trim_end_matches(".gltf"))}],
    });
    fs::write(folder.join(name), change(text.to_string())).expect("writable");
}

const POSITIONS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A GLB whose only chunk is shorter than its header says.
fn truncated_glb() -> Vec<u8> {
    let json = br#"{"asset":{"version":"2.0"}}     "#;
    let mut bytes = b"glTF".to_vec();
    for word in [2, 12 + 8 + json.len() as u32, json.len() as u32, 0x4e4f_534a] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(&json[..10]);
    bytes
}

#[test]
fn wrong_arguments_end_with_status_2() {
    let folder = folder();
    let scene = "builtin:cornell-box";
    let cases: &[(&[&str], &[&str])] = &[
        (&[], &["no command"]),
        (&["paint"], &["paint"]),
        (&["render"], &["--output", "SCENE"]),
        (&["render", scene], &["--output"]),
        (&["render", scene, "-o", "a.jpg"], &["a.jpg", ".exr", ".png"]),
        (&["render", scene, "-o", "a.exr", "-o", "a.exr"], &["twice"]),
        (&["render", scene, "-o", "a.exr", "--spp", "0"], &["--spp"]),
        (&["render", scene, "-o", "a.exr", "--size", "3by4"], &["--size", "1280x720"]),
        (&["render", scene, "-o", "a.exr", "--size", "0x4"], &["--size"]),
        (&["render", scene, "-o", "a.exr", "--crop", "4,4,4,8"], &["--crop"]),
        (&["render", scene, "-o", "a.exr", "--size", "8x8", "--crop", "0,0,9,8"], &["--crop", "8x8"]),
        (&["render", scene, "-o", "a.exr", "--alpha", "nan"], &["--alpha"]),
        (&["render", scene, "-o", "a.exr", "--alpha", "0"], &["--alpha"]),
        (&["render", scene, "-o", "a.exr", "--aov", "Z,colour"], &["colour"]),
        (&["render", scene, "-o", "a.exr", "--tonemap", "film"], &["film", "agx"]),
        (&["render", scene, "-o", "a.exr", "--max-memory", "2Q"], &["--max-memory"]),
        (&["render", scene, "-o", "a.exr", "--env-strength", "2"], &["--env"]),
        (&["render", scene, "-o", "a.exr", "--aperture", "2"], &["--focus"]),
        (&["render", scene, "-o", "a.exr", "--camera", "nobody"], &["nobody"]),
        (&["render", scene, "-o", "a.png", "--buffers"], &["--buffers", ".exr"]),
        (&["render", scene, "-o", "a.exr", "--integrator", "pt", "--reconstruct", "l2"], &["gradients"]),
        (&["compare", "a.exr"], &["REFERENCE"]),
        (&["compare", "a.exr", "b.exr", "--heatmap", "h.jpg"], &[".png"]),
    ];
    for (arguments, words) in cases {
        assert_refused(&gdpt(folder.path(), arguments), 2, words, &format!("{arguments:?}"));
    }
    assert_eq!(fs::read_dir(folder.path()).expect("the private folder").count(), 0);
}

#[test]
fn bad_scenes_are_refused_by_name_and_overwrite_nothing() {
    let folder = folder();
    let path = folder.path();
    let put = |name: &str, bytes: &[u8]| fs::write(path.join(name), bytes).expect("writable");
    put("old.exr", b"the old image");
    put("empty.glb", b"");
    put("truncated.glb", &truncated_glb());
    put("other.gltf", b"{\"asset\": 3}");
    put("text.gltf", b"no JSON at all");
    fs::create_dir(path.join("folder.glb")).expect("writable");
    triangle(path, "index.gltf", POSITIONS, [0, 1, 7], |t| t);
    triangle(path, "accessor.gltf", POSITIONS, [0, 1, 2], |t| t.replace("\"indices\":1", "\"indices\":9"));
    triangle(path, "cycle.gltf", POSITIONS, [0, 1, 2], |t| {
        t.replace("[{\"mesh\":0}]", "[{\"children\":[1]},{\"children\":[0],\"mesh\":0}]")
    });
    triangle(path, "required.gltf", POSITIONS, [0, 1, 2], |t| {
        t.replacen('{', "{\"extensionsRequired\":[\"ACME_hair\"],\"extensionsUsed\":[\"ACME_hair\"],", 1)
    });
    triangle(path, "leaves.gltf", POSITIONS, [0, 1, 2], |t| t.replace("leaves.bin", "../leaves.bin"));
    let cases: &[(&str, i32, &[&str])] = &[
        ("missing.glb", 66, &["missing.glb"]),
        ("folder.glb", 66, &["folder.glb"]),
        ("builtin:nothing", 66, &["builtin:nothing", "cornell-box"]),
        ("empty.glb", 65, &["empty.glb"]),
        ("truncated.glb", 65, &["truncated.glb"]),
        ("other.gltf", 65, &["other.gltf"]),
        ("text.gltf", 65, &["text.gltf"]),
        ("accessor.gltf", 65, &["accessor.gltf", "indices"]),
        ("index.gltf", 65, &["index.gltf", "index 7"]),
        ("cycle.gltf", 65, &["cycle.gltf", "nodes"]),
        ("required.gltf", 65, &["required.gltf", "ACME_hair"]),
        ("leaves.gltf", 65, &["leaves.gltf", "buffers"]),
    ];
    for (scene, status, words) in cases {
        let output = gdpt(path, &["render", scene, "-o", "old.exr", "--spp", "1", "--size", "8x8"]);
        assert_refused(&output, *status, words, scene);
        assert_refused(&gdpt(path, &["info", scene]), *status, words, scene);
        assert_eq!(fs::read(path.join("old.exr")).expect("still there"), b"the old image", "{scene}");
    }
    assert_no_hidden_files(path);
}

#[test]
fn triangles_that_cannot_be_kept_are_dropped_and_counted() {
    let folder = folder();
    let path = folder.path();
    let mut broken = POSITIONS;
    broken[4] = f32::NAN;
    triangle(path, "nan.gltf", broken, [0, 1, 2], |t| t);
    let arguments =
        ["render", "nan.gltf", "-o", "a.exr", "--spp", "1", "--size", "8x8", "--stats-json", "s.json"];
    let output = gdpt(path, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = fs::read_to_string(path.join("s.json")).expect("written");
    let statistics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(statistics["dropped"]["triangles"], 1);
    let strict = [&arguments[..], &["--strict"]].concat();
    assert_refused(&gdpt(path, &strict), 65, &["strict", "1 triangles dropped"], "strict");
}

#[test]
fn without_camera_and_light_it_says_so_and_the_image_is_black() {
    let folder = folder();
    triangle(folder.path(), "dark.gltf", POSITIONS, [0, 1, 2], |t| t);
    let output =
        gdpt(folder.path(), &["render", "dark.gltf", "-o", "a.exr", "--spp", "1", "--size", "16x16"]);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for word in ["no camera", "no light"] {
        assert_eq!(text.matches(word).count(), 1, "{word:?} is to be said once: {text}");
    }
    let image = read(folder.path(), "a.exr");
    assert!(["R", "G", "B"].iter().all(|c| image.channels[*c].iter().all(|v| *v == 0.0)));
    // The camera that was fitted sees the triangle.
    assert!(image.channels["Z"].iter().any(|z| *z < 1e3));
}

#[test]
fn outputs_that_cannot_be_created_are_found_before_rendering() {
    let folder = folder();
    let path = folder.path();
    triangle(path, "scene.gltf", POSITIONS, [0, 1, 2], |t| t);
    fs::copy(path.join("scene.gltf"), path.join("scene.exr")).expect("writable");
    fs::create_dir(path.join("folder.exr")).expect("writable");
    fs::write(path.join("locked.exr"), b"old").expect("writable");
    let mut permissions = fs::metadata(path.join("locked.exr")).expect("there").permissions();
    permissions.set_readonly(true);
    fs::set_permissions(path.join("locked.exr"), permissions).expect("ours");
    // Enough work to run for hours, were it begun.
    let long = ["--size", "4096x4096", "--spp", "1000000"];
    let cases = [
        ("none/a.exr", "scene.gltf", "none"),
        ("folder.exr", "scene.gltf", "folder"),
        ("locked.exr", "scene.gltf", "read-only"),
        ("scene.exr", "scene.exr", "input"),
    ];
    for (out, scene, word) in cases {
        let output = gdpt(path, &[&["render", scene, "-o", out], &long[..]].concat());
        assert_refused(&output, 73, &[out, word], out);
    }
    let output =
        gdpt(path, &[&["render", "scene.gltf", "-o", "a.exr", "--stats-json", "none/s"], &long[..]].concat());
    assert_refused(&output, 73, &["none/s"], "statistics");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(path.join("target.exr"), path.join("link.exr")).expect("links work here");
        let output = gdpt(path, &[&["render", "scene.gltf", "-o", "link.exr"], &long[..]].concat());
        assert_refused(&output, 73, &["link.exr", "link"], "link");
    }
    assert_no_hidden_files(path);
}

#[test]
fn help_has_examples_and_goes_to_stdout() {
    let folder = folder();
    for command in [
        &["--help"][..],
        &["render", "--help"],
        &["reconstruct", "--help"],
        &["compare", "--help"],
        &["analyze", "--help"],
        &["study", "--help"],
        &["info", "--help"],
    ] {
        let output = gdpt(folder.path(), command);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && output.stderr.is_empty());
        assert!(text.contains("Examples:\n  gdpt "), "{command:?} shows no example: {text}");
    }
    let version = gdpt(folder.path(), &["--version"]);
    assert_eq!(String::from_utf8_lossy(&version.stdout).trim(), concat!("gdpt ", env!("CARGO_PKG_VERSION")));
}

#[test]
fn image_layers_metadata_and_statistics_are_those_of_the_contract() {
    let folder = folder();
    let path = folder.path();
    render(path, &["-o", "a.exr", "-o", "a.png", "--buffers", "--stats-json", "s.json", "--seed", "5"]);
    let png = image::open(path.join("a.png")).expect("a PNG").to_rgb8();
    assert_eq!((png.width(), png.height()), (32, 24));
    assert!(png.pixels().any(|p| p.0[0] > 60), "the picture is black");

    let image = read(path, "a.exr");
    assert_eq!((image.width, image.height), (32, 24));
    let names = "R G B A Z N.X N.Y N.Z P.X P.Y P.Z albedo.R emission.G variance.B spp.Y primal.R primal_a.R \
                 primal_b.R dx.R dx_a.G dx_b.B dy.R dy_a.G dy_b.B";
    for name in names.split_whitespace() {
        let channel = image.channels.get(name).unwrap_or_else(|| panic!("{name} is missing"));
        assert!(channel.iter().all(|v| v.is_finite()), "{name} has values that are not finite");
    }
    assert!(image.channels["spp.Y"].iter().all(|v| *v == 8.0));
    assert!(image.world_to_camera.is_some() && image.world_to_ndc.is_some());
    let attribute = |name: &str| image.attributes.get(name).map(String::as_str);
    for (name, value) in [("seed", "5"), ("spp", "8"), ("samples", "0..8"), ("norm", "weighted")] {
        assert_eq!(attribute(&format!("gdpt/{name}")), Some(value));
    }
    for name in ["version", "scene", "integrator", "max_depth", "residual"] {
        assert!(attribute(&format!("gdpt/{name}")).is_some(), "gdpt/{name} is missing");
    }

    let text = fs::read_to_string(path.join("s.json")).expect("written");
    let statistics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(statistics["version"], 1);
    assert_eq!(statistics["samples"], 32 * 24 * 8);
    for pointer in [
        "/scene/name",
        "/settings/integrator",
        "/seconds/load",
        "/seconds/build",
        "/seconds/render",
        "/seconds/reconstruct",
        "/seconds/write",
        "/cpu_seconds",
        "/rays/total",
        "/rays/intersect_packets",
        "/rays/occluded_packets",
        "/rays/active_lanes_mean",
        "/shifts/reconnected",
        "/dropped/triangles",
        "/dropped/samples",
        "/peak_memory_bytes",
        "/error_estimate",
    ] {
        assert!(statistics.pointer(pointer).is_some_and(|v| !v.is_null()), "{pointer} is missing: {text}");
    }
    let lanes = statistics["rays"]["active_lanes_mean"].as_f64().expect("a number");
    assert!(lanes > 1.0 && lanes <= 16.0, "{lanes}");
}

#[test]
fn equal_bytes_for_any_number_of_threads_and_none_for_another_seed() {
    let folder = folder();
    let path = folder.path();
    let bytes = |name: &str, more: &[&str]| {
        render(path, &[&["-o", name, "--buffers", "--size", "70x50"], more].concat());
        fs::read(path.join(name)).expect("written")
    };
    let one = bytes("1.exr", &["--threads", "1"]);
    for threads in ["2", "5"] {
        assert!(one == bytes("n.exr", &["--threads", threads]), "{threads} threads change the image");
    }
    assert!(one != bytes("n.exr", &["--seed", "1"]));
}

#[test]
fn a_crop_is_the_part_of_the_whole_primal() {
    let folder = folder();
    let path = folder.path();
    render(path, &["-o", "all.exr", "--integrator", "pt"]);
    render(path, &["-o", "part.exr", "--integrator", "pt", "--crop", "8,4,20,15"]);
    let (all, part) = (read(path, "all.exr"), read(path, "part.exr"));
    assert_eq!((part.width, part.height), (12, 11));
    let window = part.window.expect("a part of the picture");
    assert_eq!((window.full, window.origin), ([32, 24], [8, 4]));
    for y in 0..11 {
        for x in 0..12 {
            assert_eq!(
                part.channels["G"][y * 12 + x],
                all.channels["G"][(y + 4) * 32 + x + 8],
                "at {x}, {y}"
            );
        }
    }
}

#[test]
fn reconstruct_from_buffers_is_what_render_solves() {
    let folder = folder();
    let path = folder.path();
    render(path, &["-o", "l1.exr", "--buffers"]);
    for (norm, alpha) in [("l2", "0.2"), ("l1", "0.5"), ("none", "0.2")] {
        render(path, &["-o", "direct.exr", "--buffers", "--reconstruct", norm, "--alpha", alpha]);
        let output = gdpt(
            path,
            &["reconstruct", "l1.exr", "-o", "again.exr", "--reconstruct", norm, "--alpha", alpha],
        );
        assert!(output.status.success(), "{norm}: {}", stderr(&output));
        let (direct, again) = (read(path, "direct.exr"), read(path, "again.exr"));
        assert!(direct == again, "{norm}: solving again gives another file");
    }
    render(path, &["-o", "plain.exr"]);
    let output = gdpt(path, &["reconstruct", "plain.exr", "-o", "again.exr"]);
    assert_refused(&output, 65, &["plain.exr", "--buffers"], "no buffers");
    let output = gdpt(path, &["reconstruct", "l1.exr", "-o", "l1.exr"]);
    assert_refused(&output, 73, &["l1.exr", "input"], "in place");
}

#[test]
fn without_background_alpha_is_a_matte() {
    let folder = folder();
    let wide = ["--size", "48x16", "-o"];
    render(folder.path(), &[&wide[..], &["seen.exr"]].concat());
    render(folder.path(), &[&wide[..], &["matte.exr", "--background", "off"]].concat());
    let (seen, matte) = (read(folder.path(), "seen.exr"), read(folder.path(), "matte.exr"));
    assert!(seen.channels["A"].iter().all(|&a| a == 1.0));
    // Left and right of the box there is nothing; its middle is closed.
    let row = &matte.channels["A"][8 * 48..9 * 48];
    assert_eq!((row[0], row[24], row[47]), (0.0, 1.0, 0.0));
}

#[test]
fn compare_measures_and_refuses() {
    let folder = folder();
    let path = folder.path();
    render(path, &["-o", "a.exr", "--seed", "1"]);
    render(path, &["-o", "b.exr", "--seed", "2"]);
    render(path, &["-o", "small.exr", "--size", "16x16"]);
    let json = |a: &str, b: &str| -> serde_json::Value {
        let output = gdpt(path, &["compare", a, b, "--json", "--heatmap", "h.png"]);
        assert!(output.status.success(), "{}", stderr(&output));
        serde_json::from_slice(&output.stdout).expect("one JSON object")
    };
    let same = json("a.exr", "a.exr");
    assert_eq!((&same["rel_mse"], &same["mse"], &same["nan_pixels"]), (&0.0.into(), &0.0.into(), &0.into()));
    assert_eq!((&same["flip"], &same["tonemap"]), (&0.0.into(), &"agx".into()));
    let other = json("a.exr", "b.exr");
    for name in ["rel_mse", "mse", "psnr", "flip", "mean_test", "mean_reference"] {
        assert!(other[name].as_f64().is_some_and(|v| v > 0.0), "{name} is {}", other[name]);
    }
    assert_eq!(image::open(path.join("h.png")).expect("a PNG").width(), 32);
    let text = String::from_utf8(gdpt(path, &["compare", "a.exr", "b.exr"]).stdout).expect("text");
    assert!(
        text.contains("relMSE") && text.contains("0.001") && text.contains("agx at +0 EV"),
        "no definition beside the number: {text}"
    );
    fs::write(path.join("junk.exr"), b"junk").expect("writable");
    assert_refused(&gdpt(path, &["compare", "a.exr", "small.exr"]), 65, &["32x24", "16x16"], "size");
    assert_refused(&gdpt(path, &["compare", "a.exr", "none.exr"]), 66, &["none.exr"], "missing");
    assert_refused(&gdpt(path, &["compare", "junk.exr", "a.exr"]), 65, &["junk.exr"], "junk");
}

#[test]
fn both_backends_render_and_info_describes() {
    let folder = folder();
    render(folder.path(), &["-o", "a.exr", "--backend", "obvhs"]);
    render(folder.path(), &["-o", "b.exr"]);
    let (a, b) = (read(folder.path(), "a.exr"), read(folder.path(), "b.exr"));
    let mean = |d: &Document| d.channels["G"].iter().sum::<f32>();
    assert!((mean(&a) / mean(&b) - 1.0).abs() < 0.02, "{} and {}", mean(&a), mean(&b));
    let info = gdpt(folder.path(), &["info", "builtin:cornell-box"]);
    assert!(info.status.success() && String::from_utf8_lossy(&info.stdout).contains("triangles"));
}

#[test]
fn too_little_memory_is_status_33() {
    let folder = folder();
    let output = gdpt(
        folder.path(),
        &["render", "builtin:cornell-box", "-o", "a.exr", "--size", "4096x4096", "--max-memory", "64M"],
    );
    assert_refused(&output, 33, &["4096x4096", "64 MiB"], "film");
}
