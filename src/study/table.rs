//! Tables: the page and the CSV beside it show the same text, made here once.

/// Rows of text under a header.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// Names of the columns.
    pub header: Vec<String>,
    /// One text a column.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(header: &[&str]) -> Self {
        Self { header: header.iter().map(|h| (*h).to_owned()).collect(), rows: Vec::new() }
    }

    /// Comma-separated values (RFC 4180) with a header line.
    pub fn csv(&self) -> String {
        let line = |row: &Vec<String>| {
            let cells: Vec<String> = row.iter().map(|cell| quoted(cell)).collect();
            format!("{}\r\n", cells.join(","))
        };
        std::iter::once(&self.header).chain(&self.rows).map(line).collect()
    }
}

/// A cell; quoted where it holds what would end it.
fn quoted(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

/// A measured value: four digits, scientific where plain ones would be long; empty where there is none.
pub fn number(value: f64) -> String {
    // Rounded first: 0.99999 has one digit before the point.
    let size = format!("{:.3e}", value.abs()).parse().unwrap_or(0.0);
    if !value.is_finite() {
        String::new()
    } else if size == 0.0 {
        "0".into()
    } else if (1e-2..1e4).contains(&size) {
        let digits = (3 - f64::log10(size).floor() as i32).max(0) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.3e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits_and_read_back() {
        let texts =
            [0.0, 0.999_99, 0.012_345, 123.456, 9_999.4, 1.234_56e-5, 4.2e7, f64::NAN, -0.5].map(number);
        let want = ["0", "1.000", "0.01235", "123.5", "9999", "1.235e-5", "4.200e7", "", "-0.5000"];
        assert_eq!(texts, want);
        for text in texts.iter().filter(|t| !t.is_empty()) {
            text.parse::<f64>().expect("a number");
        }
    }

    #[test]
    fn cells_are_quoted_where_they_must() {
        let mut table = Table::new(&["scene", "value"]);
        table.rows.push(vec!["a, \"b\"".into(), "1".into()]);
        assert_eq!(table.csv(), "scene,value\r\n\"a, \"\"b\"\"\",1\r\n");
    }
}
