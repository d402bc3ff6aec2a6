//! The environment's table: bilinear radiance and importance sampling by texel.
//!
//! Direction d, turned by −rotation about y, maps to u = atan2(d.x, −d.z) / 2π (mod 1), v = acos(d.y) / π. Radiance
//! is interpolated between texel centres (u wraps, v clamps). The density is constant over a texel in (u, v),
//! proportional to the mean luminance of the interpolated radiance there times sin θ of the row's middle; in solid
//! angle, pdf = p(u, v) / (2π² sin θ), sr⁻¹.

use crate::math::{Compare, LANES, Rgb, Vec3x, f32x16, splat};
use crate::scene::Environment;
use glam::Vec3;
use std::f32::consts::PI;

/// An environment prepared for look-ups and sampling.
#[derive(Clone, Debug)]
pub struct EnvironmentTable {
    width: usize,
    height: usize,
    texels: Vec<Vec3>,
    sin_rotation: f32,
    cos_rotation: f32,
    /// Cumulative probability of the rows, `height + 1` entries from 0 to 1.
    rows: Vec<f32>,
    /// Cumulative probability of the columns of each row, `width + 1` entries a row.
    columns: Vec<f32>,
    /// Where to begin the search in `rows`, `height` entries, and in each row of `columns`, `width` entries a row.
    row_guide: Vec<u32>,
    column_guide: Vec<u32>,
}

/// Luminance, Rec.709.
fn luminance(c: Vec3) -> f64 {
    f64::from(c.dot(Vec3::new(0.2126, 0.7152, 0.0722)))
}

/// Appends the cumulative distribution of `weights`, starting at 0 and ending at exactly 1; returns their sum.
/// Weights that sum to 0 give a uniform distribution, which is never reached.
fn push_cumulative(out: &mut Vec<f32>, weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    let n = weights.len();
    let mut running = 0.0;
    out.push(0.0);
    for (i, w) in weights.iter().enumerate() {
        running += w;
        let c = if sum > 0.0 { running / sum } else { (i + 1) as f64 / n as f64 };
        out.push(if i + 1 == n { 1.0 } else { c.min(1.0) as f32 });
    }
    sum
}

/// For each k of n the interval of a cumulative distribution of n intervals that holds k / n: from there a search
/// takes less than two steps on average (Chen and Asau 1974, "On Generating Random Variates from an Empirical
/// Distribution").
fn push_guide(out: &mut Vec<u32>, cumulative: &[f32]) {
    let n = cumulative.len() - 1;
    let mut i = 0;
    for k in 0..n {
        while i + 1 < n && cumulative[i + 1] <= k as f32 / n as f32 {
            i += 1;
        }
        out.push(i as u32);
    }
}

/// The interval of a cumulative distribution that holds `u` in [0, 1), and where in it, in [0, 1).
#[inline(always)]
fn invert(cumulative: &[f32], guide: &[u32], u: f32) -> (usize, f32) {
    let n = guide.len();
    let mut i = guide[((u * n as f32) as usize).min(n - 1)] as usize;
    // The product may have been rounded up to the next bin of the guide.
    while i > 0 && cumulative[i] > u {
        i -= 1;
    }
    while i + 1 < n && cumulative[i + 1] <= u {
        i += 1;
    }
    let (low, high) = (cumulative[i], cumulative[i + 1]);
    let inside = if high > low { (u - low) / (high - low) } else { 0.5 };
    const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;
    (i, inside.clamp(0.0, BELOW_ONE))
}

impl EnvironmentTable {
    /// Prepares an environment; `None` where it is black or empty.
    pub fn new(environment: &Environment) -> Option<Self> {
        let (width, height) = (environment.width as usize, environment.height as usize);
        let texels = &environment.texels;
        if width == 0 || height == 0 || texels.len() != width * height {
            return None;
        }
        // The mean over a texel of what bilinear interpolation shows there: 1/8, 6/8, 1/8 along each axis.
        let blurred = |row: usize| -> Vec<f64> {
            let rows = [row.saturating_sub(1), row, (row + 1).min(height - 1)];
            let column = |j: usize| {
                let at = |r: usize| luminance(texels[rows[r] * width + j]);
                (at(0) + 6.0 * at(1) + at(2)) / 8.0
            };
            let line: Vec<f64> = (0..width).map(column).collect();
            (0..width)
                .map(|j| (line[(j + width - 1) % width] + 6.0 * line[j] + line[(j + 1) % width]) / 8.0)
                .collect()
        };
        let mut columns = Vec::with_capacity((width + 1) * height);
        let row_weights: Vec<f64> = (0..height)
            .map(|i| {
                let sin = (std::f64::consts::PI * (i as f64 + 0.5) / height as f64).sin();
                push_cumulative(&mut columns, &blurred(i)) * sin
            })
            .collect();
        let mut rows = Vec::with_capacity(height + 1);
        if push_cumulative(&mut rows, &row_weights) <= 0.0 {
            return None;
        }
        let (mut row_guide, mut column_guide) = (Vec::new(), Vec::with_capacity(width * height));
        push_guide(&mut row_guide, &rows);
        columns.chunks_exact(width + 1).for_each(|row| push_guide(&mut column_guide, row));
        let (sin_rotation, cos_rotation) = environment.rotation.sin_cos();
        let texels = texels.clone();
        Some(Self {
            width,
            height,
            texels,
            sin_rotation,
            cos_rotation,
            rows,
            columns,
            row_guide,
            column_guide,
        })
    }

    /// Texture coordinates of a direction: u in [0, 1], v in [0, 1], and sin θ.
    #[inline(always)]
    fn to_uv(&self, d: Vec3x) -> (f32x16, f32x16, f32x16) {
        let (s, c) = (splat(self.sin_rotation), splat(self.cos_rotation));
        let x = d.x.mul_sub(c, d.z * s);
        let z = d.x.mul_add(s, d.z * c);
        let turn = x.atan2(-z) * splat(0.5 / PI);
        let u = turn.lt(f32x16::ZERO).select(turn + splat(1.0), turn);
        let sin = x.mul_add(x, z * z).sqrt();
        (u, sin.atan2(d.y) * splat(1.0 / PI), sin)
    }

    /// Radiance from the directions `d`.
    pub fn radiance(&self, d: Vec3x) -> Rgb {
        let (u, v, _) = self.to_uv(d);
        self.radiance_at(u, v)
    }

    /// Radiance at texture coordinates in [0, 1].
    #[inline(always)]
    fn radiance_at(&self, u: f32x16, v: f32x16) -> Rgb {
        let x = u * splat(self.width as f32) - splat(0.5);
        let y = v * splat(self.height as f32) - splat(0.5);
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = ((x - left).to_array(), (y - top).to_array());
        let (left, top) = (left.to_array(), top.to_array());
        let (last_column, last_row) = (self.width - 1, self.height - 1);
        Rgb::lanes(|i| {
            // From −1 on. A cast from a NaN, of an inactive lane, gives 0.
            let (column, row) = (left[i] as i32, top[i] as i32);
            let (x0, x1) = (if column < 0 { last_column } else { column as usize }, (column + 1) as usize);
            let (x0, x1) = (x0.min(last_column), if x1 > last_column { 0 } else { x1 });
            let (y0, y1) = ((row.max(0) as usize).min(last_row), ((row + 1) as usize).min(last_row));
            let (upper, lower) = (&self.texels[y0 * self.width..], &self.texels[y1 * self.width..]);
            upper[x0].lerp(upper[x1], fx[i]).lerp(lower[x0].lerp(lower[x1], fx[i]), fy[i])
        })
    }

    /// Density over (u, v) of the texel in `row` and `column`.
    #[inline(always)]
    fn texel_density(&self, row: usize, column: usize) -> f32 {
        let start = row * (self.width + 1) + column;
        let p_row = self.rows[row + 1] - self.rows[row];
        let p_column = self.columns[start + 1] - self.columns[start];
        p_row * self.height as f32 * (p_column * self.width as f32)
    }

    /// Radiance from the directions `d`, and the pdf with which [`Self::sample`] finds them, sr⁻¹.
    pub fn radiance_and_pdf(&self, d: Vec3x) -> (Rgb, f32x16) {
        let (u, v, sin) = self.to_uv(d);
        (self.radiance_at(u, v), self.pdf_at(u, v, sin))
    }

    /// pdf in solid angle, sr⁻¹, at texture coordinates where sin θ is `sin`.
    #[inline(always)]
    fn pdf_at(&self, u: f32x16, v: f32x16, sin: f32x16) -> f32x16 {
        let column = (u * splat(self.width as f32)).to_array();
        let row = (v * splat(self.height as f32)).to_array();
        let density = f32x16::new(std::array::from_fn(|i| {
            let (row, column) = (row[i] as usize, column[i] as usize);
            self.texel_density(row.min(self.height - 1), column.min(self.width - 1))
        }));
        sin.gt(f32x16::ZERO).select(density / (splat(2.0 * PI * PI) * sin), f32x16::ZERO)
    }

    /// Directions by importance, their pdf in solid angle, sr⁻¹, and the radiance from there.
    pub fn sample(&self, u: f32x16, v: f32x16) -> (Vec3x, f32x16, Rgb) {
        let (us, vs) = (u.to_array(), v.to_array());
        let (mut tu, mut tv, mut density) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let (row, y) = invert(&self.rows, &self.row_guide, vs[i]);
            let (w, stride) = (self.width, self.width + 1);
            let columns = &self.columns[row * stride..(row + 1) * stride];
            let (column, x) = invert(columns, &self.column_guide[row * w..(row + 1) * w], us[i]);
            tu[i] = (column as f32 + x) / w as f32;
            tv[i] = (row as f32 + y) / self.height as f32;
            density[i] = self.texel_density(row, column);
        }
        let (tu, tv) = (f32x16::new(tu), f32x16::new(tv));
        let (sin_phi, cos_phi) = (tu * splat(2.0 * PI)).sin_cos();
        let (sin, cos) = (tv * splat(PI)).sin_cos();
        let (x, z) = (sin * sin_phi, -sin * cos_phi);
        let (s, c) = (splat(self.sin_rotation), splat(self.cos_rotation));
        let d = Vec3x::new(x.mul_add(c, z * s), cos, z.mul_sub(c, x * s));
        let pdf = f32x16::new(density) / (splat(2.0 * PI * PI) * sin);
        (d, sin.gt(f32x16::ZERO).select(pdf, f32x16::ZERO), self.radiance_at(tu, tv))
    }
}
