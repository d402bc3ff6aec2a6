//! The page: one HTML file with its style, script, pictures and charts inside (`templates/study.*`).

use super::charts;
use super::ladder::{Findings, Side};
use super::pictures::{self, Group};
use super::report::Tables;
use super::table::Table;
use super::{Plan, fit};
use crate::analyze::plot::{Chart, Scale, Series};
use crate::error::{Error, Result};
use crate::reconstruct::Method;
use askama::Template;
use std::path::Path;

/// A table with the file it is also in.
struct Shown<'a> {
    title: &'static str,
    csv: &'static str,
    table: &'a Table,
}

/// A chart with what it shows in words.
struct Drawn {
    title: &'static str,
    svg: String,
}

/// One scene.
struct Section<'a> {
    anchor: String,
    name: &'a str,
    verdict: String,
    tables: Vec<Shown<'a>>,
    charts: Vec<Drawn>,
    groups: Vec<Group>,
    /// Ids of the pictures that the wipe shows first.
    left: String,
    right: String,
}

#[derive(Template)]
#[template(path = "study.html")]
struct Page<'a> {
    facts: Vec<(&'static str, String)>,
    shown: u32,
    summary: Table,
    sections: Vec<Section<'a>>,
}

/// The text of the page.
pub fn html(plan: &Plan, results: &[Findings], tables: &[Tables], summary: Table) -> Result<String> {
    let sections = results.iter().zip(tables).enumerate();
    let sections = sections.map(|(i, (m, t))| section(plan, m, t, i)).collect::<Result<Vec<_>>>()?;
    let page = Page { facts: facts(plan), shown: plan.shown_spp(), summary, sections };
    page.render().map_err(|e| Error::Io {
        path: Path::new("index.html").to_owned(),
        source: std::io::Error::other(e.to_string()),
    })
}

fn facts(plan: &Plan) -> Vec<(&'static str, String)> {
    let [width, height] = plan.size;
    let tone = plan.tone_map.name();
    vec![
        ("program", format!("gdpt {}", env!("CARGO_PKG_VERSION"))),
        ("size", format!("{width}\u{d7}{height} pixels")),
        ("longest path", format!("{} vertices after the camera's", plan.max_depth)),
        ("seeds", format!("{} a number of samples, from {}", plan.rounds, plan.seed)),
        ("reference", format!("path tracing of this program, {} spp, other seeds", plan.reference_spp)),
        ("pictures", format!("tone curve {tone} as gdpt render writes PNG; exposures are with the scenes")),
        ("threads", plan.threads.to_string()),
    ]
}

fn section<'a>(plan: &Plan, measured: &'a Findings, tables: &'a Tables, index: usize) -> Result<Section<'a>> {
    let groups = pictures::groups(plan, measured, index)?;
    // The wipe starts with path tracing and ours at the shown number of samples: the ladder is the first group, of
    // pairs.
    let rung = plan.spp.iter().position(|s| *s == plan.shown_spp()).unwrap_or(0);
    let id =
        |i: usize| groups.first().and_then(|g| g.pictures.get(i)).map(|p| p.id.clone()).unwrap_or_default();
    let (left, right) = (id(2 * rung), id(2 * rung + 1));
    Ok(Section {
        anchor: format!("scene-{index}"),
        name: &measured.name,
        verdict: verdict(plan, measured),
        tables: vec![
            Shown { title: "Error and time", csv: "results.csv", table: &tables.results },
            Shown { title: "Methods", csv: "methods.csv", table: &tables.methods },
            Shown { title: "Scene", csv: "scenes.csv", table: &tables.facts },
        ],
        charts: drawn(measured),
        groups,
        left,
        right,
    })
}

/// What came out, good and bad, in two sentences.
fn verdict(plan: &Plan, measured: &Findings) -> String {
    let (shown, best) = (plan.shown_spp(), Side::Gradient(Method::default()));
    let mut text = String::new();
    if let Some(cell) = measured.cell(best, shown) {
        let (spp, time) = (cell.gain_spp, cell.gain_time);
        text = format!(
            "{} at {shown} spp has {spp:.1} times less error (relMSE) than path tracing with as many samples, and \
             {time:.1} times less after the same CPU time. ",
            best.name()
        );
    }
    let gradient = |s: &Side| matches!(s, Side::Gradient(_));
    let cells: Vec<_> = measured.cells.iter().filter(|c| gradient(&c.side)).collect();
    let lost: Vec<String> = cells
        .iter()
        .filter(|c| c.gain_time < 1.0)
        .map(|c| format!("{} at {} spp ({:.2})", c.side.name(), c.spp, c.gain_time))
        .collect();
    text.push_str(&match lost.len() {
        0 => format!("At equal time it loses in none of {} cells.", cells.len()),
        n => format!("At equal time it loses in {n} of {} cells: {}.", cells.len(), lost.join(", ")),
    });
    text
}

/// A value of a method's curve: samples, CPU seconds, relMSE, FLIP.
type Pick = fn(&(f64, f64, f64, f64)) -> f64;

fn curves(measured: &Findings, x: (&'static str, Pick), y: (&'static str, Pick)) -> Chart {
    let series = measured.sides().into_iter().enumerate().map(|(color, side)| {
        let points: Vec<(f64, f64)> = measured.curve(side).iter().map(|p| (x.1(p), y.1(p))).collect();
        let slope = fit::slope(&points);
        // A minus sign, not a hyphen.
        let slope = format!("{slope:.2}").replace('-', "\u{2212}");
        let name = if points.len() > 1 { format!("{}, slope {slope}", side.name()) } else { side.name() };
        Series { name, points, color, dashed: false }
    });
    Chart { x: x.0, y: y.0, x_scale: Scale::Log, y_scale: Scale::Log, series: series.collect() }
}

fn drawn(measured: &Findings) -> Vec<Drawn> {
    let (spp, seconds) = (("samples a pixel", (|p| p.0) as Pick), ("CPU seconds", (|p| p.1) as Pick));
    let (error, flip) = (("relMSE", (|p| p.2) as Pick), ("FLIP", (|p| p.3) as Pick));
    vec![
        Drawn { title: "Error over samples", svg: curves(measured, spp, error).svg() },
        Drawn { title: "Error over CPU time", svg: curves(measured, seconds, error).svg() },
        Drawn { title: "FLIP over CPU time", svg: curves(measured, seconds, flip).svg() },
        Drawn { title: "Noise over frequency, against theory", svg: charts::spectra(&measured.noise).svg() },
        Drawn { title: "Gain of L2 over alpha, against theory", svg: charts::sweep(&measured.noise).svg() },
    ]
}
