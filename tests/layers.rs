//! The order of the modules (ARCHITECTURE.md): who may use whom, read off the `crate::` paths of the sources; and
//! the limits of a file.

use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Each module and what it may use; everything it may use stands above it, so there is no cycle.
const ORDER: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("math", &[]),
    ("film", &["error", "math"]),
    ("scene", &["error", "math", "film"]),
    ("accel", &["error", "math", "film", "scene"]),
    ("shade", &["error", "math", "film", "scene", "accel"]),
    ("path", &["error", "math", "film", "scene", "shade", "accel"]),
    ("integrate", &["error", "math", "film", "scene", "shade", "accel", "path"]),
    ("reconstruct", &["error", "math", "film"]),
    ("analyze", &["error", "math", "film", "reconstruct"]),
    ("denoise", &["error", "film"]),
    ("store", &["error", "film"]),
    ("render", &["error", "math", "film", "scene", "accel", "integrate", "reconstruct", "denoise", "store"]),
    (
        "study",
        &[
            "error",
            "math",
            "film",
            "scene",
            "accel",
            "integrate",
            "reconstruct",
            "analyze",
            "denoise",
            "store",
            "render",
        ],
    ),
    (
        "cli",
        &[
            "error",
            "math",
            "film",
            "scene",
            "integrate",
            "reconstruct",
            "analyze",
            "denoise",
            "store",
            "render",
            "study",
        ],
    ),
];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("a readable entry").path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Paths below `src/` with their text, in a fixed order.
fn sources() -> BTreeMap<PathBuf, String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&root, &mut files);
    let relative = |p: &Path| p.strip_prefix(&root).expect("found below it").to_owned();
    files.iter().map(|p| (relative(p), fs::read_to_string(p).expect("readable text"))).collect()
}

/// The module a file belongs to: its first folder, or its own name.
fn module(path: &Path) -> String {
    let first = path.components().next().expect("not empty").as_os_str().to_string_lossy().into_owned();
    first.trim_end_matches(".rs").to_owned()
}

fn identifier(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    &text[..end]
}

/// The first names behind `crate::`, those of a braced list included.
fn used(text: &str) -> BTreeSet<String> {
    let code: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or_default()).collect();
    let code = code.join("\n");
    let mut names = BTreeSet::new();
    for (at, found) in code.match_indices("crate::") {
        // `$crate::` of a macro names the same crate.
        let rest = &code[at + found.len()..];
        let Some(list) = rest.strip_prefix('{') else {
            names.insert(identifier(rest).to_owned());
            continue;
        };
        let mut depth = 0;
        let mut begins = true;
        for (i, c) in list.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => begins = true,
                c if begins && !c.is_whitespace() => {
                    names.insert(identifier(&list[i..]).to_owned());
                    begins = false;
                }
                _ => {}
            }
        }
    }
    names
}

#[test]
fn reads_every_form_of_a_path() {
    let text = "use crate::film::{Film, Half};\nuse crate::{\n    math::{Mask, lanes},\n    scene,\n};\n\
                // use crate::cli;\nlet x = crate::accel::Rays::new();";
    let names: Vec<String> = used(text).into_iter().collect();
    assert_eq!(names, ["accel", "film", "math", "scene"]);
}

#[test]
fn the_order_has_no_cycle() {
    for (i, (name, may_use)) in ORDER.iter().enumerate() {
        for used in *may_use {
            assert!(
                ORDER[..i].iter().any(|(above, _)| above == used),
                "{name} may use {used}, which is not above it"
            );
        }
    }
}

#[test]
fn modules_use_only_what_is_below_them() {
    let mut faults = Vec::new();
    for (path, text) in sources() {
        let module = module(&path);
        if module == "lib" || module == "main" {
            continue;
        }
        let Some((_, may_use)) = ORDER.iter().find(|(name, _)| *name == module) else {
            faults.push(format!("{} is in no module of the order", path.display()));
            continue;
        };
        for name in used(&text) {
            let is_module = ORDER.iter().any(|(module, _)| *module == name);
            if is_module && name != module && !may_use.contains(&name.as_str()) {
                faults.push(format!("{} uses {name}", path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn only_accel_knows_embree() {
    for (path, text) in sources() {
        let names_it =
            text.lines().map(|l| l.split("//").next().unwrap_or_default()).any(|l| l.contains("embree4"));
        assert!(!names_it || module(&path) == "accel", "{} names embree4", path.display());
    }
}

#[test]
fn files_open_with_what_they_are_and_stay_short() {
    let mut faults = Vec::new();
    for (path, text) in sources() {
        if !text.starts_with("//!") {
            faults.push(format!("{} does not open with //!", path.display()));
        }
        if text.lines().count() >= 500 {
            faults.push(format!("{} has {} lines", path.display(), text.lines().count()));
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}
