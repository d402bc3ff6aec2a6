//! Statistics of images: means with their standard errors, pixel by pixel or block by block, and tests of whether
//! two of them estimate the same image.
//!
//! Every statement is a two-sided test at a stated level; many cells at once share it by Šidák's correction
//! (threshold of each of n cells: 1 − (1 − α)^(1/n)). Where a standard error comes from few runs, Student's t
//! takes the normal distribution's place (Welch 1947 for the degrees of freedom of a difference).

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Relative rounding of an f32 image: no standard error counts as less.
const ROUNDING: f64 = 1e-6;

/// An image of RGB means with the standard error of each.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Means, row by row.
    pub mean: Vec<[f64; 3]>,
    /// Standard errors of the means.
    pub sem: Vec<[f64; 3]>,
    /// Degrees of freedom of the standard errors; infinite where they are known.
    pub freedom: f64,
}

impl Estimate {
    /// From independent runs of `width`×`height` images: at least two.
    pub fn from_runs(width: usize, height: usize, runs: &[Vec<[f32; 3]>]) -> Self {
        let n = runs.len() as f64;
        assert!(runs.len() > 1, "one run tells no error");
        assert!(runs.iter().all(|run| run.len() == width * height), "runs of one size");
        let (mean, sem) = (0..width * height)
            .map(|i| {
                let mean = each(|c| runs.iter().map(|run| f64::from(run[i][c])).sum::<f64>() / n);
                let sem = each(|c| {
                    let squares: f64 = runs.iter().map(|run| (f64::from(run[i][c]) - mean[c]).powi(2)).sum();
                    (squares / (n * (n - 1.0))).sqrt()
                });
                (mean, sem)
            })
            .unzip();
        Self { width, height, mean, sem, freedom: n - 1.0 }
    }

    /// Blocks of `side`×`side` pixels whose errors are independent.
    pub fn blocks(&self, side: usize) -> Self {
        let (width, height) = (self.width / side, self.height / side);
        let count = (side * side) as f64;
        let (mean, sem) = (0..width * height)
            .map(|block| {
                let pixels = || block_pixels(block, width, side, self.width);
                let mean = each(|c| pixels().map(|i| self.mean[i][c]).sum::<f64>() / count);
                let sem = each(|c| pixels().map(|i| self.sem[i][c].powi(2)).sum::<f64>().sqrt() / count);
                (mean, sem)
            })
            .unzip();
        Self { width, height, mean, sem, freedom: self.freedom * count }
    }

    /// The image times `factor`, as a renderer that loses or gains energy would make it.
    pub fn scaled(&self, factor: f64) -> Self {
        let scale = |values: &[[f64; 3]]| values.iter().map(|v| v.map(|v| v * factor)).collect();
        Self { mean: scale(&self.mean), sem: scale(&self.sem), ..*self }
    }

    /// Mean over all cells and channels.
    pub fn grand_mean(&self) -> f64 {
        self.mean.iter().flatten().sum::<f64>() / (3 * self.mean.len()) as f64
    }
}

/// A colour from a function of the channel.
fn each(f: impl FnMut(usize) -> f64) -> [f64; 3] {
    std::array::from_fn(f)
}

/// Indices of the pixels of one block, in an image of `columns`.
fn block_pixels(
    block: usize,
    blocks_across: usize,
    side: usize,
    columns: usize,
) -> impl Iterator<Item = usize> {
    let corner = block / blocks_across * side * columns + block % blocks_across * side;
    (0..side * side).map(move |k| corner + k / side * columns + k % side)
}

/// Means over blocks of `side`×`side` pixels of one run, for [`Estimate::from_runs`]: the way where the errors of
/// neighbours may be correlated.
pub fn block_means(width: usize, height: usize, run: &[[f32; 3]], side: usize) -> Vec<[f32; 3]> {
    let across = width / side;
    (0..across * (height / side))
        .map(|block| {
            let sum = |c: usize| {
                block_pixels(block, across, side, width).map(|i| f64::from(run[i][c])).sum::<f64>()
            };
            std::array::from_fn(|c| (sum(c) / (side * side) as f64) as f32)
        })
        .collect()
}

/// Standard score of the difference `a − b`, cell by cell: normally distributed where both estimate the same.
pub fn z_scores(a: &Estimate, b: &Estimate) -> Vec<[f64; 3]> {
    assert_eq!((a.width, a.height), (b.width, b.height), "images of one size");
    (0..a.mean.len())
        .map(|i| {
            each(|c| {
                let floor = ROUNDING * a.mean[i][c].abs().max(b.mean[i][c].abs());
                let (var_a, var_b) = (a.sem[i][c].powi(2), b.sem[i][c].powi(2) + floor * floor);
                let difference = a.mean[i][c] - b.mean[i][c];
                if difference == 0.0 {
                    return 0.0;
                }
                let freedom =
                    (var_a + var_b).powi(2) / (var_a.powi(2) / a.freedom + var_b.powi(2) / b.freedom);
                normal_of_t(difference / (var_a + var_b).sqrt(), freedom)
            })
        })
        .collect()
}

/// The normal score that is as improbable as `t` under Student's distribution of `freedom` degrees.
pub fn normal_of_t(t: f64, freedom: f64) -> f64 {
    // Far out both tails underflow; there the sign of the verdict is clear.
    if freedom > 1e6 || t.abs() > 30.0 {
        return t;
    }
    let student = StudentsT::new(0.0, 1.0, freedom).expect("degrees of freedom are positive");
    let tail = student.sf(t.abs()).max(f64::MIN_POSITIVE);
    -Normal::standard().inverse_cdf(tail) * t.signum()
}

/// |z| above which one of `cells` independent scores is improbable at level `alpha` (Šidák 1967).
pub fn sidak_threshold(alpha: f64, cells: usize) -> f64 {
    let each = -((-alpha).ln_1p() / cells as f64).exp_m1();
    -Normal::standard().inverse_cdf(0.5 * each)
}

/// Largest |z| of a list of scores.
pub fn largest(scores: &[[f64; 3]]) -> f64 {
    scores.iter().flatten().fold(0.0, |largest, z| largest.max(z.abs()))
}

/// Index and value of the cell whose |z| is largest, for messages: (cell, channel, z).
pub fn worst(scores: &[[f64; 3]]) -> (usize, usize, f64) {
    let all = scores.iter().enumerate().flat_map(|(i, z)| z.iter().enumerate().map(move |(c, &z)| (i, c, z)));
    all.max_by(|a, b| a.2.abs().total_cmp(&b.2.abs())).unwrap_or((0, 0, 0.0))
}
