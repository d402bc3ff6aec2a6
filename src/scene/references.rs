//! Every index of a glTF file, checked once: an index out of range rejects the file, whoever would use it.

use super::container::Fault;
use gltf::json::accessor::Accessor;
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, texture};

/// Checks one index against the number of things it may name.
fn index(value: usize, count: usize, kind: &str, at: impl FnOnce() -> String) -> Result<(), Fault> {
    if value < count {
        return Ok(());
    }
    let what = format!("names {kind} {value}, but there are {count}; export the file again");
    Err((at(), what))
}

fn optional<T>(
    value: Option<Index<T>>,
    count: usize,
    kind: &str,
    at: impl FnOnce() -> String,
) -> Result<(), Fault> {
    value.map_or(Ok(()), |i| index(i.value(), count, kind, at))
}

/// Checks all references between the arrays of the file.
pub(super) fn check(root: &Root) -> Result<(), Fault> {
    buffers(root)?;
    images(root)?;
    materials(root)?;
    meshes(root)?;
    for (i, node) in root.nodes.iter().enumerate() {
        optional(node.mesh, root.meshes.len(), "mesh", || format!("nodes[{i}].mesh"))?;
        optional(node.camera, root.cameras.len(), "camera", || format!("nodes[{i}].camera"))?;
        for (k, child) in node.children.iter().flatten().enumerate() {
            index(child.value(), root.nodes.len(), "node", || format!("nodes[{i}].children[{k}]"))?;
        }
    }
    for (i, scene) in root.scenes.iter().enumerate() {
        for (k, node) in scene.nodes.iter().enumerate() {
            index(node.value(), root.nodes.len(), "node", || format!("scenes[{i}].nodes[{k}]"))?;
        }
    }
    optional(root.scene, root.scenes.len(), "scene", || "scene".into())
}

fn buffers(root: &Root) -> Result<(), Fault> {
    for (i, view) in root.buffer_views.iter().enumerate() {
        let buffer = view.buffer.value();
        index(buffer, root.buffers.len(), "buffer", || format!("bufferViews[{i}].buffer"))?;
        let end = view.byte_offset.map_or(0, |o| o.0).checked_add(view.byte_length.0);
        let length = root.buffers.get(buffer).map_or(0, |b| b.byte_length.0);
        if end.is_none_or(|end| end > length) {
            let what =
                format!("reaches past the end of buffer {buffer} ({length} bytes); export the file again");
            return Err((format!("bufferViews[{i}]"), what));
        }
    }
    let views = root.buffer_views.len();
    for (i, accessor) in root.accessors.iter().enumerate() {
        optional(accessor.buffer_view, views, "bufferView", || format!("accessors[{i}].bufferView"))?;
        check_stride(root, accessor).map_err(|what| (format!("accessors[{i}]"), what))?;
        if let Some(sparse) = &accessor.sparse {
            let (replaced, count) = (sparse.count.0, accessor.count.0);
            if replaced > count {
                return Err((
                    format!("accessors[{i}].sparse.count"),
                    format!("replaces {replaced} of {count} elements"),
                ));
            }
            let (indices, values) = (sparse.indices.buffer_view.value(), sparse.values.buffer_view.value());
            index(indices, views, "bufferView", || format!("accessors[{i}].sparse.indices.bufferView"))?;
            index(values, views, "bufferView", || format!("accessors[{i}].sparse.values.bufferView"))?;
        }
    }
    Ok(())
}

fn check_stride(root: &Root, accessor: &Accessor) -> Result<(), String> {
    let stride =
        accessor.buffer_view.and_then(|v| root.buffer_views.get(v.value())).and_then(|v| v.byte_stride);
    if let (Some(stride), Checked::Valid(component), Checked::Valid(kind)) =
        (stride, accessor.component_type, accessor.type_)
    {
        let size = component.0.size() * kind.multiplicity();
        if stride.0 < size {
            return Err(format!(
                "elements of {size} bytes overlap at a stride of {}; export the file again",
                stride.0
            ));
        }
    }
    Ok(())
}

fn images(root: &Root) -> Result<(), Fault> {
    for (i, image) in root.images.iter().enumerate() {
        let at = || format!("images[{i}].bufferView");
        optional(image.buffer_view, root.buffer_views.len(), "bufferView", at)?;
    }
    for (i, texture) in root.textures.iter().enumerate() {
        optional(texture.sampler, root.samplers.len(), "sampler", || format!("textures[{i}].sampler"))?;
        // u32::MAX stands for a texture without a source.
        let source = texture.source.value();
        if source != u32::MAX as usize {
            index(source, root.images.len(), "image", || format!("textures[{i}].source"))?;
        }
    }
    Ok(())
}

fn materials(root: &Root) -> Result<(), Fault> {
    for (i, material) in root.materials.iter().enumerate() {
        let pbr = &material.pbr_metallic_roughness;
        let info = |t: &Option<texture::Info>| t.as_ref().map(|t| t.index);
        let uses = [
            (info(&pbr.base_color_texture), "pbrMetallicRoughness.baseColorTexture"),
            (info(&pbr.metallic_roughness_texture), "pbrMetallicRoughness.metallicRoughnessTexture"),
            (info(&material.emissive_texture), "emissiveTexture"),
            (material.normal_texture.as_ref().map(|t| t.index), "normalTexture"),
            (material.occlusion_texture.as_ref().map(|t| t.index), "occlusionTexture"),
        ];
        for (use_of, name) in uses {
            optional(use_of, root.textures.len(), "texture", || format!("materials[{i}].{name}.index"))?;
        }
    }
    Ok(())
}

fn meshes(root: &Root) -> Result<(), Fault> {
    let accessors = root.accessors.len();
    for (i, mesh) in root.meshes.iter().enumerate() {
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let at = |field: &str| format!("meshes[{i}].primitives[{k}].{field}");
            optional(primitive.indices, accessors, "accessor", || at("indices"))?;
            optional(primitive.material, root.materials.len(), "material", || at("material"))?;
            for accessor in primitive.attributes.values() {
                index(accessor.value(), accessors, "accessor", || at("attributes"))?;
            }
        }
    }
    Ok(())
}
