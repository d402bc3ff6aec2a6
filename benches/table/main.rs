//! One table of everything worth knowing about speed: renders on both backends, rays, solves, memory, start-up, errors
//! at equal time, and Mitsuba on the same files where it is installed.
//!
//!     cargo bench --bench table                        everything; also into target/bench.md
//!     cargo bench --bench table -- render/sponza rays  what contains one of the words
//!     cargo bench --bench table -- --quick             one round instead of five, fewer samples
//!     cargo bench --bench table -- --list              the names
//!
//! Every ratio is the median over the rounds of one run in which the sides take turns. Rates are per CPU second.
//! `GDPT_MITSUBA_PYTHON` names a Python that can import mitsuba (default python3), `GDPT_MITSUBA_SCRIPT` the program
//! that renders a GLB with it (default `../shared/tools/mitsuba_reference.py`).

mod errors;
mod mitsuba;
mod process;
mod rays;
mod renders;
mod solvers;

use clap::Parser;
use gdpt_bench::scenes;
use gdpt_bench::table::{Row, markdown};
use std::io;
use std::process::ExitCode;

/// Prints one table of what gdpt is worth on this machine.
#[derive(Parser)]
struct Arguments {
    /// Parts of the names of what to measure; everything without
    words: Vec<String>,
    /// One round, fewer samples
    #[arg(long)]
    quick: bool,
    /// Prints the names and measures nothing
    #[arg(long)]
    list: bool,
    /// Once through the built-in scenes, as small as possible: whether the bench works
    #[arg(long)]
    test: bool,
    /// What cargo passes to every bench
    #[arg(long, hide = true)]
    bench: bool,
    /// A measurement in a process of its own
    #[arg(long, hide = true)]
    child: Option<String>,
}

/// How much work goes into a measurement.
#[derive(Clone, Copy, Debug)]
struct Effort {
    /// Rounds of alternating sides.
    rounds: usize,
    /// Samples a pixel and sides of images are divided by these.
    fewer_samples: u32,
    smaller: u32,
}

impl Effort {
    const FULL: Self = Self { rounds: 5, fewer_samples: 1, smaller: 1 };
    const QUICK: Self = Self { rounds: 1, fewer_samples: 4, smaller: 1 };
    const TEST: Self = Self { rounds: 1, fewer_samples: 1024, smaller: 16 };

    fn spp(&self, spp: u32) -> u32 {
        (spp / self.fewer_samples).max(1)
    }

    fn size(&self, size: [u32; 2]) -> [u32; 2] {
        size.map(|side| side / self.smaller)
    }

    fn is_test(&self) -> bool {
        self.smaller > 1
    }
}

/// What measures a part of the table.
type Measure = Box<dyn Fn(&Effort) -> Vec<Row>>;

/// A part of the table.
struct Experiment {
    name: String,
    run: Measure,
}

fn experiments() -> Vec<Experiment> {
    let mut all = Vec::new();
    let mut add = |name: String, run: Measure| all.push(Experiment { name, run });
    for scene in scenes::names() {
        add(format!("render/{scene}"), Box::new(move |effort| renders::rows(scene, effort)));
    }
    for scene in scenes::names().filter(|&scene| scene != scenes::BUILTIN) {
        add(format!("mitsuba/{scene}"), Box::new(move |effort| mitsuba::rows(scene, effort)));
    }
    add("share/sponza".into(), Box::new(|effort| renders::share_of_embree("sponza", effort)));
    add("rays/balls".into(), Box::new(|effort| rays::rows("balls", effort)));
    add("rays/sponza".into(), Box::new(|effort| rays::rows("sponza", effort)));
    add("solve".into(), Box::new(solvers::rows));
    for scene in [scenes::BUILTIN, "sponza", "living-room"] {
        add(format!("error/{scene}"), Box::new(move |effort| errors::rows(scene, effort)));
    }
    add("film".into(), Box::new(process::film));
    for scene in scenes::names() {
        add(format!("process/{scene}"), Box::new(move |effort| process::rows(scene, effort)));
    }
    all
}

fn run(arguments: &Arguments) -> io::Result<()> {
    let effort = match (arguments.test, arguments.quick) {
        (true, _) => Effort::TEST,
        (_, true) => Effort::QUICK,
        _ => Effort::FULL,
    };
    let wanted = |name: &str| {
        let words = &arguments.words;
        let in_test =
            !effort.is_test() || !name.contains('/') || name.contains("builtin") || name == "rays/balls";
        in_test && (words.is_empty() || words.iter().any(|word| name.contains(word)))
    };
    let mut rows = Vec::new();
    for experiment in experiments().iter().filter(|experiment| wanted(&experiment.name)) {
        println!("{}", experiment.name);
        if !arguments.list {
            rows.extend((experiment.run)(&effort));
        }
    }
    if arguments.list {
        return Ok(());
    }
    let table = markdown(&rows);
    if effort.is_test() {
        println!("{} rows", rows.len());
        return Ok(());
    }
    println!("\n{table}");
    let file = scenes::root().join("target/bench.md");
    std::fs::write(&file, table)?;
    println!("also in target/bench.md");
    Ok(())
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match &arguments.child {
        Some(name) => process::child(name),
        None => run(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
