//! gdpt: gradient-domain path tracing on Intel Embree 4, sixteen rays at a time.
//!
//! A scene file becomes plain data (`scene`), the data an acceleration structure (`accel`); an
//! integrator (`integrate`) walks paths through it (`path`, `shade`) and fills a film (`film`) with an estimate of
//! the image and of its horizontal and vertical differences; a screened Poisson solve (`reconstruct`) finds the
//! image that fits both; `store` writes it. [`render`] is the table of contents.
#![forbid(unsafe_code)]

pub mod accel;
pub mod analyze;
pub mod cli;
pub mod denoise;
pub mod error;
pub mod film;
pub mod integrate;
pub mod math;
pub mod path;
pub mod reconstruct;
pub mod render;
pub mod scene;
pub mod shade;
pub mod store;
pub mod study;
