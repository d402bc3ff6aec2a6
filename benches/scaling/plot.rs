//! One SVG a family: a panel a unit, logarithmic on both axes, points and fitted lines with their exponents.

use super::fit::upper_half;
use super::points::{Curve, Family};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

type Points = Vec<(f64, f64)>;

/// Writes the plot of a family.
pub fn write(path: &Path, family: &Family, curves: &[(&Curve, Points)]) -> Result<(), Box<dyn Error>> {
    let mut units: Vec<&str> = curves.iter().map(|(curve, _)| curve.unit).collect();
    units.dedup();
    let area = SVGBackend::new(path, (520 * units.len() as u32, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, unit) in area.split_evenly((1, units.len())).iter().zip(units) {
        let of_unit: Vec<_> =
            curves.iter().filter(|(curve, points)| curve.unit == unit && !points.is_empty()).collect();
        if !of_unit.is_empty() {
            draw(panel, family, unit, &of_unit)?;
        }
    }
    area.present()?;
    Ok(())
}

/// The powers of ten around positive values: an axis without one of them inside would have no labels.
fn decades(values: impl Iterator<Item = f64> + Clone) -> std::ops::Range<f64> {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(0.0, f64::max);
    10f64.powf(low.log10().floor())..10f64.powf((high * 1.01).log10().ceil())
}

fn tick(value: &f64) -> String {
    if (1e-3..1e5).contains(value) {
        format!("{}", (value * 1e4).round() / 1e4)
    } else {
        format!("{value:.0e}")
    }
}

fn draw<B: DrawingBackend>(
    panel: &DrawingArea<B, plotters::coord::Shift>,
    family: &Family,
    unit: &str,
    curves: &[&(&Curve, Points)],
) -> Result<(), Box<dyn Error>>
where
    B::ErrorType: 'static,
{
    let all = curves.iter().flat_map(|(_, points)| points);
    let (x, y) = (decades(all.clone().map(|p| p.0)), decades(all.map(|p| p.1)));
    let mut chart = ChartBuilder::on(panel)
        .margin(12)
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(x.log_scale(), y.log_scale())?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(family.axis).y_desc(unit).x_label_formatter(&tick).y_label_formatter(&tick);
    mesh.light_line_style(WHITE.mix(0.0)).draw()?;
    for (i, (curve, points)) in curves.iter().enumerate() {
        let colour = Palette99::pick(i);
        let dots = points.iter().map(|&p| Circle::new(p, 4, colour.filled()));
        let Some(fit) = upper_half(points) else {
            chart.draw_series(dots)?;
            continue;
        };
        chart.draw_series(dots)?;
        let line = LineSeries::new(fit.range.map(|x| (x, fit.at(x))), colour.stroke_width(2));
        chart
            .draw_series(line)?
            .label(format!("{}: x^{:.2}", curve.name, fit.exponent))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    let mut labels = chart.configure_series_labels();
    labels.position(SeriesLabelPosition::UpperLeft);
    labels.background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?;
    Ok(())
}
