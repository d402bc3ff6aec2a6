//! What images and buffers say about error: measures ([`metrics`], [`flip`]), the frequency model of the solve
//! ([`model`]), measured noise against it ([`noise`], [`spectrum`], [`moments`]), and pictures of all that
//! ([`plot`]).

pub mod flip;
pub mod metrics;
pub mod model;
pub mod moments;
pub mod noise;
pub mod plot;
pub mod spectrum;
