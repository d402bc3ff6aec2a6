//! `gdpt compare`: the error of an image against a reference.

use super::flags::DisplayFlags;
use super::terminal;
use crate::analyze::flip;
use crate::analyze::metrics::{self, Comparison};
use crate::error::{Error, Result};
use crate::film::Plane;
use crate::store::png::{self, ToneMap};
use crate::store::{atomic, exr};
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  gdpt compare test.exr reference.exr
  gdpt compare test.exr reference.exr --json
  gdpt compare test.exr reference.exr --heatmap error.png

relMSE is the mean over pixels and channels of (T - R)^2 / (mean(R)^2 + 0.001), where mean(R) is the mean of the
three channels of the reference's pixel. FLIP is LDR-FLIP (0 equal, 1 most different) of the pictures that render
would write as PNG, at --exposure and with --tonemap: it judges what is seen, and depends on both.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Flags {
    /// The image to judge, .exr
    #[arg(value_name = "TEST.exr")]
    test: PathBuf,
    /// The image it should be, .exr
    #[arg(value_name = "REFERENCE.exr")]
    reference: PathBuf,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
    /// Writes the relative error of each pixel as a picture: black 0, through red and yellow, white 1 and more
    #[arg(long, value_name = "FILE.png", value_parser = png_name)]
    heatmap: Option<PathBuf>,
    #[command(flatten)]
    display: DisplayFlags,
}

/// The object of `--json`; what is not finite (PSNR of equal images) is null.
#[derive(serde::Serialize)]
struct Report {
    #[serde(flatten)]
    metrics: Comparison,
    /// Mean LDR-FLIP of the pictures at `exposure` with `tonemap`.
    flip: f64,
    exposure: f32,
    tonemap: &'static str,
}

fn png_name(text: &str) -> std::result::Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let is_png = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if is_png { Ok(path) } else { Err("does not end in .png".into()) }
}

pub fn run(flags: &Flags) -> Result<()> {
    if let Some(path) = &flags.heatmap {
        atomic::probe(path, &[&flags.test, &flags.reference])?;
    }
    let (test, reference) = (image(&flags.test)?, image(&flags.reference)?);
    let size = |p: &Plane| format!("{}x{}", p.width, p.height);
    let different = || Error::Scene {
        path: flags.test.clone(),
        at: String::new(),
        what: format!(
            "is {}, {} is {}; compare images of one size",
            size(&test),
            flags.reference.display(),
            size(&reference)
        ),
    };
    let metrics = metrics::compare(&test, &reference).ok_or_else(different)?;
    let (exposure, tone_map) = flags.display.typed();
    let [seen, wanted] = [&test, &reference].map(|plane| png::rgb8(plane, exposure, tone_map));
    let flip = flip::mean(&seen, &wanted, test.width, test.height).ok_or_else(different)?;
    let report = Report { metrics, flip, exposure, tonemap: tone_map.name() };
    if let Some(path) = &flags.heatmap {
        png::write(path, &heatmap(&test, &reference), 0.0, ToneMap::None)?;
    }
    terminal::print(&if flags.json { json(&report) } else { text(&report) });
    Ok(())
}

fn image(path: &Path) -> Result<Plane> {
    exr::read_file(path)?.plane("").ok_or_else(|| Error::Scene {
        path: path.to_owned(),
        at: String::new(),
        what: "has no channels R, G and B".into(),
    })
}

fn json(report: &Report) -> String {
    let object = serde_json::to_string_pretty(report).expect("numbers by name are always JSON");
    format!("{object}\n")
}

fn text(report: &Report) -> String {
    let m = &report.metrics;
    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        writeln!(text, "{name:<15}{value}").expect("a string grows");
    };
    row("relMSE", format!("{:.6e}  mean of (T - R)^2 / (mean(R)^2 + 0.001)", m.rel_mse));
    row("MSE", format!("{:.6e}  mean of (T - R)^2", m.mse));
    row("PSNR", format!("{:.2} dB  10 log10(P^2 / MSE), P the largest value of the reference", m.psnr));
    let Report { flip, exposure, tonemap, .. } = report;
    row(
        "FLIP",
        format!("{flip:.6}  mean LDR-FLIP of the pictures, {tonemap} at {exposure:+} EV, 67 pixels a degree"),
    );
    row("mean test", format!("{:.6e}", m.mean_test));
    row("mean reference", format!("{:.6e}", m.mean_reference));
    row("difference", format!("{:+.4} %  of the means, relative", 100.0 * m.mean_difference));
    row("NaN pixels", format!("{}  not finite in either image, left out above", m.nan_pixels));
    text
}

/// Root of the relative squared error of each pixel, as a picture; what is not finite is black.
fn heatmap(test: &Plane, reference: &Plane) -> Plane {
    Plane::from_fn(test.width, test.height, |x, y| {
        let error = metrics::pixel_rel_mse(test.at(x, y), reference.at(x, y)).sqrt() as f32;
        // Black, red, yellow, white: one channel after the other.
        std::array::from_fn(|c| (3.0 * error - c as f32).clamp(0.0, 1.0))
    })
}
