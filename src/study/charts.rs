//! The charts of both commands, and the tables they are drawn from.

use super::table::{Table, number};
use crate::analyze::noise::{Gain, Noise};
use crate::analyze::plot::{Chart, Scale, Series};
use crate::analyze::spectrum::Spectrum;

/// Power spectra of the noise against the model.
pub fn spectra(noise: &Noise) -> Chart {
    let [width, height] = noise.size;
    let white = |power: f64| Spectrum::predicted(width, height, move |_| power).points();
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
    let points = |gain: fn(&Gain) -> f64| noise.sweep.iter().map(|g| (f64::from(g.alpha), gain(g))).collect();
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

/// Spectra and their theory, bin by bin.
pub fn spectra_table(noise: &Noise) -> Table {
    let mut table = Table::new(&["cycles_per_pixel", "primal", "differences", "result", "equation_7"]);
    let columns = [&noise.primal_spectrum, &noise.gradient_spectrum, &noise.result_spectrum];
    let columns = columns.map(|s| s.points());
    for (frequency, predicted) in noise.predicted_spectrum().points() {
        let at = |points: &[(f64, f64)]| points.iter().find(|p| p.0 == frequency).map_or(f64::NAN, |p| p.1);
        let mut row = vec![number(frequency)];
        row.extend(columns.iter().map(|c| number(at(c))));
        row.push(number(predicted));
        table.rows.push(row);
    }
    table
}

/// Gains over α.
pub fn sweep_table(noise: &Noise) -> Table {
    let mut table = Table::new(&["alpha", "predicted_gain", "measured_gain"]);
    for gain in &noise.sweep {
        table.rows.push([f64::from(gain.alpha), gain.predicted, gain.measured].map(number).to_vec());
    }
    table
}
