//! Small scenes in code.

use crate::Random;
use gdpt::accel::Hits;
use gdpt::math::{LANES, Mask, Vec3x, f32x16, splat};
use gdpt::scene::{Instance, Material, Mesh, Scene, Texture, TextureRef, Wrap};
use gdpt::shade::{LightPoint, Receiver, ShadeScene};
use glam::{Affine2, Affine3A, Vec2, Vec3, Vec3A, Vec4};
use std::sync::Arc;

/// A material that only reflects diffusely.
pub fn matte() -> Material {
    Material { metallic: 0.0, specular: 0.0, ..Material::default() }
}

/// The unit square of the plane z = 0 from (0, 0) to (1, 1), front towards +z, uv = (x, y).
pub fn square(material: u32) -> Mesh {
    let corners = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    Mesh {
        name: "square".into(),
        positions: corners.iter().map(|c| Vec3A::new(c.x, c.y, 0.0)).collect(),
        triangles: Arc::new([[0, 1, 2], [0, 2, 3]]),
        normals: None,
        tangents: None,
        uvs: [Some(corners.to_vec()), Some(corners.map(|c| c * 2.0).to_vec())],
        colors: None,
        material,
    }
}

/// Adds a mesh with one placement.
pub fn place(scene: &mut Scene, mesh: Mesh, to_world: Affine3A) {
    scene.instances.push(Instance {
        mesh: scene.meshes.len() as u32,
        to_world,
        is_identity: to_world == Affine3A::IDENTITY,
    });
    scene.meshes.push(mesh);
}

/// One square of one material, moved by `to_world`.
pub fn one_square(material: Material, to_world: Affine3A) -> Scene {
    let mut scene = Scene { materials: vec![material], ..Scene::default() };
    place(&mut scene, square(0), to_world);
    scene
}

/// The same receiver in all lanes; light counts that arrives on the side of `n`.
pub fn receiver(p: Vec3, n: Vec3) -> Receiver {
    Receiver { p: Vec3x::splat(p), n: Vec3x::splat(n), both_sides: Mask::NONE }
}

/// Sixteen light points for `from`.
pub fn sample(scene: &ShadeScene, from: &Receiver, random: &mut Random) -> LightPoint {
    scene.lights.sample(scene, from, Mask::ALL, random.wide(), random.wide(), random.wide())
}

/// The same hit in all lanes.
pub fn hit(instance: u32, primitive: u32, u: f32, v: f32) -> Hits {
    hits(instance, primitive, splat(u), splat(v))
}

/// Hits all over one triangle.
pub fn hits(instance: u32, primitive: u32, u: f32x16, v: f32x16) -> Hits {
    Hits { valid: Mask::ALL, t: splat(1.0), u, v, instance: [instance; LANES], primitive: [primitive; LANES] }
}

/// A texture from its texels.
pub fn texture(width: u32, texels: &[[u8; 4]], srgb: bool, linear_filter: bool) -> Texture {
    Texture {
        width,
        height: texels.len() as u32 / width,
        texels: texels.into(),
        srgb,
        wrap: [Wrap::Repeat; 2],
        linear_filter,
    }
}

/// The first texture by the first coordinates.
pub fn reference() -> TextureRef {
    TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY }
}

/// A material that emits.
pub fn emitter(radiance: Vec3) -> Material {
    Material { emission: radiance, base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..matte() }
}

/// Area pdf for `from` of a triangle of instance `instance` that lies in a plane of constant z: a ray of length 1
/// that meets it at right angles.
pub fn area_pdf(scene: &ShadeScene, from: &Receiver, instance: u32, primitive: u32) -> f64 {
    let hits = hit(instance, primitive, 0.2, 0.3);
    let pdf = scene.lights.hit_pdf(from, &hits, Vec3x::splat(Vec3::Z), Mask::ALL);
    f64::from(pdf.as_array()[0])
}
