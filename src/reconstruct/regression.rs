//! Local linear regression of images on features, window by window (He, Sun, Tang 2010, "Guided image filtering", with
//! several features and weights; Bitterli et al. 2016 use the same model to filter renderings).
//!
//! In the (2r+1)² pixels around pixel q an image is fitted by A_q f + b_q, f being the features of a pixel: weighted
//! least squares with the ridge [`RIDGE`] on A. The value of pixel p is the weighted mean of A_q f_p + b_q over the
//! windows q that hold p. The two images are regressed on the same features, which is most of the work, together.
//!
//! Tiles are independent of each other: sums are formed anew in each, so the result does not depend on the threads.

use crate::film::Plane;
use crate::math::{LANES, f32x16, splat};
use rayon::prelude::*;

/// Features of a pixel.
pub(super) const FEATURES: usize = 7;
/// Channels regressed together: two images.
const CHANNELS: usize = 6;
/// Added to the variance of every feature.
const RIDGE: f32 = 1e-5;
/// Features farther than this from a tile's median count as this far.
const REACH: f32 = 2.0;
/// Pairs of features.
const PAIRS: usize = FEATURES * (FEATURES + 1) / 2;
/// Sums over a window: weight, features, pairs of features, channels, features by channels.
const SUMS: usize = 1 + FEATURES + PAIRS + CHANNELS + FEATURES * CHANNELS;
/// Coefficients of a window: weight, offsets, slopes.
const COEFFICIENTS: usize = 1 + CHANNELS + FEATURES * CHANNELS;
/// Windows of a tile, side by side.
const WIDE: usize = 64;
/// Rows of pixels of a tile.
const ROWS: usize = 32;
/// Largest radius.
pub(super) const MAX_RADIUS: usize = 4;

/// What the images are regressed on.
pub(super) struct Guide {
    pub width: usize,
    pub height: usize,
    /// Features of each pixel, all of the order of one.
    pub features: Vec<[f32; FEATURES]>,
    /// How much a pixel has to say in a window, 0 to 1.
    pub weights: Vec<f32>,
}

/// Plane after plane of the pixels around a tile: weight, features, weight × features, channels, weight × channels.
struct Tile {
    radius: usize,
    /// Columns: [`WIDE`] windows and the radius on both sides.
    width: usize,
    rows: usize,
    weight: Vec<f32>,
    features: [Vec<f32>; FEATURES],
    weighted: [Vec<f32>; FEATURES],
    channels: [Vec<f32>; CHANNELS],
    coefficients: Vec<f32>,
}

impl Tile {
    fn new(radius: usize) -> Self {
        let (width, rows) = (WIDE + 2 * radius, ROWS + 4 * radius);
        let plane = || vec![0.0; width * rows];
        Self {
            radius,
            width,
            rows,
            weight: plane(),
            features: std::array::from_fn(|_| plane()),
            weighted: std::array::from_fn(|_| plane()),
            channels: std::array::from_fn(|_| plane()),
            coefficients: vec![0.0; COEFFICIENTS * (ROWS + 2 * radius) * WIDE],
        }
    }

    /// Reads the pixels around the tile whose left upper pixel is (x0, y0); the weight outside is zero. Features are
    /// taken relative to their medians in the tile and cut at [`REACH`], so that their products keep their digits
    /// whatever lies behind.
    fn load(&mut self, guide: &Guide, images: [&Plane; 2], x0: usize, y0: usize) {
        let at = |start: usize, i: usize, end: usize| {
            (start + i).checked_sub(2 * self.radius).filter(|&x| x < end)
        };
        let pixel = |x: usize, y: usize| {
            let (x, y) = (at(x0, x, guide.width)?, at(y0, y, guide.height)?);
            Some(y * guide.width + x)
        };
        let some = (0..self.rows).step_by(7).flat_map(|y| (0..self.width).step_by(11).map(move |x| (x, y)));
        let some: Vec<usize> = some.filter_map(|(x, y)| pixel(x, y)).collect();
        let median: [f32; FEATURES] = std::array::from_fn(|j| {
            let mut values: Vec<f32> = some.iter().map(|&i| guide.features[i][j]).collect();
            let middle = values.len() / 2;
            if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f32::total_cmp).1 }
        });
        for y in 0..self.rows {
            for x in 0..self.width {
                let to = y * self.width + x;
                let from = pixel(x, y);
                let weight = from.map_or(0.0, |i| guide.weights[i]);
                self.weight[to] = weight;
                for (j, median) in median.iter().enumerate() {
                    let relative = from.map_or(0.0, |i| guide.features[i][j] - median);
                    let feature = relative.clamp(-REACH, REACH);
                    self.features[j][to] = feature;
                    self.weighted[j][to] = weight * feature;
                }
                for c in 0..CHANNELS {
                    self.channels[c][to] = from.map_or(0.0, |i| images[c / 3].data[i][c % 3]);
                }
            }
        }
    }

    /// Sums of the products of two planes over the windows of window row `row`.
    fn products(&self, row: usize, a: &[f32], b: &[f32], out: &mut [f32; WIDE]) {
        let mut columns = [0.0f32; WIDE + 2 * MAX_RADIUS];
        let columns = &mut columns[..self.width];
        for y in row..=row + 2 * self.radius {
            let part = y * self.width..(y + 1) * self.width;
            for (sum, (a, b)) in columns.iter_mut().zip(a[part.clone()].iter().zip(&b[part])) {
                *sum += a * b;
            }
        }
        slide(columns, self.radius, out);
    }

    /// The coefficients of all windows.
    fn fit(&mut self) {
        let ones = vec![1.0; self.weight.len()];
        let mut sums = vec![[0.0f32; WIDE]; SUMS];
        for row in 0..ROWS + 2 * self.radius {
            let mut next = sums.iter_mut();
            let mut sum = |a: &[f32], b: &[f32]| {
                self.products(row, a, b, next.next().expect("one for each sum"));
            };
            sum(&self.weight, &ones);
            self.weighted.iter().for_each(|f| sum(f, &ones));
            for i in 0..FEATURES {
                (0..=i).for_each(|j| sum(&self.weighted[i], &self.features[j]));
            }
            self.channels.iter().for_each(|c| sum(&self.weight, c));
            for c in &self.channels {
                self.weighted.iter().for_each(|f| sum(f, c));
            }
            // A window counts as much as its middle pixel.
            let middle = (row + self.radius) * self.width + self.radius;
            let rows = &mut self.coefficients[row * COEFFICIENTS * WIDE..][..COEFFICIENTS * WIDE];
            for x in (0..WIDE).step_by(LANES) {
                let weight = load(&self.weight[middle + x..]);
                let coefficients = solve(|k| load(&sums[k][x..]));
                rows[x..x + LANES].copy_from_slice(weight.as_array());
                for (k, v) in coefficients.into_iter().enumerate() {
                    rows[(k + 1) * WIDE + x..][..LANES].copy_from_slice((v * weight).as_array());
                }
            }
        }
    }

    /// Writes row `row` of the tile's pixels: `out` gets the channels of pixels `WIDE` − 2 radius wide.
    fn predict(&self, row: usize, out: &mut [[f32; WIDE]; CHANNELS]) {
        let mut mean = [0.0f32; WIDE];
        let window = |k: usize, mean: &mut [f32; WIDE]| {
            let mut columns = [0.0f32; WIDE + 2 * MAX_RADIUS];
            for y in row..=row + 2 * self.radius {
                let line = &self.coefficients[(y * COEFFICIENTS + k) * WIDE..][..WIDE];
                columns.iter_mut().zip(line).for_each(|(sum, v)| *sum += v);
            }
            slide(&columns[..WIDE + 2 * self.radius], self.radius, mean);
        };
        let mut total = [0.0f32; WIDE];
        window(0, &mut total);
        let start = (row + 2 * self.radius) * self.width + 2 * self.radius;
        let pixels = WIDE - 2 * self.radius;
        for (c, out) in out.iter_mut().enumerate() {
            window(1 + c, out);
            for (j, features) in self.features.iter().enumerate() {
                window(1 + CHANNELS + c * FEATURES + j, &mut mean);
                let features = &features[start..start + pixels];
                for (out, (mean, f)) in out.iter_mut().zip(mean.iter().zip(features)) {
                    *out += mean * f;
                }
            }
            let own = &self.channels[c][start..start + pixels];
            for (out, (total, own)) in out.iter_mut().zip(total.iter().zip(own)) {
                *out = if *total > 0.0 { *out / total } else { *own };
            }
        }
    }
}

/// Sums of 2 `radius` + 1 neighbours.
fn slide(values: &[f32], radius: usize, out: &mut [f32; WIDE]) {
    out.copy_from_slice(&values[..WIDE]);
    for d in 1..=2 * radius {
        out.iter_mut().zip(&values[d..]).for_each(|(out, v)| *out += v);
    }
}

fn load(values: &[f32]) -> f32x16 {
    f32x16::from(<[f32; LANES]>::try_from(&values[..LANES]).expect("sixteen values"))
}

/// Offsets and slopes of sixteen windows from their sums; all zero in a window without weight.
#[inline(always)]
fn solve(sum: impl Fn(usize) -> f32x16) -> [f32x16; COEFFICIENTS - 1] {
    let zero = splat(0.0);
    let weight = sum(0);
    let inverse = weight.simd_gt(zero).select(splat(1.0) / weight, zero);
    let mean: [f32x16; FEATURES] = std::array::from_fn(|i| sum(1 + i) * inverse);
    // Cholesky: covariance + ridge = L Lᵀ; the diagonal holds the inverse of L's. No pivot is below the ridge but by
    // rounding; such a feature is left out.
    let least = splat(0.5 * RIDGE);
    let mut l = [[zero; FEATURES]; FEATURES];
    for i in 0..FEATURES {
        for j in 0..=i {
            let mut v = sum(1 + FEATURES + i * (i + 1) / 2 + j) * inverse - mean[i] * mean[j];
            if i == j {
                v = v.max(zero) + splat(RIDGE);
            }
            for (a, b) in l[i].iter().zip(&l[j]).take(j) {
                v -= *a * *b;
            }
            l[i][j] = if i == j {
                v.simd_gt(least).select(splat(1.0) / v.max(least).sqrt(), zero)
            } else {
                v * l[j][j]
            };
        }
    }
    let mut out = [zero; COEFFICIENTS - 1];
    for c in 0..CHANNELS {
        let channel = sum(1 + FEATURES + PAIRS + c) * inverse;
        let first = 1 + FEATURES + PAIRS + CHANNELS + c * FEATURES;
        let mut slope: [f32x16; FEATURES] =
            std::array::from_fn(|i| sum(first + i) * inverse - mean[i] * channel);
        for i in 0..FEATURES {
            for k in 0..i {
                slope[i] -= l[i][k] * slope[k];
            }
            slope[i] *= l[i][i];
        }
        for i in (0..FEATURES).rev() {
            for k in i + 1..FEATURES {
                slope[i] -= l[k][i] * slope[k];
            }
            slope[i] *= l[i][i];
        }
        let mut offset = channel;
        for i in 0..FEATURES {
            offset -= slope[i] * mean[i];
            out[CHANNELS + c * FEATURES + i] = slope[i];
        }
        out[c] = offset;
    }
    out
}

/// The regressions of two images in windows of `radius` pixels to each side.
pub(super) fn regress(guide: &Guide, images: [&Plane; 2], radius: usize) -> [Plane; 2] {
    let (w, h) = (guide.width, guide.height);
    let (mut a, mut b) = (Plane::new(w, h), Plane::new(w, h));
    if w * h == 0 {
        return [a, b];
    }
    let pixels = WIDE - 2 * radius;
    let bands = a.data.par_chunks_mut(ROWS * w).zip(b.data.par_chunks_mut(ROWS * w)).enumerate();
    bands.for_each_init(
        || (Tile::new(radius), [[0.0; WIDE]; CHANNELS]),
        |(tile, line), (band, (a, b))| {
            for x0 in (0..w).step_by(pixels) {
                tile.load(guide, images, x0, band * ROWS);
                tile.fit();
                for (row, (a, b)) in a.chunks_exact_mut(w).zip(b.chunks_exact_mut(w)).enumerate() {
                    tile.predict(row, line);
                    for x in 0..pixels.min(w - x0) {
                        a[x0 + x] = std::array::from_fn(|c| line[c][x]);
                        b[x0 + x] = std::array::from_fn(|c| line[3 + c][x]);
                    }
                }
            }
        },
    );
    [a, b]
}
