//! What shading reads of a hit, laid out for it: a cache line for a triangle's geometry, one for its vertex
//! attributes, one for a material. A mesh is stored once, however often it is placed.
//!
//! 64 bytes a triangle, 128 where there are shading normals or texture coordinates.

use super::{Placement, offset_bound};
use crate::math::transpose::Line;
use crate::scene::{Instance, Material, Mesh, Scene};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Floats 0–2 corner, 3–5 and 6–8 edges to the other two, 9 bound on the rounding of points, 10 handedness.
pub(super) const OFFSET: usize = 9;
/// Sign of the instance's determinant.
pub(super) const HANDEDNESS: usize = 10;
/// Floats 0–8 shading normals, 9–14 first texture coordinates of the three corners.
pub(super) const UV: usize = 9;

/// What a hit of an instance has; bits of [`Place::flags`].
pub(super) mod flag {
    /// Bounds a solid.
    pub const SOLID: u32 = 1;
    /// Emissive or unlit.
    pub const EMITTER: u32 = 1 << 1;
    /// Unlit.
    pub const UNLIT: u32 = 1 << 2;
    /// Both sides emit.
    pub const TWO_SIDED: u32 = 1 << 3;
    /// Shading normals.
    pub const SMOOTH: u32 = 1 << 4;
    /// A normal map with its tangents.
    pub const MAPPED: u32 = 1 << 5;
    /// Other textures, or vertex colours, that change the material's parameters.
    pub const TEXTURED: u32 = 1 << 6;
    /// Geometry in object space.
    pub const MOVED: u32 = 1 << 7;
    /// Has a line of attributes.
    pub const ATTRIBUTES: u32 = 1 << 8;
    /// A base colour texture.
    pub const BASE_TEXTURED: u32 = 1 << 9;
}

/// Where an instance's records are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Line of the mesh's first triangle in [`Records::geometry`].
    pub geometry: usize,
    /// The same in [`Records::attributes`].
    pub attributes: usize,
    /// Index of the material.
    pub material: usize,
    /// Bits of [`flag`].
    pub flags: u32,
}

/// All records of a scene.
#[derive(Debug)]
pub(super) struct Records {
    /// One an instance.
    pub places: Vec<Place>,
    /// One a triangle of each mesh, in object space.
    pub geometry: Vec<Line>,
    /// One a triangle of each mesh that has normals or first texture coordinates.
    pub attributes: Vec<Line>,
    /// One a material: base colour, metallic, roughness, specular, specular colour, ior, transmission, absorption.
    pub materials: Vec<Line>,
}

/// The lanes that hit nothing read a triangle with a normal, so that no NaN arises.
pub(super) const NO_TRIANGLE: Line =
    Line([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);

/// A line from vectors; the rest is zero.
fn line(vectors: &[Vec3]) -> Line {
    let mut line = Line::ZERO;
    for (to, v) in line.0.chunks_exact_mut(3).zip(vectors) {
        to.copy_from_slice(&v.to_array());
    }
    line
}

fn geometry(mesh: &Mesh, triangle: [u32; 3]) -> Line {
    corners_line(triangle.map(|i| Vec3::from(mesh.positions[i as usize])), 1.0)
}

fn corners_line(corners: [Vec3; 3], handedness: f32) -> Line {
    let [a, b, c] = corners;
    let mut line = line(&[a, b - a, c - a]);
    line.0[OFFSET] = offset_bound(corners);
    line.0[HANDEDNESS] = handedness;
    line
}

fn attributes(mesh: &Mesh, triangle: [u32; 3]) -> Line {
    let normal = |i: u32| mesh.normals.as_ref().map_or(Vec3::ZERO, |n| n[i as usize]);
    let uv = |i: u32| mesh.uvs[0].as_ref().map_or(Vec2::ZERO, |uv| uv[i as usize]);
    let mut line = line(&triangle.map(normal));
    for (to, i) in line.0[UV..].chunks_exact_mut(2).zip(triangle) {
        to.copy_from_slice(&uv(i).to_array());
    }
    line
}

fn material(m: &Material) -> Line {
    let [base, specular, absorption] = [m.base_color.truncate(), m.specular_color, m.absorption];
    Line([
        base.x,
        base.y,
        base.z,
        m.metallic,
        m.roughness,
        m.specular,
        specular.x,
        specular.y,
        specular.z,
        m.ior,
        m.transmission,
        absorption.x,
        absorption.y,
        absorption.z,
        0.0,
        0.0,
    ])
}

/// Whether something beside a base colour texture changes the parameters of the material's line.
fn is_textured(material: &Material, mesh: &Mesh) -> bool {
    let textures = [
        &material.metallic_roughness_texture,
        &material.specular_texture,
        &material.specular_color_texture,
        &material.transmission_texture,
    ];
    mesh.colors.is_some() || textures.iter().any(|t| t.is_some())
}

fn flags(instance: &Instance, mesh: &Mesh, m: &Material) -> u32 {
    let attributes = mesh.normals.is_some() || mesh.uvs[0].is_some();
    [
        (m.is_solid, flag::SOLID),
        (m.unlit || m.is_emissive(), flag::EMITTER),
        (m.unlit, flag::UNLIT),
        (m.double_sided || m.unlit, flag::TWO_SIDED),
        (mesh.normals.is_some(), flag::SMOOTH),
        (m.normal_texture.is_some() && mesh.tangents.is_some(), flag::MAPPED),
        (is_textured(m, mesh), flag::TEXTURED),
        (m.base_color_texture.is_some(), flag::BASE_TEXTURED),
        (!instance.is_identity, flag::MOVED),
        (attributes, flag::ATTRIBUTES),
    ]
    .into_iter()
    .filter_map(|(on, flag)| on.then_some(flag))
    .sum()
}

impl Records {
    /// Lays out a scene, on all threads.
    pub fn new(scene: &Scene) -> Self {
        let (mut lines, mut with_attributes) = (0, 0);
        let firsts: Vec<[usize; 2]> = scene
            .meshes
            .iter()
            .map(|mesh| {
                let first = [lines, with_attributes];
                lines += mesh.triangles.len();
                if mesh.normals.is_some() || mesh.uvs[0].is_some() {
                    with_attributes += mesh.triangles.len();
                }
                first
            })
            .collect();
        let place = |instance: &Instance| {
            let mesh = &scene.meshes[instance.mesh as usize];
            let [geometry, attributes] = firsts[instance.mesh as usize];
            let material = mesh.material as usize;
            Place { geometry, attributes, material, flags: flags(instance, mesh, &scene.materials[material]) }
        };
        let all = |wanted: fn(&Mesh) -> bool, line: fn(&Mesh, [u32; 3]) -> Line| -> Vec<Line> {
            scene
                .meshes
                .par_iter()
                .filter(|mesh| wanted(mesh))
                .flat_map_iter(|mesh| mesh.triangles.iter().map(move |&triangle| line(mesh, triangle)))
                .collect()
        };
        Self {
            places: scene.instances.iter().map(place).collect(),
            geometry: all(|_| true, geometry),
            attributes: all(|mesh| mesh.normals.is_some() || mesh.uvs[0].is_some(), attributes),
            materials: scene.materials.iter().map(material).collect(),
        }
    }
}

/// The geometry of a line in the world.
pub(super) fn moved_geometry(object: &Line, instance: &Instance, placement: &Placement) -> Line {
    let l = &object.0;
    let corner = Vec3::new(l[0], l[1], l[2]);
    let edge = |i: usize| Vec3::new(l[i], l[i + 1], l[i + 2]);
    let to_world = |p: Vec3| instance.to_world.transform_point3(p);
    corners_line(
        [to_world(corner), to_world(corner + edge(3)), to_world(corner + edge(6))],
        placement.handedness,
    )
}

/// The attributes of a line in the world.
pub(super) fn moved_attributes(object: &Line, placement: &Placement) -> Line {
    let mut line = *object;
    for n in line.0[..UV].chunks_exact_mut(3) {
        let normal = placement.normal * Vec3::new(n[0], n[1], n[2]);
        n.copy_from_slice(&normal.to_array());
    }
    line
}
