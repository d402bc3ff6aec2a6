//! What images and buffers say about error.

pub mod flip;
pub mod metrics;
