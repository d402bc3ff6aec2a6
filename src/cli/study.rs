//! `gdpt study`: path tracing against gradient-domain path tracing, measured, as one page.

use super::flags::{MethodFlag, ToneMapFlag, finite, size};
use super::progress::{self, Progress};
use super::signals::Signals;
use super::terminal;
use crate::error::{Error, Result};
use crate::reconstruct::Method;
use crate::render::Source;
use crate::study::folder::Folder;
use crate::study::{self, FILES, Plan, Subject};
use clap::{Args, ValueEnum};
use std::fmt::Write;
use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  gdpt study builtin:cornell-box -o report
  gdpt study sponza.glb room.glb --env room=sky.exr --size 320x180 -o report
  gdpt study builtin:cornell-box --size 64x48 --spp 1,4,16 -o report
  gdpt study builtin:cornell-box --spp 4 --rounds 256 -o bias

The folder gets index.html, one file that needs nothing else, and its tables as CSV. The time goes into the
reference: --reference-spp decides. Built with --features denoise, path tracing denoised is one more method.";

/// Most samples of a reference that nobody asked for.
const REFERENCE_CAP: u32 = 16_384;

#[derive(Args)]
#[command(after_help = EXAMPLES)]
pub struct Flags {
    /// .glb or .gltf files, or builtin:cornell-box
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<PathBuf>,
    /// Folder for the report; made if it is missing
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Samples a pixel to compare at
    #[arg(
        long, value_name = "LIST", default_value = "1,4,16,64,256", value_delimiter = ',',
        value_parser = clap::value_parser!(u32).range(1..=1 << 20)
    )]
    spp: Vec<u32>,
    /// Columns and rows
    #[arg(long, value_name = "WxH", default_value = "256x192", value_parser = size)]
    size: [u32; 2],
    /// Samples a pixel of the reference [default: 64 times the most of --spp, 16384 at most]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1 << 24))]
    reference_spp: Option<u32>,
    /// Seeds to render each number of samples with
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=4096))]
    rounds: u32,
    /// Vertices of a path after the camera's: 1 shows emitters, 2 direct light
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(2..=1024))]
    max_depth: u32,
    /// Light from infinity, a latitude-longitude .hdr or .exr, of all scenes or of one; may be given several times
    #[arg(long, value_name = "[SCENE=]FILE")]
    env: Vec<String>,
    /// First seed
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..1 << 31))]
    seed: u64,
    /// Worker threads [default: one a logical CPU]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    threads: Option<u32>,
    /// Exposure of the pictures, in stops [default: the reference's median luminance becomes middle grey]
    #[arg(long, value_name = "EV", allow_negative_numbers = true, value_parser = finite)]
    exposure: Option<f32>,
    /// Tone mapping of the pictures
    #[arg(long, value_name = "CURVE", default_value = "agx")]
    tonemap: ToneMapFlag,
    /// How progress is shown, on stderr
    #[arg(long, value_name = "STYLE", default_value = "auto")]
    progress: progress::Style,
    /// Says nothing but errors
    #[arg(short, long)]
    quiet: bool,
}

impl Flags {
    fn plan(&self) -> Result<Plan> {
        let mut spp = self.spp.clone();
        spp.sort_unstable();
        spp.dedup();
        let most = spp.last().copied().unwrap_or(1);
        let methods = MethodFlag::value_variants().iter().map(|flag| flag.method());
        let cpus = || std::thread::available_parallelism().map_or(1, |n| n.get());
        Ok(Plan {
            subjects: self.subjects()?,
            size: self.size,
            reference_spp: self.reference_spp.unwrap_or(most.saturating_mul(64).min(REFERENCE_CAP)),
            spp,
            rounds: self.rounds,
            max_depth: self.max_depth,
            seed: self.seed,
            threads: self.threads.map_or_else(cpus, |n| n as usize),
            methods: methods.filter(|m| *m != Method::None).collect(),
            exposure: self.exposure,
            tone_map: self.tonemap.curve(),
        })
    }

    /// The scenes with their environments.
    fn subjects(&self) -> Result<Vec<Subject>> {
        let sources = self.scenes.iter().map(|path| Source::parse(path));
        let mut subjects: Vec<Subject> =
            sources.map(|source| Subject { source, environment: None }).collect();
        let names: Vec<String> = subjects.iter().map(Subject::name).collect();
        if let Some(twice) = names.iter().enumerate().find(|(i, n)| names[..*i].contains(n)) {
            return Err(Error::Usage(format!("two scenes are called {}; rename one", twice.1)));
        }
        for argument in &self.env {
            // A name in front of the sign; without one that is a scene's, the whole is a file for all.
            let named = argument.split_once('=').filter(|(name, _)| names.iter().any(|n| n == name));
            for (subject, name) in subjects.iter_mut().zip(&names) {
                match named {
                    Some((scene, file)) if scene == name => subject.environment = Some(file.into()),
                    None => subject.environment = Some(argument.into()),
                    Some(_) => {}
                }
            }
        }
        Ok(subjects)
    }
}

pub fn run(flags: &Flags) -> Result<()> {
    let plan = flags.plan()?;
    let inputs: Vec<_> = plan.subjects.iter().flat_map(Subject::inputs).collect();
    let folder = Folder::prepare(&flags.output, &FILES, &inputs)?;
    let signals = Signals::install()?;
    let progress = Progress::new(flags.progress, flags.quiet);
    let result = study::run(&plan, folder.path(), &progress, &signals.cancel);
    progress.finish();
    let written = result.map_err(|e| signals.name(e))?;
    if !flags.quiet {
        let mut text = String::new();
        for path in written {
            writeln!(text, "wrote {}", path.display()).expect("a string grows");
        }
        terminal::print(&text);
    }
    Ok(())
}
