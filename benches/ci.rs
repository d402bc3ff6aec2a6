//! The comparison that fails: ratios measured now, in one run with the sides alternating, and instructions counted by
//! callgrind, against `benches/expected.toml`.
//!
//!     cargo bench --bench ci                  compares; a row out of its band ends with status 1 and its name
//!     cargo bench --bench ci -- --record      stores what is measured now; bands already in the file are kept
//!
//! Only scenes built in code, so that every machine can measure every row. The counted kernels are compiled for
//! x86-64-v3 in a folder of their own: valgrind knows no AVX-512.

use clap::Parser;
use gdpt::integrate::Kind;
use gdpt::scene::{Scene, builtin};
use gdpt_bench::expected::{Expected, Measured, Outcome, Verdict};
use gdpt_bench::kernels::KERNELS;
use gdpt_bench::measure::{Cost, Rounds};
use gdpt_bench::rays::{self, METHODS};
use gdpt_bench::render::{Backend, Bed, pool, settings};
use gdpt_bench::table::grid;
use gdpt_bench::{scenes, shapes};
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const EXPECTED: &str = "benches/expected.toml";
const ROUNDS: usize = 9;

/// Compares speed with what is stored.
#[derive(Parser)]
struct Arguments {
    /// Store what is measured now
    #[arg(long)]
    record: bool,
    /// Measures nothing: whether what is stored can be read
    #[arg(long)]
    test: bool,
    /// What cargo passes to every bench
    #[arg(long, hide = true)]
    bench: bool,
}

/// The band of a row that was never stored. Ratios have to hold on busy machines and on other CPUs, those between ray
/// tracers and packet widths most; instructions vary with the libc alone; what a kernel counts itself does not vary.
fn default_band(name: &str) -> f64 {
    match name.split(", ").next() {
        Some("count") if name.ends_with("instructions") => 0.04,
        Some("count") => 0.01,
        _ if name.ends_with("G-PT over PT") => 0.15,
        _ if name.contains(" rays") => 0.35,
        _ => 0.25,
    }
}

/// Embree over obvhs and G-PT over PT, in whole renders on one thread.
fn render_ratios(name: &str, scene: &Scene, measured: &mut Measured) {
    let (bed, pool) = (Bed::new(scene), pool(1));
    let side = |kind, backend| bed.side(backend, settings(kind, [96, 96], 8, 0), &pool);
    let rounds = Rounds::alternate(
        ROUNDS,
        vec![
            side(Kind::Path, Backend::Embree),
            side(Kind::GradientPath, Backend::Embree),
            side(Kind::Path, Backend::Obvhs),
            side(Kind::GradientPath, Backend::Obvhs),
        ],
    );
    let mut add = |what: &str, ratio| measured.insert(format!("ratio, {name}: {what}"), ratio);
    add("obvhs over Embree, PT", rounds.ratio(2, 0, Cost::cpu));
    add("obvhs over Embree, G-PT", rounds.ratio(3, 1, Cost::cpu));
    add("G-PT over PT", rounds.ratio(1, 0, Cost::cpu));
}

/// Sixteen rays at a time over one at a time.
fn ray_ratios(scene: &Scene, measured: &mut Measured) {
    let bed = rays::Bed::new(scene, [256, 192]);
    for (kind, method) in [("primary", "embree 16 coherent"), ("first bounce", "embree 16 incoherent")] {
        let rays = bed.kinds.iter().find(|k| k.name == kind).expect("kinds have these names");
        let rounds = bed.rounds(rays, ROUNDS);
        let side = METHODS.iter().position(|m| m.0 == method).expect("methods have these names");
        measured
            .insert(format!("ratio, {kind} rays: embree 1 over {method}"), rounds.ratio(0, side, Cost::cpu));
    }
}

/// Fails with what `command` said unless it succeeds; what it printed otherwise.
fn output_of(command: &mut Command) -> Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output =
        command.output().map_err(|e| format!("{name}: {e}; ./setup bench installs what is missing"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("{name} ends with {}:\n{said}", output.status).into());
    }
    Ok(String::from_utf8(output.stdout)?)
}

/// Builds the counted kernels; their program.
fn build_kernels(target: &Path) -> Result<PathBuf> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo
        .args(["build", "--release", "--package", "gdpt-bench", "--bin", "kernels", "--target-dir"])
        .arg(target);
    cargo.env("RUSTFLAGS", "-C target-cpu=x86-64-v3").env_remove("CARGO_ENCODED_RUSTFLAGS");
    // Symbols are enough for callgrind, and quicker to build.
    cargo.env("CARGO_PROFILE_RELEASE_DEBUG", "false");
    output_of(cargo.current_dir(scenes::root()))?;
    Ok(target.join("release/kernels"))
}

/// Instructions of every kernel, and what the kernels count themselves.
fn counts(measured: &mut Measured) -> Result<()> {
    let target = scenes::root().join("target/callgrind");
    let program = build_kernels(&target)?;
    for kernel in &KERNELS {
        let profile = target.join(format!("{}.callgrind", kernel.name.replace([' ', ','], "-")));
        let mut valgrind = Command::new("valgrind");
        valgrind.args(["--tool=callgrind", "--quiet", "--toggle-collect=*counted_region*"]);
        valgrind.arg(format!("--callgrind-out-file={}", profile.display()));
        let printed = output_of(valgrind.arg(&program).arg(kernel.name))?;
        let text = fs::read_to_string(&profile)?;
        let total = text.lines().find_map(|line| line.strip_prefix("totals: "));
        let total: f64 = total.ok_or_else(|| format!("{}: no totals", profile.display()))?.trim().parse()?;
        if total == 0.0 {
            return Err(format!("{}: callgrind counted nothing", kernel.name).into());
        }
        let mut add = |what: &str, value| measured.insert(format!("count, {}: {what}", kernel.name), value);
        add("instructions", total);
        for line in printed.lines() {
            let (value, what) = line.split_once(' ').ok_or("a kernel prints a number and a name")?;
            add(what, value.parse()?);
        }
    }
    Ok(())
}

fn number(value: f64) -> String {
    if value >= 1000.0 { format!("{value:.0}") } else { format!("{value:.3}") }
}

/// A row that failed, in one line.
fn failure(verdict: &Verdict) -> String {
    let measured = verdict.measured.map_or("nothing".into(), number);
    let stored = verdict.stored.map_or("nothing".into(), |stored| {
        let [low, high] = stored.range().map(number);
        format!("{}, band {low} to {high}", number(stored.value))
    });
    format!("FAILED: {}: measured {measured}, stored {stored}", verdict.name)
}

fn print(verdicts: &[Verdict]) {
    let cells = |v: &Verdict| {
        let range = v.stored.map(|s| s.range().map(number));
        [
            v.name.clone(),
            v.measured.map_or_else(String::new, number),
            v.stored.map_or_else(String::new, |s| number(s.value)),
            range.map_or_else(String::new, |[low, high]| format!("{low} to {high}")),
            match v.outcome {
                Outcome::Within => "",
                Outcome::Outside => "OUT OF BAND",
                Outcome::NotMeasured => "NOT MEASURED",
                Outcome::NotStored => "NOT STORED",
            }
            .to_owned(),
        ]
    };
    println!("{}", grid(["row", "measured", "stored", "band", ""], verdicts.iter().map(cells)));
}

fn run(arguments: &Arguments) -> Result<bool> {
    let path = scenes::root().join(EXPECTED);
    let stored = Expected::read(&path).map_err(|e| format!("{EXPECTED}: {e}"))?;
    let missing = || format!("{EXPECTED} is missing; make bench-record writes it");
    if arguments.test {
        stored.ok_or_else(missing)?;
        return Ok(true);
    }
    let mut measured = Measured::new();
    let balls = shapes::balls(48, 24);
    render_ratios("Cornell box", &builtin("cornell-box").ok_or("no built-in scene")?, &mut measured);
    render_ratios("balls", &balls, &mut measured);
    ray_ratios(&balls, &mut measured);
    counts(&mut measured)?;

    let rustc =
        output_of(Command::new("rustc").arg("--version").current_dir(scenes::root()))?.trim().to_owned();
    if arguments.record {
        let recorded = Expected::record(rustc, &measured, stored.as_ref(), default_band);
        recorded.write(&path)?;
        print(&recorded.compare(&measured));
        println!("stored in {EXPECTED}");
        return Ok(true);
    }
    let stored = stored.ok_or_else(missing)?;
    let verdicts = stored.compare(&measured);
    print(&verdicts);
    let failed: Vec<_> = verdicts.iter().filter(|v| v.outcome != Outcome::Within).collect();
    failed.iter().for_each(|verdict| println!("{}", failure(verdict)));
    if !failed.is_empty() && stored.rustc != rustc {
        println!(
            "note: counts were stored with {}, this is {rustc}; they depend on the compiler",
            stored.rustc
        );
    }
    Ok(failed.is_empty())
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
