//! Small glTF files, built in memory for the scene tests.

use base64::Engine;
use gdpt::error::{Error, Result};
use gdpt::scene::{self, LoadOptions, Scene};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A glTF file while it is being put together: JSON and one buffer.
pub struct Builder {
    pub json: Value,
    pub binary: Vec<u8>,
}

#[allow(dead_code, reason = "each test program uses its own part of the builder")]
impl Builder {
    /// A file with nothing in it.
    pub fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"},
            "accessors": [], "bufferViews": [], "meshes": [], "nodes": [], "materials": [],
        });
        Self { json, binary: Vec::new() }
    }

    /// One right triangle in the plane z = 0, facing +z, under one node.
    pub fn triangle() -> Self {
        let mut b = Self::new();
        let positions = b.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let indices = b.indices(&[0, 1, 2]);
        b.json["meshes"] =
            json!([{"primitives": [{"attributes": {"POSITION": positions}, "indices": indices}]}]);
        b.json["nodes"] = json!([{"mesh": 0}]);
        b
    }

    /// A unit square in z = 0 with normals, coordinates (v down) and a material with all core textures.
    pub fn textured_square() -> Self {
        let mut b = Self::new();
        let p = b.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        let n = b.floats(&[[0.0, 0.0, 2.0]; 4]);
        let uv = b.floats(&[[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]);
        let i = b.indices(&[0, 1, 2, 0, 2, 3]);
        b.json["meshes"] = json!([{"primitives": [{
            "attributes": {"POSITION": p, "NORMAL": n, "TEXCOORD_0": uv}, "indices": i, "material": 0}]}]);
        b.json["nodes"] = json!([{"mesh": 0}]);
        let png = png(&[[255, 0, 0, 255], [0, 255, 0, 128]], 2);
        let view = b.view(&png);
        b.json["images"] = json!([{"bufferView": view, "mimeType": "image/png"}]);
        b.json["textures"] = json!([{"source": 0}]);
        b.json["materials"] = json!([{
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
            "normalTexture": {"index": 0, "scale": 0.5},
            "emissiveTexture": {"index": 0}, "emissiveFactor": [1.0, 0.5, 0.25]}]);
        b
    }

    /// Appends bytes as a bufferView; returns its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.binary.len().is_multiple_of(4) {
            self.binary.push(0);
        }
        let view = json!({"buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len()});
        self.binary.extend(bytes);
        push(&mut self.json["bufferViews"], view)
    }

    /// Appends an accessor over a new view.
    pub fn accessor(&mut self, bytes: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(bytes);
        let accessor = json!({"bufferView": view, "componentType": component, "type": kind, "count": count});
        push(&mut self.json["accessors"], accessor)
    }

    /// An accessor of float vectors.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"][N];
        self.accessor(&bytes, 5126, kind, values.len())
    }

    /// An accessor of 16-bit indices.
    pub fn indices(&mut self, values: &[u16]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(&bytes, 5123, "SCALAR", values.len())
    }

    fn finished(&self, uri: Option<String>) -> Value {
        let mut json = self.json.clone();
        if !self.binary.is_empty() && json.get("buffers").is_none() {
            json["buffers"] = json!([{"byteLength": self.binary.len()}]);
            if let Some(uri) = uri {
                json["buffers"][0]["uri"] = json!(uri);
            }
        }
        json
    }

    /// As a GLB.
    pub fn glb(&self) -> Vec<u8> {
        let mut text = self.finished(None).to_string().into_bytes();
        while !text.len().is_multiple_of(4) {
            text.push(b' ');
        }
        let mut binary = self.binary.clone();
        while !binary.len().is_multiple_of(4) {
            binary.push(0);
        }
        let mut out = b"glTF".to_vec();
        out.extend(2u32.to_le_bytes());
        out.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
            out.extend((chunk.len() as u32).to_le_bytes());
            out.extend(kind);
            out.extend(chunk);
        }
        out
    }

    /// As a .gltf with its buffer inline.
    pub fn inline_gltf(&self) -> Vec<u8> {
        let data = base64::engine::general_purpose::STANDARD.encode(&self.binary);
        self.finished(Some(format!("data:application/octet-stream;base64,{data}"))).to_string().into_bytes()
    }

    /// As a .gltf that names a buffer by a URI.
    pub fn gltf_with_uri(&self, uri: &str) -> Vec<u8> {
        self.finished(Some(uri.into())).to_string().into_bytes()
    }

    /// Writes the GLB into a folder of its own and loads it.
    pub fn load(&self) -> Result<Scene> {
        load_bytes(&self.glb(), "scene.glb")
    }
}

/// Appends to a JSON array; returns the index.
pub fn push(array: &mut Value, item: Value) -> usize {
    let items = array.as_array_mut().expect("the builder makes it an array");
    items.push(item);
    items.len() - 1
}

/// A PNG of RGBA pixels.
pub fn png(pixels: &[[u8; 4]], width: u32) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let height = pixels.len() as u32 / width;
    let image = image::RgbaImage::from_raw(width, height, pixels.concat()).expect("the sizes agree");
    image.write_to(&mut out, image::ImageFormat::Png).expect("memory takes everything");
    out.into_inner()
}

/// Loads bytes as a file in a folder of its own; what comes out keeps the scene's promise.
pub fn load_bytes(bytes: &[u8], name: &str) -> Result<Scene> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    load_checked(&path)
}

/// Loads a file; what comes out keeps the scene's promise.
pub fn load_checked(path: &Path) -> Result<Scene> {
    let scene = scene::load(path, &LoadOptions::default())?;
    if let Err(fault) = scene.validate() {
        panic!("{}: the scene breaks its promise: {fault}", path.display());
    }
    let _ = scene::describe(&scene);
    Ok(scene)
}

/// The text of the error; it must be one line and end with the wanted status.
#[allow(dead_code, reason = "each test program uses its own part of the builder")]
pub fn error_text(result: Result<Scene>, status: u8) -> String {
    let error = match result {
        Ok(_) => panic!("it was accepted"),
        Err(error) => error,
    };
    let text = error.to_string();
    assert_eq!(error.exit_code(), status, "{text}");
    assert!(!text.contains('\n'), "more than one line: {text:?}");
    assert!(!matches!(error, Error::Usage(_)));
    text
}

/// The folder of shared test data above the checkout, where there is one.
#[allow(dead_code, reason = "each test program uses its own part of the builder")]
pub fn shared(part: &str) -> Option<PathBuf> {
    let start = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = start.ancestors().map(|a| a.join("shared").join(part)).find(|p| p.is_dir());
    if found.is_none() {
        println!("skipped: shared/{part} absent");
    }
    found
}
