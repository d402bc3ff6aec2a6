//! Straight lines on logarithmic axes: slopes, and the error after a given time.

/// Slope of log y over log x, by least squares; NaN below two usable points.
pub fn slope(points: &[(f64, f64)]) -> f64 {
    let logs: Vec<(f64, f64)> = logarithms(points);
    let n = logs.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    let variance: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
    covariance / variance
}

fn logarithms(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let usable = points.iter().filter(|p| p.0 > 0.0 && p.1 > 0.0 && p.0.is_finite() && p.1.is_finite());
    let mut logs: Vec<_> = usable.map(|p| (p.0.ln(), p.1.ln())).collect();
    logs.sort_by(|a, b| a.0.total_cmp(&b.0));
    logs
}

/// The value at `x` of the lines between `points` on logarithmic axes; beyond the ends the last line goes on. NaN
/// below two usable points.
pub fn interpolate(points: &[(f64, f64)], x: f64) -> f64 {
    let logs = logarithms(points);
    if logs.len() < 2 {
        return f64::NAN;
    }
    let x = x.ln();
    let right = logs.partition_point(|p| p.0 < x).clamp(1, logs.len() - 1);
    let (a, b) = (logs[right - 1], logs[right]);
    (a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0)).exp()
}

/// Mean and its standard error; the latter NaN below two values.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// The geometric mean; NaN where a value is missing or not positive.
pub fn geometric_mean(values: &[f64]) -> f64 {
    (values.iter().map(|v| if *v > 0.0 { v.ln() } else { f64::NAN }).sum::<f64>() / values.len() as f64).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn power_laws_are_found_and_continued() {
        let points: Vec<(f64, f64)> =
            [1.0, 4.0, 16.0].iter().map(|x: &f64| (*x, 3.0 * x.powf(-1.5))).collect();
        assert!((slope(&points) + 1.5).abs() < 1e-12);
        for x in [0.5, 1.0, 2.0, 9.0, 16.0, 64.0] {
            assert!((interpolate(&points, x) / (3.0 * x.powf(-1.5)) - 1.0).abs() < 1e-12, "{x}");
        }
    }

    #[test]
    fn a_bend_is_followed_and_what_cannot_be_logged_is_left_out() {
        let points = [(4.0, 1.0), (1.0, 4.0), (16.0, 1.0), (8.0, -3.0), (9.0, f64::NAN)];
        assert!((interpolate(&points, 2.0) - 2.0).abs() < 1e-12);
        assert!((interpolate(&points, 8.0) - 1.0).abs() < 1e-12);
        assert!(interpolate(&points[..1], 2.0).is_nan() && slope(&points[..1]).is_nan());
    }

    #[test]
    fn means() {
        let (mean, error) = mean_and_error(&[1.0, 3.0]);
        assert!((mean, error) == (2.0, 1.0) && mean_and_error(&[5.0]).1.is_nan());
        assert!((geometric_mean(&[2.0, 8.0]) - 4.0).abs() < 1e-12 && geometric_mean(&[2.0, -1.0]).is_nan());
    }
}
