//! Time of small whole renders: path tracing and gradient-domain path tracing on both backends, with all threads (the
//! table has the ratios and the errors). Scenes: the built-in Cornell box, and Sponza where `../shared/scenes` has it.

use criterion::{Criterion, criterion_group, criterion_main};
use gdpt::integrate::Kind;
use gdpt_bench::render::{Backend, Bed, cpus, pool, settings};
use gdpt_bench::scenes;

fn render(c: &mut Criterion) {
    let pool = pool(cpus());
    for name in [scenes::BUILTIN, "sponza"] {
        let scene = match scenes::open(name) {
            Ok(scene) => scene.scene,
            Err(why) => {
                println!("skipped: {why}");
                continue;
            }
        };
        let bed = Bed::new(&scene);
        let mut group = c.benchmark_group(format!("render/{name}"));
        group.sample_size(10);
        for (kind, label) in [(Kind::Path, "PT"), (Kind::GradientPath, "G-PT")] {
            let settings = settings(kind, [128, 128], 4, 0);
            for backend in [Backend::Embree, Backend::Obvhs] {
                let run = || pool.install(|| bed.render(backend, &settings));
                group.bench_function(format!("{label} {backend:?}"), |b| b.iter(run));
            }
        }
        group.finish();
    }
}

criterion_group!(benches, render);
criterion_main!(benches);
