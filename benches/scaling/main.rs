//! Cost as the work grows: time and memory against samples, pixels, triangles, lights and threads.
//!
//!     cargo bench --bench scaling                    everything, into target/bench-scaling/
//!     cargo bench --bench scaling -- lights spp      some of it
//!
//! Every point is a process of its own, so that its peak memory is its own. One SVG a family; the exponents of the
//! table are fitted by least squares on logarithms over the upper half of the range, where fixed costs are over.

mod fit;
mod plot;
mod points;

use clap::Parser;
use gdpt_bench::measure::median;
use gdpt_bench::scenes;
use gdpt_bench::table::grid;
use points::{Curve, FAMILIES, Family, Point};
use std::error::Error;
use std::process::{Command, ExitCode, Stdio};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Measures how cost grows with the work.
#[derive(Parser)]
struct Arguments {
    /// Families to measure; all without
    families: Vec<String>,
    /// The two smallest points of each family, once: whether the bench works
    #[arg(long)]
    test: bool,
    /// What cargo passes to every bench
    #[arg(long, hide = true)]
    bench: bool,
    /// One point in this process: family and index
    #[arg(long, hide = true, num_args = 2)]
    point: Option<Vec<String>>,
}

/// Times each point is measured; what is plotted are medians.
const ROUNDS: usize = 3;

/// Measures one point in a process of its own.
fn measure(family: &Family, index: usize) -> Result<Point> {
    let mut child = Command::new(std::env::current_exe()?);
    child.args(["--point", family.name, &index.to_string()]).stderr(Stdio::inherit());
    let output = child.output()?;
    if !output.status.success() {
        return Err(format!("{} {index} ends with {}", family.name, output.status).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// A line of the table: the curve's ends and its exponent.
fn line(family: &Family, curve: &Curve, points: &[(f64, f64)]) -> [String; 5] {
    let (first, last) = (points.first(), points.last());
    let end = |p: Option<&(f64, f64)>| p.map_or_else(String::new, |(x, y)| format!("{y:.3} at {x}"));
    let exponent = fit::upper_half(points).map_or_else(String::new, |fit| format!("{:.2}", fit.exponent));
    [family.name.into(), format!("{}, {}", curve.name, curve.unit), end(first), end(last), exponent]
}

fn run(arguments: &Arguments) -> Result<()> {
    let unknown = |name: &&String| FAMILIES.iter().all(|family| family.name != **name);
    if let Some(name) = arguments.families.iter().find(unknown) {
        return Err(format!("{name}: no such family").into());
    }
    let scratch = tempfile::tempdir()?;
    let kept = scenes::root().join("target/bench-scaling");
    let folder = if arguments.test { scratch.path() } else { &kept };
    std::fs::create_dir_all(folder)?;
    let mut lines = Vec::new();
    for family in &FAMILIES {
        if !arguments.families.is_empty() && !arguments.families.iter().any(|name| name == family.name) {
            continue;
        }
        let count = (family.count)();
        let (count, rounds) = if arguments.test { (count.min(2), 1) } else { (count, ROUNDS) };
        let mut measured = vec![Vec::new(); count];
        for _ in 0..rounds {
            for (index, points) in measured.iter_mut().enumerate() {
                println!("{} {index}", family.name);
                points.push(measure(family, index)?);
            }
        }
        let points_of = |curve: &Curve| -> Vec<(f64, f64)> {
            let point = |points: &Vec<Point>| (points[0].x, median(points.iter().map(curve.value)));
            measured.iter().map(point).filter(|(x, y)| x * y > 0.0).collect()
        };
        let curves: Vec<_> = family.curves.iter().map(|curve| (curve, points_of(curve))).collect();
        plot::write(&folder.join(format!("{}.svg", family.name)), family, &curves)?;
        lines.extend(curves.iter().map(|(curve, points)| line(family, curve, points)));
    }
    let table = grid(["against", "what", "smallest", "largest", "exponent"], lines);
    std::fs::write(folder.join("exponents.md"), &table)?;
    if !arguments.test {
        println!("\n{table}\nplots and table in target/bench-scaling/");
    }
    Ok(())
}

/// The other end of [`measure`].
fn point(family: &str, index: &str) -> Result<()> {
    let family = FAMILIES.iter().find(|f| f.name == family).ok_or("no such family")?;
    println!("{}", serde_json::to_string(&(family.measure)(index.parse()?))?);
    Ok(())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match arguments.point.as_deref() {
        Some([family, index]) => point(family, index),
        _ => run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
