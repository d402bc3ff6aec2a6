//! `gdpt reconstruct`: solves again from stored buffers.

use super::flags::{DisplayFlags, MethodFlag, alpha, outputs};
use super::render::solve_row;
use super::signals::Signals;
use super::terminal;
use crate::error::Result;
use crate::reconstruct::{Alpha, Method};
use crate::render::resolve;
use clap::Args;
use std::fmt::Write;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  gdpt render scene.glb --buffers -o scene.exr
  gdpt reconstruct scene.exr --reconstruct l2 -o scene-l2.exr
  gdpt reconstruct scene.exr --alpha 0.1 -o scene.png";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Flags {
    /// An .exr written by gdpt render --buffers
    #[arg(value_name = "IN.exr")]
    input: PathBuf,
    /// File to write, .exr or .png; may be given several times
    #[arg(short, long, value_name = "OUT", required = true)]
    output: Vec<PathBuf>,
    /// How the image is found from samples and gradients
    #[arg(long, value_name = "NORM", default_value = "guided")]
    reconstruct: MethodFlag,
    /// Weight of the samples against the gradients, for l1 and l2: a number, or auto for that of the measured noise
    #[arg(long, value_name = "X|auto", default_value = "0.2", value_parser = alpha)]
    alpha: Alpha,
    #[command(flatten)]
    display: DisplayFlags,
    /// Says nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

pub fn run(flags: &Flags) -> Result<()> {
    let outputs = outputs(&flags.output)?;
    let method = flags.reconstruct.method();
    let signals = Signals::install()?;
    let solved =
        resolve::run(&flags.input, &outputs, method, flags.alpha, flags.display.typed(), &signals.cancel)
            .map_err(|e| signals.name(e))?;
    if !flags.quiet {
        let mut text = String::new();
        if solved.method != Method::None {
            writeln!(text, "reconstruct  {}", solve_row(&solved)).expect("a string grows");
        }
        for output in &outputs {
            writeln!(text, "wrote        {}", output.path.display()).expect("a string grows");
        }
        terminal::print(&text);
    }
    Ok(())
}
