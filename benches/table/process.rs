//! What has to be measured on whole processes: memory and the time from start to the first sample.

use super::Effort;
use gdpt::film::Film;
use gdpt::reconstruct::reconstruct;
use gdpt::study::usage::{peak_memory, resident_memory};
use gdpt_bench::fixtures::{noisy_buffers, problem};
use gdpt_bench::kernels::{ALPHA, SOLVERS};
use gdpt_bench::measure::median;
use gdpt_bench::scenes::{self, BenchScene};
use gdpt_bench::table::{Row, Target};
use std::hint::black_box;
use std::io;
use std::process::{Command, Stdio};
use std::time::Instant;

const NO_MEMORY: &str = "this system does not say what memory a process has";

/// Runs this program again as `name`; the number it prints.
fn measured_by_child(name: &str) -> Result<f64, String> {
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let child = Command::new(program).args(["--child", name]).stderr(Stdio::inherit()).output();
    let printed = String::from_utf8(child.map_err(|e| e.to_string())?.stdout).map_err(|e| e.to_string())?;
    printed.trim().parse().map_err(|_| NO_MEMORY.to_owned())
}

/// The other end: `film WIDTHxHEIGHT` prints bytes a pixel, `SOLVER WIDTHxHEIGHT` the peak over the size of its input.
pub fn child(name: &str) -> io::Result<()> {
    let usage = || io::Error::new(io::ErrorKind::InvalidInput, format!("--child {name}: unknown"));
    let (what, size) = name.rsplit_once(' ').ok_or_else(usage)?;
    let (width, height) = size.split_once('x').ok_or_else(usage)?;
    let parse = |side: &str| side.parse::<usize>().map_err(|_| usage());
    let (width, height) = (parse(width)?, parse(height)?);
    let pixels = (width * height) as f64;
    let memory = |now: Option<u64>| now.map(|bytes| bytes as f64).ok_or_else(|| io::Error::other(NO_MEMORY));
    let before = memory(resident_memory())?;
    if what == "film" {
        // A copy touches every page, which a fresh film leaves to the system.
        let film = black_box(Film::new(width, height, true, false).clone());
        println!("{}", (memory(resident_memory())? - before) / pixels);
        drop(film);
    } else {
        let (_, method) = SOLVERS.into_iter().find(|solver| solver.0 == what).ok_or_else(usage)?;
        let buffers = noisy_buffers(width, height);
        black_box(reconstruct(&problem(&buffers, method), method, ALPHA));
        println!("{}", (memory(peak_memory())? - before) / (pixels * 3.0 * size_of::<[f32; 3]>() as f64));
    }
    Ok(())
}

/// Bytes of a gradient film.
pub fn film(effort: &Effort) -> Vec<Row> {
    let name = "film of G-PT without feature layers, bytes a pixel";
    let [width, height] = effort.size([2048, 2048]);
    match measured_by_child(&format!("film {width}x{height}")) {
        Ok(bytes) => vec![Row::value(
            name,
            bytes.round(),
            "",
            "resident memory of a copy, rounded",
            Target::AtMost(160.0),
        )],
        Err(why) => vec![Row::skipped(name, &why)],
    }
}

/// Most memory of a solve, its input included, in sizes of the input.
pub fn solve_memory(solver: &str, [width, height]: [u32; 2]) -> Row {
    let name = format!("{solver} solve, {width}×{height}, peak memory over primal, dx and dy");
    match measured_by_child(&format!("{solver} {width}x{height}")) {
        Ok(ratio) => Row::value(name, ratio, "", "input included", Target::AtMost(3.0)),
        Err(why) => Row::skipped(name, &why),
    }
}

/// A run of the program itself, path-traced unless `extra` says otherwise; seconds and its statistics.
fn gdpt(scene: &BenchScene, extra: &[&str]) -> Result<(f64, serde_json::Value), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let statistics = folder.path().join("statistics.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_gdpt"));
    command.arg("render");
    if let Some((path, environment)) = &scene.files {
        command.arg(path);
        if let Some(environment) = environment {
            command.arg("--env").arg(environment);
        }
    } else {
        command.arg(scene.name);
    }
    command.args(extra).arg("--quiet").arg("--stats-json").arg(&statistics);
    command.arg("-o").arg(folder.path().join("image.exr"));
    let start = Instant::now();
    let status = command.status().map_err(|e| e.to_string())?;
    let seconds = start.elapsed().as_secs_f64();
    if !status.success() {
        return Err(format!("gdpt render ends with {status}"));
    }
    let text = std::fs::read_to_string(statistics).map_err(|e| e.to_string())?;
    Ok((seconds, serde_json::from_str(&text).map_err(|e| e.to_string())?))
}

/// Start-up and peak memory of the program.
pub fn rows(name: &'static str, effort: &Effort) -> Vec<Row> {
    let measure = || -> Result<Vec<Row>, String> {
        let scene = scenes::open(name)?;
        let one_tile = ["--integrator", "pt", "--size", "16x16", "--spp", "1", "--aov", "none"];
        let mut starts = Vec::new();
        for _ in 0..effort.rounds {
            starts.push(gdpt(&scene, &one_tile)?.0);
        }
        let target = if name == "sponza" { Target::AtMost(1.0) } else { Target::None };
        let label = format!("{name}: from start to a first tile of 16×16 samples, written, wall seconds");
        let start = Row::value(label, median(starts), "s", "whole process", target);

        let [width, height] = effort.size([1280, 720]);
        let size = format!("{width}x{height}");
        let (_, statistics) = gdpt(&scene, &["--size", &size, "--spp", "4"])?;
        let label = format!("{name}: peak memory of G-PT, {width}×{height}, L1, all layers, MB");
        let peak = match statistics["peak_memory_bytes"].as_f64() {
            Some(bytes) => Row::value(label, bytes * 1e-6, "MB", "whole process", Target::None),
            None => Row::skipped(label, NO_MEMORY),
        };
        Ok(vec![start, peak])
    };
    measure().unwrap_or_else(|why| vec![Row::skipped(format!("process/{name}"), &why)])
}
