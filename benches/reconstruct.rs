//! Time of the solves at 256² and 1920×1080, α = 0.2, on white noise with one outlier in a hundred.

use criterion::{Criterion, criterion_group, criterion_main};
use gdpt::reconstruct::{Input, reconstruct};
use gdpt_bench::fixtures::noisy_buffers;
use gdpt_bench::kernels::{ALPHA, SOLVERS};
use std::hint::black_box;

fn solvers(c: &mut Criterion) {
    for (width, height) in [(256, 256), (1920, 1080)] {
        let buffers = noisy_buffers(width, height);
        let input = Input::from(&buffers);
        let mut group = c.benchmark_group(format!("reconstruct {width}x{height}"));
        group.sample_size(10);
        for (name, method) in SOLVERS {
            group.bench_function(name, |b| b.iter(|| black_box(reconstruct(&input, method, ALPHA))));
        }
        group.finish();
    }
}

criterion_group!(benches, solvers);
criterion_main!(benches);
