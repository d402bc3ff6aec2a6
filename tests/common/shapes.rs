//! Building blocks of the test scenes: materials, quads, boxes, tessellated spheres, textures, cameras.
//!
//! World space is y up, metres. Meshes are stored in world space with identity instances, as the loader does for a
//! mesh that is placed once.

use gdpt::scene::{
    AlphaMode, Camera, Environment, Instance, Material, Mesh, Projection, PunctualKind, PunctualLight, Scene,
    Texture, TextureRef, Wrap,
};
use glam::{Affine2, Affine3A, Mat3A, Vec2, Vec3, Vec3A, Vec4};

/// A vector, written short.
pub const fn v(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A Lambertian material.
pub fn diffuse(r: f32, g: f32, b: f32) -> Material {
    Material {
        base_color: Vec4::new(r, g, b, 1.0),
        metallic: 0.0,
        roughness: 1.0,
        specular: 0.0,
        ..Material::default()
    }
}

/// A black one-sided emitter.
pub fn emitter(radiance: Vec3) -> Material {
    Material { emission: radiance, ..diffuse(0.0, 0.0, 0.0) }
}

/// A metal; below a roughness of 0.01 a mirror.
pub fn metal(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color.extend(1.0), metallic: 1.0, roughness, ..Material::default() }
}

/// Diffuse below a dielectric coat of index 1.5.
pub fn plastic(color: Vec3, roughness: f32) -> Material {
    Material { base_color: color.extend(1.0), metallic: 0.0, roughness, ..Material::default() }
}

/// A solid dielectric.
pub fn glass(ior: f32, roughness: f32) -> Material {
    Material {
        base_color: Vec4::ONE,
        metallic: 0.0,
        roughness,
        ior,
        transmission: 1.0,
        is_solid: true,
        ..Material::default()
    }
}

/// A scene under construction.
#[derive(Default)]
pub struct Builder {
    /// What was added so far.
    pub scene: Scene,
}

impl Builder {
    /// Adds a material.
    pub fn material(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    /// Adds a mesh in world space.
    pub fn mesh(&mut self, mesh: Mesh) {
        self.place(mesh, Affine3A::IDENTITY);
    }

    /// Adds a mesh under a transform.
    pub fn place(&mut self, mesh: Mesh, to_world: Affine3A) {
        let index = self.scene.meshes.len() as u32;
        self.scene.meshes.push(mesh);
        let is_identity = to_world == Affine3A::IDENTITY;
        self.scene.instances.push(Instance { mesh: index, to_world, is_identity });
    }

    /// Adds the parallelogram `origin`, `origin + a`, `origin + a + b`, `origin + b`; its front is towards a × b.
    pub fn quad(&mut self, origin: Vec3, a: Vec3, b: Vec3, material: Material) {
        let material = self.material(material);
        self.mesh(quad(origin, a, b, material));
    }

    /// Adds a box with outward normals.
    pub fn cuboid(&mut self, lower: Vec3, upper: Vec3, material: Material) {
        let material = self.material(material);
        self.mesh(cuboid(lower, upper, material));
    }

    /// Adds a tessellated sphere; `smooth` gives it the sphere's normals.
    pub fn sphere(&mut self, centre: Vec3, radius: f32, rings: u32, smooth: bool, material: Material) {
        let material = self.material(material);
        self.mesh(sphere(centre, radius, rings, smooth, material));
    }

    /// Adds a closed room with inward normals: left red, right green, the rest `grey`.
    pub fn room(&mut self, lower: Vec3, upper: Vec3, grey: f32, coloured: bool) {
        let size = upper - lower;
        let (x, y, z) = (Vec3::X * size.x, Vec3::Y * size.y, Vec3::Z * size.z);
        let wall = || diffuse(grey, grey, grey);
        let (left, right) =
            if coloured { (diffuse(0.6, 0.1, 0.1), diffuse(0.1, 0.5, 0.15)) } else { (wall(), wall()) };
        self.quad(lower, z, x, wall());
        self.quad(lower + y, x, z, wall());
        self.quad(lower, x, y, wall());
        self.quad(lower + z, y, x, wall());
        self.quad(lower, y, z, left);
        self.quad(lower + x, z, y, right);
    }

    /// Adds a texture and refers to it by coordinate set 0.
    pub fn texture(&mut self, texture: Texture) -> Option<TextureRef> {
        self.scene.textures.push(texture);
        let texture = self.scene.textures.len() as u32 - 1;
        Some(TextureRef { texture, uv_set: 0, transform: Affine2::IDENTITY })
    }

    /// Adds a punctual light.
    pub fn light(&mut self, kind: PunctualKind, position: Vec3, direction: Vec3, intensity: Vec3) {
        let direction = direction.normalize();
        self.scene.lights.push(PunctualLight { kind, position, direction, intensity });
    }

    /// Sets an environment of `width`×`height` texels from a function of the texel.
    pub fn environment(&mut self, width: u32, height: u32, radiance: impl Fn(u32, u32) -> Vec3) {
        let texels = (0..width * height).map(|i| radiance(i % width, i / width)).collect();
        self.scene.environment = Some(Environment { width, height, texels, rotation: 0.3, visible: true });
    }
}

/// A mesh without attributes.
pub fn bare_mesh(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    Mesh {
        name: "test".into(),
        positions: positions.into_iter().map(Vec3A::from).collect(),
        triangles: triangles.into(),
        normals: None,
        tangents: None,
        uvs: [None, None],
        colors: None,
        material,
    }
}

/// A parallelogram of two triangles with texture coordinates along its edges and tangents along `a`.
pub fn quad(origin: Vec3, a: Vec3, b: Vec3, material: u32) -> Mesh {
    let positions = vec![origin, origin + a, origin + a + b, origin + b];
    let mut mesh = bare_mesh(positions, vec![[0, 1, 2], [0, 2, 3]], material);
    mesh.uvs[0] = Some(vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]);
    mesh.tangents = Some(vec![a.normalize().extend(1.0); 4]);
    mesh
}

/// A box with outward normals.
pub fn cuboid(lower: Vec3, upper: Vec3, material: u32) -> Mesh {
    let corner = |i: u32| {
        let pick = |bit: u32, low: f32, high: f32| if i >> bit & 1 == 0 { low } else { high };
        v(pick(0, lower.x, upper.x), pick(1, lower.y, upper.y), pick(2, lower.z, upper.z))
    };
    let faces: [[u32; 4]; 6] =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    bare_mesh((0..8).map(corner).collect(), triangles, material)
}

/// A sphere of `rings` × 2 `rings` facets with outward normals.
pub fn sphere(centre: Vec3, radius: f32, rings: u32, smooth: bool, material: u32) -> Mesh {
    use std::f32::consts::PI;
    let columns = 2 * rings;
    let mut normals = Vec::new();
    for i in 0..=rings {
        for j in 0..columns {
            let theta = PI * i as f32 / rings as f32;
            let phi = 2.0 * PI * (j as f32 + 0.13) / columns as f32;
            normals.push(v(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()));
        }
    }
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..columns {
            let at = |i: u32, j: u32| i * columns + j % columns;
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            if i > 0 {
                triangles.push([a, b, c]);
            }
            if i + 1 < rings {
                triangles.push([a, c, d]);
            }
        }
    }
    let positions = normals.iter().map(|&n| centre + n * radius).collect();
    let mut mesh = bare_mesh(positions, triangles, material);
    mesh.normals = smooth.then_some(normals);
    mesh
}

/// A texture from a function of the texel that gives linear-encoded bytes.
pub fn texture(width: u32, height: u32, texel: impl Fn(u32, u32) -> [u8; 4]) -> Texture {
    Texture {
        width,
        height,
        texels: (0..width * height).map(|i| texel(i % width, i / width)).collect(),
        srgb: false,
        wrap: [Wrap::Repeat, Wrap::Repeat],
        linear_filter: true,
    }
}

/// A pinhole camera at `eye` that looks at `target`; `degrees` is the vertical field of view.
pub fn camera(eye: Vec3, target: Vec3, degrees: f32) -> Camera {
    let z = (eye - target).normalize();
    let x = Vec3::Y.cross(z).normalize();
    let matrix3 = Mat3A::from_cols(x.into(), z.cross(x).into(), z.into());
    Camera {
        name: "test".into(),
        to_world: Affine3A { matrix3, translation: eye.into() },
        projection: Projection::Perspective { yfov: degrees.to_radians() },
        lens_radius: 0.0,
        focus_distance: 1.0,
    }
}

/// `material` seen through holes.
pub fn with_alpha(material: Material, mode: AlphaMode, alpha: f32) -> Material {
    Material { alpha_mode: mode, base_color: material.base_color.truncate().extend(alpha), ..material }
}
