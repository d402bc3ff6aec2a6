//! `gdpt render`: a scene to an image.

use super::flags::RenderFlags;
use super::progress::Progress;
use super::signals::Signals;
use super::{statistics, terminal};
use crate::error::Result;
use crate::integrate::ShiftOutcome;
use crate::reconstruct::Method;
use crate::render::{self, Job, Report, Solve, metadata};
use crate::store::atomic;
use std::fmt::Write;

pub fn run(flags: RenderFlags) -> Result<()> {
    let job = flags.job()?;
    if let Some(path) = &flags.stats_json {
        let outputs = job.outputs.iter().chain(&job.denoised).map(|o| o.path.as_path());
        atomic::probe(path, &job.inputs().into_iter().chain(outputs).collect::<Vec<_>>())?;
    }
    let signals = Signals::install()?;
    let progress = Progress::new(flags.progress, flags.quiet);
    let result = render::run(&job, &progress, &signals.cancel);
    progress.finish();
    let report = result.map_err(|e| signals.name(e))?;
    let job = job.with_samples(report.spp);
    if let Some(path) = &flags.stats_json {
        atomic::write(path, statistics::json(&job, &report).as_bytes())?;
    }
    if !flags.quiet {
        terminal::print(&summary(&job, &report, flags.verbose));
    }
    render::check_strict(&job, &report)
}

/// How an image was found, in words.
pub fn solve_row(solve: &Solve) -> String {
    let Solve { method, alpha, residual, iterations, .. } = solve;
    let alpha = alpha.map(|alpha| format!(", alpha {alpha}")).unwrap_or_default();
    format!(
        "{}{alpha}, {iterations} iterations, relative residual {residual:.1e}",
        metadata::method_name(*method)
    )
}

/// What a person wants to know at the end.
fn summary(job: &Job, report: &Report, verbose: bool) -> String {
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        writeln!(text, "{name:<13}{value}").expect("a string grows");
    };
    let [width, height] = report.size;
    let s = &job.settings;
    let integrator = metadata::integrator_name(s.kind);
    row("scene", format!("{}, {} triangles", job.source.name(), report.triangles));
    row("image", format!("{width}x{height}, {} spp, {integrator}, seed {}", s.samples_taken(), s.seed));
    if report.solve.method != Method::None {
        row("reconstruct", solve_row(&report.solve));
    }
    let seconds = &report.seconds;
    row(
        "seconds",
        format!(
            "load {:.2}, build {:.2}, render {:.2}, reconstruct {:.2}, write {:.2}; {} threads",
            seconds.load, seconds.build, seconds.render, seconds.reconstruct, seconds.write, report.threads
        ),
    );
    let per_second = |count: u64| count as f64 / seconds.render.max(1e-9) / 1e6;
    row("samples", format!("{}, {:.2} M/s", report.samples, per_second(report.samples)));
    let rays = &report.statistics.rays;
    let lanes = rays.active_lanes_mean();
    row("rays", format!("{}, {:.2} M/s, {lanes:.1} of 16 lanes active", rays.total, per_second(rays.total)));
    if let Some(rel_mse) = report.solve.rel_mse {
        let percent = 100.0 * rel_mse.sqrt();
        row("error", format!("{percent:.2} % of the image's values (estimated; relMSE {rel_mse:.2e})"));
    }
    let dropped = [
        (report.load.dropped_triangles, "triangles"),
        (report.load.missing_textures, "textures, missing"),
        (report.dropped_samples, "samples, not finite"),
        (report.solve.missing as u64, "measurements, not finite"),
    ];
    for (count, what) in dropped.iter().filter(|d| d.0 > 0) {
        row("dropped", format!("{count} {what}"));
    }
    if verbose {
        for (outcome, count) in ShiftOutcome::NAMES.iter().zip(report.statistics.shifts) {
            row("shifts", format!("{count:>14} {outcome}"));
        }
    }
    for output in job.outputs.iter().chain(&job.denoised) {
        row("wrote", output.path.display().to_string());
    }
    text
}
