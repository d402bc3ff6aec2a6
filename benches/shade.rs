//! Time of shading a packet of sixteen: surface, BSDF sampling and evaluation, light sampling.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use gdpt::accel::Hits;
use gdpt::math::{LANES, Mask, Vec3x, f32x16, lanes, splat};
use gdpt::scene::{Environment, Instance, Material, Mesh, Scene, Texture, TextureRef, Wrap};
use gdpt::shade::{ShadeScene, Surface};
use glam::{Affine2, Affine3A, Vec2, Vec3, Vec3A, Vec4};
use std::f32::consts::FRAC_1_SQRT_2;
use std::hint::black_box;
use std::sync::Arc;

/// Triangles of the bench's mesh.
const TRIANGLES: u32 = 4096;

/// A field of separate triangles in the plane y = 0 with every attribute a mesh can have.
fn mesh(material: u32) -> Mesh {
    let corners: Vec<Vec2> = (0..TRIANGLES)
        .flat_map(|i| {
            let at = Vec2::new((i % 64) as f32, (i / 64) as f32);
            [at, at + Vec2::Y, at + Vec2::X]
        })
        .collect();
    Mesh {
        name: "field".into(),
        positions: corners.iter().map(|c| Vec3A::new(c.x, 0.0, c.y)).collect(),
        triangles: (0..TRIANGLES).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect::<Vec<_>>().into(),
        normals: Some(vec![Vec3::Y; corners.len()]),
        tangents: Some(vec![Vec4::new(1.0, 0.0, 0.0, 1.0); corners.len()]),
        uvs: [Some(corners.iter().map(|c| *c / 64.0).collect()), None],
        colors: None,
        material,
    }
}

/// Every pattern of bytes, so that filtering has work to do.
fn texture(srgb: bool) -> Texture {
    let texels: Vec<[u8; 4]> =
        (0..512_u32 * 512).map(|i| i.wrapping_mul(2_654_435_761).to_le_bytes()).collect();
    let texels: Arc<[[u8; 4]]> = texels.into();
    Texture { width: 512, height: 512, texels, srgb, wrap: [Wrap::Repeat; 2], linear_filter: true }
}

fn scene(material: Material, emission: Vec3) -> Scene {
    let lamp = Material { emission, ..Material::default() };
    let instance = |mesh, height: f32| Instance {
        mesh,
        to_world: Affine3A::from_translation(Vec3::new(0.0, height, 0.0)),
        is_identity: height == 0.0,
    };
    let sky = (0..512 * 256).map(|i| Vec3::splat(0.1 + (i % 97) as f32)).collect();
    Scene {
        meshes: vec![mesh(0), mesh(1)],
        instances: vec![instance(0, 0.0), instance(1, 5.0)],
        materials: vec![material, lamp],
        textures: vec![texture(true), texture(false)],
        environment: Some(Environment { width: 512, height: 256, texels: sky, rotation: 0.0, visible: true }),
        ..Scene::default()
    }
}

fn materials() -> [(&'static str, Material); 4] {
    let lambert = Material { metallic: 0.0, specular: 0.0, ..Material::default() };
    let of = |texture| Some(TextureRef { texture, uv_set: 0, transform: Affine2::IDENTITY });
    let layered = Material { specular: 1.0, roughness: 0.5, ..lambert.clone() };
    let textured = Material {
        base_color_texture: of(0),
        metallic: 1.0,
        metallic_roughness_texture: of(1),
        normal_texture: of(1),
        ..layered.clone()
    };
    let glass = Material { transmission: 1.0, is_solid: true, ..layered.clone() };
    [("lambert", lambert), ("layered", layered), ("textured", textured), ("rough_glass", glass)]
}

/// Hits scattered over the field.
fn hits() -> Hits {
    Hits {
        valid: Mask::ALL,
        t: splat(1.0),
        u: lanes(|i| i as f32 / 40.0),
        v: lanes(|i| 0.5 - i as f32 / 40.0),
        instance: [0; LANES],
        primitive: std::array::from_fn(|i| (i as u32 * 977) % TRIANGLES),
    }
}

/// Numbers in [0, 1) that differ by lane.
fn uniform(step: f32) -> f32x16 {
    lanes(|i| (0.31 + i as f32 * step).fract())
}

fn shade(c: &mut Criterion) {
    let mut group = c.benchmark_group("shade");
    group.throughput(Throughput::Elements(LANES as u64));
    let (u, v, w) = (uniform(0.618), uniform(0.755), uniform(0.57));
    let wo = Vec3x::splat(Vec3::new(0.6, FRAC_1_SQRT_2, 0.374).normalize());
    let wi = Vec3x::splat(Vec3::new(-0.3, 0.8, 0.1).normalize());
    for (name, material) in materials() {
        let scene = scene(material, Vec3::ONE);
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
    let (lamp, dark) = (scene(Material::default(), Vec3::ONE), scene(Material::default(), Vec3::ZERO));
    for (name, scene) in [("triangles_and_sky", &lamp), ("sky", &dark)] {
        let prepared = ShadeScene::new(scene);
        let p = Vec3x::splat(Vec3::new(3.0, 0.0, 4.0));
        group.bench_function(format!("light_sample/{name}"), |b| {
            b.iter(|| prepared.lights.sample(&prepared, black_box(u), v, w));
        });
        let point = prepared.lights.sample(&prepared, u, v, w);
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
