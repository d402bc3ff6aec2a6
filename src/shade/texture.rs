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

/// The index inside 0..`size` that stands for `i`.
#[inline(always)]
fn wrap(i: i32, size: u32, mode: Wrap) -> usize {
    if (i as u32) < size {
        return i as usize;
    }
    let n = i64::from(size);
    let i = i64::from(i);
    let wrapped = match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Mirror => {
            let m = i.rem_euclid(2 * n);
            m.min(2 * n - 1 - m)
        }
        Wrap::Clamp => i.clamp(0, n - 1),
    };
    wrapped as usize
}

impl Decoder {
    /// A texel in linear values; alpha is never encoded.
    #[inline(always)]
    fn decode(&self, texel: [u8; 4], srgb: bool) -> Vec4 {
        let table = if srgb { &self.srgb } else { &self.linear };
        let [r, g, b, a] = texel.map(usize::from);
        Vec4::new(table[r], table[g], table[b], self.linear[a])
    }

    /// Linear RGBA of `texture` at `uv` (after the texture transform).
    #[inline]
    pub fn lookup(&self, texture: &Texture, uv: Vec2) -> Vec4 {
        let (w, h) = (texture.width, texture.height);
        let x = uv.x * w as f32;
        let y = uv.y * h as f32;
        let texel =
            |column: usize, row: usize| self.decode(texture.texels[row * w as usize + column], texture.srgb);
        let [wrap_u, wrap_v] = texture.wrap;
        if !texture.linear_filter {
            return texel(wrap(x.floor() as i32, w, wrap_u), wrap(y.floor() as i32, h, wrap_v));
        }
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let (column, row) = (left as i32, top as i32);
        let (x0, x1) = (wrap(column, w, wrap_u), wrap(column.saturating_add(1), w, wrap_u));
        let (y0, y1) = (wrap(row, h, wrap_v), wrap(row.saturating_add(1), h, wrap_v));
        let upper = texel(x0, y0).lerp(texel(x1, y0), fx);
        let lower = texel(x0, y1).lerp(texel(x1, y1), fx);
        upper.lerp(lower, fy)
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
