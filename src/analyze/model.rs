//! The frequency model of the least-squares solve (Kettunen et al. 2015, "Gradient-domain path tracing", section on
//! Fourier analysis): how much noise is left at each frequency, and what the best α is.
//!
//! Point sampling makes white noise: |ε_F|² in the primal, |ε_G|² in each difference. With the forward difference's
//! transfer function D, |D|² = λ = (2 − 2 cos 2πω_x) + (2 − 2 cos 2πω_y), and both noises uncorrelated,
//!
//!   |ε_R|² = (α⁴ |ε_F|² + λ |ε_G|²)/(α² + λ)²                                                      (eq. 7)
//!
//! which α*² = |ε_G|²/|ε_F|² makes smallest at every λ; then |ε_F|²/|ε_R|² = 1 + λ/α*². On a finite image with
//! natural borders ω_x = k/2W and λ are the eigenvalues of the cosine transform, so the model has no border error.

/// Eigenvalue of index `k` of the second difference on `n` pixels with natural borders: 2 − 2 cos(πk/n).
pub fn eigenvalue(k: usize, n: usize) -> f64 {
    // As a sine, so that small ones keep their digits.
    4.0 * (std::f64::consts::PI * k as f64 / (2 * n) as f64).sin().powi(2)
}

/// The best α for noise of the power `primal` in the colours and `gradient` in each difference.
pub fn alpha_star(primal: f64, gradient: f64) -> f64 {
    (gradient / primal).sqrt()
}

/// Equation 7: noise power left at the frequency of eigenvalue `lambda`.
pub fn remaining(lambda: f64, alpha: f64, primal: f64, gradient: f64) -> f64 {
    let square = alpha * alpha;
    (square * square * primal + lambda * gradient) / (square + lambda).powi(2)
}

/// Predicted gain in variance over the whole `width`×`height` image: primal noise over the mean of [`remaining`].
pub fn gain(width: usize, height: usize, alpha: f64, primal: f64, gradient: f64) -> f64 {
    let columns: Vec<f64> = (0..width).map(|k| eigenvalue(k, width)).collect();
    let row = |y: usize| {
        let lambda = eigenvalue(y, height);
        columns.iter().map(|x| remaining(x + lambda, alpha, primal, gradient)).sum::<f64>()
    };
    primal * (width * height) as f64 / (0..height).map(row).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gains_are_those_of_the_theory() {
        // Integrated 2-D gains of an image without borders, from the closed form 1/mean(α²/(α² + λ)).
        for (alpha, want) in [(0.1, 156.0), (0.2, 47.2), (0.3, 24.0), (0.5, 10.6), (1.0, 3.9)] {
            let gain = gain(1024, 1024, alpha, 1.0, alpha * alpha);
            assert!((gain / want - 1.0).abs() < 0.02, "{alpha}: {gain}, expected {want}");
        }
        // The finite ones.
        assert!((gain(64, 64, 0.2, 1.0, 0.04) - 44.1).abs() < 0.05);
        assert!((gain(192, 192, 0.2, 9.0, 0.36) - 46.1).abs() < 0.05);
    }

    #[test]
    fn alpha_star_is_the_minimum_at_every_frequency() {
        let (primal, gradient) = (0.09, 0.0036);
        let star = alpha_star(primal, gradient);
        assert!((star - 0.2).abs() < 1e-12);
        for lambda in [0.01, 0.3, 2.0, 8.0] {
            let best = remaining(lambda, star, primal, gradient);
            assert!((primal / best - (1.0 + lambda / (star * star))).abs() < 1e-9);
            for factor in [0.5, 0.9, 1.1, 2.0] {
                assert!(remaining(lambda, factor * star, primal, gradient) > best);
            }
        }
    }
}
