//! What the scene loader makes of good files.

mod gltf_builder;

use gdpt::scene::{AlphaMode, Environment, LoadOptions, LoadReport, PunctualKind, Scene, Wrap, describe};
use glam::{Vec2, Vec3, Vec3A, Vec4};
use gltf_builder::{Builder, load_bytes, load_checked, png, push, shared};
use serde_json::json;

fn load(b: &Builder) -> Scene {
    b.load().unwrap_or_else(|e| panic!("{e}"))
}

/// Unit geometric normal of triangle `t` in world space.
fn normal(scene: &Scene, mesh: usize, t: usize) -> Vec3A {
    let m = &scene.meshes[mesh];
    let [a, b, c] = m.triangles[t].map(|i| m.positions[i as usize]);
    (b - a).cross(c - a).normalize()
}

#[test]
fn glb_inline_and_separate_buffers_give_the_same_scene() {
    let b = Builder::triangle();
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("data")).unwrap();
    std::fs::write(folder.path().join("data/my buffer.bin"), &b.binary).unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, b.gltf_with_uri("data/my%20buffer.bin")).unwrap();
    let scenes =
        [load(&b), load_bytes(&b.inline_gltf(), "scene.gltf").unwrap(), load_checked(&path).unwrap()];
    for scene in &scenes {
        assert_eq!(scene.triangle_count(), 1);
        assert_eq!(scene.meshes[0].positions[1], Vec3A::X);
        assert!(scene.instances[0].is_identity);
        // The specification's default material.
        assert_eq!(scene.materials[0].metallic, 1.0);
    }
}

#[test]
fn a_mirrored_node_keeps_front_normals_and_bitangents() {
    let mut b = Builder::textured_square();
    b.json["nodes"] = json!([{"mesh": 0, "scale": [-2.0, 1.0, 1.0], "translation": [0.0, 0.0, 5.0]}]);
    let scene = load(&b);
    assert!(normal(&scene, 0, 0).abs_diff_eq(Vec3A::Z, 1e-6));
    let mesh = &scene.meshes[0];
    let (n, t) = (mesh.normals.as_ref().unwrap()[0], mesh.tangents.as_ref().unwrap()[0]);
    assert!(n.abs_diff_eq(Vec3::Z, 1e-6));
    // u grows towards −x, the image's top stays at +y.
    assert!(t.truncate().abs_diff_eq(Vec3::NEG_X, 1e-5), "{t}");
    assert!((n.cross(t.truncate()) * t.w).abs_diff_eq(Vec3::Y, 1e-5), "{t}");
}

#[test]
fn generated_tangents_point_along_u_and_up_the_image() {
    let scene = load(&Builder::textured_square());
    for t in scene.meshes[0].tangents.as_ref().unwrap() {
        assert!(t.abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-5), "{t}");
    }
    assert_eq!(scene.meshes[0].normals.as_ref().unwrap()[0], Vec3::Z);
}

#[test]
fn mirrored_coordinates_split_the_vertices_of_the_seam() {
    let mut b = Builder::textured_square();
    let uv = b.floats(&[[0.0, 1.0], [1.0, 1.0], [0.0, 1.0], [1.0, 1.0]]);
    b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = json!(uv);
    let scene = load(&b);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.triangles.len(), 2);
    assert_eq!(mesh.tangents.as_ref().unwrap().len(), mesh.positions.len());
}

#[test]
fn a_normal_map_without_normals_gives_flat_ones() {
    let mut b = Builder::textured_square();
    b.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("NORMAL");
    let scene = load(&b);
    assert!(scene.meshes[0].normals.as_ref().unwrap().iter().all(|n| *n == Vec3::Z));
    assert!(scene.meshes[0].tangents.is_some());
}

#[test]
fn one_mesh_under_three_nodes_is_one_mesh_and_three_instances() {
    let mut b = Builder::triangle();
    b.json["nodes"] = json!([
        {"children": [1, 2, 3], "matrix": [2,0,0,0, 0,2,0,0, 0,0,2,0, 10,0,0,1]},
        {"mesh": 0}, {"mesh": 0, "translation": [1, 2, 3]}, {"mesh": 0, "scale": [1, 1, -1]},
    ]);
    let scene = load(&b);
    assert_eq!((scene.meshes.len(), scene.instances.len(), scene.triangle_count()), (1, 3, 3));
    let origin = |i: usize| scene.instances[i].to_world.transform_point3(Vec3::X);
    assert_eq!([origin(0), origin(1)], [Vec3::new(12.0, 0.0, 0.0), Vec3::new(14.0, 4.0, 6.0)]);
    assert!(scene.instances[2].to_world.matrix3.determinant() < 0.0);
}

#[test]
fn gpu_instancing_multiplies_a_mesh() {
    let mut b = Builder::triangle();
    let t = b.floats(&[[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]);
    b.json["nodes"] = json!([{"mesh": 0, "extensions":
        {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": t}}}}]);
    b.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let scene = load(&b);
    assert_eq!((scene.meshes.len(), scene.instances.len()), (1, 2));
    assert_eq!(scene.instances[1].to_world.translation, Vec3A::new(5.0, 0.0, 0.0));
}

#[test]
fn trs_is_scale_then_rotation_then_translation() {
    let mut b = Builder::triangle();
    let half = std::f32::consts::FRAC_1_SQRT_2;
    b.json["nodes"] =
        json!([{"mesh": 0, "scale": [2, 1, 1], "rotation": [0, 0, half, half], "translation": [1, 0, 0]}]);
    let scene = load(&b);
    assert!(scene.meshes[0].positions[1].abs_diff_eq(Vec3A::new(1.0, 2.0, 0.0), 1e-6));
}

#[test]
fn strips_and_fans_keep_their_winding_and_points_are_skipped() {
    let mut b = Builder::new();
    let p = b.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
    let f = b.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
    b.json["meshes"] = json!([
        {"primitives": [{"attributes": {"POSITION": p}, "mode": 5}, {"attributes": {"POSITION": p}, "mode": 0}]},
        {"primitives": [{"attributes": {"POSITION": f}, "mode": 6}]},
    ]);
    b.json["nodes"] = json!([{"mesh": 0}, {"mesh": 1}]);
    let scene = load(&b);
    assert_eq!(scene.meshes.len(), 2);
    for mesh in 0..2 {
        assert_eq!(scene.meshes[mesh].triangles.len(), 2);
        assert!((0..2).all(|t| normal(&scene, mesh, t) == Vec3A::Z));
    }
    assert!(scene.report.warnings.iter().any(|w| w.contains("points and lines")));
}

#[test]
fn accessors_of_every_component_type_stride_and_sparse_parts() {
    // Quantised positions, normalised, interleaved with a stride of 8 and an offset of 4.
    let mut b = Builder::triangle();
    let mut bytes = vec![9u8; 4];
    for v in [[0i16, 0, 0], [32767, 0, 0], [0, -32768, 0]] {
        bytes.extend(v.iter().flat_map(|c| c.to_le_bytes()));
        bytes.extend([7, 7]);
    }
    let a = b.accessor(&bytes[..26], 5122, "VEC3", 3);
    b.json["accessors"][a]["normalized"] = json!(true);
    b.json["accessors"][a]["byteOffset"] = json!(4);
    let view = b.json["accessors"][a]["bufferView"].as_u64().unwrap() as usize;
    b.json["bufferViews"][view]["byteStride"] = json!(8);
    // The second vertex is replaced: sparse.
    let at = b.view(&[1u8]);
    let replacement: Vec<u8> = [16384i16, 0, 0].iter().flat_map(|c| c.to_le_bytes()).collect();
    let values = b.view(&replacement);
    b.json["accessors"][a]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": at, "componentType": 5121}, "values": {"bufferView": values}});
    b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(a);
    let scene = load(&b);
    let p = &scene.meshes[0].positions;
    assert_eq!(p[1].x, 16384.0 / 32767.0);
    assert_eq!(p[2].y, -1.0);
    // Every other type, unnormalised.
    for (component, raw) in [
        (5120, vec![0u8, 0, 0, 2, 0, 0, 0, 254, 0]),
        (5121, vec![0, 0, 0, 2, 0, 0, 0, 254, 0]),
        (5123, vec![0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 254, 0, 0, 0]),
        (5125, [0u32, 0, 0, 2, 0, 0, 0, 254, 0].iter().flat_map(|v| v.to_le_bytes()).collect()),
    ] {
        let mut b = Builder::triangle();
        let a = b.accessor(&raw, component, "VEC3", 3);
        b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(a);
        let scene = load(&b);
        let expected = if component == 5120 { -2.0 } else { 254.0 };
        assert_eq!(scene.meshes[0].positions[1..], [Vec3A::X * 2.0, Vec3A::Y * expected], "{component}");
    }
}

#[test]
fn materials_carry_every_extension() {
    let mut b = Builder::textured_square();
    b.json["materials"] = json!([{
    "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
    "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.25,
        "roughnessFactor": 0.75},
    "emissiveFactor": [1, 0.5, 0],
    "normalTexture": {"index": 0, "extensions": {"KHR_texture_transform": {"offset": [0.5, 0.25]}}},
    "extensions": {
        "KHR_materials_emissive_strength": {"emissiveStrength": 20},
        "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 0.5, 0.25],
            "specularColorTexture": {"index": 0}},
        "KHR_materials_ior": {"ior": 1.33},
        "KHR_materials_transmission": {"transmissionFactor": 0.75},
        "KHR_materials_volume": {"thicknessFactor": 0.01, "attenuationDistance": 2,
            "attenuationColor": [1, 0.5, 0.25]},
        "KHR_materials_clearcoat": {"clearcoatFactor": 1},
    }}]);
    b.json["extensionsUsed"] = json!(["KHR_materials_ior", "KHR_materials_clearcoat"]);
    let scene = load(&b);
    let m = &scene.materials[0];
    assert_eq!(m.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((m.metallic, m.roughness, m.ior, m.transmission, m.specular), (0.25, 0.75, 1.33, 0.75, 0.5));
    assert_eq!(m.emission, Vec3::new(20.0, 10.0, 0.0));
    assert_eq!(m.alpha_mode, AlphaMode::Mask(0.25));
    assert!(m.is_solid && !m.unlit);
    assert!(!m.double_sided, "by default light leaves the front alone");
    assert!(m.absorption.abs_diff_eq(Vec3::new(0.0, 0.5f32.ln(), 0.25f32.ln()) / -2.0, 1e-6));
    let normal = m.normal_texture.unwrap();
    assert_eq!(normal.transform.transform_point2(Vec2::ZERO), Vec2::new(0.5, 0.25));
    assert!(!scene.textures[normal.texture as usize].srgb);
    assert!(scene.textures[m.specular_color_texture.unwrap().texture as usize].srgb);
    assert_eq!(scene.report.extensions_honoured, ["KHR_materials_ior"]);
    assert_eq!(scene.report.extensions_ignored, ["KHR_materials_clearcoat"]);
    assert!(scene.report.warnings.iter().any(|w| w.contains("KHR_materials_clearcoat")));
}

#[test]
fn one_image_is_decoded_once_for_colour_and_for_data() {
    let mut b = Builder::textured_square();
    b.json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    b.json["textures"][0]["sampler"] = json!(0);
    let scene = load(&b);
    assert_eq!(scene.textures.len(), 2);
    assert_eq!(scene.textures.iter().map(|t| t.srgb).collect::<Vec<_>>(), [true, false]);
    assert_eq!(scene.textures[0].texels.as_ptr(), scene.textures[1].texels.as_ptr());
    assert_eq!(*scene.textures[0].texels, [[255, 0, 0, 255], [0, 255, 0, 128]]);
    assert_eq!(scene.textures[0].wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert!(!scene.textures[0].linear_filter);
}

#[test]
fn webp_and_jpeg_are_read_and_webp_wins() {
    let mut b = Builder::textured_square();
    let pixels = image::RgbImage::from_pixel(3, 2, image::Rgb([200, 100, 50]));
    for format in [image::ImageFormat::Jpeg, image::ImageFormat::WebP] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        pixels.write_to(&mut bytes, format).unwrap();
        let view = b.view(&bytes.into_inner());
        let image = push(&mut b.json["images"], json!({"bufferView": view}));
        b.json["textures"][0] = json!({"source": 0, "extensions": {"EXT_texture_webp": {"source": image}}});
        let scene = load(&b);
        assert_eq!((scene.textures[0].width, scene.textures[0].height), (3, 2));
        let [r, g, blue, a] = scene.textures[0].texels[0];
        assert!(r.abs_diff(200) < 4 && g.abs_diff(100) < 4 && blue.abs_diff(50) < 4 && a == 255);
    }
}

#[test]
fn missing_textures_are_magenta_where_they_are_colours() {
    let mut b = Builder::textured_square();
    b.json["images"] = json!([{"uri": "nowhere.png"}]);
    let scene = load(&b);
    assert_eq!(scene.report.missing_textures, 1);
    let m = &scene.materials[0];
    let colour = &scene.textures[m.base_color_texture.unwrap().texture as usize];
    assert_eq!(*colour.texels, [[255, 0, 255, 255]]);
    assert!(m.normal_texture.is_none() && m.metallic_roughness_texture.is_none());
    let mut corrupt = Builder::textured_square();
    let view = corrupt.view(&png(&[[1, 2, 3, 4]; 64], 8)[..60]);
    corrupt.json["images"] = json!([{"bufferView": view}]);
    assert_eq!(load(&corrupt).report.missing_textures, 1);
}

#[test]
fn vertex_colours_and_second_coordinates_are_read() {
    let mut b = Builder::textured_square();
    let c = b.accessor(&[255, 0, 51, 255].repeat(4), 5121, "VEC4", 4);
    b.json["accessors"][c]["normalized"] = json!(true);
    let uv = b.floats(&[[0.5, 0.25]; 4]);
    let attributes = &mut b.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["COLOR_0"] = json!(c);
    attributes["TEXCOORD_1"] = json!(uv);
    b.json["materials"][0]["emissiveTexture"]["texCoord"] = json!(1);
    let scene = load(&b);
    assert_eq!(scene.meshes[0].colors.as_ref().unwrap()[0], Vec4::new(1.0, 0.0, 0.2, 1.0));
    assert_eq!(scene.meshes[0].uvs[1].as_ref().unwrap()[0], Vec2::new(0.5, 0.25));
    assert_eq!(scene.materials[0].emission_texture.unwrap().uv_set, 1);
}

#[test]
fn punctual_lights_are_placed_and_converted() {
    let mut b = Builder::triangle();
    b.json["asset"]["generator"] = json!("Khronos glTF Blender I/O v4.2");
    b.json["extensions"] = json!({"KHR_lights_punctual": {"lights": [
        {"type": "point", "intensity": 683, "color": [1, 0.5, 0]},
        {"type": "spot", "intensity": 1366, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}},
        {"type": "directional", "intensity": 683},
        {"type": "point", "intensity": 0},
    ]}});
    let quarter = std::f32::consts::FRAC_1_SQRT_2;
    let light = |i: u32| {
        json!({"extensions": {"KHR_lights_punctual": {"light": i}}, "scale": [3, 3, 3],
        "translation": [1, 2, 3], "rotation": [-quarter, 0, 0, quarter]})
    };
    b.json["nodes"] = json!([{"mesh": 0}, light(0), light(1), light(2), light(3)]);
    let scene = load(&b);
    assert_eq!(scene.lights.len(), 3);
    assert!(scene.lights[0].intensity.abs_diff_eq(Vec3::new(1.0, 0.5, 0.0), 1e-6));
    assert_eq!(scene.lights[0].position, Vec3::new(1.0, 2.0, 3.0));
    assert!(scene.lights[1].direction.abs_diff_eq(Vec3::NEG_Y, 1e-6));
    let PunctualKind::Spot { cos_inner, cos_outer } = scene.lights[1].kind else {
        panic!("not a spot light")
    };
    assert_eq!((cos_inner, cos_outer), (0.1f32.cos(), 0.2f32.cos()));
    assert!(scene.has_light());
    b.json["asset"]["generator"] = json!("something else");
    assert_eq!(load(&b).lights[1].intensity, Vec3::splat(1366.0));
}

#[test]
fn cameras_lose_scale_and_mirroring_and_one_is_fitted_where_none_is() {
    let mut b = Builder::triangle();
    let fitted = load(&b);
    assert_eq!(fitted.cameras.len(), 1);
    assert!(fitted.report.warnings.iter().any(|w| w.contains("no camera")));
    let (lower, upper) = fitted.bounds().unwrap();
    let to_camera = fitted.cameras[0].to_world.inverse();
    for corner in 0..8 {
        let pick = |bit: u32, lo: f32, hi: f32| if corner >> bit & 1 == 0 { lo } else { hi };
        let p = Vec3::new(pick(0, lower.x, upper.x), pick(1, lower.y, upper.y), pick(2, lower.z, upper.z));
        let p = to_camera.transform_point3(p);
        assert!(p.z < 0.0 && p.x.hypot(p.y) / -p.z < (0.35f32).tan());
    }
    b.json["cameras"] = json!([
        {"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}, "name": "main"},
        {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 2, "znear": 0, "zfar": 9}},
    ]);
    b.json["nodes"] = json!([{"mesh": 0}, {"camera": 0, "scale": [-2, 3, 4]}, {"camera": 1, "name": "top"}]);
    let scene = load(&b);
    assert_eq!(scene.cameras.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["main", "top"]);
    assert!(scene.cameras[0].to_world.matrix3.abs_diff_eq(glam::Mat3A::IDENTITY, 1e-6));
}

#[test]
fn bad_vertices_cost_their_triangles_only() {
    let mut b = Builder::new();
    let p = b.floats(&[
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [f32::NAN, 0.0, 0.0],
        [f32::INFINITY, 0.0, 0.0],
        [1e30, 0.0, 0.0],
        [2.0, 0.0, 0.0],
    ]);
    let n = b.floats(&[[0.0; 3], [f32::NAN; 3], [0.0, 1e-30, 0.0], [0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]]);
    let i = b.indices(&[0, 1, 2, 0, 1, 3, 0, 1, 4, 0, 1, 5, 0, 1, 6, 0, 0, 1]);
    b.json["meshes"] = json!([{"primitives": [{"attributes": {"POSITION": p, "NORMAL": n}, "indices": i}]}]);
    b.json["nodes"] = json!([{"mesh": 0}]);
    let scene = load(&b);
    assert_eq!((scene.triangle_count(), scene.report.dropped_triangles), (1, 5));
    assert_eq!(scene.meshes[0].normals.as_ref().unwrap()[..3], [Vec3::Z, Vec3::Z, Vec3::Y]);
    // A whole accessor of NaN: an empty scene, not an error.
    let nan = b.floats(&[[f32::NAN; 3]; 7]);
    b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(nan);
    let scene = load(&b);
    assert_eq!((scene.meshes.len(), scene.report.dropped_triangles), (0, 6));
    assert_eq!(scene.cameras.len(), 1);
}

#[test]
fn environments_of_both_formats_are_read_and_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let texel = |x: usize, y: usize| match (x, y) {
        (0, 0) => (f32::NAN, -1.0, 2.0),
        (1, 0) => (f32::INFINITY, 1.0, 1.0),
        _ => (x as f32, y as f32, 0.5),
    };
    let exr_path = folder.path().join("sky.exr");
    exr::prelude::write_rgb_file(&exr_path, 4, 2, texel).unwrap();
    let mut report = LoadReport::default();
    let e = Environment::load_reporting(&exr_path, 2.0, 90.0, true, &mut report).unwrap();
    assert_eq!((e.width, e.height), (4, 2));
    assert_eq!(e.texels[0], Vec3::new(0.0, 0.0, 4.0));
    assert_eq!(e.texels[1], Vec3::new(131008.0, 2.0, 2.0));
    assert_eq!(e.texels[4 + 3], Vec3::new(6.0, 2.0, 1.0));
    assert_eq!(e.rotation, std::f32::consts::FRAC_PI_2);
    assert!(report.warnings[0].contains("2 texels"), "{:?}", report.warnings);

    let hdr_path = folder.path().join("sky.hdr");
    let pixels = vec![image::Rgb([1.0f32, 0.5, 0.25]); 8];
    let file = std::fs::File::create(&hdr_path).unwrap();
    image::codecs::hdr::HdrEncoder::new(file).encode(&pixels, 4, 2).unwrap();
    let e = Environment::load(&hdr_path, 1.0, 0.0, false).unwrap();
    assert_eq!((e.width, e.height, e.visible), (4, 2, false));
    assert!(e.texels[5].abs_diff_eq(Vec3::new(1.0, 0.5, 0.25), 0.01));

    std::fs::write(folder.path().join("x.hdr"), "#?RADIANCE\nbroken").unwrap();
    for (path, status) in [("x.hdr", 65), ("absent.exr", 66), ("", 66)] {
        let error = Environment::load(&folder.path().join(path), 1.0, 0.0, true).unwrap_err();
        assert_eq!(error.exit_code(), status, "{error}");
    }
    let whole = std::fs::read(&exr_path).unwrap();
    for n in 0..whole.len() {
        std::fs::write(folder.path().join("cut.exr"), &whole[..n]).unwrap();
        if let Ok(e) = Environment::load(&folder.path().join("cut.exr"), 1.0, 0.0, true) {
            e.validate().unwrap();
        }
    }
}

#[test]
fn shared_scenes_load_with_their_triangles() {
    let Some(folder) = shared("scenes") else { return };
    for (name, triangles) in
        [("cornell-box", 36), ("sponza", 75_661), ("veach-ajar", 382_690), ("living-room", 143_163)]
    {
        let path = folder.join(format!("{name}.glb"));
        let start = std::time::Instant::now();
        let scene = gdpt::scene::load(&path, &LoadOptions::default()).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        scene.validate().unwrap();
        let dropped = scene.report.dropped_triangles;
        println!("{name}: {seconds:.3} s, {} triangles, {dropped} dropped", scene.triangle_count());
        println!("{}", describe(&scene));
        assert_eq!(scene.triangle_count() + dropped, triangles);
        assert_eq!((scene.report.missing_textures, scene.cameras.len()), (0, 1));
        // What is wrong with so few is the file: slivers without area.
        assert!(dropped * 100 < triangles, "{dropped} dropped");
    }
    let sky = Environment::load(&folder.join("living-room-sky.exr"), 1.0, 0.0, true).unwrap();
    sky.validate().unwrap();
}
