//! Rays a second on one thread, by kind of ray and packet width, packet by packet (the table has the ratios).
//!
//! Two scenes: 1.3 million triangles of dented balls in a room, and Sponza where `../shared/scenes` has it.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gdpt::math::LANES;
use gdpt_bench::rays::{Bed, METHODS};
use gdpt_bench::{scenes, shapes};
use std::hint::black_box;
use std::time::Duration;

/// Of the packets of an image, every so manieth is timed.
const THINNING: usize = 8;

fn accel(criterion: &mut Criterion) {
    let mut beds = vec![("balls", Bed::new(&shapes::balls(142, 72), [512, 384]))];
    match scenes::open("sponza") {
        Ok(sponza) => beds.push((sponza.name, Bed::new(&sponza.scene, sponza.size))),
        Err(why) => println!("skipped: {why}"),
    }
    for (name, bed) in &beds {
        for kind in &bed.kinds {
            let packets = || kind.packets.iter().step_by(THINNING);
            let mut group = criterion.benchmark_group(format!("accel/{name}/{}", kind.name));
            group.throughput(Throughput::Elements((packets().count() * LANES) as u64));
            group.sample_size(10).measurement_time(Duration::from_millis(500));
            group.warm_up_time(Duration::from_millis(100));
            for (name, method) in METHODS {
                group.bench_function(name, |b| b.iter(|| black_box(bed.trace_all(method, kind, packets()))));
            }
        }
    }
}

criterion_group!(benches, accel);
criterion_main!(benches);
