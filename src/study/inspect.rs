//! What buffers say about their own noise: `gdpt analyze`.
//!
//! The inputs are files of `render --buffers`: one, whose two halves are compared, or several renders of one view
//! that differ in their seeds alone, whose noise is measured better.

use super::charts;
use super::table::number;
use crate::analyze::moments::{Energies, Moments, ratio_color};
use crate::analyze::noise::Noise;
use crate::error::{Error, Result};
use crate::store::{Document, atomic, exr, layers, png};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The names of the files that a report folder gets.
pub const FILES: [&str; 6] =
    ["spectra.csv", "spectra.svg", "sweep.csv", "sweep.svg", "ratio-dx.png", "ratio-dy.png"];

/// What was found.
#[derive(Clone, Debug)]
pub struct Inspection {
    /// How the noise was measured.
    pub source: &'static str,
    /// Samples a pixel of one run; zero where the file does not say.
    pub samples: f64,
    /// Noise and model.
    pub noise: Noise,
    /// From the moments; `None` below two samples or without the layers.
    pub energies: Option<Energies>,
}

/// Reads and measures; `alpha` is that of the solution whose spectrum is shown.
pub fn inspect(inputs: &[PathBuf], alpha: f32) -> Result<Inspection> {
    let documents = inputs.iter().map(|path| exr::read_file(path)).collect::<Result<Vec<_>>>()?;
    let files = || inputs.iter().zip(&documents);
    let (first_path, first) = files().next().ok_or_else(|| Error::Usage("no buffers given".into()))?;
    for (path, document) in files().skip(1) {
        same_view(first, path, document)?;
    }
    let (source, runs, share) = if documents.len() == 1 {
        let halves = layers::buffers(first, first_path)?.halves.ok_or_else(|| Error::Scene {
            path: first_path.clone(),
            at: String::new(),
            what: "has no two halves; render at least two samples a pixel".into(),
        })?;
        ("the two halves of the samples", halves.to_vec(), 0.5)
    } else {
        let runs = files().map(|(path, document)| Ok(layers::buffers(document, path)?.all));
        let runs = runs.collect::<Result<Vec<_>>>()?;
        ("independent renders", runs, 1.0)
    };
    let noise = Noise::measure(&runs, share, alpha).ok_or_else(|| Error::Scene {
        path: first_path.clone(),
        at: String::new(),
        what: "has too few buffers to measure noise".into(),
    })?;
    let moments = moments(first);
    let samples = moments.as_ref().map_or(0.0, |m| m.samples);
    Ok(Inspection { source, samples, noise, energies: moments.and_then(|m| m.energies()) })
}

/// Fails where two files are not renders of one view that differ in their samples alone.
fn same_view(first: &Document, path: &Path, other: &Document) -> Result<()> {
    let fault = |what: String| Error::Scene { path: path.to_owned(), at: String::new(), what };
    if (first.width, first.height) != (other.width, other.height) {
        return Err(fault(format!(
            "is {}x{}, the first one {}x{}; give renders of one view",
            other.width, other.height, first.width, first.height
        )));
    }
    let value = |document: &Document, name: &str| document.attributes.get(name).cloned();
    for name in ["gdpt/scene", "gdpt/env", "gdpt/spp", "gdpt/camera", "gdpt/max_depth"] {
        if value(first, name) != value(other, name) {
            return Err(fault(format!("differs in {name}; give renders that differ in --seed alone")));
        }
    }
    let drawn = |document| (value(document, "gdpt/seed"), value(document, "gdpt/samples"));
    if drawn(first) == drawn(other) {
        return Err(fault("has the first one's samples; render it with another --seed".into()));
    }
    Ok(())
}

/// The moments, where the file has them.
fn moments(document: &Document) -> Option<Moments> {
    let channel = |name: &str| document.channels.get(name).cloned();
    Some(Moments {
        samples: f64::from(*document.channels.get("spp.Y")?.first()?),
        variance: document.plane("variance")?,
        gradient_square: [
            channel("moments.right")?,
            channel("moments.left")?,
            channel("moments.up")?,
            channel("moments.down")?,
        ],
        dx: document.plane("dx")?,
        dy: document.plane("dy")?,
    })
}

impl Inspection {
    /// The model's gain at its best α.
    fn best_predicted(&self) -> f64 {
        self.noise.predicted_gain(self.noise.alpha_star() as f32)
    }

    /// For people.
    pub fn text(&self) -> String {
        let noise = &self.noise;
        let mut text = String::new();
        let mut row = |name: &str, value: String| {
            writeln!(text, "{name:<22}{value}").expect("a string grows");
        };
        let [width, height] = noise.size;
        row("image", format!("{width}x{height}, {} samples a pixel", self.samples));
        row("noise measured from", self.source.into());
        row(
            "noise of the primal",
            format!("{}  variance, mean over pixels and channels", number(noise.primal)),
        );
        row("noise of dx, dy", format!("{}, {}", number(noise.dx), number(noise.dy)));
        row("alpha*", format!("{}  root of their ratio: the best alpha for L2", number(noise.alpha_star())));
        match &self.energies {
            Some(e) => {
                let star = (0.5 * (e.dx + e.dy) / e.primal).sqrt();
                row("||F||^2", format!("{}  variance of a sample's luminance", number(e.primal)));
                row("||G||^2 of dx, dy", format!("{}, {}", number(e.dx), number(e.dy)));
                row("alpha* of these", format!("{}  as if samples were not stratified", number(star)));
            }
            None => {
                row("||F||^2, ||G||^2", "not in the file: needs two samples and --aov variance,spp".into())
            }
        }
        row(
            "gain of L2 at alpha*",
            format!(
                "{} predicted: noise of the primal over that of the solution",
                number(self.best_predicted())
            ),
        );
        if let Some(best) = noise.best() {
            row("best of the sweep", format!("{} at alpha {}", number(best.measured), best.alpha));
        }
        text.push('\n');
        text.push_str("alpha     predicted   measured gain\n");
        for gain in &noise.sweep {
            let (predicted, measured) = (number(gain.predicted), number(gain.measured));
            writeln!(text, "{:<10}{predicted:<12}{measured}", gain.alpha).expect("a string grows");
        }
        text
    }

    /// For scripts.
    pub fn json(&self) -> String {
        let noise = &self.noise;
        let points = |s: &crate::analyze::spectrum::Spectrum| s.points();
        let energies =
            self.energies.as_ref().map(|e| serde_json::json!({ "primal": e.primal, "dx": e.dx, "dy": e.dy }));
        let object = serde_json::json!({
            "size": noise.size,
            "samples": self.samples,
            "measured_from": self.source,
            "noise": { "primal": noise.primal, "dx": noise.dx, "dy": noise.dy },
            "alpha_star": noise.alpha_star(),
            "sample_variance": energies,
            "predicted_gain_at_alpha_star": self.best_predicted(),
            "best": noise.best(),
            "sweep": noise.sweep,
            "spectra": {
                "alpha": noise.alpha,
                "primal": points(&noise.primal_spectrum),
                "differences": points(&noise.gradient_spectrum),
                "result": points(&noise.result_spectrum),
                "equation_7": points(&noise.predicted_spectrum()),
            },
        });
        format!("{object:#}\n")
    }

    /// Writes [`FILES`] into `folder`, which must exist. Maps are written where the file holds the moments.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let noise = &self.noise;
        let mut files: Vec<(&str, Vec<u8>)> = vec![
            (FILES[0], charts::spectra_table(noise).csv().into_bytes()),
            (FILES[1], charts::spectra(noise).svg().into_bytes()),
            (FILES[2], charts::sweep_table(noise).csv().into_bytes()),
            (FILES[3], charts::sweep(noise).svg().into_bytes()),
        ];
        let [width, height] = noise.size;
        if let Some(e) = &self.energies {
            for (name, ratio) in [(FILES[4], &e.dx_ratio), (FILES[5], &e.dy_ratio)] {
                let pixels: Vec<u8> = ratio.iter().flat_map(|r| ratio_color(*r)).collect();
                let path = folder.join(name);
                let bytes =
                    png::encode_rgb8(&pixels, width, height).map_err(|source| Error::Io { path, source })?;
                files.push((name, bytes));
            }
        }
        let paths = files.into_iter().map(|(name, bytes)| {
            let path = folder.join(name);
            atomic::write(&path, &bytes).map(|()| path)
        });
        paths.collect()
    }
}
