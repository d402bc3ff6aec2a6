//! The solves at 1920×1080: time on all threads and memory.

use super::{Effort, process};
use gdpt::reconstruct::reconstruct;
use gdpt_bench::fixtures::{noisy_buffers, problem};
use gdpt_bench::kernels::{ALPHA, SOLVERS};
use gdpt_bench::measure::{Rounds, Side, cost};
use gdpt_bench::render::{cpus, pool};
use gdpt_bench::table::{Row, Target, seconds};

/// Seconds on two cores that are asked for.
fn target(solver: &str) -> Target {
    match solver {
        "L2" => Target::AtMost(0.15),
        "L1" => Target::AtMost(1.5),
        "weighted" => Target::AtMost(1.0),
        _ => Target::None,
    }
}

pub fn rows(effort: &Effort) -> Vec<Row> {
    let [width, height] = effort.size([1920, 1080]);
    let buffers = noisy_buffers(width as usize, height as usize);
    let pool = pool(cpus());
    let sides = SOLVERS.map(|(_, method)| -> Side<'_> {
        let (input, pool) = (problem(&buffers, method), &pool);
        Box::new(move || pool.install(|| cost(|| reconstruct(&input, method, ALPHA))))
    });
    let rounds = Rounds::alternate(effort.rounds, sides.into());
    let mut rows = Vec::new();
    for (side, (name, _)) in SOLVERS.iter().enumerate() {
        let cost = rounds.cost(side);
        let label = format!("{name} solve, {width}×{height}, {} threads, wall seconds", cpus());
        rows.push(Row::value(label, cost.wall, "s", &seconds(cost), target(name)));
        rows.push(process::solve_memory(name, [width, height]));
    }
    rows
}
