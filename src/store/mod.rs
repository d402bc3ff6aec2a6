//! Image files: what is in one ([`Document`]), how it reaches the disk whole or not at all ([`atomic`]), OpenEXR
//! ([`exr`]) and PNG ([`png`]).
//!
//! Equal documents give equal bytes: no clock, host, path, timing or thread count enters a file.

pub mod atomic;
pub mod exr;
pub mod layers;
pub mod png;

use crate::film::Plane;
use std::collections::BTreeMap;

/// Where the pixels lie in the picture that was asked for: `--crop` renders a part of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Size of the whole picture, pixels.
    pub full: [u32; 2],
    /// Left upper pixel of the part that is stored.
    pub origin: [u32; 2],
}

/// An image file in memory: float channels of one size, by name, with the metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Samples row by row, row 0 at the top; names are `R` or `layer.R`.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// Where the pixels lie in the whole picture; all of it where absent.
    pub window: Option<Window>,
    /// World to camera space (y up, z forward), for row vectors, row by row.
    pub world_to_camera: Option<[f32; 16]>,
    /// World to normalised device coordinates (x, y in −1…1), for row vectors, row by row.
    pub world_to_ndc: Option<[f32; 16]>,
    /// Text attributes, by full name (`gdpt/seed`).
    pub attributes: BTreeMap<String, String>,
}

impl Document {
    /// An empty document.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, ..Self::default() }
    }

    /// Stores a plane as the channels `layer.a`, `layer.b`, `layer.c` where `suffixes` is `["a", "b", "c"]`; the
    /// root layer is the empty name.
    pub fn set_plane(&mut self, layer: &str, suffixes: [&str; 3], plane: &Plane) {
        for (c, suffix) in suffixes.into_iter().enumerate() {
            let samples = plane.data.iter().map(|pixel| pixel[c]).collect();
            self.channels.insert(channel_name(layer, suffix), samples);
        }
    }

    /// The colour plane of a layer, or nothing where one of its three channels is missing.
    pub fn plane(&self, layer: &str) -> Option<Plane> {
        self.layer(layer, ["R", "G", "B"])
    }

    /// The three channels of a layer by their suffixes, or nothing where one is missing.
    pub fn layer(&self, layer: &str, suffixes: [&str; 3]) -> Option<Plane> {
        let [r, g, b] = suffixes.map(|suffix| self.channels.get(&channel_name(layer, suffix)));
        let data = r?.iter().zip(g?).zip(b?).map(|((&r, &g), &b)| [r, g, b]).collect();
        Some(Plane { width: self.width, height: self.height, data })
    }
}

/// The name of a channel in a file.
fn channel_name(layer: &str, suffix: &str) -> String {
    if layer.is_empty() { suffix.to_owned() } else { format!("{layer}.{suffix}") }
}
