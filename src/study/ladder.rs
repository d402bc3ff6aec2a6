//! The measurement of one scene: every method at every number of samples, and what pictures need beside that.

use super::bench::{self, Bench, Reference, Score, Shot, solve};
use super::fit;
use super::{Plan, Subject, usage};
use crate::analyze::noise::Noise;
use crate::denoise;
use crate::error::Result;
use crate::film::{Half, Measured};
use crate::integrate::{Kind, Settings};
use crate::reconstruct::Method;
use crate::render::{Monitor, metadata};
use std::sync::atomic::AtomicBool;

/// Independent runs whose noise is taken apart into frequencies.
const NOISE_RUNS: u64 = 4;

/// How an image is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Path tracing.
    Path,
    /// Path tracing, denoised.
    Denoised,
    /// Gradient-domain path tracing with a reconstruction.
    Gradient(Method),
    /// Path tracing with differences by common random numbers, twice the samples, and the default reconstruction.
    Common,
}

impl Side {
    /// The name in tables and charts.
    pub fn name(self) -> String {
        match self {
            Self::Path => "PT".into(),
            Self::Denoised => "PT + OIDN".into(),
            Self::Gradient(method) => format!("G-PT {}", metadata::method_name(method)),
            Self::Common => format!("CRN {}", metadata::method_name(Method::default())),
        }
    }
}

/// One method at one number of samples, means over the seeds.
#[derive(Clone, Debug)]
pub struct Cell {
    pub side: Side,
    pub spp: u32,
    pub render_seconds: f64,
    pub solve_seconds: f64,
    pub rel_mse: f64,
    pub flip: f64,
    /// relMSE that the solver expected, mean over the seeds; NaN where it expects nothing.
    pub estimate: f64,
    /// Mean relative difference of the image's mean from the reference's, and its standard error over the seeds.
    pub energy: (f64, f64),
    /// relMSE of path tracing with as many samples, over this one.
    pub gain_spp: f64,
    /// relMSE of path tracing after the same CPU time, over this one.
    pub gain_time: f64,
    /// The first seed's image.
    pub shot: Shot,
}

impl Cell {
    /// CPU time, s.
    pub fn seconds(&self) -> f64 {
        self.render_seconds + self.solve_seconds
    }
}

/// Everything measured on one scene.
pub struct Findings {
    pub name: String,
    pub triangles: u64,
    pub reference: Reference,
    pub cells: Vec<Cell>,
    /// Noise of gradient-domain path tracing at the shown number of samples.
    pub noise: Noise,
    /// Path tracing with the CPU time of the default method at the shown number of samples, and its samples.
    pub equal_time: (u32, Shot, Score),
    /// Gradient-domain path tracing at the shown number of samples: primal, dx, dy.
    pub buffers: Measured,
    /// Least squares at the smallest number of samples with and without the weights of pairs.
    pub pair_weights: [Shot; 2],
}

impl Findings {
    /// The cell of a method.
    pub fn cell(&self, side: Side, spp: u32) -> Option<&Cell> {
        self.cells.iter().find(|c| c.side == side && c.spp == spp)
    }

    /// The methods, in the order of the tables.
    pub fn sides(&self) -> Vec<Side> {
        let mut sides = Vec::new();
        for cell in &self.cells {
            if !sides.contains(&cell.side) {
                sides.push(cell.side);
            }
        }
        sides
    }

    /// A method's (samples, CPU seconds, relMSE, FLIP) over the ladder.
    pub fn curve(&self, side: Side) -> Vec<(f64, f64, f64, f64)> {
        let cells = self.cells.iter().filter(|c| c.side == side);
        cells.map(|c| (f64::from(c.spp), c.seconds(), c.rel_mse, c.flip)).collect()
    }
}

/// Sums over the seeds.
struct Tally {
    side: Side,
    spp: u32,
    scores: Vec<Score>,
    seconds: [f64; 2],
    estimates: f64,
    first: Shot,
}

/// Adds a shot to its tally.
fn tally(tallies: &mut Vec<Tally>, side: Side, spp: u32, score: Score, shot: Shot) {
    let seconds = [shot.render_seconds, shot.solve_seconds];
    match tallies.iter_mut().find(|t| t.side == side && t.spp == spp) {
        Some(t) => {
            t.scores.push(score);
            t.seconds = [t.seconds[0] + seconds[0], t.seconds[1] + seconds[1]];
            t.estimates += shot.estimate;
        }
        None => tallies.push(Tally {
            side,
            spp,
            scores: vec![score],
            seconds,
            estimates: shot.estimate,
            first: shot,
        }),
    }
}

/// Measures one scene.
pub fn measure(
    plan: &Plan,
    subject: &Subject,
    monitor: &dyn Monitor,
    cancel: &AtomicBool,
) -> Result<Findings> {
    let scene = bench::load(subject, monitor)?;
    let bench = Bench::new(plan, subject, &scene, monitor, cancel)?;
    let reference = bench.reference()?;
    let mut tallies = Vec::new();
    for round in 0..u64::from(plan.rounds) {
        climb(&bench, &reference, round, &mut tallies)?;
    }
    let cells = cells(plan, tallies);
    let shown = plan.shown_spp();
    bench.stage(&format!("noise at {shown} spp"));
    let mut runs = Vec::new();
    for i in 0..NOISE_RUNS {
        runs.push(bench.gradients(shown, plan.seed + i)?.0.measured(Half::Both));
    }
    let noise = Noise::measure(&runs, 1.0, super::bench::ALPHA).expect("four runs of one size");
    let equal_time = equal_time(&bench, &reference, &cells)?;
    let pair_weights = pair_weights(&bench)?;
    Ok(Findings {
        name: bench.name.clone(),
        triangles: scene.triangle_count(),
        reference,
        cells,
        noise,
        equal_time,
        buffers: runs.swap_remove(0),
        pair_weights,
    })
}

/// Renders every method at every number of samples with one seed; the sides swap turns from round to round.
fn climb(bench: &Bench, reference: &Reference, round: u64, tallies: &mut Vec<Tally>) -> Result<()> {
    let plan = bench.plan;
    let seed = plan.seed + round;
    let add = |tallies: &mut Vec<Tally>, side, spp, shot: Shot| {
        tally(tallies, side, spp, bench.score(&shot, reference), shot);
    };
    for &spp in &plan.spp {
        bench.stage(&format!("{spp} spp, seed {} of {}", round + 1, plan.rounds));
        let path = |tallies: &mut Vec<Tally>| -> Result<()> {
            add(tallies, Side::Path, spp, bench.path(spp, seed)?);
            Ok(())
        };
        let path_first = round.is_multiple_of(2);
        if path_first {
            path(tallies)?;
        }
        let (film, seconds) = bench.gradients(spp, seed)?;
        for &method in &plan.methods {
            add(tallies, Side::Gradient(method), spp, solve(&film, method, seconds));
        }
        if !path_first {
            path(tallies)?;
        }
        let (film, seconds) = bench.common(spp, seed)?;
        add(tallies, Side::Common, spp, solve(&film, Method::default(), seconds));
        if denoise::AVAILABLE {
            add(tallies, Side::Denoised, spp, denoised(bench, spp, seed)?);
        }
    }
    let top = top_spp(plan);
    bench.stage(&format!("{top} spp, seed {} of {}", round + 1, plan.rounds));
    add(tallies, Side::Path, top, bench.path(top, seed)?);
    Ok(())
}

/// The number of samples that path tracing alone renders, so that its curve reaches the others' times.
fn top_spp(plan: &Plan) -> u32 {
    plan.spp.last().map_or(4, |s| s.saturating_mul(4))
}

fn denoised(bench: &Bench, spp: u32, seed: u64) -> Result<Shot> {
    let settings = Settings { features: true, ..bench.settings(Kind::Path, spp, seed) };
    let (film, render_seconds) = bench.film(&settings)?;
    let (image, solve_seconds) = usage::timed(|| denoise::primal(&film));
    let (image, direct) = (image?, film.direct());
    Ok(Shot { image, direct, render_seconds, solve_seconds, estimate: f64::NAN })
}

/// Means over the seeds, and the gains over path tracing.
fn cells(plan: &Plan, tallies: Vec<Tally>) -> Vec<Cell> {
    let order = |side: Side| match side {
        Side::Path => 0,
        Side::Denoised => 1,
        Side::Common => 2,
        Side::Gradient(method) => 3 + plan.methods.iter().position(|m| *m == method).unwrap_or(0),
    };
    let mut cells: Vec<Cell> = tallies
        .into_iter()
        .map(|t| {
            let n = t.scores.len() as f64;
            let mean = |f: fn(&Score) -> f64| t.scores.iter().map(f).sum::<f64>() / n;
            let energies: Vec<f64> = t.scores.iter().map(|s| s.energy).collect();
            Cell {
                side: t.side,
                spp: t.spp,
                render_seconds: t.seconds[0] / n,
                solve_seconds: t.seconds[1] / n,
                rel_mse: mean(|s| s.rel_mse),
                flip: mean(|s| s.flip),
                estimate: t.estimates / n,
                energy: fit::mean_and_error(&energies),
                gain_spp: f64::NAN,
                gain_time: f64::NAN,
                shot: t.first,
            }
        })
        .collect();
    cells.sort_by_key(|c| (order(c.side), c.spp));
    let path: Vec<(u32, f64, f64)> =
        cells.iter().filter(|c| c.side == Side::Path).map(|c| (c.spp, c.seconds(), c.rel_mse)).collect();
    let over_time: Vec<(f64, f64)> = path.iter().map(|p| (p.1, p.2)).collect();
    for cell in &mut cells {
        let error = if cell.rel_mse > 0.0 { cell.rel_mse } else { f64::NAN };
        let same = path.iter().find(|p| p.0 == cell.spp).map_or(f64::NAN, |p| p.2);
        cell.gain_spp = same / error;
        cell.gain_time = fit::interpolate(&over_time, cell.seconds()) / error;
    }
    cells
}

/// Path tracing for as long as the default method takes at the shown number of samples.
fn equal_time(bench: &Bench, reference: &Reference, cells: &[Cell]) -> Result<(u32, Shot, Score)> {
    let shown = bench.plan.shown_spp();
    let seconds =
        |side: Side| cells.iter().find(|c| c.side == side && c.spp == shown).map_or(f64::NAN, Cell::seconds);
    let ratio = seconds(Side::Gradient(Method::default())) / seconds(Side::Path);
    let spp = (f64::from(shown) * ratio).round().clamp(1.0, f64::from(top_spp(bench.plan))) as u32;
    bench.stage(&format!("equal time, {spp} spp"));
    let shot = bench.path(spp, bench.plan.seed)?;
    let score = bench.score(&shot, reference);
    Ok((spp, shot, score))
}

/// Least squares with and without the weights between a path and its shifted twin.
fn pair_weights(bench: &Bench) -> Result<[Shot; 2]> {
    let spp = bench.plan.spp.first().copied().unwrap_or(1);
    bench.stage("pair weights");
    let shot = |pair_mis| -> Result<Shot> {
        let settings = bench.settings(Kind::GradientPath, spp, bench.plan.seed);
        let (film, seconds) = bench.film(&Settings { pair_mis, ..settings })?;
        Ok(solve(&film, Method::L2, seconds))
    };
    Ok([shot(true)?, shot(false)?])
}
