//! From measurements to files: tables, charts, and the page that shows them.

use super::Plan;
use super::charts;
use super::fit;
use super::ladder::{Findings, Side};
use super::page;
use super::table::{Table, number};
use crate::error::Result;
use crate::reconstruct::Method;
use crate::store::atomic;
use std::path::{Path, PathBuf};

/// The files of a report; the page comes last, so that it never shows numbers that are not there yet.
pub const FILES: [&str; 7] =
    ["results.csv", "methods.csv", "scenes.csv", "alpha.csv", "spectra.csv", "summary.csv", "index.html"];

/// The tables of one scene, without the column that names it.
pub struct Tables {
    pub results: Table,
    pub methods: Table,
    pub facts: Table,
    pub alpha: Table,
    pub spectra: Table,
}

impl Tables {
    pub fn of(plan: &Plan, measured: &Findings) -> Self {
        Self {
            results: results(measured),
            methods: methods(measured),
            facts: facts(plan, measured),
            alpha: charts::sweep_table(&measured.noise),
            spectra: charts::spectra_table(&measured.noise),
        }
    }
}

/// Every method at every number of samples.
fn results(measured: &Findings) -> Table {
    let mut table = Table::new(&[
        "method",
        "spp",
        "render_cpu_s",
        "solve_cpu_s",
        "rel_mse",
        "flip",
        "estimated_rel_mse",
        "gain_equal_spp",
        "gain_equal_time",
        "energy_percent",
        "energy_error_percent",
    ]);
    for cell in &measured.cells {
        let mut row = vec![cell.side.name(), cell.spp.to_string()];
        let (energy, deviation) = cell.energy;
        let values = [
            cell.render_seconds,
            cell.solve_seconds,
            cell.rel_mse,
            cell.flip,
            cell.estimate,
            cell.gain_spp,
            cell.gain_time,
            100.0 * energy,
            100.0 * deviation,
        ];
        row.extend(values.map(number));
        table.rows.push(row);
    }
    table
}

/// How each method's error falls, and from where on it beats the denoiser at equal time.
fn methods(measured: &Findings) -> Table {
    let mut table = Table::new(&["method", "slope_of_rel_mse_over_spp"]);
    let over_time = |side: Side| -> Vec<(f64, f64)> {
        measured.curve(side).into_iter().map(|(_, seconds, error, _)| (seconds, error)).collect()
    };
    let denoised = over_time(Side::Denoised);
    if !denoised.is_empty() {
        table.header.push("beats_oidn_from_spp".into());
    }
    for side in measured.sides() {
        let curve = measured.curve(side);
        let slope = fit::slope(&curve.iter().map(|p| (p.0, p.2)).collect::<Vec<_>>());
        let mut row = vec![side.name(), number(slope)];
        if !denoised.is_empty() {
            let beats = |p: &&(f64, f64, f64, f64)| p.2 <= fit::interpolate(&denoised, p.1);
            row.push(match curve.iter().find(beats) {
                _ if side == Side::Denoised => String::new(),
                Some(point) => point.0.to_string(),
                None => "never here".into(),
            });
        }
        table.rows.push(row);
    }
    table
}

/// What holds for the scene as a whole, as (name, value).
fn facts(plan: &Plan, measured: &Findings) -> Table {
    let [width, height] = plan.size;
    let most = plan.spp.last().copied().unwrap_or(1);
    let samples = f64::from(most) * f64::from(width) * f64::from(height);
    let cost = |side: Side| measured.cell(side, most).map_or(f64::NAN, |c| 1e9 * c.render_seconds / samples);
    let (path, gradient) = (cost(Side::Path), cost(Side::Gradient(Method::default())));
    let noise = &measured.noise;
    let best = noise.best();
    let (equal_spp, _, equal) = &measured.equal_time;
    let mut table = Table::new(&["name", "value"]);
    let mut row = |name: &str, value: String| table.rows.push(vec![name.into(), value]);
    row("triangles", measured.triangles.to_string());
    row("exposure of the pictures (EV)", measured.reference.exposure.to_string());
    row("relMSE of the reference's own noise", number(measured.reference.noise));
    row("CPU ns a sample of PT", number(path));
    row("CPU ns a sample of G-PT", number(gradient));
    row("cost of G-PT over PT", number(gradient / path));
    row("PT samples in the CPU time of the shown picture", equal_spp.to_string());
    row("relMSE of one render of PT with these", number(equal.rel_mse));
    row("alpha* (best alpha by the model)", number(noise.alpha_star()));
    row("variance gain of L2 predicted there", number(noise.predicted_gain(noise.alpha_star() as f32)));
    row("best variance gain of L2 measured", number(best.map_or(f64::NAN, |g| g.measured)));
    row("alpha there", number(best.map_or(f64::NAN, |g| f64::from(g.alpha))));
    table
}

/// Equal-time gains of every method on every scene, at the shown number of samples.
pub fn summary(plan: &Plan, results: &[Findings]) -> Table {
    let shown = plan.shown_spp();
    let mut table = Table::new(&["method"]);
    table.header.extend(results.iter().map(|m| m.name.clone()));
    table.header.push("geometric mean".into());
    for side in results.first().map(Findings::sides).unwrap_or_default() {
        let gain = |m: &Findings| m.cell(side, shown).map_or(f64::NAN, |c| c.gain_time);
        let gains: Vec<f64> = results.iter().map(gain).collect();
        let mut row = vec![side.name()];
        row.extend(gains.iter().map(|g| number(*g)));
        row.push(number(fit::geometric_mean(&gains)));
        table.rows.push(row);
    }
    table
}

/// One table of all scenes, named in the first column.
fn joined<'a>(parts: impl Iterator<Item = (&'a str, &'a Table)>) -> Table {
    let mut all = Table::new(&["scene"]);
    for (scene, part) in parts {
        if all.header.len() == 1 {
            all.header.extend(part.header.iter().cloned());
        }
        all.rows.extend(part.rows.iter().map(|row| {
            let mut named = vec![scene.to_owned()];
            named.extend(row.iter().cloned());
            named
        }));
    }
    all
}

/// Writes everything; returns the paths.
pub fn write(plan: &Plan, results: &[Findings], folder: &Path) -> Result<Vec<PathBuf>> {
    let tables: Vec<Tables> = results.iter().map(|m| Tables::of(plan, m)).collect();
    let names: Vec<&str> = results.iter().map(|m| m.name.as_str()).collect();
    let all = |pick: fn(&Tables) -> &Table| joined(names.iter().copied().zip(tables.iter().map(pick))).csv();
    let summary = summary(plan, results);
    let texts = [
        all(|t| &t.results),
        all(|t| &t.methods),
        all(|t| &t.facts),
        all(|t| &t.alpha),
        all(|t| &t.spectra),
        summary.csv(),
        page::html(plan, results, &tables, summary)?,
    ];
    let write = |(name, text): (&str, String)| {
        let path = folder.join(name);
        atomic::write(&path, text.as_bytes()).map(|()| path)
    };
    FILES.into_iter().zip(texts).map(write).collect()
}
