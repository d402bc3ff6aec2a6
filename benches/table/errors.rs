//! What gradients buy: relMSE (`analyze::metrics`) of path tracing over that of gradient-domain path tracing at equal CPU
//! time, the solve included, against a path-traced reference whose own noise is subtracted.

use super::Effort;
use gdpt::analyze::metrics::compare;
use gdpt::film::{Half, Plane};
use gdpt::integrate::Kind;
use gdpt::reconstruct::{Input, reconstruct};
use gdpt_bench::kernels::{ALPHA, SOLVERS};
use gdpt_bench::measure::{Cost, median, timed};
use gdpt_bench::render::{Backend, Bed, cpus, pool, settings};
use gdpt_bench::scenes;
use gdpt_bench::table::{Row, Target};

const SPP: u32 = 64;
const REFERENCE_SPP: u32 = 2048;

fn target(scene: &str, solver: &str) -> Target {
    match (scene, solver) {
        (scenes::BUILTIN | "cornell-box", "L1") => Target::AtLeast(20.0),
        ("sponza", "L1") => Target::AtLeast(7.0),
        _ => Target::AtLeast(1.0),
    }
}

/// A converged image and the relMSE of its own noise.
struct Reference {
    image: Plane,
    noise: f64,
}

impl Reference {
    fn new(bed: &Bed, size: [u32; 2], spp: u32) -> Self {
        let half = |seed| {
            let settings = settings(Kind::Path, size, spp.div_ceil(2), seed);
            bed.render(Backend::Embree, &settings).0.primal(Half::Both)
        };
        let (a, b) = (half(1001), half(1002));
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| 0.5 * (a[c] + b[c]));
        let data = a.data.iter().zip(&b.data).map(mean).collect();
        // Two independent halves differ by four times the variance of their mean.
        let noise = compare(&a, &b).expect("images of one size").rel_mse / 4.0;
        Self { image: Plane { width: a.width, height: a.height, data }, noise }
    }

    fn error(&self, image: &Plane) -> f64 {
        compare(image, &self.image).expect("images of one size").rel_mse - self.noise
    }
}

pub fn rows(name: &'static str, effort: &Effort) -> Vec<Row> {
    let scene = match scenes::open(name) {
        Ok(scene) => scene,
        Err(why) => return vec![Row::skipped(format!("error/{name}"), &why)],
    };
    let (bed, pool) = (Bed::new(&scene.scene), pool(cpus()));
    let size = effort.size(scene.size.map(|side| side / 2));
    let reference = pool.install(|| Reference::new(&bed, size, effort.spp(REFERENCE_SPP)));

    // A round: [PT, then each solver] as (CPU seconds, error).
    let mut measured = Vec::new();
    for seed in 0..effort.rounds as u64 {
        let of = |kind| settings(kind, size, effort.spp(SPP), seed);
        let render = |kind| pool.install(|| timed(|| bed.render(Backend::Embree, &of(kind)).0));
        let (film, path) = render(Kind::Path);
        let mut round = vec![(path.cpu, reference.error(&film.primal(Half::Both)))];
        let (film, gradient) = render(Kind::GradientPath);
        let buffers = film.buffers();
        let input = Input::from(&buffers);
        for (_, method) in SOLVERS {
            let (solution, Cost { cpu, .. }) = pool.install(|| timed(|| reconstruct(&input, method, ALPHA)));
            round.push((gradient.cpu + cpu, reference.error(&solution.image)));
        }
        measured.push(round);
    }
    let row = |(i, (solver, _)): (usize, &(&str, _))| {
        let gains = measured.iter().map(|round| {
            let ((path_cpu, path_error), (cpu, error)) = (round[0], round[i + 1]);
            path_error * path_cpu / (error * cpu)
        });
        let text = |side: usize| {
            let error = median(measured.iter().map(|round| round[side].1));
            let cpu = median(measured.iter().map(|round| round[side].0));
            format!("relMSE {error:.3e} in {cpu:.3} s CPU")
        };
        let label =
            format!("{name}: relMSE at equal time, PT over G-PT with {solver}, {} spp", effort.spp(SPP));
        let ours = format!("G-PT {solver}: {}", text(i + 1));
        Row::ratio(label, ours, format!("PT: {}", text(0)), median(gains), target(name, solver))
    };
    SOLVERS.iter().enumerate().map(row).collect()
}
