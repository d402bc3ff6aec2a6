//! Line charts as SVG, by `plotters`: linear or logarithmic axes, the legend below the plot so that nothing covers a
//! curve. Text stays text, colours stay attributes, so that a page can restyle both.

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use std::error::Error as StdError;
use std::ops::Range;

/// Width of a chart, in the units of its view box: narrow enough to be read on a phone.
const WIDTH: u32 = 480;
/// Height of a chart without its legend.
const HEIGHT: u32 = 330;
/// Height of a line of the legend, which has two columns.
const LINE: u32 = 22;
/// Size of all text, in plotters' measure: 1.24 times that of the letters' em.
const TEXT: u32 = 18;

/// Colours that differ for colour-blind eyes too, on white and on black (after Okabe and Ito).
const COLORS: [RGBColor; 8] = [
    RGBColor(120, 120, 120),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(200, 150, 0),
    RGBColor(86, 180, 233),
    RGBColor(150, 60, 60),
];

/// How an axis is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps.
    Linear,
    /// Equal factors; values that are not positive are left out.
    Log,
}

/// One curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// (x, y); what is not finite, or cannot be on its axis, is left out.
    pub points: Vec<(f64, f64)>,
    /// Index of its colour; series of one index belong together.
    pub color: usize,
    /// Dashes for theory, a line with dots for what was measured.
    pub dashed: bool,
}

/// A chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What the horizontal axis is, with its unit.
    pub x: &'static str,
    /// What the vertical axis is, with its unit.
    pub y: &'static str,
    /// Of the horizontal axis.
    pub x_scale: Scale,
    /// Of the vertical axis.
    pub y_scale: Scale,
    /// The curves.
    pub series: Vec<Series>,
}

/// The text of a tick.
fn tick(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        "0".into()
    } else if (1e-2..1e5).contains(&size) {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').into()
    } else {
        format!("{value:.1e}").replace(".0e", "e")
    }
}

/// Ticks of a logarithmic axis are at powers of ten or, where few of them are in the range, of two.
fn base(range: &Range<f64>) -> f64 {
    if range.end / range.start < 300.0 { 2.0 } else { 10.0 }
}

impl Scale {
    fn shows(self, value: f64) -> bool {
        value.is_finite() && (self == Self::Linear || value > 0.0)
    }

    /// The range of an axis: all values, with a margin.
    fn range(self, values: impl Iterator<Item = f64>) -> Range<f64> {
        let extremes = |(low, high): (f64, f64), v: f64| (low.min(v), high.max(v));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), extremes);
        match self {
            _ if low > high => 1.0..10.0,
            Self::Log => {
                let margin = (high / low).powf(0.05).max(1.2);
                low / margin..high * margin
            }
            Self::Linear if low == high => low - 1.0..high + 1.0,
            Self::Linear => low..high + 0.02 * (high - low),
        }
    }
}

impl Chart {
    /// The SVG element.
    pub fn svg(&self) -> String {
        let shown: Vec<Series> = self.series.iter().map(|s| self.visible(s)).collect();
        let all = || shown.iter().flat_map(|s| &s.points);
        let x = self.x_scale.range(all().map(|p| p.0));
        let y = self.y_scale.range(all().map(|p| p.1));
        let (x_base, y_base) = (base(&x), base(&y));
        let drawn = match (self.x_scale, self.y_scale) {
            (Scale::Linear, Scale::Linear) => self.draw(&shown, x, y),
            (Scale::Linear, Scale::Log) => self.draw(&shown, x, y.log_scale().base(y_base)),
            (Scale::Log, Scale::Linear) => self.draw(&shown, x.log_scale().base(x_base), y),
            (Scale::Log, Scale::Log) => {
                self.draw(&shown, x.log_scale().base(x_base), y.log_scale().base(y_base))
            }
        };
        drawn.expect("drawing into a string needs no system")
    }

    /// A series without the points that cannot be on the axes.
    fn visible(&self, series: &Series) -> Series {
        let shows = |p: &&(f64, f64)| self.x_scale.shows(p.0) && self.y_scale.shows(p.1);
        Series { points: series.points.iter().filter(shows).copied().collect(), ..series.clone() }
    }

    fn draw<X, Y>(&self, series: &[Series], x: X, y: Y) -> Result<String, Box<dyn StdError>>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut svg = String::new();
        let legend = LINE * series.len().div_ceil(2) as u32 + LINE / 2;
        {
            let root = SVGBackend::with_string(&mut svg, (WIDTH, HEIGHT + legend)).into_drawing_area();
            root.fill(&WHITE)?;
            let (plot, below) = root.split_vertically(HEIGHT);
            let mut context = ChartBuilder::on(&plot)
                .margin(6)
                .margin_right(14)
                .x_label_area_size(46)
                .y_label_area_size(84)
                .build_cartesian_2d(x, y)?;
            context
                .configure_mesh()
                .light_line_style(TRANSPARENT)
                .bold_line_style(BLACK.mix(0.15))
                .label_style(("sans-serif", TEXT))
                .x_labels(6)
                .y_labels(6)
                .x_label_formatter(&|v| tick(*v))
                .y_label_formatter(&|v| tick(*v))
                .x_desc(self.x)
                .y_desc(self.y)
                .draw()?;
            for s in series {
                let style = COLORS[s.color % COLORS.len()].stroke_width(2);
                if s.dashed {
                    context.draw_series(DashedLineSeries::new(s.points.iter().copied(), 6, 4, style))?;
                } else {
                    context.draw_series(LineSeries::new(s.points.iter().copied(), style))?;
                    let dot = |p: &(f64, f64)| Circle::new(*p, 3, style.filled());
                    context.draw_series(s.points.iter().map(dot))?;
                }
            }
            draw_legend(&below, series)?;
            root.present()?;
        }
        Ok(svg)
    }
}

/// Two columns of samples of the lines with their names.
fn draw_legend(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    series: &[Series],
) -> Result<(), Box<dyn StdError>> {
    for (i, s) in series.iter().enumerate() {
        let (left, top) = ((16 + i as u32 % 2 * WIDTH / 2) as i32, (i as u32 / 2 * LINE) as i32);
        let middle = top + LINE as i32 / 2;
        let style = COLORS[s.color % COLORS.len()].stroke_width(2);
        let parts = if s.dashed { vec![(0, 8), (14, 22)] } else { vec![(0, 22)] };
        for (from, to) in parts {
            area.draw(&PathElement::new(vec![(left + from, middle), (left + to, middle)], style))?;
        }
        if !s.dashed {
            area.draw(&Circle::new((left + 11, middle), 3, style.filled()))?;
        }
        let text = ("sans-serif", TEXT).into_text_style(area);
        area.draw(&Text::new(s.name.clone(), (left + 30, middle - TEXT as i32 / 3), text))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(x_scale: Scale, y_scale: Scale, points: Vec<(f64, f64)>) -> String {
        let series = vec![
            Series { name: "a < b".into(), points: points.clone(), color: 0, dashed: false },
            Series { name: "theory".into(), points, color: 0, dashed: true },
        ];
        Chart { x: "samples", y: "error", x_scale, y_scale, series }.svg()
    }

    #[test]
    fn every_kind_of_axes_draws_its_points_and_its_legend() {
        for x in [Scale::Linear, Scale::Log] {
            for y in [Scale::Linear, Scale::Log] {
                let svg = chart(x, y, vec![(1.0, 0.1), (4.0, 0.02), (16.0, 0.006)]);
                // Three dots and one in the legend; names are escaped.
                assert_eq!(svg.matches("<circle").count(), 4, "{x:?} {y:?}");
                assert!(svg.contains("a &lt; b") && svg.contains("theory") && svg.contains("samples"));
            }
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_left_out() {
        let svg = chart(Scale::Log, Scale::Log, vec![(1.0, f64::NAN), (0.0, 1.0), (2.0, -1.0), (3.0, 4.0)]);
        assert_eq!(svg.matches("<circle").count(), 2);
        assert!(chart(Scale::Linear, Scale::Log, Vec::new()).contains("</svg>"));
        assert_eq!(chart(Scale::Linear, Scale::Linear, vec![(2.0, 2.0)]).matches("<circle").count(), 2);
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!([1e-4, 0.05, 1.0, 256.0, 0.0].map(tick), ["1e-4", "0.05", "1", "256", "0"]);
    }
}
