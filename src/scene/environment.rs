//! Light from infinity: a lat-long image, y up, with importance sampling by texel.
//!
//! Direction d maps to u = atan2(d.x, −d.z) / 2π (mod 1), v = acos(d.y) / π, row 0 at the zenith.

use super::LoadReport;
use super::uri;
use crate::error::{Error, Result};
use exr::prelude as openexr;
use glam::Vec3;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Most texels that are read: 16384×8192.
const MAX_TEXELS: u64 = 1 << 27;
/// Stands for +∞, the overflow of half floats: their largest value.
const HALF_MAX: f32 = 65504.0;

/// An environment of radiance, W·m⁻²·sr⁻¹.
#[derive(Clone, Debug)]
pub struct Environment {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB radiance, row by row, not negative, finite; strength already applied.
    pub texels: Vec<Vec3>,
    /// Rotation about y, rad: the sampled direction is the world direction turned by −`rotation`.
    pub rotation: f32,
    /// Whether the camera sees it (it lights the scene in any case).
    pub visible: bool,
}

impl Environment {
    /// Reads a lat-long image, Radiance HDR or OpenEXR by its first bytes, and multiplies it by `strength`.
    pub fn load(path: &Path, strength: f32, rotation_degrees: f32, visible: bool) -> Result<Self> {
        Self::load_reporting(path, strength, rotation_degrees, visible, &mut LoadReport::default())
    }

    /// [`Environment::load`], with a warning in the report where texels had to be repaired: those that are negative
    /// or not a number become 0, infinite ones the largest half float.
    pub fn load_reporting(
        path: &Path,
        strength: f32,
        rotation_degrees: f32,
        visible: bool,
        report: &mut LoadReport,
    ) -> Result<Self> {
        if !(strength >= 0.0 && strength.is_finite() && rotation_degrees.is_finite()) {
            let what = "the environment's strength must be finite and not negative, its rotation finite";
            return Err(Error::Usage(what.into()));
        }
        let bytes = uri::read_input(path, 32 * MAX_TEXELS)?;
        let reject = |what: String| Error::Scene { path: path.into(), at: String::new(), what };
        let decoded = if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            decode_exr(&bytes)
        } else if bytes.starts_with(b"#?") {
            decode_hdr(&bytes)
        } else {
            Err("is neither Radiance HDR nor OpenEXR; convert the environment to one of them".into())
        };
        let (width, height, mut texels) = decoded.map_err(reject)?;
        let mut repaired = 0u64;
        for texel in &mut texels {
            let good = texel.to_array().map(|v| match v {
                v if v.is_nan() || v < 0.0 => 0.0,
                v if v == f32::INFINITY => HALF_MAX,
                v => v,
            });
            repaired += u64::from(Vec3::from_array(good) != *texel);
            *texel = (Vec3::from_array(good) * strength).min(Vec3::splat(1e30));
        }
        if repaired > 0 {
            let what = "texels are negative or not finite; they were repaired";
            report.warn(format!("{}: {repaired} {what}", path.display()));
        }
        let rotation = rotation_degrees.rem_euclid(360.0).to_radians();
        Ok(Self { width, height, texels, rotation, visible })
    }

    /// Checks sizes and values; the text names the first fault.
    pub fn validate(&self) -> std::result::Result<(), String> {
        let texels = u64::from(self.width) * u64::from(self.height);
        if texels == 0 || self.texels.len() as u64 != texels || !self.rotation.is_finite() {
            return Err("size or rotation".into());
        }
        let good = |t: &Vec3| t.is_finite() && t.min_element() >= 0.0;
        if self.texels.iter().all(good) { Ok(()) } else { Err("texel negative or not finite".into()) }
    }
}

/// Width, height and texels, or what is wrong.
type Decoded = std::result::Result<(u32, u32, Vec<Vec3>), String>;

fn check_size(width: u64, height: u64) -> std::result::Result<(), String> {
    let texels = width.saturating_mul(height);
    if texels == 0 || texels > MAX_TEXELS {
        return Err(format!("{width}×{height} texels; between 1 and 2^27 are read: scale the image"));
    }
    Ok(())
}

fn decode_hdr(bytes: &[u8]) -> Decoded {
    let broken = |e: image::ImageError| format!("cannot be decoded: {e}");
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Hdr);
    reader.limits(Limits::no_limits());
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height))?;
    let pixels = DynamicImage::from_decoder(decoder).map_err(broken)?.into_rgb32f();
    let texels = pixels.into_raw().as_chunks::<3>().0.iter().map(|&t| Vec3::from_array(t)).collect();
    Ok((width, height, texels))
}

fn decode_exr(bytes: &[u8]) -> Decoded {
    use openexr::{ReadChannels, ReadLayers};
    let broken = |e: openexr::Error| format!("cannot be decoded: {e}");
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    for header in &meta.headers {
        check_size(header.layer_size.x() as u64, header.layer_size.y() as u64)?;
    }
    let image = openexr::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size, _| (size.x(), vec![Vec3::ZERO; size.x() * size.y()]),
            |(width, texels): &mut (usize, Vec<Vec3>), at, (r, g, b): (f32, f32, f32)| {
                if let Some(texel) = texels.get_mut(at.y() * *width + at.x()) {
                    *texel = Vec3::new(r, g, b);
                }
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let size = image.layer_data.size;
    Ok((size.x() as u32, size.y() as u32, image.layer_data.channel_data.pixels.1))
}
