//! The noise of primal, differences and least-squares solution, measured over independent runs of one image, and
//! what the frequency model says of it.
//!
//! No reference is needed: with K runs, the noise of one is its difference from the mean of all, times √(K/(K − 1)).
//! Where a film has but its two halves, which are independent, the whole film has half their noise power.

use super::model;
use super::spectrum::{Kind, Spectrum};
use crate::film::{Measured, Plane};
use crate::reconstruct::{Alpha, Input, Method, reconstruct};

/// Values of α a sweep solves for: about two an octave from 1/64 to 4.
pub const SWEEP: [f32; 17] = [
    0.0156, 0.022, 0.031, 0.044, 0.0625, 0.088, 0.125, 0.177, 0.25, 0.354, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0,
];

/// Variance gain of the solve at one α.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Gain {
    /// Weight of the primal.
    pub alpha: f32,
    /// By [`model::gain`] from the measured noise of primal and differences.
    pub predicted: f64,
    /// Noise of the primal over noise of the solution.
    pub measured: f64,
}

/// Noise power and its spectra, all of one run, mean over channels, (W·m⁻²·sr⁻¹)².
#[derive(Clone, Debug)]
pub struct Noise {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Of the primal.
    pub primal: f64,
    /// Of a horizontal difference.
    pub dx: f64,
    /// Of a vertical difference.
    pub dy: f64,
    /// Spectrum of the primal's noise.
    pub primal_spectrum: Spectrum,
    /// Spectrum of the differences' noise, both directions.
    pub gradient_spectrum: Spectrum,
    /// α at which the solution's spectrum is taken.
    pub alpha: f32,
    /// Spectrum of the least-squares solution's noise.
    pub result_spectrum: Spectrum,
    /// Gains over [`SWEEP`].
    pub sweep: Vec<Gain>,
}

impl Noise {
    /// Measures `runs` of one size, two at least (`None` otherwise). `share` is the noise power of what is asked
    /// about over that of one run: 1, or ½ where the runs are the halves of a film.
    pub fn measure(runs: &[Measured], share: f64, alpha: f32) -> Option<Self> {
        let first = runs.first()?;
        let size = |p: &Plane| (p.width, p.height);
        let one_size =
            |r: &Measured| [&r.primal, &r.dx, &r.dy].iter().all(|p| size(p) == size(&first.primal));
        if runs.len() < 2 || !runs.iter().all(one_size) {
            return None;
        }
        let [primal, dx, dy] = [
            deviations(runs.iter().map(|r| &r.primal)),
            deviations(runs.iter().map(|r| &r.dx)),
            deviations(runs.iter().map(|r| &r.dy)),
        ];
        let (width, height) = size(&first.primal);
        let spectrum = |planes: &[Plane], kind| {
            let mut sum = Spectrum::default();
            planes.iter().for_each(|p| sum.merge(&Spectrum::of(p, kind)));
            sum.scale(share);
            sum
        };
        let mut gradient_spectrum = spectrum(&dx, Kind::Dx);
        gradient_spectrum.merge(&spectrum(&dy, Kind::Dy));
        let mut noise = Self {
            size: [width, height],
            primal: share * power(&primal, width, height),
            dx: share * power(&dx, width.saturating_sub(1), height),
            dy: share * power(&dy, width, height.saturating_sub(1)),
            primal_spectrum: spectrum(&primal, Kind::Image),
            gradient_spectrum,
            alpha,
            result_spectrum: spectrum(&solved(runs, alpha), Kind::Image),
            sweep: Vec::new(),
        };
        let gain = |alpha| Gain {
            alpha,
            predicted: noise.predicted_gain(alpha),
            measured: noise.primal / (share * power(&solved(runs, alpha), width, height)),
        };
        noise.sweep = SWEEP.map(gain).to_vec();
        Some(noise)
    }

    /// Mean noise power of the differences of both directions.
    pub fn gradient(&self) -> f64 {
        0.5 * (self.dx + self.dy)
    }

    /// The α that the model calls best.
    pub fn alpha_star(&self) -> f64 {
        model::alpha_star(self.primal, self.gradient())
    }

    /// The model's variance gain at `alpha`.
    pub fn predicted_gain(&self, alpha: f32) -> f64 {
        let [width, height] = self.size;
        model::gain(width, height, f64::from(alpha), self.primal, self.gradient())
    }

    /// The gain measured best, of the sweep.
    pub fn best(&self) -> Option<Gain> {
        self.sweep.iter().copied().max_by(|a, b| a.measured.total_cmp(&b.measured))
    }

    /// Equation 7 for the solution's spectrum.
    pub fn predicted_spectrum(&self) -> Spectrum {
        let [width, height] = self.size;
        let left = |lambda| model::remaining(lambda, f64::from(self.alpha), self.primal, self.gradient());
        Spectrum::predicted(width, height, left)
    }
}

/// Least-squares solutions of the runs, as noise.
fn solved(runs: &[Measured], alpha: f32) -> Vec<Plane> {
    let solve = |r: &Measured| reconstruct(&Input::new(r), Method::L2, Alpha::Fixed(alpha)).image;
    let solutions: Vec<Plane> = runs.iter().map(solve).collect();
    deviations(solutions.iter())
}

/// The noise of each of several runs of one plane; zero where a run is not finite.
fn deviations<'a>(runs: impl Iterator<Item = &'a Plane> + Clone) -> Vec<Plane> {
    let count = runs.clone().count() as f64;
    let Some(first) = runs.clone().next() else { return Vec::new() };
    let mut mean = vec![[0.0f64; 3]; first.data.len()];
    for plane in runs.clone() {
        for (sum, value) in mean.iter_mut().zip(&plane.data) {
            (0..3).for_each(|c| sum[c] += f64::from(value[c]) / count);
        }
    }
    let scale = (count / (count - 1.0)).sqrt();
    let deviation = |(value, mean): (&[f32; 3], &[f64; 3])| {
        let noise: [f32; 3] = std::array::from_fn(|c| ((f64::from(value[c]) - mean[c]) * scale) as f32);
        if noise.iter().all(|v| v.is_finite()) { noise } else { [0.0; 3] }
    };
    runs.map(|p| Plane {
        width: p.width,
        height: p.height,
        data: p.data.iter().zip(&mean).map(deviation).collect(),
    })
    .collect()
}

/// Mean square over the left upper `width`×`height` pixels, the channels and the planes.
fn power(planes: &[Plane], width: usize, height: usize) -> f64 {
    let square =
        |p: &Plane, i: usize| p.at(i % width, i / width).iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
    let sum = |p: &Plane| (0..width * height).map(|i| square(p, i)).sum::<f64>();
    planes.iter().map(sum).sum::<f64>() / (3 * planes.len() * width * height) as f64
}

#[cfg(test)]
pub(super) mod tests;
