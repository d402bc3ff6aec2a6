//! Conjugate gradients for weighted screened Poisson problems, preconditioned by one multigrid cycle.
//!
//! The operator is A = diag(w0) + Dxᵀ diag(wx) Dx + Dyᵀ diag(wy) Dy with weights ≥ 0 that the three channels share.
//! A cycle smooths once with damped Jacobi, sums the residual over 2×2 pixels, solves the coarser problem the same
//! way, adds its solution and smooths once more (Briggs, Henson, McCormick 2000, "A multigrid tutorial"). A coarse
//! edge weighs half the sum of the fine edges it replaces: it is twice as long, so a smooth function keeps its energy.
//! The cycle is symmetric and positive, so it may precondition conjugate gradients; one system for all channels.
//!
//! Sums are taken band by band and added in order: the result does not depend on the number of threads.

use super::rows::BAND;
use rayon::prelude::*;

/// Damping of Jacobi's method: 4/5 smooths the five-point Laplacian best.
const DAMPING: f32 = 0.8;

/// The operator on one grid.
#[derive(Clone, Debug, Default)]
pub(crate) struct Weights {
    pub width: usize,
    pub height: usize,
    /// Weight of the value of each pixel.
    pub w0: Vec<f32>,
    /// Weight of the difference to the right neighbour; zero in the last column.
    pub wx: Vec<f32>,
    /// Weight of the difference to the lower neighbour; zero in the last row.
    pub wy: Vec<f32>,
}

impl Weights {
    /// All zero.
    pub fn new(width: usize, height: usize) -> Self {
        let plane = || vec![0.0; width * height];
        Self { width, height, w0: plane(), wx: plane(), wy: plane() }
    }

    /// Sets `coarse`, of half the size rounded up, to the operator on 2×2 pixels at a time.
    fn coarsen(&self, coarse: &mut Self) {
        let w = coarse.width;
        let at = |plane: &[f32], x: usize, y: usize| {
            if x < self.width && y < self.height { plane[y * self.width + x] } else { 0.0 }
        };
        let rows =
            coarse.w0.par_chunks_mut(w).zip(coarse.wx.par_chunks_mut(w)).zip(coarse.wy.par_chunks_mut(w));
        rows.enumerate().for_each(|(y, ((w0, wx), wy))| {
            for x in 0..w {
                let (x2, y2) = (2 * x, 2 * y);
                w0[x] = at(&self.w0, x2, y2)
                    + at(&self.w0, x2 + 1, y2)
                    + (at(&self.w0, x2, y2 + 1) + at(&self.w0, x2 + 1, y2 + 1));
                wx[x] = 0.5 * (at(&self.wx, x2 + 1, y2) + at(&self.wx, x2 + 1, y2 + 1));
                wy[x] = 0.5 * (at(&self.wy, x2, y2 + 1) + at(&self.wy, x2 + 1, y2 + 1));
            }
        });
    }

    /// Damping over the diagonal, zero where nothing holds a pixel.
    fn damped_inverse(&self, inverse: &mut [f32]) {
        let w = self.width;
        inverse.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
            for (x, out) in row.iter_mut().enumerate() {
                let i = y * w + x;
                let left = if x > 0 { self.wx[i - 1] } else { 0.0 };
                let above = if y > 0 { self.wy[i - w] } else { 0.0 };
                let diagonal = self.w0[i] + (self.wx[i] + left) + (self.wy[i] + above);
                *out = if diagonal > f32::MIN_POSITIVE { DAMPING / diagonal } else { 0.0 };
            }
        });
    }

    /// Row `y` of A v, from rows y − 1, y and y + 1 of v; at a border pass row y itself for the row outside.
    fn row_product(&self, y: usize, [above, here, below]: [&[f32]; 3], out: &mut [f32]) {
        let w = self.width;
        let at = y * w;
        let up = at.saturating_sub(w);
        let (w0, wx) = (&self.w0[at..at + w], &self.wx[at..at + w]);
        let (wy, wy_up) = (&self.wy[at..at + w], &self.wy[up..up + w]);
        for c in 0..3 {
            let channel = c * w..(c + 1) * w;
            let (u, v, d) = (&above[channel.clone()], &here[channel.clone()], &below[channel.clone()]);
            let out = &mut out[channel];
            for x in 0..w {
                out[x] = w0[x] * v[x] + (wy[x] * (v[x] - d[x]) + wy_up[x] * (v[x] - u[x]));
            }
            for (out, (weight, v)) in out.iter_mut().zip(wx.iter().zip(v.windows(2))) {
                *out += weight * (v[0] - v[1]);
            }
            for (out, (weight, v)) in out[1..].iter_mut().zip(wx.iter().zip(v.windows(2))) {
                *out += weight * (v[1] - v[0]);
            }
        }
    }
}

/// Three consecutive rows that are computed once each while a band is walked downwards.
struct Window {
    rows: [Vec<f32>; 3],
}

impl Window {
    fn new(stride: usize) -> Self {
        Self { rows: std::array::from_fn(|_| vec![0.0; stride]) }
    }

    /// Fills rows y − 1 and y; call once at the top of a band.
    fn start(&mut self, y: usize, fill: &impl Fn(usize, &mut [f32])) {
        fill(y.saturating_sub(1), &mut self.rows[1]);
        fill(y, &mut self.rows[2]);
    }

    /// Moves down to row `y`, filling row y + 1 (row `y` again at the lower border); returns the three rows.
    fn advance(&mut self, y: usize, height: usize, fill: &impl Fn(usize, &mut [f32])) -> [&[f32]; 3] {
        self.rows.rotate_left(1);
        fill((y + 1).min(height - 1), &mut self.rows[2]);
        [&self.rows[0], &self.rows[1], &self.rows[2]]
    }
}

/// One level of the cycle.
struct Level {
    weights: Weights,
    inverse: Vec<f32>,
    /// Right-hand side and solution of coarse levels; unused on the finest.
    rhs: Vec<f32>,
    solution: Vec<f32>,
}

impl Level {
    fn new(weights: Weights, coarse: bool) -> Self {
        let pixels = weights.width * weights.height;
        let n = if coarse { 3 * pixels } else { 0 };
        Self { inverse: vec![0.0; pixels], weights, rhs: vec![0.0; n], solution: vec![0.0; n] }
    }

    /// Row `y` of the first Jacobi step from zero.
    fn smoothed_row(&self, rhs: &[f32], y: usize, out: &mut [f32]) {
        let w = self.weights.width;
        let inverse = &self.inverse[y * w..(y + 1) * w];
        let rhs = &rhs[3 * y * w..3 * (y + 1) * w];
        for (out, rhs) in out.chunks_exact_mut(w).zip(rhs.chunks_exact(w)) {
            for x in 0..w {
                out[x] = inverse[x] * rhs[x];
            }
        }
    }

    /// Residual after the first smoothing, summed over 2×2 pixels into `coarse` (of width `cw`).
    fn restrict(&self, rhs: &[f32], cw: usize, coarse: &mut [f32]) {
        let (w, h) = (self.weights.width, self.weights.height);
        let stride = 3 * w;
        let fill = |y: usize, out: &mut [f32]| self.smoothed_row(rhs, y, out);
        coarse.par_chunks_mut(BAND / 2 * 3 * cw).enumerate().for_each_init(
            || (Window::new(stride), vec![0.0; stride]),
            |(window, product), (band, rows)| {
                let first = band * BAND;
                window.start(first, &fill);
                rows.fill(0.0);
                for y in first..(first + BAND).min(h) {
                    let three = window.advance(y, h, &fill);
                    self.weights.row_product(y, three, product);
                    let row = &mut rows[(y - first) / 2 * 3 * cw..][..3 * cw];
                    let rhs = &rhs[y * stride..(y + 1) * stride];
                    for c in 0..3 {
                        let (rhs, product) = (&rhs[c * w..][..w], &product[c * w..][..w]);
                        let pairs = rhs.chunks(2).zip(product.chunks(2));
                        for (out, (r, p)) in row[c * cw..][..cw].iter_mut().zip(pairs) {
                            *out += r.iter().sum::<f32>() - p.iter().sum::<f32>();
                        }
                    }
                }
            },
        );
    }

    /// Adds the coarse solution to the first smoothing and smooths again into `out`; returns `rhs` · `out`.
    fn prolongate(&self, rhs: &[f32], cw: usize, coarse: &[f32], out: &mut [f32]) -> f64 {
        let (w, h) = (self.weights.width, self.weights.height);
        let stride = 3 * w;
        let fill = |y: usize, row: &mut [f32]| {
            self.smoothed_row(rhs, y, row);
            let coarse = &coarse[y / 2 * 3 * cw..][..3 * cw];
            for (row, coarse) in row.chunks_exact_mut(w).zip(coarse.chunks_exact(cw)) {
                for (pair, v) in row.chunks_mut(2).zip(coarse) {
                    pair.iter_mut().for_each(|p| *p += v);
                }
            }
        };
        let dots = out.par_chunks_mut(BAND * stride).enumerate().map_init(
            || (Window::new(stride), vec![0.0; stride]),
            |(window, product), (band, rows)| {
                window.start(band * BAND, &fill);
                let mut dot = 0.0;
                for (i, out) in rows.chunks_exact_mut(stride).enumerate() {
                    let y = band * BAND + i;
                    let three = window.advance(y, h, &fill);
                    self.weights.row_product(y, three, product);
                    let (rhs, inverse) = (&rhs[y * stride..][..stride], &self.inverse[y * w..][..w]);
                    for c in 0..3 {
                        let part = c * w..(c + 1) * w;
                        let (rhs, product, v) =
                            (&rhs[part.clone()], &product[part.clone()], &three[1][part.clone()]);
                        let out = &mut out[part];
                        for x in 0..w {
                            out[x] = v[x] + inverse[x] * (rhs[x] - product[x]);
                        }
                    }
                    dot += row_dot(rhs, out);
                }
                dot
            },
        );
        dots.collect::<Vec<_>>().iter().sum()
    }
}

/// Dot product of two rows: short f32 sums in 16 lanes, added up in f64.
fn row_dot(a: &[f32], b: &[f32]) -> f64 {
    let mut total = 0.0;
    for (a, b) in a.chunks(256).zip(b.chunks(256)) {
        let mut lanes = [0.0f32; 16];
        for (a, b) in a.chunks(16).zip(b.chunks(16)) {
            for (lane, (a, b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
                *lane += a * b;
            }
        }
        total += lanes.iter().map(|v| f64::from(*v)).sum::<f64>();
    }
    total
}

/// Vectors of conjugate gradients, kept from one solve to the next: fresh memory costs more than it seems.
#[derive(Default)]
struct Krylov {
    z: Vec<f32>,
    p: Vec<f32>,
    last: Vec<f32>,
    q: Vec<f32>,
}

/// The operator and its coarser versions.
pub(crate) struct Multigrid {
    levels: Vec<Level>,
    krylov: Krylov,
}

impl Multigrid {
    /// All levels down to one pixel, for an operator that is set by [`Self::set_weights`].
    pub fn new(width: usize, height: usize) -> Self {
        let (mut w, mut h) = (width, height);
        let mut levels = vec![Level::new(Weights::new(w, h), false)];
        while w * h > 1 {
            (w, h) = (w.div_ceil(2), h.div_ceil(2));
            levels.push(Level::new(Weights::new(w, h), true));
        }
        let vector = || vec![0.0; 3 * width * height];
        Self { levels, krylov: Krylov { z: vector(), p: vector(), last: vector(), q: vector() } }
    }

    /// Lets `set` change the weights of the finest level and rebuilds the others; returns what `set` returned.
    pub fn set_weights<R>(&mut self, set: impl FnOnce(&mut Weights) -> R) -> R {
        let result = set(&mut self.levels[0].weights);
        for i in 0..self.levels.len() {
            let (fine, coarse) = self.levels.split_at_mut(i + 1);
            let level = &mut fine[i];
            level.weights.damped_inverse(&mut level.inverse);
            if let Some(coarse) = coarse.first_mut() {
                level.weights.coarsen(&mut coarse.weights);
            }
        }
        result
    }

    /// `out` = one cycle for `rhs`; returns their dot product.
    fn cycle(levels: &mut [Level], rhs: &[f32], out: &mut [f32]) -> f64 {
        let Some((level, coarser)) = levels.split_first_mut() else { return 0.0 };
        let Some(coarse) = coarser.first_mut() else {
            for (out, rhs) in out.iter_mut().zip(rhs) {
                *out = rhs * level.inverse[0] / DAMPING;
            }
            return row_dot(rhs, out);
        };
        let cw = coarse.weights.width;
        let mut coarse_rhs = std::mem::take(&mut coarse.rhs);
        let mut coarse_solution = std::mem::take(&mut coarse.solution);
        level.restrict(rhs, cw, &mut coarse_rhs);
        Self::cycle(coarser, &coarse_rhs, &mut coarse_solution);
        let dot = level.prolongate(rhs, cw, &coarse_solution, out);
        coarser[0].rhs = coarse_rhs;
        coarser[0].solution = coarse_solution;
        dot
    }

    /// `r` −= A `v`.
    pub fn subtract_product(&self, v: &[f32], r: &mut [f32]) {
        let weights = &self.levels[0].weights;
        let stride = 3 * weights.width;
        r.par_chunks_mut(stride).enumerate().for_each_init(
            || vec![0.0; stride],
            |product, (y, r)| {
                let row = |y: usize| &v[y * stride..(y + 1) * stride];
                let three = [row(y.saturating_sub(1)), row(y), row((y + 1).min(weights.height - 1))];
                weights.row_product(y, three, product);
                r.iter_mut().zip(product).for_each(|(r, p)| *r -= *p);
            },
        );
    }

    /// `next` = `z` + `beta` `last`, `q` = A `next`; returns their dot product.
    fn direction(&self, z: &[f32], beta: f32, last: &[f32], next: &mut [f32], q: &mut [f32]) -> f64 {
        let weights = &self.levels[0].weights;
        let stride = 3 * weights.width;
        let fill = |y: usize, row: &mut [f32]| {
            let part = y * stride..(y + 1) * stride;
            for (out, (z, last)) in row.iter_mut().zip(z[part.clone()].iter().zip(&last[part])) {
                *out = z + beta * last;
            }
        };
        let bands = next.par_chunks_mut(BAND * stride).zip(q.par_chunks_mut(BAND * stride)).enumerate();
        let dots = bands.map_init(
            || Window::new(stride),
            |window, (band, (next, q))| {
                window.start(band * BAND, &fill);
                let mut dot = 0.0;
                for (i, (next, q)) in
                    next.chunks_exact_mut(stride).zip(q.chunks_exact_mut(stride)).enumerate()
                {
                    let three = window.advance(band * BAND + i, weights.height, &fill);
                    weights.row_product(band * BAND + i, three, q);
                    next.copy_from_slice(three[1]);
                    dot += row_dot(next, q);
                }
                dot
            },
        );
        dots.collect::<Vec<_>>().iter().sum()
    }

    /// Improves `x` by at most `steps` steps, `r` being its residual on entry and on return. Stops where the square
    /// of the residual's norm is at most `enough`; returns the steps taken and that square.
    pub fn conjugate_gradients(
        &mut self,
        x: &mut [f32],
        r: &mut [f32],
        steps: usize,
        enough: f64,
    ) -> (usize, f64) {
        let mut left = super::l2::norm_square(r);
        let mut krylov = std::mem::take(&mut self.krylov);
        let Krylov { z, p, last, q } = &mut krylov;
        p.fill(0.0);
        let mut rho_last = f64::INFINITY;
        let mut taken = 0;
        while taken < steps && left > enough {
            let rho = Self::cycle(&mut self.levels, r, z);
            std::mem::swap(p, last);
            let length = rho / self.direction(z, (rho / rho_last) as f32, last, p, q);
            if !(length.is_finite() && length > 0.0) {
                break;
            }
            left = advance(length as f32, p, q, x, r);
            rho_last = rho;
            taken += 1;
        }
        self.krylov = krylov;
        (taken, left)
    }
}

/// `x` += a `p`, `r` −= a `q`; returns the square of the norm of `r`.
fn advance(a: f32, p: &[f32], q: &[f32], x: &mut [f32], r: &mut [f32]) -> f64 {
    const CHUNK: usize = 1 << 14;
    let steps = p.par_chunks(CHUNK).zip(q.par_chunks(CHUNK));
    let targets = x.par_chunks_mut(CHUNK).zip(r.par_chunks_mut(CHUNK));
    let squares = steps.zip(targets).map(|((p, q), (x, r))| {
        for (x, p) in x.iter_mut().zip(p) {
            *x += a * p;
        }
        for (r, q) in r.iter_mut().zip(q) {
            *r -= a * q;
        }
        row_dot(r, r)
    });
    squares.collect::<Vec<_>>().iter().sum()
}
