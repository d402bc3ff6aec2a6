//! FLIP against the authors' own Python package: stored values always, the package itself where Python has it.
//!
//! The stored values are those of `flip-evaluator` 1.7 (PyPI), `evaluate(reference, test, "LDR")` on the pictures of
//! [`picture`], bytes over 255, with its default of 67.02 pixels a degree.

use gdpt::analyze::flip;
use std::fs;
use std::process::Command;

/// A picture with edges, ramps and noise: integers alone decide it.
fn picture(width: usize, height: usize, seed: usize) -> Vec<u8> {
    let byte = |x: usize, y: usize, c: usize| {
        (x * (7 + 3 * c) + y * (13 + 5 * c) + x * y * (c + 1 + seed) / 3 + 29 * c + seed * 17) % 256
    };
    (0..width * height * 3).map(|i| byte(i / 3 % width, i / 3 / width, i % 3) as u8).collect()
}

/// Columns, rows, the two seeds, and what the package says.
const STORED: &[(usize, usize, [usize; 2], f64)] =
    &[(64, 48, [0, 1], 0.503_755_4), (40, 30, [0, 1], 0.585_070_3), (33, 57, [2, 5], 0.417_423_9)];

#[test]
fn values_are_those_of_the_authors_package() {
    for &(width, height, [reference, test], stored) in STORED {
        let (reference, test) = (picture(width, height, reference), picture(width, height, test));
        let mean = flip::mean(&test, &reference, width, height).expect("one size");
        assert!((mean - stored).abs() < 1e-5, "{width}x{height}: {mean}, the package says {stored}");
    }
}

const SCRIPT: &str = "
import sys, numpy
from flip_evaluator import evaluate
folder = sys.argv[1]
for name in sys.argv[2:]:
    width, height = map(int, name.split('x'))
    read = lambda which: numpy.fromfile(f'{folder}/{name}.{which}', dtype=numpy.uint8) \\
        .reshape(height, width, 3).astype(numpy.float32) / 255
    print(evaluate(read('reference'), read('test'), 'LDR')[1])
";

#[test]
fn the_package_itself_agrees_where_python_has_it() {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let has = Command::new(&python).args(["-c", "import flip_evaluator"]).output();
    if !has.is_ok_and(|o| o.status.success()) {
        println!(
            "skipped: {python} has no flip_evaluator (pip install flip-evaluator; PYTHON names another one)"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a private folder");
    let mut names = Vec::new();
    for &(width, height, seeds, _) in STORED {
        names.push(format!("{width}x{height}"));
        for (which, seed) in ["reference", "test"].iter().zip(seeds) {
            let file = folder.path().join(format!("{width}x{height}.{which}"));
            fs::write(file, picture(width, height, seed)).expect("writable");
        }
    }
    let output = Command::new(&python)
        .args(["-c", SCRIPT])
        .arg(folder.path())
        .args(&names)
        .output()
        .expect("it starts");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let said: Vec<f64> = text.lines().filter_map(|line| line.trim().parse().ok()).collect();
    assert_eq!(said.len(), STORED.len(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    for (&(width, height, [reference, test], _), said) in STORED.iter().zip(said) {
        let (reference, test) = (picture(width, height, reference), picture(width, height, test));
        let mean = flip::mean(&test, &reference, width, height).expect("one size");
        assert!((mean - said).abs() < 1e-5, "{width}x{height}: {mean}, the package says {said}");
    }
}
