//! Texture look-ups: wrap modes, nearest and bilinear filter, sRGB to linear through a table.
//!
//! Texel (i, j) covers [i, i+1) × [j, j+1) over the size; its centre is at +0.5. Filtering is done on linear values.

use crate::scene::{Scene, Texture, TextureRef, Wrap};
use glam::{Vec2, Vec4};

/// Tables from a byte to a linear value in 0..=1.
#[derive(Clone, Debug)]
pub struct Decoder {
    linear: [f32; 256],
    srgb: [f32; 256],
}

impl Default for Decoder {
    fn default() -> Self {
        let linear = std::array::from_fn(|i| i as f32 / 255.0);
        Self { linear, srgb: linear.map(srgb_to_linear) }
    }
}

/// The transfer function of IEC 61966-2-1.
pub fn srgb_to_linear(x: f32) -> f32 {
    if x <= 0.04045 { x / 12.92 } else { ((f64::from(x) + 0.055) / 1.055).powf(2.4) as f32 }
}

/// The two texels that interpolation along one axis takes at coordinate `t` (1 is the whole image), and the weight
/// of the second. A nearest filter takes the texel that `t` lies in.
#[inline(always)]
fn neighbours(t: f32, size: u32, mode: Wrap, linear: bool) -> (u32, u32, f32) {
    // Whole repetitions go first, while the fraction is exact.
    let t = match mode {
        Wrap::Repeat => t - t.floor(),
        Wrap::Mirror => {
            let m = t - 2.0 * (0.5 * t).floor();
            m.min(2.0 - m)
        }
        Wrap::Clamp => t.clamp(0.0, 1.0),
    };
    let last = size - 1;
    let x = t * size as f32;
    if !linear {
        let i = (x as u32).min(last);
        return (i, i, 0.0);
    }
    // A cast from a NaN gives 0, from what is below 0 too.
    let (above, fraction) = (x + 0.5, (x + 0.5).fract());
    let right = above as u32;
    let wrapped = mode == Wrap::Repeat;
    let first = if right == 0 { if wrapped { last } else { 0 } } else { (right - 1).min(last) };
    let second = if right > last { if wrapped { 0 } else { last } } else { right };
    (first, second, fraction)
}

/// Four texels around a point: upper left, upper right, lower left, lower right; and how far right and down it lies.
#[derive(Clone, Copy, Default)]
pub(super) struct Footprint {
    texels: [[u8; 4]; 4],
    fraction: Vec2,
    srgb: bool,
}

impl Footprint {
    /// Reads the texels of `texture` around `uv` (after the texture transform).
    #[inline(always)]
    pub(super) fn new(texture: &Texture, uv: Vec2) -> Self {
        let linear = texture.linear_filter;
        let (x0, x1, fx) = neighbours(uv.x, texture.width, texture.wrap[0], linear);
        let (y0, y1, fy) = neighbours(uv.y, texture.height, texture.wrap[1], linear);
        let (upper, lower) = (y0 as usize * texture.width as usize, y1 as usize * texture.width as usize);
        let texel = |row: usize, x: u32| texture.texels[row + x as usize];
        let texels = [texel(upper, x0), texel(upper, x1), texel(lower, x0), texel(lower, x1)];
        Self { texels, fraction: Vec2::new(fx, fy), srgb: texture.srgb }
    }
}

impl Decoder {
    /// A texel in linear values; alpha is never encoded.
    #[inline(always)]
    fn decode(&self, texel: [u8; 4], srgb: bool) -> Vec4 {
        let table = if srgb { &self.srgb } else { &self.linear };
        let [r, g, b, a] = texel.map(usize::from);
        Vec4::new(table[r], table[g], table[b], self.linear[a])
    }

    /// Linear RGBA between the texels of a footprint.
    #[inline(always)]
    pub(super) fn filter(&self, f: &Footprint) -> Vec4 {
        let [a, b, c, d] = f.texels.map(|texel| self.decode(texel, f.srgb));
        a.lerp(b, f.fraction.x).lerp(c.lerp(d, f.fraction.x), f.fraction.y)
    }

    /// Linear RGBA of `texture` at `uv` (after the texture transform).
    #[inline]
    pub fn lookup(&self, texture: &Texture, uv: Vec2) -> Vec4 {
        self.filter(&Footprint::new(texture, uv))
    }

    /// Linear RGBA of a material's texture at the mesh's coordinates (`uv` of both sets).
    #[inline]
    pub fn lookup_ref(&self, scene: &Scene, reference: &TextureRef, uv: [Vec2; 2]) -> Vec4 {
        let uv = uv[usize::from(reference.uv_set.min(1))];
        self.lookup(&scene.textures[reference.texture as usize], reference.transform.transform_point2(uv))
    }

    /// Mean of all texels, linear.
    pub fn mean(&self, texture: &Texture) -> Vec4 {
        let mut counts = [[0_u64; 256]; 4];
        for texel in texture.texels.iter() {
            for (count, &byte) in counts.iter_mut().zip(texel) {
                count[usize::from(byte)] += 1;
            }
        }
        let mean = |channel: usize| {
            let table = if texture.srgb && channel < 3 { &self.srgb } else { &self.linear };
            let sum: f64 = counts[channel].iter().zip(table).map(|(&n, &x)| n as f64 * f64::from(x)).sum();
            (sum / texture.texels.len().max(1) as f64) as f32
        };
        Vec4::new(mean(0), mean(1), mean(2), mean(3))
    }
}
