//! Paths: how sixteen of them are traced, lit and continued, and how a path is shifted to a neighbouring pixel.
//!
//! Vertex x_k is the k-th surface a path meets, x_1 the one the camera sees. `beta` is throughput ÷ pdf, Russian
//! roulette included; every pdf is in solid angle (sr⁻¹) unless its name says otherwise.

pub mod bounce;
pub mod direct;
pub mod queue;
pub mod shift;
#[cfg(test)]
mod shift_tests;
pub mod tail;
pub mod trace;

use crate::math::sampler::sample_4d_wide;
use crate::math::{LANES, f32x16};

/// Bounds on the length of a path.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Longest path in vertices after the camera: 1 is emitters seen directly, 2 direct light.
    pub max_depth: u32,
    /// First vertex after which Russian roulette may end a path.
    pub rr_depth: u32,
}

/// Which random numbers the lanes of a packet draw: a stream (a pixel's scramble) and a sample index a lane.
#[derive(Clone, Copy, Debug)]
pub struct Streams {
    /// Scrambling seed of each lane's pixel.
    pub seeds: [u32; LANES],
    /// Sample index of each lane.
    pub indices: [u32; LANES],
}

impl Streams {
    /// Light choice and position at vertex `depth`: (select, u, v, unused).
    #[inline(always)]
    pub fn light(&self, depth: u32) -> [f32x16; 4] {
        sample_4d_wide(&self.seeds, &self.indices, 2 * depth)
    }

    /// Continuation at vertex `depth`: (lobe, u, v, Russian roulette).
    #[inline(always)]
    pub fn scatter(&self, depth: u32) -> [f32x16; 4] {
        sample_4d_wide(&self.seeds, &self.indices, 2 * depth + 1)
    }
}
