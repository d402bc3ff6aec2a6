//! The scenes of the statistical tests, each built in code to isolate one rule of the shift. Images are tiny, of
//! sizes that are not multiples of a block, so that many seeds fit.

mod dielectric;
mod lit;
mod material;

pub use dielectric::*;
pub use lit::*;
pub use material::*;

use gdpt::scene::{Camera, Scene};

/// A scene with what it takes to render it.
pub struct TestScene {
    /// For messages.
    pub name: &'static str,
    /// The scene.
    pub scene: Scene,
    /// The camera.
    pub camera: Camera,
    /// Size of the image.
    pub size: [u32; 2],
    /// Longest path.
    pub max_depth: u32,
    /// GGX alpha at or below which a lobe is glossy for the shift.
    pub shift_threshold: f32,
    /// Samples a pixel of one gradient render.
    pub spp: u32,
    /// Samples a pixel of one render of the reference.
    pub reference_spp: u32,
}

impl TestScene {
    /// A scene with the usual settings.
    pub fn new(name: &'static str, scene: Scene, camera: Camera, max_depth: u32) -> Self {
        Self {
            name,
            scene,
            camera,
            size: [13, 10],
            max_depth,
            shift_threshold: 0.001,
            spp: 32,
            reference_spp: 128,
        }
    }

    /// Other numbers of samples.
    pub fn samples(self, spp: u32, reference_spp: u32) -> Self {
        Self { spp, reference_spp, ..self }
    }

    /// Another threshold of the shift.
    pub fn threshold(self, shift_threshold: f32) -> Self {
        Self { shift_threshold, ..self }
    }
}
