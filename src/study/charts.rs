//! The charts of both commands.

use crate::analyze::noise::Noise;
use crate::analyze::plot::{Chart, Scale, Series};

/// Power spectra of the noise against the model.
pub fn spectra(noise: &Noise) -> Chart {
    let [width, height] = noise.size;
    let white =
        |power: f64| crate::analyze::spectrum::Spectrum::predicted(width, height, move |_| power).points();
    let series = |name: &str, points, color, dashed| Series { name: name.into(), points, color, dashed };
    Chart {
        x: "frequency, cycles a pixel",
        y: "noise power",
        x_scale: Scale::Linear,
        y_scale: Scale::Log,
        series: vec![
            series("primal", noise.primal_spectrum.points(), 0, false),
            series("white, the same power", white(noise.primal), 0, true),
            series("differences", noise.gradient_spectrum.points(), 1, false),
            series("white, the same power", white(noise.gradient()), 1, true),
            series(&format!("L2, alpha {}", noise.alpha), noise.result_spectrum.points(), 2, false),
            series("equation 7", noise.predicted_spectrum().points(), 2, true),
        ],
    }
}

/// Variance gain of the least-squares solve over α.
pub fn sweep(noise: &Noise) -> Chart {
    let points = |gain: fn(&crate::analyze::noise::Gain) -> f64| {
        noise.sweep.iter().map(|g| (f64::from(g.alpha), gain(g))).collect()
    };
    let series = |name: &str, points, dashed| Series { name: name.into(), points, color: 1, dashed };
    Chart {
        x: "alpha",
        y: "variance gain of L2",
        x_scale: Scale::Log,
        y_scale: Scale::Log,
        series: vec![
            series("measured", points(|g| g.measured), false),
            series("predicted", points(|g| g.predicted), true),
        ],
    }
}
