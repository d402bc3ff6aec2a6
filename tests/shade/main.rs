//! Statistical tests of shading: warps (S1), BSDFs (S2), lights (S3), and what surfaces gather.
//!
//! Seeds are fixed. A chi² test fails below the significance 0.01, shared out over all its cells (Šidák).

mod bsdf;
mod bsdf_properties;
mod chi_square;
mod environment;
mod light_tree;
mod lights;
mod scenes;
mod surface;
mod textures;
mod warps;

use gdpt::math::sampler::hash;
use gdpt::math::{LANES, Vec3x, f32x16};

/// Independent uniform numbers: a counter, hashed.
pub struct Random {
    seed: u32,
    counter: u32,
}

impl Random {
    /// A stream of its own for each seed.
    pub fn new(seed: u32) -> Self {
        Self { seed, counter: 0 }
    }

    /// In [0, 1), a multiple of 2⁻²⁴.
    pub fn float(&mut self) -> f32 {
        self.counter += 1;
        (hash(hash(self.seed, 0x7368_6164), self.counter) >> 8) as f32 / (1 << 24) as f32
    }

    /// Sixteen of them.
    pub fn wide(&mut self) -> f32x16 {
        let values: [f32; LANES] = std::array::from_fn(|_| self.float());
        f32x16::new(values)
    }

    /// Unit vectors in all directions.
    pub fn directions(&mut self) -> Vec3x {
        let (u, v) = (self.wide(), self.wide());
        Vec3x::lanes(|i| {
            let z = 1.0 - 2.0 * u.as_array()[i];
            let r = (1.0 - z * z).max(0.0).sqrt();
            let (sin, cos) = (std::f32::consts::TAU * v.as_array()[i]).sin_cos();
            glam::Vec3::new(r * cos, r * sin, z).normalize()
        })
    }
}
