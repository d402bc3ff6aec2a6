//! Power laws: y = factor · x^exponent by least squares on logarithms.

use gdpt::study::fit::slope;

/// A fitted power law.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    /// Of x.
    pub exponent: f64,
    factor: f64,
    /// The smallest and the largest x it was fitted to.
    pub range: [f64; 2],
}

impl Fit {
    /// Its value at `x`.
    pub fn at(&self, x: f64) -> f64 {
        self.factor * x.powf(self.exponent)
    }
}

/// Fits the points, in ascending order of x, whose x is in the upper half of the range on a logarithmic scale; `None`
/// below two of them.
pub fn upper_half(points: &[(f64, f64)]) -> Option<Fit> {
    let [low, high] = [points.first()?.0, points.last()?.0];
    let middle = (low * high).sqrt();
    let upper: Vec<_> = points.iter().filter(|(x, _)| *x >= middle).copied().collect();
    // Two points of a short range, rather than one.
    let chosen = if upper.len() < 2 { points } else { &upper };
    let exponent = slope(chosen);
    let offset = |(x, y): &(f64, f64)| y.ln() - exponent * x.ln();
    let factor = (chosen.iter().map(offset).sum::<f64>() / chosen.len() as f64).exp();
    exponent.is_finite().then_some(Fit { exponent, factor, range: [chosen.first()?.0, high] })
}
