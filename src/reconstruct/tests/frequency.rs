//! The frequency model of the least-squares solve: white noise in, predicted error out (algorithm test T14).

use super::*;

fn eigenvalue(k: usize, n: usize) -> f64 {
    2.0 - 2.0 * (std::f64::consts::PI * k as f64 / n as f64).cos()
}

/// Predicted mean square error of least squares for white noise, per frequency: eq. 7 with its DCT eigenvalues.
fn predicted(lambda: f64, alpha: f64, primal: f64, gradient: f64) -> f64 {
    let square = alpha * alpha;
    (square * square * primal * primal + lambda * gradient * gradient) / (square + lambda).powi(2)
}

#[test]
fn variance_gain_is_the_predicted_one() {
    for (n, gain, draws) in [(64, 44.1, 12), (192, 46.1, 2)] {
        let lambda = |i: usize| eigenvalue(i % n, n) + eigenvalue(i / n, n);
        let remaining: f64 =
            (0..n * n).map(|i| predicted(lambda(i), 0.2, 1.0, 0.2)).sum::<f64>() / (n * n) as f64;
        assert!((1.0 / remaining - gain).abs() < 0.06, "{n}: {}", 1.0 / remaining);
        let zero = Plane::new(n, n);
        let error = |alpha, seed| {
            let planes = Planes::noisy(&zero, 0.3, 0.06, seed);
            (mse(&planes.primal, &zero), mse(&planes.solve(Method::L2, alpha), &zero))
        };
        let (before, after) = (100..100 + draws)
            .map(|seed| error(0.2, seed))
            .fold((0.0, 0.0), |sum, e| (sum.0 + e.0, sum.1 + e.1));
        let measured = before / after;
        assert!((measured / gain - 1.0).abs() < 0.05, "{n}: {measured} against {gain}");
        let sweep = [0.02f32, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4].map(|a| (error(a, 100).1, a));
        let best = sweep.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).expect("eight values");
        assert!((best.1 - 0.2).abs() < 0.06, "{n}: {sweep:?}");
    }
}

#[test]
fn error_spectrum_follows_equation_7() {
    let n = 192;
    let dct = rustdct::DctPlanner::<f64>::new().plan_dct2(n);
    for alpha in [0.1f32, 0.2, 0.5] {
        let planes = Planes::noisy(&Plane::new(n, n), 0.3, 0.06, 18);
        let image = planes.solve(Method::L2, alpha);
        let mut bins = vec![(0.0, 0.0, 0usize); 12];
        for c in 0..3 {
            let mut spectrum: Vec<f64> = image.data.iter().map(|v| f64::from(v[c])).collect();
            for _ in 0..2 {
                spectrum.chunks_exact_mut(n).for_each(|row| dct.process_dct2(row));
                spectrum = (0..n * n).map(|i| spectrum[i % n * n + i / n]).collect();
            }
            for (i, v) in spectrum.iter().enumerate().skip(1) {
                let (kx, ky) = (i % n, i / n);
                let unit = |k| if k == 0 { 1.0 } else { 2.0 } / n as f64;
                let lambda = eigenvalue(kx, n) + eigenvalue(ky, n);
                let radius = (kx as f64).hypot(ky as f64) / n as f64;
                let bin = &mut bins[((radius * 10.0) as usize).min(11)];
                bin.0 += v * v * unit(kx) * unit(ky);
                bin.1 += predicted(lambda, f64::from(alpha), 0.3, 0.06);
                bin.2 += 1;
            }
        }
        for (i, (measured, want, count)) in bins.into_iter().enumerate() {
            assert!(
                count > 800 && (measured / want - 1.0).abs() < 0.1,
                "alpha {alpha}, bin {i}: {measured} {want}"
            );
        }
    }
}
