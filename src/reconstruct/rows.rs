//! The rows of the problem: which are measured, and what the differences say beyond the primal.
//!
//! All solvers look for y = x − g, the correction of the primal. Its data are the residuals of the primal,
//! ex = dx − Dx g and ey = dy − Dy g, so consistent data give y = 0 exactly and rounding scales with the noise, not
//! with the image. A field is one value a channel and pixel, row y being R, G, B one after the other (3 W values).

use super::LIMIT;
use super::dct::{Real, real};
use crate::film::{Measured, Plane};
use rayon::prelude::*;
use std::borrow::Cow;

/// Rows of pixels a parallel task works on.
pub(crate) const BAND: usize = 16;

/// Bits of [`Problem::mask`]: which rows of a pixel have no measurement.
pub(crate) const NO_PRIMAL: u8 = 1;
/// The difference to the right is missing.
pub(crate) const NO_DX: u8 = 2;
/// The difference downwards is missing.
pub(crate) const NO_DY: u8 = 4;

/// The input with its missing rows found and the primal's holes filled.
pub(crate) struct Problem<'a> {
    pub width: usize,
    pub height: usize,
    /// The primal, finite everywhere.
    pub primal: Cow<'a, Plane>,
    dx: &'a Plane,
    dy: &'a Plane,
    /// Missing rows of each pixel; empty where nothing is missing.
    pub mask: Vec<u8>,
    pub missing: usize,
}

/// Whether a value is a measurement.
pub(crate) fn measured(v: &[f32; 3]) -> bool {
    v.iter().all(|v| v.abs() <= LIMIT)
}

impl<'a> Problem<'a> {
    pub fn new(input: &'a Measured) -> Self {
        let (width, height) = (input.primal.width, input.primal.height);
        let bits = |i: usize| {
            let (inside_x, inside_y) = (i % width + 1 < width, i / width + 1 < height);
            u8::from(!measured(&input.primal.data[i])) * NO_PRIMAL
                + u8::from(inside_x && !measured(&input.dx.data[i])) * NO_DX
                + u8::from(inside_y && !measured(&input.dy.data[i])) * NO_DY
        };
        let missing = (0..width * height).into_par_iter().map(|i| bits(i).count_ones() as usize).sum();
        let mut problem = Self {
            width,
            height,
            primal: Cow::Borrowed(&input.primal),
            dx: &input.dx,
            dy: &input.dy,
            mask: Vec::new(),
            missing,
        };
        if missing > 0 {
            problem.mask = (0..width * height).map(bits).collect();
            problem.fill_holes();
        }
        problem
    }

    /// Gives pixels without a primal the mean of their measured neighbours, or zero. Their row has no weight, so the
    /// value is only where the solvers start from.
    fn fill_holes(&mut self) {
        let (w, h) = (self.width, self.height);
        let mut filled = self.primal.as_ref().clone();
        for i in (0..w * h).filter(|&i| self.mask[i] & NO_PRIMAL != 0) {
            let (x, y) = (i % w, i / w);
            let around = [
                (x > 0, i.wrapping_sub(1)),
                (x + 1 < w, i + 1),
                (y > 0, i.wrapping_sub(w)),
                (y + 1 < h, i + w),
            ];
            let mut sum = [0.0f32; 3];
            let mut count = 0.0;
            for (_, j) in around.into_iter().filter(|&(inside, j)| inside && self.mask[j] & NO_PRIMAL == 0) {
                sum.iter_mut().zip(self.primal.data[j]).for_each(|(s, v)| *s += v);
                count += 1.0;
            }
            filled.data[i] = if count > 0.0 { sum.map(|s| s / count) } else { [0.0; 3] };
        }
        self.primal = Cow::Owned(filled);
    }

    /// Values of a row of a field.
    pub fn stride(&self) -> usize {
        3 * self.width
    }

    /// Writes the residuals of the primal in pixel row `y`: `ex` and `ey`, zero where missing or outside.
    pub fn residuals<T: Real>(&self, y: usize, ex: &mut [T], ey: &mut [T]) {
        let w = self.width;
        let here = &self.primal.data[y * w..(y + 1) * w];
        let dx = &self.dx.data[y * w..(y + 1) * w];
        let t = |v: f32| <T as From<f32>>::from(v);
        let difference = |d: f32, a: f32, b: f32| t(d) - (t(b) - t(a));
        for c in 0..3 {
            for x in 0..w - 1 {
                ex[c * w + x] = difference(dx[x][c], here[x][c], here[x + 1][c]);
            }
            ex[c * w + w - 1] = T::zero();
        }
        if y + 1 < self.height {
            let below = &self.primal.data[(y + 1) * w..(y + 2) * w];
            let dy = &self.dy.data[y * w..(y + 1) * w];
            for c in 0..3 {
                for x in 0..w {
                    ey[c * w + x] = difference(dy[x][c], here[x][c], below[x][c]);
                }
            }
        } else {
            ey.fill(T::zero());
        }
        if !self.mask.is_empty() {
            for x in 0..w {
                for c in 0..3 {
                    if self.mask[y * w + x] & NO_DX != 0 {
                        ex[c * w + x] = T::zero();
                    }
                    if self.mask[y * w + x] & NO_DY != 0 {
                        ey[c * w + x] = T::zero();
                    }
                }
            }
        }
    }

    /// Walks down the pixel rows of band `band`, giving `visit` the number of each and `weight` · Dᵀ e in it; `row` is
    /// where it is formed. `weigh` may change the residuals ex and ey of a pixel row before.
    pub fn divergence_band<T: Real>(
        &self,
        weight: T,
        band: usize,
        row: &mut [T],
        weigh: &impl Fn(usize, &mut [T], &mut [T]),
        mut visit: impl FnMut(usize, &[T]),
    ) {
        let (w, stride) = (self.width, self.stride());
        let zero = || vec![T::zero(); stride];
        let (mut ex, mut ey, mut above) = (zero(), zero(), zero());
        if band > 0 {
            self.residuals(band * BAND - 1, &mut ex, &mut above);
            weigh(band * BAND - 1, &mut ex, &mut above);
        }
        for y in band * BAND..((band + 1) * BAND).min(self.height) {
            self.residuals(y, &mut ex, &mut ey);
            weigh(y, &mut ex, &mut ey);
            for c in 0..3 {
                let part = c * w..(c + 1) * w;
                let [ex, ey, above] = [&ex, &ey, &above].map(|e| &e[part.clone()]);
                let out = &mut row[part];
                out[0] = weight * (above[0] - ey[0] - ex[0]);
                for x in 1..w {
                    out[x] = weight * (above[x] - ey[x] + (ex[x - 1] - ex[x]));
                }
            }
            visit(y, row);
            std::mem::swap(&mut ey, &mut above);
        }
    }

    /// `weight` · Dᵀ e: the right-hand side of the unweighted problem.
    pub fn divergence<T: Real>(&self, weight: f64) -> Vec<T> {
        self.weighted_divergence(weight, &|_, _, _| ())
    }

    /// `weight` · Dᵀ e, `weigh` having changed the residuals of each pixel row.
    pub fn weighted_divergence<T: Real>(
        &self,
        weight: f64,
        weigh: &(impl Fn(usize, &mut [T], &mut [T]) + Sync),
    ) -> Vec<T> {
        let stride = self.stride();
        let mut field = vec![T::zero(); stride * self.height];
        if field.is_empty() {
            return field;
        }
        field.par_chunks_mut(BAND * stride).enumerate().for_each(|(band, rows)| {
            let mut line = vec![T::zero(); stride];
            self.divergence_band(real(weight), band, &mut line, weigh, |y, row| {
                rows[(y - band * BAND) * stride..][..stride].copy_from_slice(row);
            });
        });
        field
    }

    /// The image g + y.
    pub fn image(&self, correction: &[f32]) -> Plane {
        let w = self.width;
        let mut image = Plane::new(w, self.height);
        if w > 0 {
            let rows = image.data.par_chunks_mut(w).zip(self.primal.data.par_chunks(w));
            rows.zip(correction.par_chunks(3 * w)).for_each(|((pixels, primal), row)| {
                for (x, (pixel, g)) in pixels.iter_mut().zip(primal).enumerate() {
                    *pixel = std::array::from_fn(|c| g[c] + row[c * w + x]);
                }
            });
        }
        image
    }
}
