//! Statistical tests of the gradient-domain integrator on small scenes built in code: everything is estimated over
//! independent, fixed seeds and judged by z-scores that include the noise of the reference.

#[path = "../common/mod.rs"]
mod common;
mod differences;
mod failed_shifts;
mod invariants;
mod reconstruction;
