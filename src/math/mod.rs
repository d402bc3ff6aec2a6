//! Mathematics of a packet: wide vectors and frames, warps with their pdfs, tables, samplers.

pub mod alias;
pub mod sampler;
pub mod transpose;
pub mod warp;
pub mod wide;

pub use self::wide::{Compare, Frame, LANES, Mask, Permute, Pick, Rgb, Select, Vec3x, f32x16, lanes, splat};
