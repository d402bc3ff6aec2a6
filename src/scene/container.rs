//! From the bytes of a file to glTF's JSON and its binary chunk.
//!
//! A GLB is a header (magic, version 2, length) and chunks (length, type, data), all little-endian. The header is
//! believed only as far as the file reaches. The JSON is read by the `gltf` crate's types without its validation,
//! which rejects extensions that are honoured here.

use gltf::json::Root;
use serde_json::Value;
use std::ops::Range;

const MAGIC: &[u8] = b"glTF";
const JSON_CHUNK: u32 = 0x4E4F_534A;
const BIN_CHUNK: u32 = 0x004E_4942;

/// Where the two chunks lie in the file.
#[derive(Debug, PartialEq)]
pub(super) struct Chunks {
    pub(super) json: Range<usize>,
    pub(super) binary: Option<Range<usize>>,
}

/// What is wrong, and where: a byte offset or JSON path.
pub(super) type Fault = (String, String);

fn fault<T>(at: impl Into<String>, what: impl Into<String>) -> Result<T, Fault> {
    Err((at.into(), what.into()))
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    let raw = bytes.get(offset..offset.checked_add(4)?)?;
    Some(u32::from_le_bytes(raw.try_into().ok()?))
}

/// Finds the chunks of a GLB, or takes a text file as one JSON chunk.
pub(super) fn split(bytes: &[u8]) -> Result<Chunks, Fault> {
    if bytes.is_empty() {
        return fault("", "the file is empty; export the scene again");
    }
    if !bytes.starts_with(MAGIC) {
        if bytes.starts_with(&[0xEF, 0xBB, 0xBF]) {
            return fault("byte 0", "a byte order mark, which glTF forbids; save the JSON without it");
        }
        let first = bytes.iter().copied().find(|b| !b.is_ascii_whitespace());
        if first != Some(b'{') {
            return fault("byte 0", "neither a GLB nor a glTF JSON object; give a .glb or .gltf file");
        }
        return Ok(Chunks { json: 0..bytes.len(), binary: None });
    }
    let (Some(version), Some(length)) = (word(bytes, 4), word(bytes, 8)) else {
        return fault("byte 4", "the GLB ends inside its header; copy or export the file again");
    };
    if version != 2 {
        return fault("byte 4", format!("GLB version {version}; only version 2 is read"));
    }
    let length = length as usize;
    if length > bytes.len() {
        return fault(
            "byte 8",
            format!("the GLB is cut off: {} of {length} bytes; copy or export the file again", bytes.len()),
        );
    }
    let (mut json, mut binary, mut offset) = (None, None, 12);
    while offset < length {
        let (Some(size), Some(kind)) = (word(bytes, offset), word(bytes, offset + 4)) else {
            return fault(format!("byte {offset}"), "the GLB ends inside a chunk's header");
        };
        let start = offset + 8;
        let end = start.saturating_add(size as usize);
        if end > length {
            return fault(
                format!("byte {offset}"),
                format!("a chunk of {size} bytes reaches past the end of the GLB"),
            );
        }
        match (kind, &json) {
            (JSON_CHUNK, None) => json = Some(start..end),
            (_, None) => return fault(format!("byte {offset}"), "the first chunk of the GLB is not JSON"),
            (BIN_CHUNK, _) if binary.is_none() => binary = Some(start..end),
            // Later chunks of a known kind and all of an unknown kind are to be ignored.
            _ => {}
        }
        offset = end;
    }
    match json {
        Some(json) => Ok(Chunks { json, binary }),
        None => fault("byte 12", "the GLB has no JSON chunk; export the file again"),
    }
}

/// The JSON as types, and what of it is not typed because it is not honoured.
#[derive(Debug)]
pub(super) struct Parsed {
    pub(super) root: Root,
    pub(super) is_animated: bool,
}

/// Reads the JSON. Integers may be written as `1.0`, as JSON allows.
pub(super) fn parse(json: &[u8]) -> Result<Parsed, Fault> {
    let mut value: Value = match serde_json::from_slice(json) {
        Ok(value) => value,
        Err(e) => return fault("", format!("the JSON is broken: {e}; export the file again")),
    };
    normalise(&mut value);
    let is_animated = set_motion_aside(&mut value);
    let root = serde_path_to_error::deserialize(value).map_err(|e| {
        let path = e.path().to_string();
        (if path == "." { String::new() } else { path }, format!("not glTF: {}", e.into_inner()))
    })?;
    Ok(Parsed { root, is_animated })
}

/// Removes animations and skins, whose types know less than files hold (animation pointers), and gives scenes
/// without nodes an empty list. Says whether there were animations.
fn set_motion_aside(value: &mut Value) -> bool {
    let Value::Object(map) = value else { return false };
    map.remove("skins");
    for scene in map.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Value::Object(scene) = scene {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    map.remove("animations").is_some_and(|animations| animations.as_array().is_some_and(|a| !a.is_empty()))
}

/// Keys whose integers may pass 32 bits.
const WIDE_KEYS: [&str; 4] = ["byteOffset", "byteLength", "byteStride", "count"];

/// Writes whole numbers as integers; an integer that no index can hold becomes a float, which every index refuses
/// (the reader's types would cut it to 32 bits). Application data is dropped unread.
fn normalise(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.remove("extras");
            for (key, value) in map.iter_mut() {
                match value.as_f64() {
                    Some(_) if WIDE_KEYS.contains(&key.as_str()) => whole_number(value, u64::MAX as f64),
                    Some(_) => whole_number(value, f64::from(u32::MAX)),
                    None => normalise(value),
                }
            }
        }
        Value::Array(items) => {
            for item in items {
                if item.is_number() { whole_number(item, f64::from(u32::MAX)) } else { normalise(item) }
            }
        }
        _ => {}
    }
}

fn whole_number(value: &mut Value, limit: f64) {
    let Some(number) = value.as_f64() else { return };
    if value.is_f64() && number.fract() == 0.0 && number >= 0.0 && number < limit.min(9.0e15) {
        *value = Value::from(number as u64);
    } else if !value.is_f64() && number > limit {
        *value = Value::from(number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(u32, &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, data) in chunks {
            body.extend((data.len() as u32).to_le_bytes());
            body.extend(kind.to_le_bytes());
            body.extend(*data);
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(2u32.to_le_bytes());
        bytes.extend((12 + body.len() as u32).to_le_bytes());
        bytes.extend(body);
        bytes
    }

    #[test]
    fn finds_both_chunks_and_ignores_unknown_ones() {
        let bytes = glb(&[(JSON_CHUNK, b"{}  "), (7, b"abcd"), (BIN_CHUNK, b"1234")]);
        assert_eq!(split(&bytes), Ok(Chunks { json: 20..24, binary: Some(44..48) }));
    }

    #[test]
    fn rejects_every_truncation_and_a_zero_length() {
        let bytes = glb(&[(JSON_CHUNK, b"{}  "), (BIN_CHUNK, b"1234")]);
        for n in 0..bytes.len() {
            assert!(split(&bytes[..n]).is_err(), "{n} bytes were accepted");
        }
        let mut zero = bytes.clone();
        zero[8..12].fill(0);
        assert!(split(&zero).is_err());
        let mut huge = bytes;
        huge[12..16].fill(255);
        assert!(split(&huge).is_err());
    }

    #[test]
    fn whole_numbers_become_integers_and_wide_indices_are_refused() {
        let good =
            br#"{"asset":{"version":"2.0"},"scene":1e0,"bufferViews":[{"buffer":0.0,"byteLength":10e-1}]}"#;
        let parsed = parse(good).expect("integers written as floats are legal");
        assert_eq!(parsed.root.scene.map(|s| s.value()), Some(1));
        let wide =
            parse(br#"{"asset":{"version":"2.0"},"scene":4294967296}"#).expect_err("no index is that wide");
        assert_eq!(wide.0, "scene");
        let typed = parse(br#"{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":3}]}]}"#)
            .expect_err("attributes are an object");
        assert_eq!(typed.0, "meshes[0].primitives[0].attributes");
    }
}
