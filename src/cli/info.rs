//! `gdpt info`: what is in a scene.

use super::terminal;
use crate::error::Result;
use crate::render::{Source, open};
use crate::scene::{LoadOptions, describe};
use clap::Args;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  gdpt info scene.glb
  gdpt info builtin:cornell-box";

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Flags {
    /// A .glb or .gltf file, or builtin:cornell-box
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
}

pub fn run(flags: &Flags) -> Result<()> {
    let scene = open(&Source::parse(&flags.scene), &LoadOptions::default())?;
    for warning in &scene.report.warnings {
        terminal::warning(warning);
    }
    terminal::print(&describe(&scene));
    Ok(())
}
