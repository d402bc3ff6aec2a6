//! The scene: plain, validated data. Every float in it is finite and every index in range; what could not be kept
//! is counted in the [`LoadReport`].
//!
//! World space is glTF's: right-handed, y up, metres. Colours are linear Rec.709.

mod accessor;
mod budget;
mod builtin;
pub mod camera;
mod container;
mod describe;
mod document;
pub mod environment;
mod fit;
mod geometry;
mod gltf_reader;
mod lights;
mod material;
mod nodes;
mod raw;
mod references;
mod tangents;
mod texture;
mod uri;
mod validate;

use crate::error::Result;
use glam::{Affine2, Affine3A, Vec2, Vec3, Vec3A, Vec4};
use std::path::Path;
use std::sync::Arc;

pub use builtin::{BUILTIN_NAMES, builtin};
pub use camera::{Camera, Projection};
pub use describe::describe;
pub use environment::Environment;
pub use fit::fitted_camera;

/// How a scene is read.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Unit of the file's punctual lights.
    pub light_unit: LightUnit,
    /// Emissive materials that are `doubleSided` shine from both sides. By default light leaves the front alone, as
    /// area lights of other path tracers do: many exporters mark every material.
    pub double_sided_emission: bool,
    /// Bytes that the file, its decoded images and its geometry may take.
    pub max_memory: u64,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self { light_unit: LightUnit::Auto, double_sided_emission: false, max_memory: 8 << 30 }
    }
}

/// Unit of the intensities of punctual lights. Emissive materials are radiance in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightUnit {
    /// Candela and lux, as the specification says: divided by 683 lm·W⁻¹.
    Photometric,
    /// W·sr⁻¹ and W·m⁻², as many exporters write.
    Radiometric,
    /// Photometric where `asset.generator` names Blender, which converts watts by 683 lm·W⁻¹; else radiometric.
    #[default]
    Auto,
}

/// Reads a .glb or .gltf file.
///
/// What can be repaired is, with a warning in [`Scene::report`]; what cannot is an error that names its place.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
    gltf_reader::read(path, options)
}

/// Everything that is rendered.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangle meshes, one per glTF primitive; each has one material.
    pub meshes: Vec<Mesh>,
    /// Placements of meshes. A hit names an instance by its index here.
    pub instances: Vec<Instance>,
    /// Materials; every `Mesh::material` is an index into this.
    pub materials: Vec<Material>,
    /// Decoded images with their samplers.
    pub textures: Vec<Texture>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Light from infinity.
    pub environment: Option<Environment>,
    /// Cameras in file order; a loader adds one that sees the whole scene where the file has none.
    pub cameras: Vec<Camera>,
    /// What was read, dropped and not honoured.
    pub report: LoadReport,
}

/// Triangles with one material, in object space (world space where the one instance is the identity).
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Name in the file, for messages.
    pub name: String,
    /// Vertex positions, m; 16 bytes each, so that Embree can share them.
    pub positions: Arc<[Vec3A]>,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Arc<[[u32; 3]]>,
    /// Unit shading normals a vertex; flat shading without.
    pub normals: Option<Vec<Vec3>>,
    /// Tangents a vertex, w = ±1 is the sign of the bitangent; present where the material has a normal map.
    pub tangents: Option<Vec<Vec4>>,
    /// Texture coordinate sets 0 and 1.
    pub uvs: [Option<Vec<Vec2>>; 2],
    /// Linear vertex colours and alpha, multiplied into the base colour.
    pub colors: Option<Vec<Vec4>>,
    /// Index into `Scene::materials`.
    pub material: u32,
}

/// A placement of a mesh.
///
/// A mirroring (negative determinant) keeps the mesh's winding as it is in object space. Its front stays the front
/// if the geometric normal is taken from object space by the inverse transpose; a normal computed from edges in
/// world space has to be multiplied by the sign of the determinant, and so has the bitangent cross(n, t)·w.
#[derive(Clone, Copy, Debug)]
pub struct Instance {
    /// Index into `Scene::meshes`.
    pub mesh: u32,
    /// Object to world.
    pub to_world: Affine3A,
    /// Whether `to_world` is the identity: a mesh that is placed once is stored in world space.
    pub is_identity: bool,
}

/// glTF's metallic-roughness material with the extensions that are honoured.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Base colour (linear) and alpha.
    pub base_color: Vec4,
    /// Multiplies `base_color`; sRGB.
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Perceptual roughness; GGX alpha is its square, below [`Material::SMOOTH_ALPHA`] a perfect mirror.
    pub roughness: f32,
    /// Roughness in G, metalness in B; linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals; linear.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
    /// Emitted radiance, W·m⁻²·sr⁻¹ (factor × strength).
    pub emission: Vec3,
    /// Multiplies `emission`; sRGB.
    pub emission_texture: Option<TextureRef>,
    /// KHR_materials_specular: strength of the dielectric reflection; 0 is a pure Lambertian surface.
    pub specular: f32,
    /// Multiplies `specular` with its alpha.
    pub specular_texture: Option<TextureRef>,
    /// Tint of the dielectric reflection at normal incidence.
    pub specular_color: Vec3,
    /// Multiplies `specular_color`; sRGB.
    pub specular_color_texture: Option<TextureRef>,
    /// Index of refraction of the inside relative to the outside.
    pub ior: f32,
    /// Share of the dielectric's light that is transmitted instead of scattered diffusely.
    pub transmission: f32,
    /// Multiplies `transmission` with its R.
    pub transmission_texture: Option<TextureRef>,
    /// Whether the surface bounds a solid (KHR_materials_volume with thickness > 0); else it is thin.
    pub is_solid: bool,
    /// Absorption inside the solid, m⁻¹.
    pub absorption: Vec3,
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Emission leaves both sides (see `LoadOptions`); scattering always treats both sides alike.
    pub double_sided: bool,
    /// KHR_materials_unlit: shows `base_color`, scatters nothing.
    pub unlit: bool,
}

impl Material {
    /// GGX alpha (roughness²) below which a lobe is a Dirac.
    pub const SMOOTH_ALPHA: f32 = 1e-4;

    /// Whether a ray may pass where alpha says so.
    pub fn has_coverage(&self) -> bool {
        self.alpha_mode != AlphaMode::Opaque
    }

    /// Every texture in use.
    pub fn texture_refs(&self) -> impl Iterator<Item = &TextureRef> {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emission_texture,
            &self.specular_texture,
            &self.specular_color_texture,
            &self.transmission_texture,
        ]
        .into_iter()
        .flatten()
    }

    /// Every place for a texture.
    fn texture_slots(&mut self) -> [&mut Option<TextureRef>; 7] {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.normal_texture,
            &mut self.emission_texture,
            &mut self.specular_texture,
            &mut self.specular_color_texture,
            &mut self.transmission_texture,
        ]
    }

    /// Whether triangles of this material are area lights.
    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0 && !self.unlit
    }
}

/// The default material of glTF: a rough white metal is not what people expect, but it is the specification.
impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 1.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emission: Vec3::ZERO,
            emission_texture: None,
            specular: 1.0,
            specular_texture: None,
            specular_color: Vec3::ONE,
            specular_color_texture: None,
            ior: 1.5,
            transmission: 0.0,
            transmission_texture: None,
            is_solid: false,
            absorption: Vec3::ZERO,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

/// How alpha becomes coverage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Covered where alpha ≥ the cutoff.
    Mask(f32),
    /// Covered with probability alpha.
    Blend,
}

/// A use of a texture by a material.
#[derive(Clone, Copy, Debug)]
pub struct TextureRef {
    /// Index into `Scene::textures`.
    pub texture: u32,
    /// Which of the mesh's coordinate sets, 0 or 1.
    pub uv_set: u8,
    /// KHR_texture_transform: file coordinates to sampled coordinates.
    pub transform: Affine2,
}

/// An image with its sampler. Row 0 is v = 0 (the top, as in glTF).
#[derive(Clone, Debug)]
pub struct Texture {
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// RGBA, row by row; shared by textures that use one image.
    pub texels: Arc<[[u8; 4]]>,
    /// Whether R, G, B are sRGB-encoded; alpha never is.
    pub srgb: bool,
    /// Wrap mode of u and of v.
    pub wrap: [Wrap; 2],
    /// Bilinear, or the nearest texel.
    pub linear_filter: bool,
}

/// What lies outside the unit square of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    Repeat,
    /// The image mirrored.
    Mirror,
    /// The edge texel.
    Clamp,
}

/// A light of KHR_lights_punctual, in world space.
#[derive(Clone, Copy, Debug)]
pub struct PunctualLight {
    /// What kind, with the parameters of that kind.
    pub kind: PunctualKind,
    /// Position, m (not used by directional lights).
    pub position: Vec3,
    /// Unit direction in which it shines (not used by point lights).
    pub direction: Vec3,
    /// Radiant intensity W·sr⁻¹ (point, spot) or irradiance W·m⁻² (directional).
    pub intensity: Vec3,
}

/// The kinds of punctual light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// In all directions alike.
    Point,
    /// Within a cone: full inside the inner angle, none outside the outer; glTF's quadratic falloff between.
    Spot {
        /// Cosine of the inner half-angle.
        cos_inner: f32,
        /// Cosine of the outer half-angle.
        cos_outer: f32,
    },
    /// Parallel light from infinity.
    Directional,
}

/// What the loader read, dropped and did not honour.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// One line each: what is used by the file and not honoured, or was repaired. Said once, by name.
    pub warnings: Vec<String>,
    /// Triangles dropped because they are degenerate, not finite or out of range.
    pub dropped_triangles: u64,
    /// Textures that could not be read (shown magenta).
    pub missing_textures: u64,
    /// Extensions the file uses that are honoured.
    pub extensions_honoured: Vec<String>,
    /// Extensions the file uses that are not.
    pub extensions_ignored: Vec<String>,
    /// `asset.generator` of the file.
    pub generator: String,
}

impl LoadReport {
    /// Lines that are kept: what a file can say a million times is not worth more.
    const MAX_WARNINGS: usize = 200;

    /// Adds a line, once.
    pub fn warn(&mut self, line: String) {
        if self.warnings.len() < Self::MAX_WARNINGS {
            if !self.warnings.contains(&line) {
                self.warnings.push(line);
            }
        } else if self.warnings.len() == Self::MAX_WARNINGS {
            self.warnings.push("more warnings are not shown".into());
        }
    }

    /// Adds what another report says of a part of the same file.
    fn absorb(&mut self, part: LoadReport) {
        self.dropped_triangles += part.dropped_triangles;
        self.missing_textures += part.missing_textures;
        for line in part.warnings {
            self.warn(line);
        }
    }
}

impl Scene {
    /// Whether anything emits light that a path can find: without, the image is black.
    pub fn has_light(&self) -> bool {
        let emits = |i: &Instance| {
            let mesh = self.meshes.get(i.mesh as usize);
            let material = mesh.and_then(|m| self.materials.get(m.material as usize));
            material.is_some_and(|m| m.is_emissive() || m.unlit)
        };
        self.environment.is_some() || !self.lights.is_empty() || self.instances.iter().any(emits)
    }

    /// Triangles over all instances.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|i| self.meshes[i.mesh as usize].triangles.len() as u64).sum()
    }

    /// World-space bounds over all instances, (lower, upper); `None` for an empty scene.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let mut bounds: Option<(Vec3, Vec3)> = None;
        for instance in &self.instances {
            let mesh = &self.meshes[instance.mesh as usize];
            for &index in mesh.triangles.iter().flatten() {
                let p = Vec3::from(instance.to_world.transform_point3a(mesh.positions[index as usize]));
                let (lower, upper) = bounds.unwrap_or((p, p));
                bounds = Some((lower.min(p), upper.max(p)));
            }
        }
        bounds
    }
}
