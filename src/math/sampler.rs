//! Stateless samples: a random number is a pure function of (seed, pixel or block, sample index, dimension), so
//! that any sample can be replayed, split over machines or resumed.
//!
//! Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen Scrambling") in padded sets of four
//! dimensions; every stream (pixel or block) scrambles with a seed of its own.

use super::{LANES, f32x16, lanes};

/// Mixes two words into one (the finaliser of PCG-XSH-RR's successor, "lowbias32" by Wellons, twice).
#[inline(always)]
pub fn hash(a: u32, b: u32) -> u32 {
    let mut x = a ^ b.wrapping_mul(0x9e37_79b9).rotate_left(15);
    for _ in 0..2 {
        x ^= x >> 16;
        x = x.wrapping_mul(0x7feb_352d);
        x ^= x >> 15;
        x = x.wrapping_mul(0x846c_a68b);
        x ^= x >> 16;
    }
    x
}

/// What a stream of samples belongs to: a pixel, or a block of 4×4 pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// The pixel at column x, row y.
    Pixel(u32, u32),
    /// The block at block column x, block row y.
    Block(u32, u32),
}

impl Stream {
    /// The scrambling seed of this stream.
    pub fn seed(self, seed: u64) -> u32 {
        let (x, y, salt) = match self {
            Self::Pixel(x, y) => (x, y, 0x70_69_78),
            Self::Block(x, y) => (x, y, 0x62_6c_6b),
        };
        hash(hash(hash(hash(seed as u32, (seed >> 32) as u32), salt), x), y)
    }
}

/// Samples that one scramble can hold; sample indices beyond start a new, independent scramble.
const SEQUENCE: u32 = 1 << 16;

/// Four dimensions of one sample, each in [0, 1): dimensions `4 set .. 4 set + 4` of sample `index` of a stream.
#[inline]
pub fn sample_4d(stream_seed: u32, index: u32, set: u32) -> [f32; 4] {
    // Each set is a four-dimensional sequence of its own, decorrelated by its scramble (padding).
    let scramble = hash(stream_seed, set.wrapping_add((index / SEQUENCE).wrapping_mul(0x1_0001)));
    sobol_burley::sample_4d(index % SEQUENCE, 0, scramble)
}

/// [`sample_4d`] for sixteen lanes, each with its own stream and sample index.
#[inline]
pub fn sample_4d_wide(stream_seeds: &[u32; LANES], indices: &[u32; LANES], set: u32) -> [f32x16; 4] {
    let points: [[f32; 4]; LANES] = std::array::from_fn(|i| sample_4d(stream_seeds[i], indices[i], set));
    std::array::from_fn(|d| lanes(|i| points[i][d]))
}
