//! Pearson's chi² test of a histogram against expected counts.

/// Significance of a whole family of tests.
const ALPHA: f64 = 0.01;

/// Least expected count of a cell; rarer cells are pooled.
const LEAST: f64 = 5.0;

/// Probability of a value beyond `z` under the normal distribution, by Simpson's rule.
fn normal_tail(z: f64) -> f64 {
    if z < 0.0 {
        return 1.0 - normal_tail(-z);
    }
    const STEPS: usize = 2000;
    let h = 12.0 / STEPS as f64;
    let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let sum: f64 = (0..=STEPS)
        .map(|i| {
            let weight = if i == 0 || i == STEPS { 1.0 } else { [2.0, 4.0][i % 2] };
            weight * density(z + i as f64 * h)
        })
        .sum();
    sum * h / 3.0
}

/// p-value of a chi² value (Wilson and Hilferty's cube root).
fn p_value(chi2: f64, degrees: usize) -> f64 {
    let k = degrees as f64;
    let spread = 2.0 / (9.0 * k);
    normal_tail(((chi2 / k).cbrt() - (1.0 - spread)) / spread.sqrt())
}

/// Fails where `observed` does not follow `expected`; `family` is the number of tests that share the significance.
pub fn assert_follows(what: &str, observed: &[f64], expected: &[f64], family: usize) {
    assert_eq!(observed.len(), expected.len());
    let mut order: Vec<usize> = (0..expected.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut chi2, mut cells, mut pool) = (0.0, 0_usize, (0.0, 0.0));
    for i in order {
        assert!(expected[i] >= 0.0, "{what}: expected count {}", expected[i]);
        pool = (pool.0 + observed[i], pool.1 + expected[i]);
        if pool.1 >= LEAST {
            chi2 += (pool.0 - pool.1).powi(2) / pool.1;
            cells += 1;
            pool = (0.0, 0.0);
        }
    }
    assert!(pool.1 > 0.0 || pool.0 == 0.0, "{what}: {} samples where none may fall", pool.0);
    assert!(cells > 1, "{what}: no cells");
    let p = p_value(chi2, cells - 1);
    let least = 1.0 - (1.0 - ALPHA).powf(1.0 / family as f64);
    assert!(p >= least, "{what}: chi² {chi2:.1} of {cells} cells, p {p:.3e} below {least:.3e}");
}

#[test]
fn the_test_itself_can_fail() {
    let expected = vec![100.0; 1000];
    let mut observed = expected.clone();
    assert_follows("equal", &observed, &expected, 1);
    for (i, o) in observed.iter_mut().enumerate() {
        *o += if i % 2 == 0 { 15.0 } else { -15.0 };
    }
    assert!(std::panic::catch_unwind(|| assert_follows("unequal", &observed, &expected, 1)).is_err());
    assert!((p_value(18.307, 10) - 0.05).abs() < 1e-3);
    assert!((p_value(1106.97, 1000) - 0.01).abs() < 1e-4);
}
