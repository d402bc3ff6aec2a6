//! Inputs of the small benches: surfaces to shade, vertices to shift, noisy planes to solve, samples to merge.

use gdpt::accel::Hits;
use gdpt::film::{Buffers, Measured, PixelSample, Plane};
use gdpt::math::{Frame, LANES, Mask, Vec3x, f32x16, lanes, splat};
use gdpt::reconstruct::{Input, Method};
use gdpt::scene::{Environment, Instance, Material, Mesh, Scene, Texture, TextureRef, Wrap};
use gdpt::shade::{Bsdf, Surface};
use glam::{Affine2, Affine3A, Vec2, Vec3, Vec3A, Vec4};
use std::sync::Arc;

/// Triangles of the field.
const TRIANGLES: u32 = 4096;

/// A field of separate triangles in the plane y = 0 with every attribute a mesh can have.
fn field(material: u32) -> Mesh {
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

/// A field of `material` under one of lamps that emit `emission`, and a sky.
pub fn fields(material: Material, emission: Vec3) -> Scene {
    let lamp = Material { emission, ..Material::default() };
    let instance = |mesh, height: f32| Instance {
        mesh,
        to_world: Affine3A::from_translation(Vec3::new(0.0, height, 0.0)),
        is_identity: height == 0.0,
    };
    let sky = (0..512 * 256).map(|i| Vec3::splat(0.1 + (i % 97) as f32)).collect();
    Scene {
        meshes: vec![field(0), field(1)],
        instances: vec![instance(0, 0.0), instance(1, 5.0)],
        materials: vec![material, lamp],
        textures: vec![texture(true), texture(false)],
        environment: Some(Environment { width: 512, height: 256, texels: sky, rotation: 0.0, visible: true }),
        ..Scene::default()
    }
}

/// Materials by name, from plain to costly; their textures are those of [`fields`].
pub fn materials() -> [(&'static str, Material); 4] {
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
pub fn hits() -> Hits {
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
pub fn uniform(step: f32) -> f32x16 {
    lanes(|i| (0.31 + i as f32 * step).fract())
}

/// Sixteen surfaces on a wavy plane, which `phase` shifts.
pub fn vertex(phase: f32) -> Surface {
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

/// Roughly normal noise from a hash of the pixel, twenty times as strong in one pixel of a hundred.
fn noise(x: usize, y: usize, salt: u64) -> f32 {
    let mut z = ((y as u64) << 32 | x as u64).wrapping_add(salt << 56).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    let bytes = (z ^ (z >> 31)).to_le_bytes();
    let sum: f32 = bytes[..6].iter().map(|b| f32::from(*b) / 128.0 - 1.0).sum();
    if bytes[7] < 3 { 20.0 * sum } else { sum }
}

/// A chequered image and its differences, noisy, in two halves.
pub fn noisy_buffers(width: usize, height: usize) -> Buffers {
    let value = |x: usize, y: usize| if (x / 40 + y / 33).is_multiple_of(2) { 0.9 } else { 0.2f32 };
    let half = |first_salt: u64| {
        let difference = |sx: usize, sy: usize, salt: u64| {
            Plane::from_fn(width, height, |x, y| {
                [value(x + sx, y + sy) - value(x, y) + 0.07 * noise(x, y, first_salt + salt); 3]
            })
        };
        Measured {
            primal: Plane::from_fn(width, height, |x, y| [value(x, y) + 0.42 * noise(x, y, first_salt); 3]),
            dx: difference(1, 0, 1),
            dy: difference(0, 1, 2),
        }
    };
    let halves = [half(1), half(4)];
    let mean = |plane: fn(&Measured) -> &Plane| {
        let [a, b] = halves.each_ref().map(plane);
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
        Plane { width, height, data: a.data.iter().zip(&b.data).map(mean).collect() }
    };
    let all = Measured { primal: mean(|m| &m.primal), dx: mean(|m| &m.dx), dy: mean(|m| &m.dy) };
    Buffers { all, halves: Some(halves), direct: Plane::new(width, height), features: None }
}

/// What `method` needs of the buffers, and no more: halves cost two more solves, which estimate the error.
pub fn problem(buffers: &Buffers, method: Method) -> Input<'_> {
    if method == Method::Weighted { Input::from(buffers) } else { Input::new(&buffers.all) }
}

/// A sample with all its parts.
pub fn sample(i: usize) -> PixelSample {
    let value = 0.1 + (i % 17) as f32;
    PixelSample {
        primal: [value, 0.5, 0.25],
        direct: [0.0, value, 0.0],
        gradient: [[value, 0.0, -value]; 4],
        depth: value,
        normal: [0.0, 0.6, 0.8],
        position: [value; 3],
        albedo: [0.7; 3],
    }
}
