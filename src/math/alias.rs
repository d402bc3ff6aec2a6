//! Discrete distributions in constant time: Walker's alias method (Vose 1991).

/// (threshold in 0..=1, outcome above it) of one outcome.
pub type Bin = (f32, u32);

/// An alias table over n outcomes: one look-up a sample, exact probabilities for queries.
#[derive(Clone, Debug, Default)]
pub struct AliasTable {
    bins: Vec<Bin>,
    /// Probability of each outcome; sums to 1.
    pdf: Vec<f32>,
}

impl AliasTable {
    /// Builds the table; `None` where no weight is positive and finite. Other weights count as zero.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<Self> {
        let weights: Vec<f64> =
            weights.into_iter().map(|w| if w.is_finite() && w > 0.0 { w } else { 0.0 }).collect();
        let sum: f64 = weights.iter().sum();
        if sum <= 0.0 || !sum.is_finite() {
            return None;
        }
        let n = weights.len();
        let mut scaled: Vec<f64> = weights.iter().map(|w| w / sum * n as f64).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| scaled[i] < 1.0);
        let mut bins = vec![(1.0_f32, 0_u32); n];
        for (i, bin) in bins.iter_mut().enumerate() {
            bin.1 = i as u32;
        }
        while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
            bins[s] = (scaled[s] as f32, l as u32);
            scaled[l] -= 1.0 - scaled[s];
            if scaled[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // Leftovers of `small` differ from 1 by rounding alone, unless their weight is zero.
        if let Some(heaviest) = (0..n).max_by(|&a, &b| weights[a].total_cmp(&weights[b])) {
            for s in small.into_iter().filter(|&s| weights[s] == 0.0) {
                bins[s] = (0.0, heaviest as u32);
            }
        }
        let pdf = weights.iter().map(|w| (w / sum) as f32).collect();
        Some(Self { bins, pdf })
    }

    /// Number of outcomes.
    pub fn len(&self) -> usize {
        self.bins.len()
    }

    /// Whether there is no outcome.
    pub fn is_empty(&self) -> bool {
        self.bins.is_empty()
    }

    /// Probability of `outcome`.
    #[inline(always)]
    pub fn pdf(&self, outcome: usize) -> f32 {
        self.pdf[outcome]
    }

    /// The bins, for those who keep many small tables in one array and draw with [`draw`].
    pub fn bins(&self) -> &[Bin] {
        &self.bins
    }

    /// The outcome for `u` in [0, 1), and a fresh uniform number made from the rest of `u`.
    #[inline(always)]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        draw(&self.bins, u)
    }
}

/// [`AliasTable::sample`] for the bins of a table; there must be one.
#[inline(always)]
pub fn draw(bins: &[Bin], u: f32) -> (usize, f32) {
    let scaled = u * bins.len() as f32;
    let bin = (scaled as usize).min(bins.len() - 1);
    let rest = scaled - bin as f32;
    let (threshold, alias) = bins[bin];
    if rest < threshold {
        (bin, (rest / threshold).min(BELOW_ONE))
    } else {
        (alias as usize, ((rest - threshold) / (1.0 - threshold)).clamp(0.0, BELOW_ONE))
    }
}

/// The largest f32 below 1.
pub const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frequencies_match_the_pdf_and_zero_weights_are_never_drawn() {
        let weights = [0.0, 1.0, 5.0, 0.25, 0.0, 3.0, f64::NAN, -1.0];
        let table = AliasTable::new(weights).expect("positive weights");
        let n = 1 << 20;
        let mut counts = [0u32; 8];
        for i in 0..n {
            counts[table.sample((i as f32 + 0.5) / n as f32).0] += 1;
        }
        for (i, &count) in counts.iter().enumerate() {
            let expected = table.pdf(i) * n as f32;
            assert!((count as f32 - expected).abs() <= 16.0, "outcome {i}: {count} for {expected}");
        }
        assert!((0..8).map(|i| f64::from(table.pdf(i))).sum::<f64>() - 1.0 < 1e-6);
    }

    #[test]
    fn no_positive_weight_is_no_table() {
        assert!(AliasTable::new([0.0, -2.0, f64::NAN]).is_none());
        assert!(AliasTable::new([]).is_none());
    }
}
