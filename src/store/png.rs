//! The picture for the screen: exposure, tone mapping, sRGB encoding, 8 bit, PNG. The only place that does any of
//! it.
//!
//! * AgX (T. Sobotka): a gamut inset, log2 exposure from −10 to +6.5 stops about middle grey, a sigmoid, the inset
//!   undone. Highlights lose saturation instead of clipping to primaries.
//! * ACES: K. Narkowicz's rational fit of the reference transform, channel by channel.
//! * None: clipped to 0…1.

use crate::error::{Error, Result};
use crate::film::Plane;
use glam::{Mat3, Vec3};
use image::ImageEncoder;
use std::path::Path;

/// How radiance becomes a display value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// AgX, base look.
    #[default]
    Agx,
    /// ACES, fitted curve.
    Aces,
    /// Clipping.
    None,
}

impl ToneMap {
    /// The word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Agx => "agx",
            Self::Aces => "aces",
            Self::None => "none",
        }
    }
}

/// Rows sum to 1: white stays white. Channels mix before the curve, so that none saturates alone.
const AGX_INSET: Mat3 = Mat3::from_cols_array(&[
    0.842_479_1,
    0.042_328_24,
    0.042_375_65,
    0.078_433_6,
    0.878_468_6,
    0.078_433_6,
    0.079_223_75,
    0.079_166_13,
    0.879_143,
]);

/// AgX's sigmoid on normalised log exposure `x`: through (10/16.5, 0.5), middle grey, with slope 2.
fn agx_sigmoid(x: f32) -> f32 {
    const PIVOT: (f32, f32) = (10.0 / 16.5, 0.5);
    const SLOPE: f32 = 2.0;
    // One side of the curve, as distances from the pivot: `reach` is the distance to the end of the axis, where the
    // curve arrives at 0 or 1 exactly; `power` says how late it bends.
    let side = |distance: f32, reach: f32, power: f32| {
        let straight = SLOPE * reach;
        let scale = (straight.powf(-power) * ((straight / PIVOT.1).powf(power) - 1.0)).powf(-1.0 / power);
        let term = SLOPE * distance / scale;
        scale * term / (1.0 + term.powf(power)).powf(1.0 / power)
    };
    if x < PIVOT.0 {
        PIVOT.1 - side(PIVOT.0 - x, PIVOT.0, 3.0)
    } else {
        PIVOT.1 + side(x - PIVOT.0, 1.0 - PIVOT.0, 3.25)
    }
}

/// Linear display values of linear radiance.
fn agx(color: Vec3) -> Vec3 {
    let log = (AGX_INSET * color).map(|v| ((v.max(1e-10) / 0.18).log2() + 10.0) / 16.5);
    let curve = log.clamp(Vec3::ZERO, Vec3::ONE).map(agx_sigmoid);
    // The curve yields values for a display of exponent 2.2.
    (AGX_INSET.inverse() * curve).map(|v| v.clamp(0.0, 1.0).powf(2.2))
}

fn aces(color: Vec3) -> Vec3 {
    // The fit is normalised to a white 1/0.6 times brighter.
    color.map(|v| {
        let x = 0.6 * v.max(0.0);
        x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)
    })
}

/// The sRGB transfer function (IEC 61966-2-1).
fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// 8-bit sRGB of one pixel; `scale` is 2^exposure. What is not finite shows as black (NaN) or white (+∞).
fn encode_pixel(radiance: [f32; 3], scale: f32, tone_map: ToneMap) -> [u8; 3] {
    let finite = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1e6) };
    let color = Vec3::from(radiance.map(|v| finite(v * scale)));
    let display = match tone_map {
        ToneMap::Agx => agx(color),
        ToneMap::Aces => aces(color),
        ToneMap::None => color,
    };
    display.to_array().map(|v| (srgb(v.clamp(0.0, 1.0)) * 255.0 + 0.5) as u8)
}

/// The picture of `plane` with `exposure` in stops: 8-bit sRGB, row by row.
pub fn rgb8(plane: &Plane, exposure: f32, tone_map: ToneMap) -> Vec<u8> {
    let scale = exposure.exp2();
    plane.data.iter().flat_map(|&p| encode_pixel(p, scale, tone_map)).collect()
}

/// The bytes of a PNG of `plane` with `exposure` in stops.
pub fn encode(plane: &Plane, exposure: f32, tone_map: ToneMap) -> std::io::Result<Vec<u8>> {
    encode_rgb8(&rgb8(plane, exposure, tone_map), plane.width, plane.height)
}

/// The bytes of a PNG of 8-bit sRGB pixels.
pub fn encode_rgb8(pixels: &[u8], width: usize, height: usize) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    image::codecs::png::PngEncoder::new(&mut bytes)
        .write_image(pixels, width as u32, height as u32, image::ExtendedColorType::Rgb8)
        .map_err(std::io::Error::other)?;
    Ok(bytes)
}

/// Writes `plane` as PNG, atomically.
pub fn write(path: &Path, plane: &Plane, exposure: f32, tone_map: ToneMap) -> Result<()> {
    let bytes =
        encode(plane, exposure, tone_map).map_err(|source| Error::Io { path: path.to_owned(), source })?;
    super::atomic::write(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_tone_mapping_it_is_the_srgb_curve() {
        // The standard's values: linear 0.2159 is code 128, 0.5 is 188, and the ends are the ends.
        assert_eq!(encode_pixel([0.0, 0.5, 1.0], 1.0, ToneMap::None), [0, 188, 255]);
        assert_eq!(encode_pixel([0.215_9, 7.0, -1.0], 1.0, ToneMap::None), [128, 255, 0]);
        assert_eq!(encode_pixel([f32::NAN, f32::INFINITY, 0.25], 2.0, ToneMap::None), [0, 255, 188]);
    }

    #[test]
    fn curves_rise_from_black_to_white_and_keep_grey_grey() {
        for tone_map in [ToneMap::Agx, ToneMap::Aces] {
            let mut last = 0;
            for stop in -120..=70 {
                let v = 0.18 * (stop as f32 / 10.0).exp2();
                let [r, g, b] = encode_pixel([v; 3], 1.0, tone_map);
                assert!(r.abs_diff(g) <= 1 && g.abs_diff(b) <= 1, "{tone_map:?} tints grey: {r} {g} {b}");
                assert!(g >= last, "{tone_map:?} falls at {stop}");
                last = g;
            }
            assert!(last >= 254, "{tone_map:?} ends at {last}");
            assert!(encode_pixel([0.0; 3], 1.0, tone_map)[0] <= 1);
        }
    }

    #[test]
    fn agx_puts_middle_grey_at_the_pivot() {
        assert!((agx_sigmoid(10.0 / 16.5) - 0.5).abs() < 1e-6);
        assert!(agx_sigmoid(0.0).abs() < 1e-6 && (agx_sigmoid(1.0) - 1.0).abs() < 1e-6);
        // Slope 2 at the pivot, from both sides.
        let d = 1e-3;
        let slope = (agx_sigmoid(10.0 / 16.5 + d) - agx_sigmoid(10.0 / 16.5 - d)) / (2.0 * d);
        assert!((slope - 2.0).abs() < 1e-2, "{slope}");
    }

    #[test]
    fn the_file_decodes_to_the_pixels() {
        let plane = Plane::from_fn(3, 2, |x, y| [x as f32 * 0.4, y as f32, 0.5]);
        let bytes = encode(&plane, 0.0, ToneMap::None).expect("memory");
        let back = image::load_from_memory(&bytes).expect("a PNG").to_rgb8();
        assert_eq!((back.width(), back.height()), (3, 2));
        assert_eq!(back.get_pixel(0, 1).0, [0, 255, 188]);
    }
}
