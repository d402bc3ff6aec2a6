//! What the benches share: scenes, alternating measurements, the table, the kernels whose instructions are counted
//! and the comparison with what is stored.
//!
//! A crate of its own, because every bench is a program of its own, and because the counted kernels are compiled once
//! more for another CPU: their build should not wait for what only the benches need.

pub mod expected;
pub mod fixtures;
pub mod kernels;
pub mod measure;
pub mod rays;
pub mod render;
pub mod replay;
pub mod scenes;
pub mod shapes;
pub mod table;
