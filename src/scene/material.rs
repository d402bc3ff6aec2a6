//! Materials: glTF's metallic-roughness model with the KHR extensions that are honoured, clamped to their ranges.

use super::document::{Document, one_line};
use super::raw::{Fields, RawTexture, clamped, clamped3};
use super::texture::TextureTable;
use super::{AlphaMode, LoadReport, Material, TextureRef};
use crate::error::Result;
use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::json::material::AlphaMode as JsonAlphaMode;
use gltf::json::validation::Checked;
use gltf::json::{self, Index, texture};
use serde_json::{Map, Value};

/// Largest factor of emission; beyond it products overflow.
const MAX_RADIANCE: f32 = 1e15;
/// Smallest attenuation colour: its logarithm has to be finite.
const MIN_ATTENUATION: f32 = 1e-6;

/// Reads one material at a time and collects the textures in use.
pub(super) struct MaterialReader<'a> {
    pub(super) document: &'a Document,
    pub(super) textures: TextureTable,
}

impl<'a> MaterialReader<'a> {
    pub(super) fn read(
        &mut self,
        i: usize,
        entry: &'a json::Material,
        report: &mut LoadReport,
    ) -> Result<Material> {
        let at = format!("materials[{i}]");
        let name = entry.name.as_deref().map_or_else(|| format!("material {i}"), one_line);
        let mut material = Material { name, double_sided: entry.double_sided, ..Material::default() };
        self.core(&mut material, entry, &at, report)?;
        let others = entry.extensions.as_ref().map(|e| &e.others);
        material.unlit = others.is_some_and(|map| map.contains_key("KHR_materials_unlit"));
        self.emission(&mut material, entry, others, &at, report)?;
        self.dielectric(&mut material, others, &at, report)?;
        volume(self.document, &mut material, others, &at, report)?;
        Ok(material)
    }

    fn core(
        &mut self,
        m: &mut Material,
        entry: &'a json::Material,
        at: &str,
        report: &mut LoadReport,
    ) -> Result<()> {
        let pbr = &entry.pbr_metallic_roughness;
        let place = |key: &str| format!("{at}.pbrMetallicRoughness.{key}");
        let base = pbr.base_color_factor.0.map(|v| clamped(report, &place("baseColorFactor"), v, 0.0, 1.0));
        m.base_color = Vec4::from_array(base);
        m.metallic = clamped(report, &place("metallicFactor"), pbr.metallic_factor.0, 0.0, 1.0);
        m.roughness = clamped(report, &place("roughnessFactor"), pbr.roughness_factor.0, 0.0, 1.0);
        m.base_color_texture =
            self.info(&pbr.base_color_texture, true, &place("baseColorTexture"), report)?;
        let texture = &pbr.metallic_roughness_texture;
        m.metallic_roughness_texture =
            self.info(texture, false, &place("metallicRoughnessTexture"), report)?;
        if let Some(normal) = &entry.normal_texture {
            let at = format!("{at}.normalTexture");
            m.normal_scale = clamped(report, &format!("{at}.scale"), normal.scale, -100.0, 100.0);
            let others = normal.extensions.as_ref().map(|e| &e.others);
            let raw = self.raw(normal.index, normal.tex_coord, others, at)?;
            m.normal_texture = Some(self.reference(raw, false, report)?);
        }
        if entry.occlusion_texture.is_some() {
            report.warn("occlusion textures are not used: occlusion is computed".into());
        }
        m.alpha_mode = match entry.alpha_mode {
            Checked::Valid(JsonAlphaMode::Opaque) => AlphaMode::Opaque,
            Checked::Valid(JsonAlphaMode::Mask) => {
                let cutoff = entry.alpha_cutoff.map_or(0.5, |c| c.0);
                AlphaMode::Mask(clamped(report, &format!("{at}.alphaCutoff"), cutoff, 0.0, f32::MAX))
            }
            Checked::Valid(JsonAlphaMode::Blend) => AlphaMode::Blend,
            Checked::Invalid => {
                let what = "is none of OPAQUE, MASK, BLEND; export the file again";
                return Err(self.document.reject(format!("{at}.alphaMode"), what));
            }
        };
        Ok(())
    }

    fn emission(
        &mut self,
        m: &mut Material,
        entry: &'a json::Material,
        others: Option<&'a Map<String, Value>>,
        at: &str,
        report: &mut LoadReport,
    ) -> Result<()> {
        let place = format!("{at}.emissiveFactor");
        let factor = clamped3(report, &place, Vec3::from_array(entry.emissive_factor.0), 0.0, MAX_RADIANCE);
        let mut strength = 1.0;
        let name = "KHR_materials_emissive_strength";
        if let Some(fields) = Fields::extension(self.document, others, at, name)? {
            let value = fields.number("emissiveStrength", 1.0)?;
            strength = clamped(report, &fields.at("emissiveStrength"), value, 0.0, MAX_RADIANCE);
        }
        m.emission = (factor * strength).min(Vec3::splat(MAX_RADIANCE));
        m.emission_texture =
            self.info(&entry.emissive_texture, true, &format!("{at}.emissiveTexture"), report)?;
        Ok(())
    }

    fn dielectric(
        &mut self,
        m: &mut Material,
        others: Option<&'a Map<String, Value>>,
        at: &str,
        report: &mut LoadReport,
    ) -> Result<()> {
        if let Some(f) = Fields::extension(self.document, others, at, "KHR_materials_specular")? {
            let value = f.number("specularFactor", 1.0)?;
            m.specular = clamped(report, &f.at("specularFactor"), value, 0.0, 1.0);
            let value = f.vec3("specularColorFactor", Vec3::ONE)?;
            m.specular_color = clamped3(report, &f.at("specularColorFactor"), value, 0.0, 1e4);
            m.specular_texture = self.field(&f, "specularTexture", false, report)?;
            m.specular_color_texture = self.field(&f, "specularColorTexture", true, report)?;
        }
        if let Some(f) = Fields::extension(self.document, others, at, "KHR_materials_ior")? {
            let value = f.number("ior", 1.5)?;
            // The specification lets 0 stand for full reflection at every angle.
            m.ior = if value == 0.0 {
                report.warn(format!("{}: 0 (full reflection) is read as {MAX_IOR}", f.at("ior")));
                MAX_IOR
            } else {
                clamped(report, &f.at("ior"), value, 1.0, MAX_IOR)
            };
        }
        if let Some(f) = Fields::extension(self.document, others, at, "KHR_materials_transmission")? {
            let value = f.number("transmissionFactor", 0.0)?;
            m.transmission = clamped(report, &f.at("transmissionFactor"), value, 0.0, 1.0);
            m.transmission_texture = self.field(&f, "transmissionTexture", false, report)?;
        }
        Ok(())
    }

    fn field(
        &mut self,
        f: &Fields<'a>,
        key: &str,
        srgb: bool,
        report: &mut LoadReport,
    ) -> Result<Option<TextureRef>> {
        f.texture(key)?.map(|raw| self.reference(raw, srgb, report)).transpose()
    }

    fn info(
        &mut self,
        info: &'a Option<texture::Info>,
        srgb: bool,
        at: &str,
        report: &mut LoadReport,
    ) -> Result<Option<TextureRef>> {
        let Some(info) = info else { return Ok(None) };
        let others = info.extensions.as_ref().map(|e| &e.others);
        let raw = self.raw(info.index, info.tex_coord, others, at.into())?;
        self.reference(raw, srgb, report).map(Some)
    }

    fn raw(
        &self,
        index: Index<json::Texture>,
        tex_coord: u32,
        others: Option<&'a Map<String, Value>>,
        at: String,
    ) -> Result<RawTexture<'a>> {
        let transform = Fields::extension(self.document, others, &at, "KHR_texture_transform")?;
        Ok(RawTexture { index: index.value(), tex_coord: u64::from(tex_coord), transform, at })
    }

    fn reference(&mut self, raw: RawTexture<'a>, srgb: bool, report: &mut LoadReport) -> Result<TextureRef> {
        let mut set = raw.tex_coord;
        let mut transform = Affine2::IDENTITY;
        if let Some(f) = &raw.transform {
            set = f.integer("texCoord")?.unwrap_or(set);
            let (offset, scale) = (f.vec2("offset", Vec2::ZERO)?, f.vec2("scale", Vec2::ONE)?);
            transform = uv_transform(offset, f.number("rotation", 0.0)?, scale);
        }
        if set > 1 {
            report.warn(format!("{}: texture coordinate set {set} is not read; set 0 is used", raw.at));
            set = 0;
        }
        Ok(TextureRef { texture: self.textures.index_of(raw.index, srgb), uv_set: set as u8, transform })
    }
}

/// Index of refraction that stands for infinity.
const MAX_IOR: f32 = 1000.0;

/// KHR_texture_transform: scale, then rotation, then offset. v points down the image, so the counter-clockwise turn
/// of the coordinates is (u, v) → (u cos + v sin, v cos − u sin).
fn uv_transform(offset: Vec2, rotation: f32, scale: Vec2) -> Affine2 {
    let (sin, cos) = rotation.sin_cos();
    let turn = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
    Affine2::from_mat2_translation(turn * Mat2::from_diagonal(scale), offset)
}

/// KHR_materials_volume: a thickness makes the surface bound a solid; absorption = −ln(colour) ÷ distance, m⁻¹.
fn volume(
    document: &Document,
    m: &mut Material,
    others: Option<&Map<String, Value>>,
    at: &str,
    report: &mut LoadReport,
) -> Result<()> {
    let Some(f) = Fields::extension(document, others, at, "KHR_materials_volume")? else { return Ok(()) };
    m.is_solid = f.number("thicknessFactor", 0.0)? > 0.0;
    if f.has("thicknessTexture") {
        report.warn(
            "KHR_materials_volume thicknessTexture is not used: light travels through the real geometry"
                .into(),
        );
    }
    if f.has("attenuationDistance") {
        let value = f.number("attenuationDistance", f32::MAX)?;
        let distance = clamped(report, &f.at("attenuationDistance"), value, 1e-9, f32::MAX);
        let color = f.vec3("attenuationColor", Vec3::ONE)?;
        let color = clamped3(report, &f.at("attenuationColor"), color, 0.0, 1.0);
        m.absorption =
            Vec3::from_array(color.to_array().map(|c| -c.max(MIN_ATTENUATION).ln() / distance + 0.0));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn texture_transform_scales_then_turns_then_offsets() {
        let t = uv_transform(Vec2::new(0.25, 0.5), FRAC_PI_2, Vec2::new(2.0, 3.0));
        // u points right, v down: a quarter turn counter-clockwise sends +u to −v and +v to +u.
        assert!(t.transform_point2(Vec2::X).abs_diff_eq(Vec2::new(0.25, 0.5 - 2.0), 1e-6));
        assert!(t.transform_point2(Vec2::Y).abs_diff_eq(Vec2::new(0.25 + 3.0, 0.5), 1e-6));
    }
}
