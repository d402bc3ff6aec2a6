//! Rows to columns: sixteen records of memory become sixteen lanes. Eight floats at a time, the width that
//! `wide` transposes in registers.

use super::{LANES, f32x16};
use wide::f32x8;

/// Sixteen floats that fill a cache line; a record of one lane.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct Line(pub [f32; LANES]);

impl Line {
    /// All zero.
    pub const ZERO: Self = Self([0.0; LANES]);
}

/// Column c of the result holds float c of each line.
#[inline(always)]
pub fn columns(lines: &[Line; LANES]) -> [f32x16; LANES] {
    let (a, b) = (half(lines, 0), half(lines, 8));
    std::array::from_fn(|c| if c < 8 { a[c] } else { b[c - 8] })
}

/// Columns `from..from + 8`.
#[inline(always)]
fn half(lines: &[Line; LANES], from: usize) -> [f32x16; 8] {
    let row = |i: usize| f32x8::new(std::array::from_fn(|c| lines[i].0[from + c]));
    let upper = f32x8::transpose(std::array::from_fn(row));
    let lower = f32x8::transpose(std::array::from_fn(|i| row(i + 8)));
    std::array::from_fn(|c| bytemuck::cast([upper[c], lower[c]]))
}
