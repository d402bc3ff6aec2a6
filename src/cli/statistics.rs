//! `--stats-json`: one object about one render.
//!
//! | Field | Meaning |
//! |---|---|
//! | `version` | of this format: 1. New fields may come without a new version |
//! | `gdpt` | version of the program |
//! | `scene` | what was rendered, `triangles`, `extensions_honoured`, `extensions_ignored` |
//! | `settings` | what decided the image, as in the EXR's `gdpt/` attributes; `norm` (`auto` resolved), `alpha` (null where the norm has none), `threads` |
//! | `samples` | over all pixels |
//! | `seconds` | wall time: `load`, `build`, `render`, `reconstruct`, `write` |
//! | `cpu_seconds` | of the whole process, all threads |
//! | `rays` | `total`, `intersect_packets`, `occluded_packets`, `active_lanes_mean` (of 16) |
//! | `shifts` | counts by outcome |
//! | `dropped` | `triangles`, `textures` (missing), `samples` (not finite), `measurements` (missing in the solve) |
//! | `peak_memory_bytes` | of the process; null where the system does not say |
//! | `error_estimate` | relative error of the image: the root of its estimated relMSE (bias is not seen); null below two samples |
//! | `solve` | `iterations`, `residual` (relative) |
//! | `warnings` | of the loader |
//! | `outputs` | files written |

use crate::integrate::ShiftOutcome;
use crate::render::{Job, Report, metadata};
use crate::study::usage::{cpu_seconds, peak_memory};
use serde_json::{Map, Value, json};

/// The number that was typed, not the nearest f32 written out in f64.
fn decimal(value: f32) -> Value {
    value.to_string().parse::<f64>().map_or(Value::Null, Value::from)
}

/// The object, as text.
pub fn json(job: &Job, report: &Report) -> String {
    let mut settings: Map<String, Value> =
        metadata::settings(job).into_iter().map(|(name, value)| (name.to_owned(), value.into())).collect();
    settings.insert("norm".into(), metadata::method_name(report.solve.method).into());
    settings.insert("alpha".into(), report.solve.alpha.map_or(Value::Null, decimal));
    settings.insert("threads".into(), json!(report.threads));
    let shifts: Map<String, Value> = ShiftOutcome::NAMES
        .into_iter()
        .zip(report.statistics.shifts)
        .map(|(outcome, count)| (outcome.to_owned(), count.into()))
        .collect();
    let seconds = &report.seconds;
    let rays = &report.statistics.rays;
    let outputs: Vec<_> =
        job.outputs.iter().chain(&job.denoised).map(|o| o.path.display().to_string()).collect();
    let object = json!({
        "version": 1,
        "gdpt": env!("CARGO_PKG_VERSION"),
        "scene": {
            "name": job.source.name(),
            "triangles": report.triangles,
            "extensions_honoured": report.load.extensions_honoured,
            "extensions_ignored": report.load.extensions_ignored,
        },
        "settings": settings,
        "samples": report.samples,
        "seconds": {
            "load": seconds.load,
            "build": seconds.build,
            "render": seconds.render,
            "reconstruct": seconds.reconstruct,
            "write": seconds.write,
        },
        "cpu_seconds": cpu_seconds(),
        "rays": {
            "total": rays.total,
            "intersect_packets": rays.intersect_packets,
            "occluded_packets": rays.occluded_packets,
            "active_lanes_mean": rays.active_lanes_mean(),
        },
        "shifts": shifts,
        "dropped": {
            "triangles": report.load.dropped_triangles,
            "textures": report.load.missing_textures,
            "samples": report.dropped_samples,
            "measurements": report.solve.missing,
        },
        "peak_memory_bytes": peak_memory(),
        "error_estimate": report.solve.rel_mse.map(f64::sqrt),
        "solve": {"iterations": report.solve.iterations, "residual": report.solve.residual},
        "warnings": report.load.warnings,
        "outputs": outputs,
    });
    format!("{object:#}\n")
}
