//! Images: PNG, JPEG and WebP to RGBA, 8 bits, decoded in parallel, each image once however many textures use it.
//!
//! An image that cannot be read is a repair, not an error: colours become magenta, data (normals, roughness, …) is
//! left out; both are counted. An image that breaks the sandbox or the memory budget rejects the scene.

use super::document::{Document, Fetch, one_line};
use super::raw::Fields;
use super::{LoadReport, Texture, Wrap};
use crate::error::{Error, Result};
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::io::Cursor;
use std::sync::Arc;

const MAGENTA: [u8; 4] = [255, 0, 255, 255];

/// A decoded image.
struct Pixels {
    width: u32,
    height: u32,
    texels: Arc<[[u8; 4]]>,
}

/// Textures in the order in which materials first use them; one for each pair (glTF texture, encoding).
#[derive(Default)]
pub(super) struct TextureTable {
    uses: Vec<(usize, bool)>,
    by_use: BTreeMap<(usize, bool), u32>,
}

impl TextureTable {
    /// The scene's index of a glTF texture read as sRGB or linear.
    pub(super) fn index_of(&mut self, texture: usize, srgb: bool) -> u32 {
        let next = self.uses.len() as u32;
        *self.by_use.entry((texture, srgb)).or_insert_with(|| {
            self.uses.push((texture, srgb));
            next
        })
    }

    /// Decodes what is used. The second list says which textures are there (false: could not be read).
    pub(super) fn load(
        &self,
        document: &Document,
        report: &mut LoadReport,
    ) -> Result<(Vec<Texture>, Vec<bool>)> {
        let mut sources = Vec::with_capacity(self.uses.len());
        for &(texture, _) in &self.uses {
            sources.push(source_of(document, texture)?);
        }
        let wanted: BTreeSet<usize> = sources.iter().flatten().copied().collect();
        let wanted: Vec<usize> = wanted.into_iter().collect();
        let decoded: Vec<Decoded> =
            wanted.par_iter().map(|&image| decode(document, image)).collect::<Result<_>>()?;
        let mut images = BTreeMap::new();
        for (image, decoded) in wanted.into_iter().zip(decoded) {
            match decoded {
                Ok(pixels) => drop(images.insert(image, pixels)),
                Err(why) => {
                    report.warn(format!(
                        "images[{image}]: {why}; shown magenta, or left out where it is not a colour"
                    ));
                }
            }
        }
        let mut textures = Vec::with_capacity(self.uses.len());
        let mut present = Vec::with_capacity(self.uses.len());
        let mut missing = BTreeSet::new();
        for (&(texture, srgb), source) in self.uses.iter().zip(sources) {
            let pixels = source.and_then(|image| images.get(&image));
            if pixels.is_none() {
                missing.insert(texture);
                if source.is_none() {
                    report.warn(format!("textures[{texture}]: has no image that can be read; shown magenta"));
                }
            }
            present.push(pixels.is_some());
            textures.push(build(document, texture, srgb, pixels, report));
        }
        report.missing_textures += missing.len() as u64;
        Ok((textures, present))
    }
}

/// The image of a texture: the WebP one where there is one.
fn source_of(document: &Document, texture: usize) -> Result<Option<usize>> {
    let Some(entry) = document.root.textures.get(texture) else { return Ok(None) };
    let at = format!("textures[{texture}]");
    let others = entry.extensions.as_ref().map(|e| &e.others);
    if let Some(webp) = Fields::extension(document, others, &at, "EXT_texture_webp")?
        && let Some(source) = webp.integer("source")?
    {
        let image = usize::try_from(source).ok().filter(|&i| i < document.root.images.len());
        let missing =
            || document.reject(webp.at("source"), format!("names image {source}, which does not exist"));
        return image.ok_or_else(missing).map(Some);
    }
    Ok(Some(entry.source.value()).filter(|&i| i < document.root.images.len()))
}

/// Pixels, or why there are none.
type Decoded = std::result::Result<Pixels, String>;

fn decode(document: &Document, image: usize) -> Result<Decoded> {
    let Some(entry) = document.root.images.get(image) else { return Ok(Err("does not exist".into())) };
    if let Some(view) = entry.buffer_view {
        let (bytes, _) = document.view(view.value())?;
        return decode_bytes(document, bytes);
    }
    let Some(uri) = &entry.uri else { return Ok(Err("has neither a URI nor a bufferView".into())) };
    match document.fetch(uri, "an image") {
        Ok(bytes) => decode_bytes(document, &bytes),
        Err(Fetch::Corrupt(why)) => Ok(Err(why)),
        Err(Fetch::Missing(path, why)) => Ok(Err(format!("{}: {why}", path.display()))),
        Err(Fetch::Forbidden(why)) => Err(document.reject(format!("images[{image}].uri"), why)),
        Err(Fetch::Fatal(error)) => Err(error),
    }
}

fn decode_bytes(document: &Document, bytes: &[u8]) -> Result<Decoded> {
    // The bytes decide, not the declared type: files with the wrong one are common and harmless.
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)) => format,
        _ => return Ok(Err("is neither PNG, JPEG nor WebP".into())),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(document.budget.left());
    reader.limits(limits);
    let decoder = match reader.into_decoder() {
        Ok(decoder) => decoder,
        Err(e) => return refused(e),
    };
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 {
        return Ok(Err("has no pixels".into()));
    }
    let what = format!("an image of {width}×{height}");
    document.budget.take(texels.saturating_mul(4).saturating_add(decoder.total_bytes()), &what)?;
    let pixels = match DynamicImage::from_decoder(decoder) {
        Ok(pixels) => pixels.into_rgba8(),
        Err(e) => return refused(e),
    };
    let raw = pixels.into_raw();
    let texels: Arc<[[u8; 4]]> = Arc::from(bytemuck::cast_slice::<u8, [u8; 4]>(&raw));
    Ok(Ok(Pixels { width, height, texels }))
}

fn refused(error: image::ImageError) -> Result<Decoded> {
    match error {
        image::ImageError::Limits(e) => {
            Err(Error::OutOfMemory(format!("an image: {e}; raise the memory limit")))
        }
        other => Ok(Err(one_line(&format!("cannot be decoded: {other}")))),
    }
}

fn build(
    document: &Document,
    texture: usize,
    srgb: bool,
    pixels: Option<&Pixels>,
    report: &mut LoadReport,
) -> Texture {
    let entry = document.root.textures.get(texture).and_then(|t| t.sampler);
    let sampler = entry.and_then(|s| document.root.samplers.get(s.value()));
    let mut wrap = |mode: Checked<WrappingMode>, key: &str| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) => Wrap::Repeat,
        Checked::Invalid => {
            report.warn(format!("textures[{texture}]: the sampler's {key} is none of glTF's; it repeats"));
            Wrap::Repeat
        }
    };
    let wrap = sampler.map_or([Wrap::Repeat; 2], |s| [wrap(s.wrap_s, "wrapS"), wrap(s.wrap_t, "wrapT")]);
    let nearest = sampler.is_some_and(|s| s.mag_filter == Some(Checked::Valid(MagFilter::Nearest)));
    let (width, height, texels) = match pixels {
        Some(p) => (p.width, p.height, Arc::clone(&p.texels)),
        None => (1, 1, Arc::from([MAGENTA])),
    };
    Texture { width, height, texels, srgb, wrap, linear_filter: !nearest }
}
