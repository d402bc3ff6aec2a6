//! Small scenes in code.

use gdpt::accel::Hits;
use gdpt::math::{LANES, Mask, f32x16, splat};
use gdpt::scene::{Instance, Material, Mesh, Scene, Texture, TextureRef, Wrap};
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
