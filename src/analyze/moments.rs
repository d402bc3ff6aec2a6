//! Where gradients pay: the variance of a difference over that of the colours, pixel by pixel, from the moments that
//! a film keeps of its samples.
//!
//! Everything is luminance. The film keeps the variance of the primal channel by channel; its luminance's is taken as
//! (Σ w_c σ_c)², exact where the channels' noise is fully correlated, as that of path tracing nearly is. For a fixed
//! number of samples the square of a mean makes no noise, so these are variances and not the raw second moments.

use crate::film::Plane;

/// Weights of R, G, B in the luminance, Rec.709.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// What a film keeps of its samples' spread.
#[derive(Clone, Debug)]
pub struct Moments {
    /// Samples a pixel.
    pub samples: f64,
    /// Variance of the mean primal, channel by channel.
    pub variance: Plane,
    /// Mean squared luminance of the one-sided differences to the right, left, up, down.
    pub gradient_square: [Vec<f32>; 4],
    /// Mean differences to the right.
    pub dx: Plane,
    /// Mean differences downwards.
    pub dy: Plane,
}

/// Variances of one sample.
#[derive(Clone, Debug)]
pub struct Energies {
    /// ‖F‖²: of the primal, mean over the image.
    pub primal: f64,
    /// ‖G‖² of horizontal differences.
    pub dx: f64,
    /// ‖G‖² of vertical differences.
    pub dy: f64,
    /// Variance of dx over that of the primal, a pixel; NaN in the last column and where neither pixel has any variance.
    pub dx_ratio: Vec<f64>,
    /// Variance of dy over that of the primal, a pixel; NaN in the last row and where neither pixel has any variance.
    pub dy_ratio: Vec<f64>,
}

fn luminance(v: [f32; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE[c] * f64::from(v[c])).sum()
}

impl Moments {
    /// The variances; a film of fewer than two samples has none.
    pub fn energies(&self) -> Option<Energies> {
        if self.samples < 2.0 {
            return None;
        }
        let (w, h) = (self.variance.width, self.variance.height);
        let primal: Vec<f64> =
            self.variance.data.iter().map(|v| self.samples * luminance(v.map(f32::sqrt)).powi(2)).collect();
        let [right, left, up, down] = &self.gradient_square;
        let square = |plane: &[f32], i: usize| f64::from(plane[i]);
        // A difference is the mean of one side minus that of the other; either has about half of it as its mean.
        let one = |mean: &Plane, i: usize, there: f64, back: f64| {
            (there + back - 0.5 * luminance(mean.data[i]).powi(2)).max(0.0)
        };
        let dx = |i: usize| {
            (i % w + 1 < w).then(|| (one(&self.dx, i, square(right, i), square(left, i + 1)), i + 1))
        };
        let dy =
            |i: usize| (i / w + 1 < h).then(|| (one(&self.dy, i, square(down, i), square(up, i + w)), i + w));
        let (dx, dx_ratio) = self.relate(&primal, dx);
        let (dy, dy_ratio) = self.relate(&primal, dy);
        let mean = primal.iter().sum::<f64>() / primal.len() as f64;
        Some(Energies { primal: mean, dx, dy, dx_ratio, dy_ratio })
    }

    /// Mean variance of the differences, and its ratio to the mean of the two pixels' a pixel. `difference` gives the
    /// variance and the neighbour.
    fn relate(&self, primal: &[f64], difference: impl Fn(usize) -> Option<(f64, usize)>) -> (f64, Vec<f64>) {
        let (mut sum, mut count) = (0.0, 0.0);
        let ratios = (0..primal.len())
            .map(|i| {
                let Some((variance, neighbour)) = difference(i) else { return f64::NAN };
                sum += variance;
                count += 1.0;
                variance / (0.5 * (primal[i] + primal[neighbour]))
            })
            .collect();
        (sum / count, ratios)
    }
}

/// The colour of a ratio of variances, sRGB: white where both are equal, ever bluer down to 1/256 (gradients pay),
/// ever redder up to 256, grey where there is none.
pub fn ratio_color(ratio: f64) -> [u8; 3] {
    if ratio.is_nan() {
        return [128; 3];
    }
    let t = (ratio.log2() / 8.0).clamp(-1.0, 1.0);
    let mix = |from: f64, to: f64| (from + (to - from) * t.abs() + 0.5) as u8;
    let end = if t < 0.0 { [5.0, 48.0, 140.0] } else { [150.0, 10.0, 30.0] };
    end.map(|to| mix(247.0, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variances_and_ratios_of_known_moments() {
        // Primal samples of deviation 2 in every channel, 16 of them; differences: each side has the square 0.5.
        let plane = |v: f32| Plane::from_fn(3, 2, |_, _| [v; 3]);
        let moments = Moments {
            samples: 16.0,
            variance: plane(4.0 / 16.0),
            gradient_square: std::array::from_fn(|_| vec![0.5; 6]),
            dx: plane(0.2),
            dy: plane(0.0),
        };
        let e = moments.energies().expect("sixteen samples");
        assert!((e.primal - 4.0).abs() < 1e-6 && (e.dy - 1.0).abs() < 1e-6);
        assert!((e.dx - (1.0 - 0.5 * 0.04)).abs() < 1e-6);
        assert!((e.dy_ratio[1] - 0.25).abs() < 1e-6 && e.dy_ratio[4].is_nan());
        assert!(e.dx_ratio[2].is_nan() && e.dx_ratio[3].is_finite());
        assert!(Moments { samples: 1.0, ..moments }.energies().is_none());
    }

    #[test]
    fn colours_say_which_side() {
        let [r, _, b] = ratio_color(1.0 / 64.0);
        assert!(b > r);
        let [r, _, b] = ratio_color(64.0);
        assert!(r > b);
        assert_eq!((ratio_color(1.0), ratio_color(f64::NAN)), ([247; 3], [128; 3]));
        assert_eq!(ratio_color(f64::INFINITY), ratio_color(256.0));
    }
}
