//! Solving again from the buffers of a file: another norm, another alpha, no rendering.

use super::job::{Format, Output};
use super::{Solve, metadata};
use crate::error::Result;
use crate::reconstruct::{Alpha, Method};
use crate::store::png::{self, ToneMap};
use crate::store::{atomic, exr, layers};
use std::num::NonZero;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Reads the buffers of `input`, solves, and writes the outputs with the layers and the metadata of the input.
pub fn run(
    input: &Path,
    outputs: &[Output],
    method: Method,
    alpha: Alpha,
    (exposure, tone_map): (f32, ToneMap),
    cancel: &AtomicBool,
) -> Result<Solve> {
    for output in outputs {
        atomic::probe(&output.path, &[input])?;
    }
    let mut document = exr::read_file(input)?;
    let buffers = layers::buffers(&document, input)?;
    // The same kind of workers as a render has: equal buffers give equal bytes.
    let workers = super::pool(std::thread::available_parallelism().map_or(1, NonZero::get))?;
    let solved = workers.install(|| super::solve(&buffers, method, alpha));
    let solve = Solve::of(&solved.solution);
    super::go_on(cancel)?;
    layers::set_image(&mut document, &solved.image);
    metadata::set_solve(&mut document, &solve);
    for output in outputs {
        match output.format {
            Format::Exr => exr::write(&output.path, &document)?,
            Format::Png => png::write(&output.path, &solved.image, exposure, tone_map)?,
        }
    }
    Ok(solve)
}
