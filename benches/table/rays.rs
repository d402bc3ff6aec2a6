//! Rays a second on one thread by kind of ray and packet width, against Embree one ray at a time.

use super::Effort;
use gdpt_bench::rays::{Bed, METHODS};
use gdpt_bench::table::{Rate, Row, Target};
use gdpt_bench::{scenes, shapes};

pub fn rows(name: &'static str, effort: &Effort) -> Vec<Row> {
    let bed = if name == "balls" {
        let [columns, rows] = [142, 72].map(|n| n / effort.smaller);
        Bed::new(&shapes::balls(columns, rows), effort.size([512, 384]))
    } else {
        match scenes::open(name) {
            Ok(scene) => Bed::new(&scene.scene, effort.size(scene.size)),
            Err(why) => return vec![Row::skipped(format!("rays/{name}"), &why)],
        }
    };
    let mut rows = Vec::new();
    for kind in &bed.kinds {
        let rounds = bed.rounds(kind, effort.rounds);
        let rate = |side| Rate { side, label: METHODS[side].0, millions: kind.rays() as f64 * 1e-6 };
        for (side, (method, _)) in METHODS.iter().enumerate().skip(1) {
            let asked = kind.name == "primary" && *method == "embree 16 coherent";
            let target = if asked { Target::AtLeast(2.0) } else { Target::None };
            let label = format!("{name}: {} rays, {method} over {}", kind.name, METHODS[0].0);
            rows.push(Row::rates(label, &rounds, rate(side), rate(0), target));
        }
    }
    rows
}
