//! What images and buffers say about error.

pub mod metrics;
