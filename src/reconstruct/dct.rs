//! Exact solution of (p + q L) x = b on a W×H grid, L the five-point Laplacian with natural (Neumann) borders.
//!
//! L = Dxᵀ Dx + Dyᵀ Dy is diagonal under the DCT-II, with eigenvalues λ_k + λ_l, λ_k = 2 − 2 cos(πk/N), so the
//! solution is a forward transform, one division a frequency and a backward transform: O(N log N), no iteration.
//!
//! The transform of Makhoul (1980, "A fast cosine transform in one and two dimensions"): with v the even samples
//! followed by the odd ones in reverse and w_k = exp(−iπk/2N), X_k = (w_k V_k + conj(w_k) V_{N−k})/2. That is linear,
//! so one complex FFT transforms two real sequences, one in the real and one in the imaginary part.
//!
//! Layout of a field: row y is the three channels one after the other, 3 W values. Three passes over memory: rows
//! forward in place; columns forward, divided and backward, 16 at a time into blocks of their own; rows backward.
//! Every pass reads where it likes and writes its own chunk only, so the result does not depend on the threads.

use rayon::prelude::*;
use rustdct::rustfft::num_complex::Complex;
use rustdct::rustfft::num_traits::{Float, NumCast};
use rustdct::rustfft::{Fft, FftNum, FftPlanner};
use std::sync::Arc;

/// Columns transformed together: one cache line of f32.
const BLOCK: usize = 16;
/// Pairs of rows a task transforms.
const ROW_PAIRS: usize = 8;

/// The scalar of a solve: f32 in production, f64 as its oracle.
pub trait Real: FftNum + Float + From<f32> {}
impl<T: FftNum + Float + From<f32>> Real for T {}

/// `value` in the precision of the solve.
pub(crate) fn real<T: Real>(value: f64) -> T {
    <T as NumCast>::from(value).expect("every float has a nearest f32 and f64")
}

/// DCT-II and its inverse for sequences of one length, two real sequences at a time.
struct Dct<T> {
    len: usize,
    forward: Arc<dyn Fft<T>>,
    backward: Arc<dyn Fft<T>>,
    /// exp(−iπk/2N)
    twiddle: Vec<Complex<T>>,
    /// Where sample n goes before the FFT.
    order: Vec<usize>,
    /// 2 − 2 cos(πk/N), as 4 sin² so that small ones keep their digits.
    lambda: Vec<T>,
}

impl<T: Real> Dct<T> {
    fn new(len: usize, planner: &mut FftPlanner<T>) -> Self {
        let angle = |k: usize| std::f64::consts::PI * k as f64 / (2 * len) as f64;
        Self {
            len,
            forward: planner.plan_fft_forward(len),
            backward: planner.plan_fft_inverse(len),
            twiddle: (0..len).map(|k| Complex::new(real(angle(k).cos()), real(-angle(k).sin()))).collect(),
            order: (0..len).map(|n| if n % 2 == 0 { n / 2 } else { len - 1 - n / 2 }).collect(),
            lambda: (0..len).map(|k| real(4.0 * angle(k).sin().powi(2))).collect(),
        }
    }

    fn scratch_len(&self) -> usize {
        self.forward.get_inplace_scratch_len().max(self.backward.get_inplace_scratch_len())
    }

    /// From the FFT of the reordered samples to DCT coefficients, frequencies k and N − k together.
    fn coefficients(&self, k: usize, v: &[Complex<T>]) -> (Complex<T>, Complex<T>) {
        let half = real::<T>(0.5);
        let a = self.twiddle[k] * v[k];
        let b = self.twiddle[k].conj() * v[self.len - k];
        let d = a - b;
        ((a + b) * half, Complex::new(-d.im, d.re) * half)
    }

    /// The inverse of [`Self::coefficients`]: stores V_k and V_{N−k}.
    fn spectrum(&self, k: usize, x: Complex<T>, mirror: Complex<T>, v: &mut [Complex<T>]) {
        let i_mirror = Complex::new(-mirror.im, mirror.re);
        v[k] = self.twiddle[k].conj() * (x - i_mirror);
        v[self.len - k] = self.twiddle[k] * (x + i_mirror);
    }
}

/// What one task needs: the sequences and the scratch of the FFT.
struct Work<T> {
    data: Vec<Complex<T>>,
    scratch: Vec<Complex<T>>,
}

impl<T: Real> Work<T> {
    fn new(dct: &Dct<T>, sequences: usize) -> Self {
        let zero = Complex::new(T::zero(), T::zero());
        Self { data: vec![zero; dct.len * sequences], scratch: vec![zero; dct.scratch_len()] }
    }
}

/// The solver for one film size and one pair of weights.
pub(crate) struct DctSolver<T> {
    width: usize,
    height: usize,
    rows: Dct<T>,
    columns: Dct<T>,
    primal_weight: T,
    gradient_weight: T,
}

impl<T: Real> DctSolver<T> {
    /// Solves with p = `primal_weight` and q = `gradient_weight`; the mean of every right-hand side is taken as zero,
    /// which makes p = 0 as good as any other.
    pub fn new(width: usize, height: usize, primal_weight: f64, gradient_weight: f64) -> Self {
        let mut planner = FftPlanner::new();
        Self {
            width,
            height,
            rows: Dct::new(width, &mut planner),
            columns: Dct::new(height, &mut planner),
            primal_weight: real(primal_weight),
            gradient_weight: real(gradient_weight),
        }
    }

    /// Replaces the right-hand side `field` by the solution.
    pub fn solve(&self, field: &mut [T]) {
        if field.is_empty() {
            return;
        }
        field.par_chunks_mut(2 * ROW_PAIRS * self.width).for_each_init(
            || Work::new(&self.rows, 1),
            |work, rows| rows.chunks_mut(2 * self.width).for_each(|pair| self.row_forward(work, pair)),
        );
        let blocks = self.width.div_ceil(BLOCK);
        let block_len = self.height * BLOCK;
        let mut blocked = vec![T::zero(); 3 * blocks * block_len];
        blocked.par_chunks_mut(block_len).enumerate().for_each_init(
            || Work::new(&self.columns, BLOCK / 2),
            |work, (i, out)| self.column_block(work, field, i, out),
        );
        field.par_chunks_mut(2 * ROW_PAIRS * self.width).enumerate().for_each_init(
            || Work::new(&self.rows, 1),
            |work, (task, rows)| {
                for (i, pair) in rows.chunks_mut(2 * self.width).enumerate() {
                    self.row_backward(work, &blocked, 2 * (task * ROW_PAIRS + i), pair);
                }
            },
        );
    }

    /// DCT-II of one or two rows in place.
    fn row_forward(&self, work: &mut Work<T>, pair: &mut [T]) {
        let n = self.width;
        let (first, second) = pair.split_at_mut(n);
        for (x, &to) in self.rows.order.iter().enumerate() {
            let im = second.get(x).copied().unwrap_or(T::zero());
            work.data[to] = Complex::new(first[x], im);
        }
        self.rows.forward.process_with_scratch(&mut work.data, &mut work.scratch);
        let mut store = |k: usize, v: Complex<T>| {
            first[k] = v.re;
            if let Some(s) = second.get_mut(k) {
                *s = v.im;
            }
        };
        store(0, work.data[0]);
        for k in 1..=n / 2 {
            let (x, mirror) = self.rows.coefficients(k, &work.data);
            store(k, x);
            store(n - k, mirror);
        }
    }

    /// Transforms, divides and transforms back the 16 columns of block `index` into `out`.
    fn column_block(&self, work: &mut Work<T>, field: &[T], index: usize, out: &mut [T]) {
        let (n, channel, x0) = (self.height, index % 3, index / 3 * BLOCK);
        let columns = BLOCK.min(self.width - x0);
        for (y, &to) in self.columns.order.iter().enumerate() {
            let start = (3 * y + channel) * self.width + x0;
            let mut line = [T::zero(); BLOCK];
            line[..columns].copy_from_slice(&field[start..start + columns]);
            for (p, v) in line.chunks_exact(2).enumerate() {
                work.data[p * n + to] = Complex::new(v[0], v[1]);
            }
        }
        let used = columns.div_ceil(2) * n;
        self.columns.forward.process_with_scratch(&mut work.data[..used], &mut work.scratch);
        for (p, v) in work.data[..used].chunks_exact_mut(n).enumerate() {
            self.divide(v, x0 + 2 * p);
        }
        self.columns.backward.process_with_scratch(&mut work.data[..used], &mut work.scratch);
        for (line, &from) in out.chunks_exact_mut(BLOCK).zip(&self.columns.order) {
            for (p, v) in line.chunks_exact_mut(2).enumerate() {
                let value = work.data[p * n + from];
                v[0] = value.re;
                v[1] = value.im;
            }
        }
    }

    /// Divides the spectra of columns `kx` (real part) and `kx` + 1 (imaginary part) by the operator's eigenvalues.
    fn divide(&self, v: &mut [Complex<T>], kx: usize) {
        let n = self.height;
        let norm = real::<T>(1.0 / (self.width * n) as f64);
        let (p, q) = (self.primal_weight, self.gradient_weight);
        let lambda = [self.rows.lambda[kx], self.rows.lambda[(kx + 1).min(self.width - 1)]];
        let apply = |k: usize, x: Complex<T>| {
            let ly = self.columns.lambda[k];
            Complex::new(
                x.re * (norm / (p + q * (lambda[0] + ly))),
                x.im * (norm / (p + q * (lambda[1] + ly))),
            )
        };
        v[0] = if kx == 0 { Complex::new(T::zero(), apply(0, v[0]).im) } else { apply(0, v[0]) };
        for k in 1..=n / 2 {
            let (x, mirror) = self.columns.coefficients(k, v);
            self.columns.spectrum(k, apply(k, x), apply(n - k, mirror), v);
        }
    }

    /// Inverse DCT of rows `row` and `row` + 1 (channel rows of the field) out of the blocks.
    fn row_backward(&self, work: &mut Work<T>, blocked: &[T], row: usize, pair: &mut [T]) {
        let n = self.width;
        let block_len = self.height * BLOCK;
        let line = |row: usize, block: usize| {
            let start = (3 * block + row % 3) * block_len + row / 3 * BLOCK;
            &blocked[start..start + BLOCK]
        };
        let two = pair.len() > n;
        for (block, target) in pair[..n].chunks_mut(BLOCK).enumerate() {
            target.copy_from_slice(&line(row, block)[..target.len()]);
        }
        if two {
            for (block, target) in pair[n..].chunks_mut(BLOCK).enumerate() {
                target.copy_from_slice(&line(row + 1, block)[..target.len()]);
            }
        }
        let (first, second) = pair.split_at_mut(n);
        let load = |k: usize| Complex::new(first[k], second.get(k).copied().unwrap_or(T::zero()));
        work.data[0] = load(0);
        for k in 1..=n / 2 {
            self.rows.spectrum(k, load(k), load(n - k), &mut work.data);
        }
        self.rows.backward.process_with_scratch(&mut work.data, &mut work.scratch);
        for (x, &from) in self.rows.order.iter().enumerate() {
            first[x] = work.data[from].re;
            if let Some(s) = second.get_mut(x) {
                *s = work.data[from].im;
            }
        }
    }
}
