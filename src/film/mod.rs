//! The film: what an integrator measured, pixel by pixel, and what a solver needs of it.
//!
//! Every write of a sample goes to its own pixel: the four one-sided gradient sums live at the base pixel, and the
//! differences dx, dy are formed once, before the solve. No races, no atomics: tiles merge in any order to the same
//! bits.

pub mod plane;

pub use plane::Plane;
