//! Measures of error between images.
pub mod metrics;
