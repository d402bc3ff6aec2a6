//! Scenes built in code: dented balls in a lit room, merged or instanced; floors under many lamps. Lengths in m.

use gdpt::math::sampler::hash;
use gdpt::scene::{Camera, Instance, Material, Mesh, Projection, Scene};
use glam::{Affine3A, Mat3, Vec3, Vec3A};
use std::f32::consts::{PI, TAU};

/// A number in [0, 1) for (what, which).
pub fn unit(a: u32, b: u32) -> f32 {
    (hash(a, b) >> 8) as f32 / (1u32 << 24) as f32
}

/// Triangles under construction.
#[derive(Default)]
struct Triangles {
    positions: Vec<Vec3A>,
    indices: Vec<[u32; 3]>,
}

impl Triangles {
    /// A ball around `centre` whose dents depend on `salt`.
    fn ball(&mut self, centre: Vec3A, radius: f32, [columns, rows]: [u32; 2], salt: f32) {
        let first = self.positions.len() as u32;
        for row in 0..=rows {
            for column in 0..=columns {
                let (theta, phi) = (PI * row as f32 / rows as f32, TAU * column as f32 / columns as f32);
                let n = Vec3A::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
                let dent = (9.0 * n.x + salt).sin() * (8.0 * n.y).sin() * (7.0 * n.z).cos();
                self.positions.push(centre + n * (radius * (1.0 + 0.14 * dent)));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = first + row * (columns + 1) + column;
                let b = a + columns + 1;
                self.indices.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
            }
        }
    }

    /// The six walls of the cube [low, low + size]³, seen from inside.
    fn room(&mut self, low: f32, size: f32) {
        let corner = |i: u32| Vec3A::from_array([0, 1, 2].map(|axis| low + size * (i >> axis & 1) as f32));
        for quad in [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]] {
            self.quad(quad.map(corner));
        }
    }

    fn quad(&mut self, corners: [Vec3A; 4]) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }

    fn mesh(self, name: &str, material: u32) -> Mesh {
        Mesh {
            name: name.into(),
            positions: self.positions.into(),
            triangles: self.indices.into(),
            normals: None,
            tangents: None,
            uvs: [None, None],
            colors: None,
            material,
        }
    }
}

/// Matt grey, and a lamp that shines from both sides with the same power whatever its area, m², is.
fn materials(lamp_area: f32) -> Vec<Material> {
    let matt = Material {
        base_color: Vec3::splat(0.6).extend(1.0),
        metallic: 0.0,
        specular: 0.0,
        ..Material::default()
    };
    let lamp = Material { emission: Vec3::splat(10.0 / lamp_area), double_sided: true, ..matt.clone() };
    vec![matt, lamp]
}

fn camera(eye: Vec3, target: Vec3, yfov: f32) -> Camera {
    let back = (eye - target).normalize();
    let right = Vec3::Y.cross(back).normalize();
    Camera {
        name: String::new(),
        to_world: Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), eye),
        projection: Projection::Perspective { yfov },
        lens_radius: 0.0,
        focus_distance: 1.0,
    }
}

fn in_place(mesh: u32) -> Instance {
    Instance { mesh, to_world: Affine3A::IDENTITY, is_identity: true }
}

/// The room for balls at integer positions 0 to `grid` − 1 along each axis, its lamp and a camera in a corner.
fn room(grid: u32) -> Scene {
    let (low, size) = (-1.0, grid as f32 + 1.0);
    let (mut walls, mut lamp) = (Triangles::default(), Triangles::default());
    walls.room(low, size);
    let (a, b, y) = (low + 0.4 * size, low + 0.6 * size, low + 0.99 * size);
    lamp.quad([[a, a], [a, b], [b, b], [b, a]].map(|[x, z]| Vec3A::new(x, y, z)));
    let middle = Vec3::splat(0.5 * (grid as f32 - 1.0));
    let eye = Vec3::new(low + 0.1, middle.y + 0.7, grid as f32 - 0.2);
    Scene {
        meshes: vec![walls.mesh("walls", 0), lamp.mesh("lamp", 1)],
        instances: vec![in_place(0), in_place(1)],
        materials: materials((b - a) * (b - a)),
        cameras: vec![camera(eye, middle, 1.1)],
        ..Scene::default()
    }
}

/// The place of a ball in a grid, jittered.
fn place(ball: u32, grid: u32) -> Vec3A {
    let cell = [ball % grid, ball / grid % grid, ball / grid.pow(2)].map(|i| i as f32);
    Vec3A::from_array(cell) + 0.3 * Vec3A::from_array([0, 1, 2].map(|axis| unit(ball, axis) - 0.5))
}

/// 4×4×4 dented balls of `columns` × `rows` quads each in one mesh, in a room. The full size of the benches,
/// 142 × 72, makes 1.3 million triangles.
pub fn balls(columns: u32, rows: u32) -> Scene {
    const GRID: u32 = 4;
    let mut scene = room(GRID);
    let mut all = Triangles::default();
    for ball in 0..GRID.pow(3) {
        all.ball(place(ball, GRID), 0.36, [columns, rows], ball as f32);
    }
    scene.instances.push(in_place(scene.meshes.len() as u32));
    scene.meshes.push(all.mesh("balls", 0));
    scene
}

/// `count` placements, turned and scaled, of one dented ball of `columns` × `rows` quads, in a room.
pub fn instanced_balls(count: u32, columns: u32, rows: u32) -> Scene {
    let grid = (1..).find(|grid: &u32| grid.pow(3) >= count).unwrap_or(1);
    let mut scene = room(grid);
    let mut ball = Triangles::default();
    ball.ball(Vec3A::ZERO, 0.36, [columns, rows], 0.0);
    let mesh = scene.meshes.len() as u32;
    scene.meshes.push(ball.mesh("ball", 0));
    scene.instances.extend((0..count).map(|ball| {
        let turn = Affine3A::from_rotation_y(TAU * unit(ball, 3));
        let scale = Affine3A::from_scale(Vec3::splat(0.8 + 0.2 * unit(ball, 4)));
        let to_world = Affine3A::from_translation(place(ball, grid).into()) * turn * scale;
        Instance { mesh, to_world, is_identity: false }
    }));
    scene
}

/// A room whose light comes from `count` small triangles of equal power, scattered below the ceiling; all of them
/// together have the area and the power of one large lamp.
pub fn lamps(count: u32) -> Scene {
    let mut scene = room(2);
    let area = 0.5;
    let side = (2.0 * area / count as f32).sqrt();
    let mut lamps = Triangles::default();
    for lamp in 0..count {
        let random = |what| unit(lamp, what);
        let corner = Vec3A::new(2.6 * random(0) - 0.8, 1.6 + 0.2 * random(1), 2.6 * random(2) - 0.8);
        let (sin, cos) = (TAU * random(3)).sin_cos();
        let (along, across) = (Vec3A::new(cos, 0.0, sin) * side, Vec3A::new(-sin, 0.0, cos) * side);
        let first = lamps.positions.len() as u32;
        lamps.positions.extend([corner, corner + across, corner + along]);
        lamps.indices.push([first, first + 1, first + 2]);
    }
    scene.meshes[1] = lamps.mesh("lamps", 1);
    scene.materials = materials(area);
    let mut balls = Triangles::default();
    for ball in 0..8 {
        balls.ball(place(ball, 2), 0.36, [32, 16], ball as f32);
    }
    scene.instances.push(in_place(scene.meshes.len() as u32));
    scene.meshes.push(balls.mesh("balls", 0));
    scene
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_valid_and_as_large_as_they_say() {
        for (scene, triangles) in [
            (balls(6, 4), 14 + 64 * 48),
            (instanced_balls(9, 6, 4), 14 + 9 * 48),
            (lamps(100), 12 + 100 + 8 * 1024),
        ] {
            scene.validate().expect("a valid scene");
            assert_eq!(scene.triangle_count(), triangles);
            assert!(scene.has_light());
        }
    }
}
