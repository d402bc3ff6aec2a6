//! Time of shading a packet of sixteen: surface, BSDF sampling and evaluation, light sampling.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gdpt::math::{LANES, Mask, Vec3x};
use gdpt::scene::Material;
use gdpt::shade::{Receiver, ShadeScene, Surface};
use gdpt_bench::fixtures::{fields, hits, materials, uniform};
use glam::Vec3;
use std::f32::consts::FRAC_1_SQRT_2;
use std::hint::black_box;

fn shade(c: &mut Criterion) {
    let mut group = c.benchmark_group("shade");
    group.throughput(Throughput::Elements(LANES as u64));
    let (u, v, w) = (uniform(0.618), uniform(0.755), uniform(0.57));
    let wo = Vec3x::splat(Vec3::new(0.6, FRAC_1_SQRT_2, 0.374).normalize());
    let wi = Vec3x::splat(Vec3::new(-0.3, 0.8, 0.1).normalize());
    for (name, material) in materials() {
        let scene = fields(material, Vec3::ONE);
        let prepared = ShadeScene::new(&scene);
        let hits = hits();
        group.bench_function(format!("surface/{name}"), |b| {
            b.iter(|| Surface::new(&prepared, black_box(&hits), Mask::ALL, wo));
        });
        let bsdf = Surface::new(&prepared, &hits, Mask::ALL, wo).bsdf;
        group.bench_function(format!("sample/{name}"), |b| {
            b.iter(|| black_box(&bsdf).sample(wo, u, v, w, Mask::ALL));
        });
        group.bench_function(format!("eval/{name}"), |b| {
            b.iter(|| black_box(&bsdf).eval(wo, black_box(wi)));
        });
    }
    let (lamp, dark) = (fields(Material::default(), Vec3::ONE), fields(Material::default(), Vec3::ZERO));
    for (name, scene) in [("triangles_and_sky", &lamp), ("sky", &dark)] {
        let prepared = ShadeScene::new(scene);
        let p = Vec3x::splat(Vec3::new(3.0, 0.0, 4.0));
        let from = Receiver { p, n: Vec3x::splat(Vec3::Y), both_sides: Mask::NONE };
        group.bench_function(format!("light_sample/{name}"), |b| {
            b.iter(|| prepared.lights.sample(&prepared, &from, Mask::ALL, black_box(u), v, w));
        });
        let point = prepared.lights.sample(&prepared, &from, Mask::ALL, u, v, w);
        group.bench_function(format!("light_seen/{name}"), |b| {
            b.iter(|| prepared.lights.seen_from(&prepared, black_box(&point), p));
        });
        group.bench_function(format!("environment/{name}"), |b| {
            b.iter(|| prepared.lights.environment_with_pdf(black_box(wi)));
        });
    }
    group.finish();
}

criterion_group!(benches, shade);
criterion_main!(benches);
