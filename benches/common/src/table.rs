//! The one table of `make bench`: what was measured, what it is compared with, and whether the target is met.

use crate::measure::{Cost, Rounds};
use comfy_table::{Table, presets};

/// What a row should reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// This or more.
    AtLeast(f64),
    /// This or less.
    AtMost(f64),
    /// Nothing is asked.
    None,
}

impl Target {
    /// Whether `value` reaches it; `None` where nothing is asked.
    pub fn is_met(self, value: f64) -> Option<bool> {
        match self {
            Self::AtLeast(target) => Some(value >= target),
            Self::AtMost(target) => Some(value <= target),
            Self::None => None,
        }
    }

    fn text(self, unit: &str) -> String {
        match self {
            Self::AtLeast(target) => format!("≥ {target}{unit}"),
            Self::AtMost(target) => format!("≤ {target}{unit}"),
            Self::None => String::new(),
        }
    }
}

/// A row of the table.
#[derive(Clone, Debug)]
pub struct Row {
    name: String,
    ours: String,
    other: String,
    ratio: String,
    target: String,
    is_met: Option<bool>,
}

/// What a side made a second: how much work it did, in which unit.
#[derive(Clone, Copy, Debug)]
pub struct Rate<'a> {
    /// Which side.
    pub side: usize,
    /// What it is called.
    pub label: &'a str,
    /// Work done a round, in millions.
    pub millions: f64,
}

impl Rate<'_> {
    fn text(&self, cost: Cost) -> String {
        let Self { label, millions, .. } = self;
        format!("{label}: {:.2} M/s ({})", millions / cost.cpu, seconds(cost))
    }
}

/// CPU and wall seconds.
pub fn seconds(cost: Cost) -> String {
    format!("{:.3} s CPU, {:.3} s wall", cost.cpu, cost.wall)
}

impl Row {
    /// A ratio with its two sides.
    pub fn ratio(name: impl Into<String>, ours: String, other: String, ratio: f64, target: Target) -> Self {
        Self {
            name: name.into(),
            ours,
            other,
            ratio: format!("{ratio:.2}"),
            target: target.text(""),
            is_met: target.is_met(ratio),
        }
    }

    /// Work a CPU second of two sides: the ratio is above 1 where `ours` is faster.
    pub fn rates(name: impl Into<String>, rounds: &Rounds, ours: Rate, other: Rate, target: Target) -> Self {
        let ratio = rounds.ratio(other.side, ours.side, Cost::cpu) * ours.millions / other.millions;
        let text = |rate: Rate| rate.text(rounds.cost(rate.side));
        Self::ratio(name, text(ours), text(other), ratio, target)
    }

    /// A value that is no ratio.
    pub fn value(name: impl Into<String>, value: f64, unit: &str, detail: &str, target: Target) -> Self {
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        Self {
            name: name.into(),
            ours: format!("{value:.3}{unit}"),
            other: detail.to_owned(),
            ratio: String::new(),
            target: target.text(&unit),
            is_met: target.is_met(value),
        }
    }

    /// A row that could not be measured, and why.
    pub fn skipped(name: impl Into<String>, why: &str) -> Self {
        let name = name.into();
        println!("skipped: {name}: {why}");
        Self {
            name,
            ours: format!("skipped: {why}"),
            other: String::new(),
            ratio: String::new(),
            target: String::new(),
            is_met: None,
        }
    }
}

/// Cells under a header, as a table that Markdown reads.
pub fn grid<const N: usize>(header: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN).set_header(header).add_rows(rows);
    format!("{table}\n")
}

/// The rows as a table.
pub fn markdown(rows: &[Row]) -> String {
    let cells = |row: &Row| {
        let verdict = row.is_met.map_or("", |is_met| if is_met { "met" } else { "missed" });
        let Row { name, ours, other, ratio, target, .. } = row.clone();
        [name, ours, other, ratio, target, verdict.to_owned()]
    };
    grid(["row", "ours", "other side", "ratio", "target", "met or missed"], rows.iter().map(cells))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_met_or_missed() {
        assert_eq!(Target::AtLeast(2.0).is_met(1.9), Some(false));
        assert_eq!(Target::AtLeast(2.0).is_met(2.0), Some(true));
        assert_eq!(Target::AtMost(0.15).is_met(0.2), Some(false));
        assert_eq!(Target::AtMost(0.15).is_met(f64::NAN), Some(false));
        assert_eq!(Target::None.is_met(1.0), None);
    }

    #[test]
    fn rates_are_of_one_run_and_the_table_says_so() {
        let seconds = [0.5, 2.0];
        let side = |s: f64| -> crate::measure::Side<'static> { Box::new(move || Cost { cpu: s, wall: s }) };
        let rounds = Rounds::alternate(5, seconds.map(side).into());
        let rate = |side, label| Rate { side, label, millions: 3.0 };
        let row = Row::rates("ours over theirs", &rounds, rate(0, "a"), rate(1, "b"), Target::AtLeast(5.0));
        let text = markdown(&[row]);
        let line = text.lines().last().expect("three lines");
        for part in ["ours over theirs", "a: 6.00 M/s", "b: 1.50 M/s", "4.00", "≥ 5", "missed"] {
            assert!(line.contains(part), "{part} in {line}");
        }
    }
}
