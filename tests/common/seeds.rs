//! Statistics over independent seeds: means with standard errors, z-scores, a regression slope by jackknife.

/// Independent repetitions of a vector of measurements: `runs[s][e]` is entry e of seed s.
#[derive(Clone, Debug, Default)]
pub struct Runs(pub Vec<Vec<f64>>);

/// A mean and the variance of that mean.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    /// Mean over the seeds.
    pub mean: f64,
    /// Variance of the mean.
    pub variance: f64,
}

/// Mean of values and variance of the mean.
pub fn estimate(values: impl Iterator<Item = f64> + Clone) -> Estimate {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0));
    Estimate { mean, variance }
}

/// z-score of the difference of two estimates; where both are without noise, 0 if equal within `exact`.
pub fn z_score(a: Estimate, b: Estimate, exact: f64) -> f64 {
    let difference = a.mean - b.mean;
    let sigma = (a.variance + b.variance).sqrt();
    if difference.abs() <= exact { 0.0 } else { difference / sigma }
}

impl Runs {
    /// Adds the RGB entries of one seed.
    pub fn push(&mut self, entries: &[[f32; 3]]) {
        self.0.push(entries.iter().flatten().map(|&v| f64::from(v)).collect());
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.0.first().map_or(0, Vec::len)
    }

    /// The estimate of entry `e`.
    pub fn entry(&self, e: usize) -> Estimate {
        estimate(self.0.iter().map(|run| run[e]))
    }

    /// The estimate of Σ weight · entry: noise that entries share is accounted for.
    pub fn functional(&self, weights: &[(usize, f64)]) -> Estimate {
        let values: Vec<f64> =
            self.0.iter().map(|run| weights.iter().map(|&(e, w)| run[e] * w).sum()).collect();
        estimate(values.into_iter())
    }

    /// Mean of the entries over all seeds but `left_out`, and over those of one parity only.
    fn means(&self, left_out: Option<usize>, keep: impl Fn(usize) -> bool) -> Vec<f64> {
        let mut sum = vec![0.0; self.len()];
        let mut count = 0.0;
        for (_, run) in self.0.iter().enumerate().filter(|&(s, _)| Some(s) != left_out && keep(s)) {
            count += 1.0;
            sum.iter_mut().zip(run).for_each(|(sum, v)| *sum += v);
        }
        sum.iter().map(|s| s / count).collect()
    }
}

/// Slope of the regression of `tested` on `truth` (1 where only noise differs), with its variance by jackknife. The
/// noise of `truth` does not pull it down: its two halves (even and odd seeds) stand in for its square.
pub fn slope(tested: &Runs, truth: &Runs) -> Estimate {
    let weights: Vec<f64> = (0..tested.len())
        .map(|e| {
            let variance = tested.entry(e).variance + truth.entry(e).variance;
            if variance > 0.0 { 1.0 / variance } else { 0.0 }
        })
        .collect();
    let at = |left_out: Option<usize>| {
        let g = tested.means(left_out, |_| true);
        let a = truth.means(left_out, |s| s % 2 == 0);
        let b = truth.means(left_out, |s| s % 2 == 1);
        let (mut up, mut down) = (0.0, 0.0);
        for e in 0..g.len() {
            up += weights[e] * g[e] * 0.5 * (a[e] + b[e]);
            down += weights[e] * a[e] * b[e];
        }
        up / down
    };
    let n = tested.0.len();
    let leave_one_out: Vec<f64> = (0..n).map(|s| at(Some(s))).collect();
    let mean = leave_one_out.iter().sum::<f64>() / n as f64;
    let spread: f64 = leave_one_out.iter().map(|v| (v - mean).powi(2)).sum();
    Estimate { mean: at(None), variance: spread * (n as f64 - 1.0) / n as f64 }
}
