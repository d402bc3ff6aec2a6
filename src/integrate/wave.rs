//! Waves: the paths of one tile for a few samples a pixel, in flight together so that packets stay full at depth.

use crate::film::{FilmTile, PixelSample};
use crate::path::queue::Queues;
use crate::path::tail::Slot;

/// Side of a tile in pixels; a multiple of the block's side.
pub const TILE: u32 = 16;

/// Samples a pixel in flight: 16 × 16 × 8 paths fill packets well and their state stays in the second-level cache.
const WAVE: u32 = 8;

/// Splits `spp` samples from `first` on into waves.
pub fn waves(first: u32, spp: u32) -> impl Iterator<Item = std::ops::Range<u32>> {
    let end = first + spp;
    (first..end).step_by(WAVE as usize).map(move |start| start..(start + WAVE).min(end))
}

/// Memory of a wave, kept from one to the next: fresh pages cost more than the work on them.
#[derive(Debug, Default)]
pub struct Scratch {
    /// What the tails gather, by slot.
    pub slots: Vec<Slot>,
    /// The samples, by slot.
    pub samples: Vec<PixelSample>,
    /// What T is multiplied with for the gradients, by slot and direction.
    pub factors: Vec<[[f32; 3]; 4]>,
    /// Waiting paths.
    pub queues: Queues,
}

impl Scratch {
    /// Empty slots and samples for a wave; no path waits.
    pub fn reset(&mut self, region: &Region, wave: &std::ops::Range<u32>) -> &mut Self {
        let pixels = (region.x1 - region.x0) * (region.y1 - region.y0);
        let count = (pixels * (wave.end - wave.start)) as usize;
        self.slots.clear();
        self.slots.resize(count, Slot::default());
        self.samples.clear();
        self.samples.resize(count, PixelSample::default());
        self.factors.clear();
        self.factors.resize(count, [[0.0; 3]; 4]);
        self
    }
}

/// The pixels of one tile, in coordinates of the whole film; a tile of the film's grid cut to the part that is
/// rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    /// Left column.
    pub x0: u32,
    /// Top row.
    pub y0: u32,
    /// One past the right column.
    pub x1: u32,
    /// One past the bottom row.
    pub y1: u32,
    /// The part of the film that is rendered: [x0, y0, x1, y1).
    pub film: [u32; 4],
}

impl Region {
    /// The tiles of the part [x0, x1) × [y0, y1) of the film, row by row. The grid is that of the whole film, so a
    /// crop renders the same samples as the whole.
    pub fn tiles(x0: u32, y0: u32, x1: u32, y1: u32) -> Vec<Self> {
        let film = [x0, y0, x1, y1];
        let starts = |from: u32, to: u32| (from / TILE * TILE..to).step_by(TILE as usize);
        starts(y0, y1)
            .flat_map(|y| starts(x0, x1).map(move |x| (x, y)))
            .map(|(x, y)| Self {
                x0: x.max(x0),
                y0: y.max(y0),
                x1: (x + TILE).min(x1),
                y1: (y + TILE).min(y1),
                film,
            })
            .collect()
    }

    /// An empty film tile for this region of a film whose left upper pixel is (x, y).
    pub fn film_tile(&self, x: u32, y: u32) -> FilmTile {
        FilmTile::new(
            (self.x0 - x) as usize,
            (self.y0 - y) as usize,
            (self.x1 - self.x0) as usize,
            (self.y1 - self.y0) as usize,
        )
    }

    /// Whether pixel (x, y) is rendered at all, here or in another tile.
    pub fn film_contains(&self, x: i64, y: i64) -> bool {
        let [x0, y0, x1, y1] = self.film.map(i64::from);
        (x0..x1).contains(&x) && (y0..y1).contains(&y)
    }

    /// Whether pixel (x, y) belongs to this tile.
    pub fn contains(&self, x: u32, y: u32) -> bool {
        (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y)
    }

    /// Slot of the pixel at (x, y) for the `wave_index`-th sample of a wave.
    pub fn slot(&self, x: u32, y: u32, wave_index: u32) -> u32 {
        let (width, height) = (self.x1 - self.x0, self.y1 - self.y0);
        wave_index * width * height + (y - self.y0) * width + (x - self.x0)
    }

    /// Adds the finished samples of a wave to the tile, in the order of their indices.
    pub fn develop(&self, wave: &std::ops::Range<u32>, samples: &[PixelSample], tile: &mut FilmTile) {
        let width = (self.x1 - self.x0) as usize;
        let pixels = width * (self.y1 - self.y0) as usize;
        for (index, samples) in wave.clone().zip(samples.chunks_exact(pixels)) {
            for (i, sample) in samples.iter().enumerate() {
                tile.add(i % width, i / width, index, sample);
            }
        }
    }
}
