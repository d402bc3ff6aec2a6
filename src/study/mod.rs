//! The evidence: what stored buffers say about their noise ([`inspect`], `gdpt analyze`), and path tracing against
//! gradient-domain path tracing, measured, as tables, charts and one page to read ([`run`], `gdpt study`).
//!
//! How a study measures:
//! * The reference is path tracing of two other seeds, half of its samples each. relMSE is taken of the image without
//!   very direct light, which is no part of what the methods differ in, minus the reference's own noise: a quarter of
//!   the relMSE between the reference's halves.
//! * Each method renders every number of samples with several seeds, path tracing and gradient-domain path tracing
//!   taking turns; errors are means over the seeds, CPU times too. A method's time is its render's and its solve's.
//! * Equal time: the error of path tracing after the same CPU time, on the straight lines between its measured points
//!   on logarithmic axes. Path tracing renders one number of samples more, four times the largest, so that this
//!   seldom extrapolates.
//! * FLIP is that of the whole pictures, tone-mapped as `render` does it.

mod bench;
pub mod charts;
pub mod fit;
pub mod folder;
pub mod inspect;
mod ladder;
mod page;
mod pictures;
mod report;
pub mod table;
pub mod usage;

use crate::error::Result;
use crate::reconstruct::Method;
use crate::render::{Monitor, Source};
use crate::store::png::ToneMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

pub use self::report::FILES;

/// A scene to measure.
#[derive(Clone, Debug)]
pub struct Subject {
    /// What is rendered.
    pub source: Source,
    /// Light from infinity beside it.
    pub environment: Option<PathBuf>,
}

impl Subject {
    /// A short name: the file's without folder and extension.
    pub fn name(&self) -> String {
        match &self.source {
            Source::Builtin(name) => name.clone(),
            Source::File(path) => {
                path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
            }
        }
    }

    /// Files that are read.
    pub fn inputs(&self) -> impl Iterator<Item = &Path> {
        let scene = match &self.source {
            Source::File(path) => Some(path.as_path()),
            Source::Builtin(_) => None,
        };
        scene.into_iter().chain(self.environment.as_deref())
    }
}

/// A study, fully specified.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What is rendered.
    pub subjects: Vec<Subject>,
    /// Columns and rows.
    pub size: [u32; 2],
    /// Samples a pixel, rising.
    pub spp: Vec<u32>,
    /// Samples a pixel of the reference.
    pub reference_spp: u32,
    /// Seeds a method renders each number of samples with.
    pub rounds: u32,
    /// Longest path.
    pub max_depth: u32,
    /// First seed.
    pub seed: u64,
    /// Worker threads.
    pub threads: usize,
    /// Reconstructions to compare; the default one is shown in the pictures.
    pub methods: Vec<Method>,
    /// Stops, for pictures; each scene's own, by its reference, where there is none.
    pub exposure: Option<f32>,
    /// For pictures.
    pub tone_map: ToneMap,
}

impl Plan {
    /// The number of samples at which pictures compare methods: the largest up to 64.
    pub fn shown_spp(&self) -> u32 {
        let up_to = self.spp.iter().copied().filter(|&s| s <= 64).max();
        up_to.or(self.spp.first().copied()).unwrap_or(1)
    }
}

/// Measures, and writes the report into `folder`, which must exist. Nothing is written before all is measured.
pub fn run(plan: &Plan, folder: &Path, monitor: &dyn Monitor, cancel: &AtomicBool) -> Result<Vec<PathBuf>> {
    let pool = crate::render::pool(plan.threads)?;
    let mut results = Vec::new();
    for subject in &plan.subjects {
        results.push(pool.install(|| ladder::measure(plan, subject, monitor, cancel))?);
    }
    monitor.stage("report");
    report::write(plan, &results, folder)
}
