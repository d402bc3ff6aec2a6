//! `gdpt analyze`: what stored buffers say about their noise, and the theory of it.

use super::flags::positive;
use super::terminal;
use crate::error::Result;
use crate::study::folder::Folder;
use crate::study::inspect::{self, FILES};
use clap::Args;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const EXAMPLES: &str = "\
Examples:
  gdpt render scene.glb --buffers -o scene.exr && gdpt analyze scene.exr
  gdpt analyze scene.exr -o analysis
  gdpt analyze seed-0.exr seed-1.exr seed-2.exr seed-3.exr --json

One file is measured by its two halves. Several files are renders of one view with different seeds; they measure
better. alpha* is the root of the noise
of the differences over that of the colours, the best alpha of a least-squares solve.
The folder gets spectra and sweep, as .csv and .svg, and two maps, ratio-dx.png and ratio-dy.png: the variance of a
difference over that of the colours; blue is below 1, where gradients pay, white is 1, red is above.";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Flags {
    /// Files written by gdpt render --buffers
    #[arg(value_name = "IN.exr", required = true)]
    inputs: Vec<PathBuf>,
    /// Folder for plots, maps and tables
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Alpha of the least-squares solution whose spectrum is shown
    #[arg(long, value_name = "X", default_value_t = 0.2, value_parser = positive)]
    alpha: f32,
    /// Prints one JSON object
    #[arg(long)]
    json: bool,
}

pub fn run(flags: &Flags) -> Result<()> {
    let inputs: Vec<&Path> = flags.inputs.iter().map(PathBuf::as_path).collect();
    let prepare = |path: &PathBuf| Folder::prepare(path, &FILES, &inputs);
    let folder = flags.output.as_ref().map(prepare).transpose()?;
    let inspection = inspect::inspect(&flags.inputs, flags.alpha)?;
    let written = folder.as_ref().map_or(Ok(Vec::new()), |f| inspection.write(f.path()))?;
    if flags.json {
        terminal::print(&inspection.json());
        return Ok(());
    }
    let mut text = inspection.text();
    for path in written {
        writeln!(text, "wrote {}", path.display()).expect("a string grows");
    }
    terminal::print(&text);
    Ok(())
}
