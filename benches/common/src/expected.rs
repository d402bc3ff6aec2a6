//! What `make bench-ci` compares with: a stored value and a band for each row, and the comparison, which must be able
//! to fail.

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

const HEADER: &str = "\
# What `make bench-ci` compares with. `make bench-record` writes it: values are replaced, bands are kept.
# A row passes from value / (1 + band) to value * (1 + band).
# \"ratio\": CPU seconds of two sides that take turns in one run. \"count\": instructions of a kernel on x86-64-v3, by
# callgrind, and what the kernel itself counts; they depend on the compiler.
";

/// A row of the file.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stored {
    /// Measured when it was recorded.
    pub value: f64,
    /// How far a measurement may be from it, as a share of it: from value ÷ (1 + band) to value × (1 + band).
    pub band: f64,
}

impl Stored {
    /// The smallest and the largest value within the band.
    pub fn range(&self) -> [f64; 2] {
        [self.value / (1.0 + self.band), self.value * (1.0 + self.band)]
    }

    /// Whether a measurement is within the band; no number never is.
    pub fn contains(&self, measured: f64) -> bool {
        let [low, high] = self.range();
        (low..=high).contains(&measured)
    }
}

/// The file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// The compiler that made what was measured, as it names itself: another one makes other instructions.
    pub rustc: String,
    /// Rows by name.
    pub rows: BTreeMap<String, Stored>,
}

/// How a row fared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// Within the band.
    Within,
    /// Outside of it.
    Outside,
    /// Stored, but not measured.
    NotMeasured,
    /// Measured, but not stored.
    NotStored,
}

/// A row compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The row's name.
    pub name: String,
    /// What was measured.
    pub measured: Option<f64>,
    /// What is stored.
    pub stored: Option<Stored>,
    /// How it fared.
    pub outcome: Outcome,
}

/// Measured values by the name of their row.
pub type Measured = BTreeMap<String, f64>;

impl Expected {
    /// Compares every row that is stored or measured.
    pub fn compare(&self, measured: &Measured) -> Vec<Verdict> {
        let names: BTreeSet<&String> = self.rows.keys().chain(measured.keys()).collect();
        let verdict = |name: &String| {
            let (measured, stored) = (measured.get(name).copied(), self.rows.get(name).copied());
            let outcome = match (measured, stored) {
                (Some(measured), Some(stored)) if stored.contains(measured) => Outcome::Within,
                (Some(_), Some(_)) => Outcome::Outside,
                (None, _) => Outcome::NotMeasured,
                (Some(_), None) => Outcome::NotStored,
            };
            Verdict { name: name.clone(), measured, stored, outcome }
        };
        names.into_iter().map(verdict).collect()
    }

    /// Reads the file; `None` where there is none.
    pub fn read(path: &Path) -> io::Result<Option<Self>> {
        match std::fs::read_to_string(path) {
            Ok(text) => toml::from_str(&text).map(Some).map_err(io::Error::other),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Writes the file, with a line on what it is.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        let rows = toml::to_string(self).map_err(io::Error::other)?;
        std::fs::write(path, format!("{HEADER}\n{rows}"))
    }

    /// The rows of `measured`; a row that was stored before keeps its band, a new one gets `band(name)`.
    pub fn record(rustc: String, measured: &Measured, before: Option<&Self>, band: fn(&str) -> f64) -> Self {
        let row = |(name, &value): (&String, &f64)| {
            let known = before.and_then(|before| before.rows.get(name));
            (name.clone(), Stored { value, band: known.map_or_else(|| band(name), |stored| stored.band) })
        };
        Self { rustc, rows: measured.iter().map(row).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expected() -> Expected {
        let rows = [("cost", 2.0, 0.25), ("instructions", 1000.0, 0.05)];
        let row = |(name, value, band): (&str, f64, f64)| (name.to_owned(), Stored { value, band });
        Expected { rustc: "rustc 1".into(), rows: rows.map(row).into() }
    }

    fn outcome(cost: f64, instructions: f64) -> Vec<Outcome> {
        let measured = [("cost".to_owned(), cost), ("instructions".to_owned(), instructions)].into();
        expected().compare(&measured).iter().map(|verdict| verdict.outcome).collect()
    }

    #[test]
    fn values_inside_the_band_pass_and_outside_fail_on_both_sides() {
        use Outcome::{Outside, Within};
        assert_eq!(outcome(2.0, 1000.0), [Within, Within]);
        assert_eq!(outcome(2.49, 1049.0), [Within, Within]);
        assert_eq!(outcome(2.51, 1000.0), [Outside, Within]);
        assert_eq!(outcome(1.59, 953.0), [Outside, Within]);
        assert_eq!(outcome(2.0, 951.0), [Within, Outside]);
        assert_eq!(outcome(2.0, 2000.0), [Within, Outside]);
    }

    #[test]
    fn what_is_no_number_fails() {
        assert_eq!(outcome(f64::NAN, f64::INFINITY), [Outcome::Outside; 2]);
    }

    #[test]
    fn rows_missing_on_either_side_fail_by_name() {
        let measured = [("cost".to_owned(), 2.0), ("new".to_owned(), 1.0)].into();
        let verdicts = expected().compare(&measured);
        let of =
            |name| verdicts.iter().find(|verdict| verdict.name == name).expect("every row has a verdict");
        assert_eq!(of("instructions").outcome, Outcome::NotMeasured);
        assert_eq!(of("new").outcome, Outcome::NotStored);
        assert_eq!(of("cost").outcome, Outcome::Within);
    }

    #[test]
    fn recording_keeps_bands_and_the_file_reads_back() {
        let measured: Measured = [("cost".to_owned(), 3.0), ("new".to_owned(), 1.0)].into();
        let recorded = Expected::record("rustc 2".into(), &measured, Some(&expected()), |_| 0.1);
        assert_eq!(recorded.rows["cost"], Stored { value: 3.0, band: 0.25 });
        assert_eq!(recorded.rows["new"], Stored { value: 1.0, band: 0.1 });
        assert!(recorded.compare(&measured).iter().all(|verdict| verdict.outcome == Outcome::Within));

        let folder = tempfile::tempdir().expect("a writable folder");
        let path = folder.path().join("expected.toml");
        assert_eq!(Expected::read(&path).expect("an absent file is no error"), None);
        recorded.write(&path).expect("a writable folder");
        assert_eq!(Expected::read(&path).expect("what was written"), Some(recorded));
        std::fs::write(&path, "rows = 1").expect("a writable file");
        assert!(Expected::read(&path).is_err());
    }
}
