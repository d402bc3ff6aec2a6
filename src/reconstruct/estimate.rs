//! The error of a result, from the results of two independent halves of the samples: half their difference has the
//! noise of their mean. Bias does not show.

use crate::film::Plane;

/// Side of the blocks of the error map, pixels.
pub const BLOCK: usize = 8;

/// Added to the squared grey of a pixel, (W·m⁻²·sr⁻¹)², as in `analyze::metrics`.
const EPSILON: f64 = 0.001;

/// The estimated error of an image.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorEstimate {
    /// The relMSE of `analyze::metrics` that a reference without noise would show: the mean over pixels and channels
    /// of the variance over (grey of the image)² + 0.001.
    pub rel_mse: f64,
    /// Columns of the map.
    pub columns: usize,
    /// The same over blocks of [`BLOCK`]×[`BLOCK`] pixels (smaller at the right and lower border), row by row.
    pub map: Vec<f64>,
}

impl ErrorEstimate {
    /// The estimate for `image` from the images of the halves, and from the square of a bias where that is known, one a
    /// pixel. Pixels that are not finite are left out.
    pub(super) fn new(image: &Plane, [a, b]: [&Plane; 2], bias: Option<&[f32]>) -> Self {
        let columns = image.width.div_ceil(BLOCK);
        let mut sums = vec![(0.0, 0.0); columns * image.height.div_ceil(BLOCK)];
        for (i, value) in image.data.iter().enumerate() {
            let grey = value.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
            let square = (0..3)
                .map(|c| (0.5 * (f64::from(a.data[i][c]) - f64::from(b.data[i][c]))).powi(2))
                .sum::<f64>();
            let bias = bias.map_or(0.0, |b| f64::from(b[i]));
            let error = (square / 3.0 + bias) / (grey * grey + EPSILON);
            if error.is_finite() {
                let sum = &mut sums[i / image.width / BLOCK * columns + i % image.width / BLOCK];
                *sum = (sum.0 + error, sum.1 + 1.0);
            }
        }
        let mean = |(sum, count): (f64, f64)| if count > 0.0 { sum / count } else { 0.0 };
        let total = sums.iter().fold((0.0, 0.0), |t, s| (t.0 + s.0, t.1 + s.1));
        Self { rel_mse: mean(total), columns, map: sums.into_iter().map(mean).collect() }
    }

    /// The relative error: the root of [`Self::rel_mse`].
    pub fn relative(&self) -> f64 {
        self.rel_mse.sqrt()
    }
}
