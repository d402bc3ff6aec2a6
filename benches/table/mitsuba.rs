//! Path tracing against Mitsuba 3 `llvm_ad_rgb` on the same file, size, samples and path length, in turn.

use super::Effort;
use gdpt::integrate::Kind;
use gdpt_bench::measure::{Cost, Rounds, Side};
use gdpt_bench::render::{Backend, Bed, MAX_DEPTH, cpus, megasamples, pool, settings};
use gdpt_bench::scenes::{self, BenchScene};
use gdpt_bench::table::{Rate, Row, Target};
use std::cell::RefCell;
use std::path::PathBuf;
use std::process::Command;

/// How Mitsuba is run.
struct Mitsuba {
    python: String,
    script: PathBuf,
}

impl Mitsuba {
    /// The one of the environment, or why there is none.
    fn find() -> Result<Self, String> {
        let python = std::env::var("GDPT_MITSUBA_PYTHON").unwrap_or_else(|_| "python3".into());
        let shared = || scenes::shared().join("tools/mitsuba_reference.py");
        let script = std::env::var_os("GDPT_MITSUBA_SCRIPT").map_or_else(shared, PathBuf::from);
        if !script.exists() {
            return Err(format!("{} absent", script.display()));
        }
        match Command::new(&python).args(["-c", "import mitsuba"]).output() {
            Ok(output) if output.status.success() => Ok(Self { python, script }),
            _ => Err(format!("{python} cannot import mitsuba; GDPT_MITSUBA_PYTHON names one that can")),
        }
    }

    /// One render of it.
    fn time(&self, scene: &BenchScene, [width, height]: [u32; 2], spp: u32) -> Result<Cost, String> {
        let (path, environment) = scene.files.as_ref().ok_or("the scene is no file")?;
        let mut command = Command::new(&self.python);
        command.arg(&self.script).arg("time").arg(path).args(["--size", &format!("{width}x{height}")]);
        command.args(["--spp", &spp.to_string(), "--max-depth", &MAX_DEPTH.to_string()]);
        if let Some(environment) = environment {
            command.arg("--env").arg(environment);
        }
        let output = command.output().map_err(|e| e.to_string())?;
        let said = || String::from_utf8_lossy(&output.stderr).lines().last().unwrap_or_default().to_owned();
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).map_err(|_| said())?;
        let seconds = |field: &str| json[field].as_f64().ok_or_else(|| format!("no {field} in its answer"));
        Ok(Cost { cpu: seconds("cpu_seconds")?, wall: seconds("seconds")? })
    }
}

fn target(scene: &str) -> Target {
    match scene {
        "cornell-box" => Target::AtLeast(2.0),
        "sponza" | "living-room" => Target::AtLeast(1.4),
        _ => Target::None,
    }
}

pub fn rows(name: &'static str, effort: &Effort) -> Vec<Row> {
    let label = format!("{name}: PT samples, gdpt over Mitsuba llvm_ad_rgb");
    let (mitsuba, scene) = match Mitsuba::find().and_then(|mitsuba| Ok((mitsuba, scenes::open(name)?))) {
        Ok(found) => found,
        Err(why) => return vec![Row::skipped(label, &why)],
    };
    // Twice the samples of the other rows: Mitsuba has fixed costs a render that more samples hide.
    let (size, spp) = (effort.size(scene.size), 2 * effort.spp(scene.spp));
    let (bed, pool) = (Bed::new(&scene.scene), pool(cpus()));
    let failure = RefCell::new(None);
    let theirs: Side<'_> = Box::new(|| match mitsuba.time(&scene, size, spp) {
        Ok(cost) => cost,
        Err(why) => {
            failure.replace(Some(why));
            Cost::default()
        }
    });
    let ours = bed.side(Backend::Embree, settings(Kind::Path, size, spp, 0), &pool);
    let rounds = Rounds::alternate(effort.rounds, vec![ours, theirs]);
    if let Some(why) = failure.take() {
        return vec![Row::skipped(label, &why)];
    }
    let rate = |side, label| Rate { side, label, millions: megasamples(size, spp) };
    vec![Row::rates(label, &rounds, rate(0, "gdpt"), rate(1, "Mitsuba"), target(name))]
}
