//! The promise of the scene, checked: every float finite, every index in range, every range kept.

use super::{AlphaMode, Material, Mesh, Projection, PunctualKind, Scene, Texture};

/// What is wrong, with its place.
type Check = Result<(), String>;

fn ensure(good: bool, what: impl FnOnce() -> String) -> Check {
    if good { Ok(()) } else { Err(what()) }
}

impl Scene {
    /// Checks everything the renderer relies on; the text names the first fault.
    pub fn validate(&self) -> Check {
        for (i, mesh) in self.meshes.iter().enumerate() {
            self.check_mesh(mesh).map_err(|what| format!("meshes[{i}] ({}): {what}", mesh.name))?;
        }
        for (i, instance) in self.instances.iter().enumerate() {
            ensure((instance.mesh as usize) < self.meshes.len(), || {
                format!("instances[{i}]: mesh out of range")
            })?;
            let m = &instance.to_world;
            ensure(m.is_finite() && m.inverse().is_finite(), || {
                format!("instances[{i}]: singular transform")
            })?;
            let is_identity = *m == glam::Affine3A::IDENTITY;
            ensure(is_identity == instance.is_identity, || format!("instances[{i}]: is_identity is wrong"))?;
        }
        for (i, material) in self.materials.iter().enumerate() {
            self.check_material(material)
                .map_err(|what| format!("materials[{i}] ({}): {what}", material.name))?;
        }
        for (i, texture) in self.textures.iter().enumerate() {
            check_texture(texture).map_err(|what| format!("textures[{i}]: {what}"))?;
        }
        self.check_lights()?;
        self.check_cameras()
    }

    fn check_mesh(&self, mesh: &Mesh) -> Check {
        let n = mesh.positions.len();
        ensure((mesh.material as usize) < self.materials.len(), || "material out of range".into())?;
        ensure(mesh.positions.iter().all(|p| p.is_finite()), || "position not finite".into())?;
        let in_range = mesh.triangles.iter().flatten().all(|&i| (i as usize) < n);
        ensure(in_range, || "vertex index out of range".into())?;
        if let Some(normals) = &mesh.normals {
            ensure(normals.len() == n && normals.iter().all(|v| v.is_normalized()), || "normals".into())?;
        }
        if let Some(tangents) = &mesh.tangents {
            let good = |t: &glam::Vec4| t.truncate().is_normalized() && t.w.abs() == 1.0;
            ensure(tangents.len() == n && tangents.iter().all(good), || "tangents".into())?;
            ensure(mesh.normals.is_some(), || "tangents without normals".into())?;
        }
        for uvs in mesh.uvs.iter().flatten() {
            ensure(uvs.len() == n && uvs.iter().all(|v| v.is_finite()), || "texture coordinates".into())?;
        }
        if let Some(colors) = &mesh.colors {
            let good = |c: &glam::Vec4| c.min_element() >= 0.0 && c.max_element() <= 1.0;
            ensure(colors.len() == n && colors.iter().all(good), || "colours".into())?;
        }
        let material = self.materials.get(mesh.material as usize);
        for texture in material.iter().flat_map(|m| m.texture_refs()) {
            let uvs = mesh.uvs.get(usize::from(texture.uv_set));
            ensure(uvs.is_some_and(Option::is_some), || {
                "texture coordinates of the material missing".into()
            })?;
        }
        let is_mapped = material.is_some_and(|m| m.normal_texture.is_some());
        ensure(!is_mapped || mesh.tangents.is_some(), || "normal map without tangents".into())
    }

    fn check_material(&self, m: &Material) -> Check {
        let unit = |v: f32| (0.0..=1.0).contains(&v);
        let base = m.base_color.to_array().into_iter().all(unit);
        ensure(base && unit(m.metallic) && unit(m.roughness), || {
            "base colour, metallic or roughness".into()
        })?;
        ensure(unit(m.specular) && unit(m.transmission), || "specular or transmission".into())?;
        let positive = |v: glam::Vec3| v.is_finite() && v.min_element() >= 0.0;
        let colours = positive(m.emission) && positive(m.absorption) && positive(m.specular_color);
        ensure(colours, || "emission, absorption or specular colour".into())?;
        ensure(m.ior.is_finite() && m.ior >= 1.0, || "index of refraction".into())?;
        ensure(m.normal_scale.is_finite(), || "normal scale".into())?;
        if let AlphaMode::Mask(cutoff) = m.alpha_mode {
            ensure(cutoff.is_finite() && cutoff >= 0.0, || "alpha cutoff".into())?;
        }
        for texture in m.texture_refs() {
            let in_range = (texture.texture as usize) < self.textures.len() && texture.uv_set < 2;
            ensure(in_range && texture.transform.is_finite(), || "texture reference".into())?;
        }
        Ok(())
    }

    fn check_lights(&self) -> Check {
        for (i, light) in self.lights.iter().enumerate() {
            let unit = light.direction.is_normalized() && light.position.is_finite();
            ensure(unit, || format!("lights[{i}]: position or direction"))?;
            let positive = light.intensity.is_finite() && light.intensity.min_element() >= 0.0;
            ensure(positive, || format!("lights[{i}]: intensity"))?;
            if let PunctualKind::Spot { cos_inner, cos_outer } = light.kind {
                let ordered = cos_inner > cos_outer && cos_inner <= 1.0 && cos_outer >= -1e-6;
                ensure(ordered, || format!("lights[{i}]: angles"))?;
            }
        }
        self.environment
            .as_ref()
            .map_or(Ok(()), |e| e.validate().map_err(|what| format!("environment: {what}")))
    }

    fn check_cameras(&self) -> Check {
        for (i, camera) in self.cameras.iter().enumerate() {
            let m = camera.to_world.matrix3;
            let rigid = (m * m.transpose()).abs_diff_eq(glam::Mat3A::IDENTITY, 1e-4) && m.determinant() > 0.0;
            ensure(rigid && camera.to_world.is_finite(), || format!("cameras[{i}]: transform"))?;
            let good = match camera.projection {
                Projection::Perspective { yfov } => yfov > 0.0 && yfov < std::f32::consts::PI,
                Projection::Orthographic { ymag } => ymag > 0.0 && ymag.is_finite(),
            };
            ensure(good, || format!("cameras[{i}]: projection"))?;
        }
        Ok(())
    }
}

fn check_texture(t: &Texture) -> Check {
    let texels = u64::from(t.width) * u64::from(t.height);
    ensure(texels > 0 && t.texels.len() as u64 == texels, || "size".into())
}
