//! Error of an image against a reference.
//!
//! * relMSE: mean over pixels and channels of (I_c − R_c)²/(R̄² + 0.001), R̄ = (R + G + B)/3 of the reference;
//! * MSE: mean over pixels and channels of (I_c − R_c)²;
//! * PSNR: 10 log₁₀(P²/MSE) in dB, the peak P being the largest value of any channel of the reference.
//!
//! Nothing is clamped and no outlier dropped. Pixels that are not finite in either image have no error: they are
//! counted and left out of every mean. Sums are in f64, in pixel order.

use crate::film::Plane;

/// Added to the squared grey of the reference in relMSE, (W·m⁻²·sr⁻¹)².
pub const REL_MSE_EPSILON: f64 = 0.001;

/// The comparison of two images of one size.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Comparison {
    /// Relative mean square error, see the module's text.
    pub rel_mse: f64,
    /// Mean square error, (W·m⁻²·sr⁻¹)².
    pub mse: f64,
    /// Peak signal-to-noise ratio, dB; infinite for equal images.
    pub psnr: f64,
    /// Mean of the test image over pixels and channels.
    pub mean_test: f64,
    /// Mean of the reference over pixels and channels.
    pub mean_reference: f64,
    /// (mean_test − mean_reference)/mean_reference, 0 for equal means.
    pub mean_difference: f64,
    /// Pixels left out because either image is not finite there.
    pub nan_pixels: usize,
}

fn finite(v: &[f32; 3]) -> bool {
    v.iter().all(|v| v.is_finite())
}

/// Relative square error of one pixel, mean over its channels; NaN where either is not finite.
pub fn pixel_rel_mse(test: [f32; 3], reference: [f32; 3]) -> f64 {
    if !finite(&test) || !finite(&reference) {
        return f64::NAN;
    }
    let grey = reference.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
    square_error(test, reference) / (grey * grey + REL_MSE_EPSILON)
}

/// Square error of one pixel, mean over its channels.
fn square_error(test: [f32; 3], reference: [f32; 3]) -> f64 {
    (0..3).map(|c| (f64::from(test[c]) - f64::from(reference[c])).powi(2)).sum::<f64>() / 3.0
}

/// Compares `test` with `reference`; `None` where they differ in size. Means over no pixel at all are NaN.
pub fn compare(test: &Plane, reference: &Plane) -> Option<Comparison> {
    if (test.width, test.height) != (reference.width, reference.height) {
        return None;
    }
    let (mut rel_mse, mut mse, mut mean_test, mut mean_reference) = (0.0, 0.0, 0.0, 0.0);
    let (mut peak, mut pixels) = (0.0f64, 0usize);
    let grey = |v: &[f32; 3]| v.iter().map(|v| f64::from(*v)).sum::<f64>() / 3.0;
    for (t, r) in test.data.iter().zip(&reference.data).filter(|(t, r)| finite(t) && finite(r)) {
        rel_mse += pixel_rel_mse(*t, *r);
        mse += square_error(*t, *r);
        mean_test += grey(t);
        mean_reference += grey(r);
        peak = r.iter().fold(peak, |p, v| p.max(f64::from(*v)));
        pixels += 1;
    }
    let n = pixels as f64;
    let (mse, mean_test, mean_reference) = (mse / n, mean_test / n, mean_reference / n);
    let equal = mean_test == mean_reference;
    Some(Comparison {
        rel_mse: rel_mse / n,
        mse,
        psnr: if mse == 0.0 { f64::INFINITY } else { 10.0 * (peak * peak / mse).log10() },
        mean_test,
        mean_reference,
        mean_difference: if equal { 0.0 } else { (mean_test - mean_reference) / mean_reference },
        nan_pixels: test.data.len() - pixels,
    })
}

/// Means over blocks of `size`×`size` pixels (smaller at the right and lower border), row by row, of the pixels that
/// are finite; NaN for a block without one.
pub fn block_means(plane: &Plane, size: usize) -> Vec<[f64; 3]> {
    let size = size.max(1);
    let (columns, rows) = (plane.width.div_ceil(size), plane.height.div_ceil(size));
    let mut sums = vec![([0.0; 3], 0usize); columns * rows];
    for (i, v) in plane.data.iter().enumerate().filter(|(_, v)| finite(v)) {
        let (sum, count) = &mut sums[i / plane.width / size * columns + i % plane.width / size];
        for c in 0..3 {
            sum[c] += f64::from(v[c]);
        }
        *count += 1;
    }
    sums.into_iter().map(|(sum, count)| sum.map(|s: f64| s / count as f64)).collect()
}

/// z-scores of the means of independent `runs` (each a list of values) against `expected`, value by value:
/// (mean − expected)/(deviation/√K). Zero where every run equals the expectation; `None` below two runs or where the
/// lengths differ.
pub fn z_scores(runs: &[Vec<f64>], expected: &[f64]) -> Option<Vec<f64>> {
    if runs.len() < 2 || runs.iter().any(|r| r.len() != expected.len()) {
        return None;
    }
    let k = runs.len() as f64;
    let score = |(i, expected): (usize, &f64)| {
        let mean = runs.iter().map(|r| r[i]).sum::<f64>() / k;
        let variance = runs.iter().map(|r| (r[i] - mean).powi(2)).sum::<f64>() / (k - 1.0);
        if mean == *expected { 0.0 } else { (mean - expected) / (variance / k).sqrt() }
    };
    Some(expected.iter().enumerate().map(score).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_known_pair() {
        let reference = Plane { width: 2, height: 1, data: vec![[1.0, 2.0, 3.0], [0.0; 3]] };
        let test = Plane { width: 2, height: 1, data: vec![[1.5, 2.0, 3.0], [0.0, 0.0, 0.1]] };
        let c = compare(&test, &reference).expect("one size");
        let want = 0.5 * (0.25 / 3.0 / 4.001 + f64::from(0.1f32).powi(2) / 3.0 / 0.001);
        assert!((c.rel_mse - want).abs() < 1e-12, "{}", c.rel_mse);
        let mse = (0.25 + f64::from(0.1f32).powi(2)) / 6.0;
        assert!((c.mse - mse).abs() < 1e-12);
        assert!((c.psnr - 10.0 * (9.0 / mse).log10()).abs() < 1e-9);
        assert!((c.mean_reference - 1.0).abs() < 1e-12 && (c.mean_test - 1.1).abs() < 1e-8);
        assert!((c.mean_difference - 0.1).abs() < 1e-8);
        assert_eq!(c.nan_pixels, 0);
    }

    #[test]
    fn equal_images_and_missing_pixels() {
        let mut test = Plane::from_fn(4, 3, |x, y| [x as f32, y as f32, 1.0]);
        let reference = test.clone();
        let c = compare(&test, &reference).expect("one size");
        assert!(c.rel_mse == 0.0 && c.mse == 0.0 && c.psnr == f64::INFINITY && c.mean_difference == 0.0);
        test.data[5][1] = f32::NAN;
        test.data[6][0] = f32::INFINITY;
        let c = compare(&test, &reference).expect("one size");
        assert!(c.nan_pixels == 2 && c.rel_mse == 0.0);
        assert!(compare(&test, &Plane::new(3, 4)).is_none());
    }

    #[test]
    fn blocks_and_scores() {
        let mut plane = Plane::from_fn(5, 3, |x, y| [x as f32, y as f32, 2.0]);
        plane.data[0][0] = f32::NAN;
        let means = block_means(&plane, 2);
        assert_eq!(means.len(), 6);
        assert!((means[0][0] - 2.0 / 3.0).abs() < 1e-12 && means[5] == [4.0, 2.0, 2.0]);
        let z = z_scores(&[vec![1.0, 2.0], vec![3.0, 2.0]], &[1.0, 2.0]).expect("two runs");
        assert!((z[0] - 1.0).abs() < 1e-12 && z[1] == 0.0);
        assert!(z_scores(&[vec![1.0]], &[1.0]).is_none());
    }
}
