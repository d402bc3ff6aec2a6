//! Scenes that need no file. The Cornell box follows the measurements published by Cornell's Program of Computer
//! Graphics, in metres, with the usual RGB values for its paints and lamp; the lamp hangs 0.3 mm below the ceiling.

use super::{Camera, Instance, Material, Mesh, Projection, Scene};
use glam::{Affine3A, Mat3A, Vec3, Vec3A, Vec4};

/// Names that [`builtin`] knows.
pub const BUILTIN_NAMES: [&str; 1] = ["cornell-box"];

/// A scene built in code, by name.
pub fn builtin(name: &str) -> Option<Scene> {
    match name {
        "cornell-box" => Some(cornell_box()),
        _ => None,
    }
}

/// Four corners, counter-clockwise seen from the front, mm.
type Quad = [[f32; 3]; 4];

const FLOOR: Quad = [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]];
const CEILING: Quad = [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]];
const BACK: Quad = [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]];
const RIGHT: Quad = [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]];
const LEFT: Quad = [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]];
const LAMP: Quad =
    [[343.0, 548.5, 227.0], [343.0, 548.5, 332.0], [213.0, 548.5, 332.0], [213.0, 548.5, 227.0]];
const SHORT_BLOCK: Quad =
    [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]];
const TALL_BLOCK: Quad =
    [[423.0, 330.0, 247.0], [265.0, 330.0, 296.0], [314.0, 330.0, 456.0], [472.0, 330.0, 406.0]];

fn cornell_box() -> Scene {
    let paint = |name: &str, rgb: [f32; 3]| Material {
        name: name.into(),
        base_color: Vec3::from_array(rgb).extend(1.0),
        metallic: 0.0,
        specular: 0.0,
        ..Material::default()
    };
    let lamp = Material {
        base_color: Vec4::new(0.0, 0.0, 0.0, 1.0),
        emission: Vec3::new(17.0, 12.0, 4.0),
        ..paint("lamp", [0.0; 3])
    };
    let materials = vec![
        paint("white", [0.725, 0.71, 0.68]),
        paint("red", [0.63, 0.065, 0.05]),
        paint("green", [0.14, 0.45, 0.091]),
        lamp,
    ];
    let mut short = vec![SHORT_BLOCK];
    short.extend(sides(SHORT_BLOCK));
    let mut tall = vec![TALL_BLOCK];
    tall.extend(sides(TALL_BLOCK));
    let meshes = vec![
        mesh("walls", 0, &[FLOOR, CEILING, BACK]),
        mesh("left wall", 1, &[LEFT]),
        mesh("right wall", 2, &[RIGHT]),
        mesh("short block", 0, &short),
        mesh("tall block", 0, &tall),
        mesh("lamp", 3, &[LAMP]),
    ];
    let instance = |mesh| Instance { mesh, to_world: Affine3A::IDENTITY, is_identity: true };
    let instances = (0..meshes.len() as u32).map(instance).collect();
    // It looks along +z: a half turn about y. 25 mm of sensor behind a lens of 35 mm.
    let camera = Camera {
        name: "camera".into(),
        to_world: Affine3A {
            matrix3: Mat3A::from_cols(Vec3A::NEG_X, Vec3A::Y, Vec3A::NEG_Z),
            translation: Vec3A::new(0.278, 0.273, -0.8),
        },
        projection: Projection::Perspective { yfov: 2.0 * (12.5f32 / 35.0).atan() },
        lens_radius: 0.0,
        focus_distance: 1.0,
    };
    Scene { meshes, instances, materials, cameras: vec![camera], ..Scene::default() }
}

/// The four faces below a top face, down to the floor.
fn sides(top: Quad) -> [Quad; 4] {
    let [a, b, c, d] = top;
    let down = |p: [f32; 3]| [p[0], 0.0, p[2]];
    [(a, b), (b, c), (c, d), (d, a)].map(|(p, q)| [q, p, down(p), down(q)])
}

fn mesh(name: &str, material: u32, quads: &[Quad]) -> Mesh {
    let positions = quads.iter().flatten().map(|&p| Vec3A::from_array(p) * 1e-3).collect();
    let triangles =
        (0..quads.len() as u32).flat_map(|q| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i: u32| 4 * q + i)));
    Mesh {
        name: name.into(),
        positions,
        triangles: triangles.collect(),
        normals: None,
        tangents: None,
        uvs: [None, None],
        colors: None,
        material,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_of_the_room_look_inwards_and_of_blocks_outwards() {
        let scene = builtin("cornell-box").expect("it is built in");
        scene.validate().expect("it is valid");
        assert_eq!(scene.triangle_count(), 32);
        for mesh in &scene.meshes {
            let is_block = mesh.name.ends_with("block");
            let n = mesh.positions.len() as f32;
            let own = mesh.positions.iter().copied().sum::<Vec3A>() / n;
            let centre = if is_block { own } else { Vec3A::splat(0.28) };
            for t in mesh.triangles.iter() {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                let outward = (b - a).cross(c - a).dot((a + b + c) / 3.0 - centre) > 0.0;
                assert_eq!(outward, is_block, "{} {t:?}", mesh.name);
            }
        }
        assert!(builtin("teapot").is_none());
    }
}
