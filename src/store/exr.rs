//! OpenEXR: single part, scan lines, ZIP, float32, linear Rec.709.
//!
//! The encoder keeps unknown attributes in a hash map whose order changes from run to run; [`encode`] sorts them
//! in the encoded header, so that equal documents give equal bytes.

use super::{Document, Window, atomic};
use crate::error::{Error, Result};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatImage, FlatSamples, Image, Layer,
    LayerAttributes, ReadChannels, ReadLayers, WritableImage, read,
};
use std::io::{Cursor, Error as IoError};
use std::path::Path;

/// Primaries and white of Rec.709, CIE xy.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Text as the format holds it: Latin letters; anything else becomes `?`.
fn text(value: &str) -> Text {
    let plain: String =
        value.chars().map(|c| if c.is_ascii() && !c.is_control() { c } else { '?' }).collect();
    Text::new_or_none(plain).expect("ASCII is always representable")
}

/// Writes a document as EXR, atomically.
pub fn write(path: &Path, document: &Document) -> Result<()> {
    let bytes = encode(document).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    atomic::write(path, &bytes)
}

/// The bytes of an EXR file.
pub fn encode(document: &Document) -> std::io::Result<Vec<u8>> {
    let size = Vec2(document.width, document.height);
    let channel = |(name, samples): (&String, &Vec<f32>)| {
        AnyChannel::new(text(name), FlatSamples::F32(samples.clone()))
    };
    let channels = AnyChannels::sort(document.channels.iter().map(channel).collect());
    let mut attributes = LayerAttributes {
        software_name: Some(text(concat!("gdpt ", env!("CARGO_PKG_VERSION")))),
        world_to_camera: document.world_to_camera,
        world_to_normalized_device: document.world_to_ndc,
        ..LayerAttributes::default()
    };
    for (name, value) in &document.attributes {
        attributes.other.insert(text(name), AttributeValue::Text(text(value)));
    }
    let mut display = IntegerBounds::from_dimensions(size);
    if let Some(window) = document.window {
        attributes.layer_position = Vec2(window.origin[0] as i32, window.origin[1] as i32);
        display = IntegerBounds::from_dimensions(Vec2(window.full[0] as usize, window.full[1] as usize));
    }
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let mut image = Image::from_layer(Layer::new(size, attributes, encoding, channels));
    image.attributes.display_window = display;
    image.attributes.chromaticities = Some(REC_709);
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).map_err(|e| IoError::other(e.to_string()))?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes).ok_or_else(|| IoError::other("the encoder wrote no readable header"))?;
    Ok(bytes)
}

/// Sorts the attributes of an encoded single-part header by name. The header's length stays, and so does every
/// offset after it. `None` where the bytes are not such a header.
fn sort_attributes(bytes: &mut [u8]) -> Option<()> {
    // Magic number and version, then (name\0 type\0 size value)* and an empty name.
    const START: usize = 8;
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut at = START;
    while *bytes.get(at)? != 0 {
        let name_end = at + bytes.get(at..)?.iter().position(|&b| b == 0)? + 1;
        let kind_end = name_end + bytes.get(name_end..)?.iter().position(|&b| b == 0)? + 1;
        let size = u32::from_le_bytes(bytes.get(kind_end..kind_end + 4)?.try_into().ok()?) as usize;
        let end = kind_end + 4 + size;
        attributes.push(bytes.get(at..end)?.to_vec());
        at = end;
    }
    attributes.sort();
    bytes.get_mut(START..at)?.copy_from_slice(&attributes.concat());
    Some(())
}

/// Reads the first flat part of an EXR file; whole and half numbers become float32.
pub fn read_file(path: &Path) -> Result<Document> {
    let input = |what: String| Error::Input { path: path.to_owned(), what };
    let metadata = std::fs::metadata(path).map_err(|e| input(format!("cannot be read: {e}")))?;
    if !metadata.is_file() {
        return Err(input("is not a file".into()));
    }
    let bytes = std::fs::read(path).map_err(|e| input(format!("cannot be read: {e}")))?;
    decode(&bytes).map_err(|what| Error::Scene { path: path.to_owned(), at: String::new(), what })
}

/// Decodes a file; the error says what is wrong with it.
fn decode(bytes: &[u8]) -> std::result::Result<Document, String> {
    let broken = |e: exr::error::Error| format!("is not a usable OpenEXR image: {e}");
    let metadata = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    // Deflate cannot shrink by more than about 1032; a file that claims more would only exhaust the memory.
    let claimed =
        metadata.headers.iter().map(|h| h.layer_size.0 as u128 * h.layer_size.1 as u128 * 4).sum::<u128>();
    if claimed > (bytes.len() as u128).saturating_mul(2000) + (1 << 24) {
        return Err("claims more pixels than a file of its length can hold".into());
    }
    let image: FlatImage = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let display = image.attributes.display_window;
    let layer = image.layer_data.into_iter().next().ok_or("has no image in it")?;
    let Vec2(width, height) = layer.size;
    let mut document = Document::new(width, height);
    for channel in layer.channel_data.list {
        if channel.sampling != Vec2(1, 1) {
            return Err(format!("channel {} is subsampled, which is not supported", channel.name));
        }
        let samples: Vec<f32> = channel.sample_data.values_as_f32().collect();
        if samples.len() != width * height {
            return Err(format!("channel {} has {} samples", channel.name, samples.len()));
        }
        document.channels.insert(channel.name.to_string(), samples);
    }
    let origin = layer.attributes.layer_position - display.position;
    if let ([Ok(x), Ok(y)], Vec2(w, h)) = ([u32::try_from(origin.0), u32::try_from(origin.1)], display.size)
        && (w, h) != (width, height)
    {
        document.window = Some(Window { full: [w as u32, h as u32], origin: [x, y] });
    }
    document.world_to_camera = layer.attributes.world_to_camera;
    document.world_to_ndc = layer.attributes.world_to_normalized_device;
    for (name, value) in layer.attributes.other.iter().chain(&image.attributes.other) {
        if let AttributeValue::Text(value) = value
            && name.to_string().starts_with("gdpt/")
        {
            document.attributes.insert(name.to_string(), value.to_string());
        }
    }
    Ok(document)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Plane;

    fn example() -> Document {
        let mut document = Document::new(19, 37);
        let plane = Plane::from_fn(19, 37, |x, y| [x as f32, y as f32 * 0.3, (x * y) as f32 - 1e-3]);
        document.set_plane("", ["R", "G", "B"], &plane);
        document.set_plane("N", ["X", "Y", "Z"], &plane);
        document.set_plane("primal_a", ["R", "G", "B"], &plane);
        document.world_to_camera = Some(std::array::from_fn(|i| i as f32));
        document.window = Some(Window { full: [100, 80], origin: [7, 11] });
        for name in ["seed", "spp", "norm", "alpha", "version", "integrator", "filter", "residual"] {
            document.attributes.insert(format!("gdpt/{name}"), format!("value of {name}"));
        }
        document
    }

    #[test]
    fn reads_back_what_was_written() {
        let document = example();
        let back = decode(&encode(&document).expect("memory")).expect("a file of our own");
        assert_eq!(back, document);
        assert_eq!(back.plane("primal_a"), back.plane(""));
        assert_eq!(back.plane("dx"), None);
    }

    #[test]
    fn equal_documents_give_equal_bytes() {
        // Twenty encodings: eight attributes in a random order would agree once in 40320.
        let first = encode(&example()).expect("memory");
        for _ in 0..20 {
            assert!(
                encode(&example()).expect("memory") == first,
                "the order of attributes leaks into the file"
            );
        }
    }

    #[test]
    fn every_truncation_is_refused_with_a_reason() {
        let bytes = encode(&example()).expect("memory");
        for length in (0..bytes.len() - 1).step_by(7) {
            let reason = decode(&bytes[..length]).expect_err("a truncated file has no image");
            assert!(!reason.is_empty());
        }
        assert!(decode(b"not an image at all").is_err());
    }
}
