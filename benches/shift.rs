//! The shift's arithmetic, a packet of sixteen pairs at a time: half-vector copies and reconnections.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gdpt::math::{LANES, Mask, Vec3x, lanes};
use gdpt::path::shift::{PairWeights, half_vector, reconnect};
use gdpt_bench::fixtures::vertex;
use std::hint::black_box;

fn shift(c: &mut Criterion) {
    let (x, y, z) = (vertex(0.0), vertex(0.02), vertex(3.0));
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
