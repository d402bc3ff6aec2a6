//! Whole renders of a scene: Embree and obvhs, path tracing and gradient-domain path tracing, one and two threads.

use super::Effort;
use gdpt::integrate::{Kind, Statistics};
use gdpt_bench::measure::{Cost, Rounds, median, timed};
use gdpt_bench::render::{Backend, Bed, cpus, megasamples, pool, render, settings};
use gdpt_bench::replay::Timed;
use gdpt_bench::scenes;
use gdpt_bench::table::{Rate, Row, Target, seconds};

/// Cost of a gradient-domain sample over a path-traced one that is asked for.
fn gradient_target(scene: &str) -> Target {
    match scene {
        scenes::BUILTIN | "cornell-box" => Target::AtMost(1.9),
        "sponza" => Target::AtMost(1.5),
        _ => Target::None,
    }
}

pub fn rows(name: &'static str, effort: &Effort) -> Vec<Row> {
    let scene = match scenes::open(name) {
        Ok(scene) => scene,
        Err(why) => return vec![Row::skipped(format!("render/{name}"), &why)],
    };
    let bed = Bed::new(&scene.scene);
    let (size, spp) = (effort.size(scene.size), effort.spp(scene.spp));
    let (one, two) = (pool(1), pool(2));
    let of = |kind| settings(kind, size, spp, 0);
    let mut sides = Vec::new();
    for backend in [Backend::Embree, Backend::Obvhs] {
        for kind in [Kind::Path, Kind::GradientPath] {
            sides.push(bed.side(backend, of(kind), &two));
        }
    }
    for kind in [Kind::Path, Kind::GradientPath] {
        sides.push(bed.side(Backend::Embree, of(kind), &one));
    }
    let rounds = Rounds::alternate(effort.rounds, sides);

    let rate = |side, label| Rate { side, label, millions: megasamples(size, spp) };
    let mut rows = vec![
        Row::rates(
            format!("{name}: PT samples, Embree over obvhs"),
            &rounds,
            rate(0, "Embree"),
            rate(2, "obvhs"),
            Target::AtLeast(2.0),
        ),
        Row::rates(
            format!("{name}: G-PT samples, Embree over obvhs"),
            &rounds,
            rate(1, "Embree"),
            rate(3, "obvhs"),
            Target::AtLeast(2.0),
        ),
        Row::ratio(
            format!("{name}: CPU time of a G-PT sample over a PT sample"),
            format!("G-PT: {}", seconds(rounds.cost(1))),
            format!("PT: {}", seconds(rounds.cost(0))),
            rounds.ratio(1, 0, Cost::cpu),
            gradient_target(name),
        ),
    ];
    for (kind, label, alone, together) in [(Kind::Path, "PT", 4, 0), (Kind::GradientPath, "G-PT", 5, 1)] {
        rows.push(threads(name, label, &rounds, alone, together));
        let (_, statistics) = two.install(|| bed.render(Backend::Embree, &of(kind)));
        rows.push(lanes(name, label, &statistics));
    }
    rows
}

fn threads(name: &str, label: &str, rounds: &Rounds, alone: usize, together: usize) -> Row {
    let name = format!("{name}: {label}, two threads over one, wall time");
    if cpus() < 2 {
        return Row::skipped(name, "this machine has one core");
    }
    Row::ratio(
        name,
        format!("two threads: {}", seconds(rounds.cost(together))),
        format!("one: {}", seconds(rounds.cost(alone))),
        rounds.ratio(alone, together, Cost::wall),
        Target::AtLeast(1.9),
    )
}

fn lanes(name: &str, label: &str, statistics: &Statistics) -> Row {
    let rays = &statistics.rays;
    let detail = format!("{} rays in {} packets", rays.total, rays.intersect_packets + rays.occluded_packets);
    let name = format!("{name}: {label}, active lanes a packet, of 16");
    Row::value(name, rays.active_lanes_mean(), "", &detail, Target::AtLeast(12.0))
}

/// The share of a render on one thread that passes inside calls of the Embree backend: the packing of packets included,
/// the rest of the renderer not. Both are wall time of the same run, so that a busy machine stretches both.
pub fn share_of_embree(name: &'static str, effort: &Effort) -> Vec<Row> {
    let label = format!("{name}: share of PT's time inside the Embree backend, %");
    let scene = match scenes::open(name) {
        Ok(scene) => scene,
        Err(why) => return vec![Row::skipped(label, &why)],
    };
    let bed = Bed::new(&scene.scene);
    let settings = settings(Kind::Path, effort.size(scene.size), effort.spp(scene.spp), 0);
    let share = |_| {
        pool(1).install(|| {
            let embree = Timed::new(bed.embree());
            let (_, whole) = timed(|| render(&scene.scene, &embree, &settings));
            100.0 * embree.share(whole.wall)
        })
    };
    let share = median((0..effort.rounds).map(share));
    vec![Row::value(label, share, "", "calls timed one by one", Target::AtLeast(70.0))]
}
