//! Wall time of the L2 and the L1 solve at 256² and 1920×1080, α = 0.2, on white noise with one outlier in a hundred.

use criterion::{Criterion, criterion_group, criterion_main};
use gdpt::film::{Measured, Plane};
use gdpt::reconstruct::{Alpha, Input, Method, reconstruct};
use std::hint::black_box;

/// Roughly normal noise from a hash of the pixel, twenty times as strong in one pixel of a hundred.
fn noise(x: usize, y: usize, salt: u64) -> f32 {
    let mut z = ((y as u64) << 32 | x as u64).wrapping_add(salt << 56).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let bytes = (z ^ (z >> 31)).to_le_bytes();
    let sum: f32 = bytes[..6].iter().map(|b| f32::from(*b) / 128.0 - 1.0).sum();
    if bytes[7] < 3 { 20.0 * sum } else { sum }
}

fn solvers(c: &mut Criterion) {
    for (width, height) in [(256, 256), (1920, 1080)] {
        let value = |x: usize, y: usize| if (x / 40 + y / 33).is_multiple_of(2) { 0.9 } else { 0.2f32 };
        let primal = Plane::from_fn(width, height, |x, y| [value(x, y) + 0.3 * noise(x, y, 1); 3]);
        let difference = |sx: usize, sy: usize, salt: u64| {
            Plane::from_fn(width, height, |x, y| {
                [value(x + sx, y + sy) - value(x, y) + 0.05 * noise(x, y, salt); 3]
            })
        };
        let (dx, dy) = (difference(1, 0, 2), difference(0, 1, 3));
        let measured = Measured { primal, dx, dy };
        let input = Input::new(&measured);
        let mut group = c.benchmark_group(format!("reconstruct {width}x{height}"));
        group.sample_size(10);
        group.bench_function("L2", |b| {
            b.iter(|| black_box(reconstruct(&input, Method::L2, Alpha::Fixed(0.2))))
        });
        group.bench_function("L1", |b| {
            b.iter(|| black_box(reconstruct(&input, Method::L1, Alpha::Fixed(0.2))))
        });
        group.finish();
    }
}

criterion_group!(benches, solvers);
criterion_main!(benches);
