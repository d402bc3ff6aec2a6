//! `gdpt study` and `gdpt analyze` as a user runs them: whole reports, numbers that are those of the CSV files, a page
//! that works in a browser, and nothing left behind by what failed.

mod browser;
mod report;
#[path = "../process/signal.rs"]
mod signal;

use assert_cmd::cargo::cargo_bin;
use signal::signalled;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program in `folder`.
fn gdpt(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(cargo_bin!("gdpt"));
    command.current_dir(folder).args(arguments).stdin(Stdio::null()).output().expect("the program starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("readable").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn analyze_measures_halves_and_seeds_and_refuses_what_is_not_one_view() {
    let folder = tempfile::tempdir().expect("a private folder");
    let path = folder.path();
    let box_of = |seed: &str, more: &[&str], name: &str| {
        let mut arguments = vec!["render", "builtin:cornell-box", "--size", "48x36", "--spp", "8", "-q"];
        arguments.extend(["--seed", seed, "-o", name]);
        arguments.extend(more);
        let output = gdpt(path, &arguments);
        assert!(output.status.success(), "{}", text(&output.stderr));
    };
    box_of("0", &["--buffers"], "a.exr");
    box_of("1", &["--buffers"], "b.exr");
    box_of("2", &["--buffers", "--max-depth", "3"], "other.exr");
    box_of("3", &[], "plain.exr");
    let json = |arguments: &[&str]| -> serde_json::Value {
        let output = gdpt(path, &[&["analyze", "--json"], arguments].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("one JSON object")
    };
    let (halves, seeds) = (json(&["a.exr", "-o", "folder"]), json(&["a.exr", "b.exr"]));
    for found in [&halves, &seeds] {
        let star = found["alpha_star"].as_f64().expect("a number");
        assert!((0.05..2.0).contains(&star), "alpha* {star}");
        let gain = found["best"]["measured"].as_f64().expect("a number");
        assert!(gain > 3.0, "the solve gains {gain}");
    }
    let noise = |found: &serde_json::Value| found["noise"]["primal"].as_f64().expect("a number");
    let ratio = noise(&halves) / noise(&seeds);
    assert!((0.5..3.0).contains(&ratio), "noise by halves over noise by seeds: {ratio}");
    let files = ["ratio-dx.png", "ratio-dy.png", "spectra.csv", "spectra.svg", "sweep.csv", "sweep.svg"];
    assert_eq!(names(&path.join("folder")), files);
    assert_eq!(image::open(path.join("folder/ratio-dx.png")).expect("a PNG").width(), 48);
    let words = text(&gdpt(path, &["analyze", "a.exr"]).stdout);
    assert!(words.contains("alpha*") && words.contains("||G||^2"), "{words}");

    let refused = |arguments: &[&str], status: i32, word: &str| {
        let output = gdpt(path, &[&["analyze"], arguments].concat());
        let error = text(&output.stderr);
        assert!(output.status.code() == Some(status) && error.contains(word), "{arguments:?}: {error}");
    };
    refused(&["plain.exr"], 65, "--buffers");
    refused(&["a.exr", "a.exr"], 65, "another --seed");
    refused(&["a.exr", "other.exr"], 65, "max_depth");
    refused(&["none.exr"], 66, "none.exr");
    refused(&["a.exr", "-o", "no/where"], 73, "folder");
    refused(&["none.exr", "-o", "new"], 66, "none.exr");
    assert!(!path.join("new").exists(), "an empty folder was left behind");
}

#[test]
fn what_cannot_be_studied_is_refused_before_any_work() {
    let folder = tempfile::tempdir().expect("a private folder");
    let path = folder.path();
    fs::write(path.join("file"), "x").expect("writable");
    let refused = |arguments: &[&str], status: i32, word: &str| {
        let output = gdpt(path, &[&["study"], arguments].concat());
        let error = text(&output.stderr);
        assert!(output.status.code() == Some(status) && error.contains(word), "{arguments:?}: {error}");
        assert!(!path.join("report").exists(), "{arguments:?}: an empty folder was left behind");
    };
    refused(&["builtin:cornell-box", "-o", "file"], 73, "not a folder");
    refused(&["builtin:cornell-box", "-o", "no/where"], 73, "no/where");
    refused(&["builtin:cornell-box", "builtin:cornell-box", "-o", "report"], 2, "cornell-box");
    refused(&["none.glb", "-o", "report"], 66, "none.glb");
    refused(&["builtin:cornell-box", "-o", "report", "--env", "none.hdr"], 66, "none.hdr");
    refused(&["builtin:cornell-box", "-o", "report", "--spp", "4,0"], 2, "--spp");
}

#[cfg(unix)]
#[test]
fn an_interrupted_study_leaves_nothing() {
    let folder = tempfile::tempdir().expect("a private folder");
    let path = folder.path();
    fs::create_dir(path.join("report")).expect("writable");
    fs::write(path.join("report/index.html"), "old").expect("writable");
    for (output, left) in [("report", vec!["report"]), ("new", vec!["report"])] {
        let arguments = ["study", "builtin:cornell-box", "--reference-spp", "10000000", "-o", output];
        let (ended, rest) = signalled(path, &arguments, "reference", "INT");
        assert_eq!(ended.code(), Some(130), "{rest}");
        assert_eq!(names(path), left);
        assert_eq!(names(&path.join("report")), ["index.html"]);
        assert_eq!(fs::read(path.join("report/index.html")).expect("still there"), b"old");
    }
}
