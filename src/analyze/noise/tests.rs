//! Synthetic noise of known power: its spectra are those of the theory, α* and the gains come out.

use super::*;
use crate::math::sampler::hash;

/// Independent normal noise of deviation `sigma`, by Box and Muller.
pub(in crate::analyze) fn noise(width: usize, height: usize, sigma: f64, seed: u32) -> Plane {
    let uniform = |i: usize, k: u32| (f64::from(hash(hash(i as u32, seed), k)) + 0.5) / 2f64.powi(32);
    let normal = |i: usize, k: u32| {
        (-2.0 * uniform(i, 2 * k).ln()).sqrt() * (2.0 * std::f64::consts::PI * uniform(i, 2 * k + 1)).cos()
    };
    Plane::from_fn(width, height, |x, y| {
        std::array::from_fn(|c| (sigma * normal(y * width + x, c as u32)) as f32)
    })
}

/// A smooth image: what is not noise must cancel.
fn signal(width: usize, height: usize) -> Plane {
    Plane::from_fn(width, height, |x, y| [(x as f32 * 0.1).sin() + 2.0, y as f32 * 0.02, 1.0])
}

fn sum(a: &Plane, b: &Plane) -> Plane {
    Plane::from_fn(a.width, a.height, |x, y| std::array::from_fn(|c| a.at(x, y)[c] + b.at(x, y)[c]))
}

/// Forward differences; what lies beyond the border must not be read.
pub(in crate::analyze) fn difference(image: &Plane, step: (usize, usize)) -> Plane {
    Plane::from_fn(image.width, image.height, |x, y| {
        let (nx, ny) = (x + step.0, y + step.1);
        if nx >= image.width || ny >= image.height {
            return [f32::NAN; 3];
        }
        std::array::from_fn(|c| image.at(nx, ny)[c] - image.at(x, y)[c])
    })
}

fn runs(width: usize, height: usize, primal: f64, gradient: f64, count: u32) -> Vec<Measured> {
    let image = signal(width, height);
    let (dx, dy) = (difference(&image, (1, 0)), difference(&image, (0, 1)));
    (0..count)
        .map(|i| Measured {
            primal: sum(&image, &noise(width, height, primal, 3 * i)),
            dx: sum(&dx, &noise(width, height, gradient, 3 * i + 1)),
            dy: sum(&dy, &noise(width, height, gradient, 3 * i + 2)),
        })
        .collect()
}

#[test]
fn alpha_star_and_gains_of_synthetic_noise_come_out() {
    for (primal, gradient) in [(0.3, 0.06), (0.5, 0.5), (0.02, 0.001)] {
        let star = gradient / primal;
        let measured =
            Noise::measure(&runs(96, 64, primal, gradient, 3), 1.0, star as f32).expect("three runs");
        assert!((measured.primal / (primal * primal) - 1.0).abs() < 0.05, "{}", measured.primal);
        assert!((measured.alpha_star() / star - 1.0).abs() < 0.03, "{} for {star}", measured.alpha_star());
        for gain in measured.sweep.iter().filter(|g| f64::from(g.alpha) > 0.3 * star) {
            let ratio = gain.measured / gain.predicted;
            assert!((ratio - 1.0).abs() < 0.15, "{}: {} {}", gain.alpha, gain.measured, gain.predicted);
        }
        let best = measured.best().expect("a sweep");
        assert!((f64::from(best.alpha) / star).log2().abs() < 1.01, "best at {}, not {star}", best.alpha);
        let pairs = measured.result_spectrum.points().into_iter().zip(measured.predicted_spectrum().points());
        for ((frequency, power), (_, want)) in pairs.skip(2) {
            assert!((power / want - 1.0).abs() < 0.25, "at {frequency}: {power}, equation 7 {want}");
        }
    }
}

#[test]
fn two_runs_are_needed_and_halves_count_half() {
    let two = runs(32, 32, 0.3, 0.1, 2);
    assert!(Noise::measure(&two[..1], 1.0, 0.2).is_none());
    let whole = Noise::measure(&two, 1.0, 0.2).expect("two runs");
    let half = Noise::measure(&two, 0.5, 0.2).expect("two runs");
    assert!((whole.primal / half.primal - 2.0).abs() < 1e-9);
    assert!((whole.alpha_star() - half.alpha_star()).abs() < 1e-12);
    assert_eq!(whole.sweep[3].measured, half.sweep[3].measured);
}

#[test]
fn a_row_of_pixels_and_missing_values_do_no_harm() {
    let mut thin = runs(1, 40, 0.3, 0.1, 2);
    thin[0].primal.data[7] = [f32::NAN; 3];
    let measured = Noise::measure(&thin, 1.0, 0.2).expect("two runs");
    assert!(measured.primal.is_finite() && measured.dy.is_finite());
}
