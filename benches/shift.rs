//! The shift's arithmetic, a packet of sixteen pairs at a time: half-vector copies and reconnections.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gdpt::math::{Frame, LANES, Mask, Vec3x, lanes};
use gdpt::path::shift::{PairWeights, half_vector, reconnect};
use gdpt::shade::{Bsdf, Surface};
use std::hint::black_box;

/// Sixteen surfaces on a wavy plane, `phase` shifts them.
fn surface(phase: f32) -> Surface {
    let x = lanes(|i| i as f32 * 0.1 + phase);
    let n = Vec3x::new(
        lanes(|i| 0.1 * (i as f32 + phase).sin()),
        lanes(|i| 0.1 * (i as f32).cos()),
        lanes(|_| 1.0),
    );
    let n = n.normalize();
    let mut surface = Surface::default();
    surface.p = Vec3x::new(x, lanes(|i| i as f32 * 0.05), lanes(|_| phase));
    surface.ng = n;
    surface.wo = Vec3x::new(lanes(|_| 0.3), lanes(|_| phase * 0.1), lanes(|_| 0.9)).normalize();
    surface.bsdf = Bsdf::black(Frame::from_normal(n));
    surface
}

fn shift(c: &mut Criterion) {
    let (x, y, z) = (surface(0.0), surface(0.02), surface(3.0));
    let wi = Vec3x::new(lanes(|_| -0.2), lanes(|_| 0.1), lanes(|_| 0.9)).normalize();
    let mut group = c.benchmark_group("shift");
    group.throughput(Throughput::Elements(LANES as u64));
    group.bench_function("half_vector reflection", |b| {
        b.iter(|| half_vector(black_box(&x), black_box(wi), black_box(&y), Mask::NONE));
    });
    group.bench_function("half_vector transmission", |b| {
        b.iter(|| half_vector(black_box(&x), black_box(-wi), black_box(&y), Mask::ALL));
    });
    group.bench_function("reconnect", |b| {
        b.iter(|| reconnect(black_box(&x), black_box(&y), black_box(&z)));
    });
    let weights = PairWeights { mis: true };
    group.bench_function("pair weight", |b| {
        b.iter(|| weights.weight(black_box(lanes(|i| 1.0 + i as f32)), black_box(lanes(|i| i as f32))));
    });
    group.finish();
}

criterion_group!(benches, shift);
criterion_main!(benches);
