//! The differences that the gradient-domain integrator measures, against those of a converged path-traced image:
//! over K independent seeds, pixel by pixel, summed over blocks, rows and columns, on average over the image, and as
//! the slope of a regression, which a wrong scale would turn away from 1. The noise of the reference is in every z.
//!
//! `GDPT_TEST_SEED` adds to all seeds and `GDPT_TEST_SCALE` multiplies the samples, to tell a bug from a tail.

use super::common::scenes::{self, TestScene};
use super::common::seeds::{Estimate, Runs, slope, z_score};
use super::common::{Pair, accel, differences, gradients, pairs, render, settings};
use gdpt::film::Half;
use gdpt::integrate::{Kind, ShiftOutcome, Statistics};
use std::collections::BTreeMap;
use std::time::Instant;

/// Independent seeds of gradients and of the reference.
const SEEDS: u64 = 64;

/// Bound on every z-score.
const Z: f64 = 4.0;

/// Sums of entries that are tested as one: 4×4 blocks, rows and columns, each for both axes, and everything, all
/// channels together.
fn functionals(width: usize, height: usize) -> BTreeMap<(Part, bool), Vec<(usize, f64)>> {
    let mut sums = BTreeMap::<_, Vec<(usize, f64)>>::new();
    for (i, p) in pairs(width, height).enumerate() {
        for part in [Part::Block(p.x / 4, p.y / 4), Part::Column(p.x), Part::Row(p.y)] {
            sums.entry((part, p.horizontal)).or_default().extend((0..3).map(|c| (3 * i + c, 1.0)));
        }
    }
    sums
}

/// What is summed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Block(usize, usize),
    Column(usize),
    Row(usize),
}

/// What the statistics say of one scene.
struct Verdict {
    outside: usize,
    worst: f64,
    mean: f64,
    worst_sum: f64,
    slope: Estimate,
}

fn judge(scene: &TestScene, tested: &Runs, truth: &Runs) -> Verdict {
    let [width, height] = scene.size.map(|n| n as usize);
    // Images without noise on both sides differ by rounding alone.
    let scale = truth.0.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
    let exact = 1e-6 * scale;
    let z: Vec<f64> = (0..tested.len()).map(|e| z_score(tested.entry(e), truth.entry(e), exact)).collect();
    let worst = z.iter().fold(0.0_f64, |m, z| m.max(z.abs()));
    let outside = z.chunks(3).filter(|rgb| rgb.iter().any(|z| z.is_nan() || z.abs() >= Z)).count();
    let weights: Vec<(usize, f64)> = (0..tested.len())
        .map(|e| (e, tested.entry(e).variance + truth.entry(e).variance))
        .filter(|&(_, variance)| variance > 0.0)
        .map(|(e, variance)| (e, variance.sqrt().recip()))
        .collect();
    let z_of = |w: &[(usize, f64)]| z_score(tested.functional(w), truth.functional(w), exact);
    let worst_sum = functionals(width, height)
        .values()
        .map(|w| z_of(w))
        .fold(0.0_f64, |worst, z| if z.abs() > worst.abs() { z } else { worst });
    Verdict { outside, worst, mean: z_of(&weights), worst_sum, slope: slope(tested, truth) }
}

/// The entries out of bounds, in words.
fn outliers(scene: &TestScene, tested: &Runs, truth: &Runs) -> Vec<String> {
    let [width, height] = scene.size.map(|n| n as usize);
    let describe = |(i, pair): (usize, Pair)| {
        (0..3).filter_map(move |c| {
            let (g, r) = (tested.entry(3 * i + c), truth.entry(3 * i + c));
            let z = z_score(g, r, 0.0);
            let [sigma_g, sigma_r] = [g.variance.sqrt(), r.variance.sqrt()];
            (z.abs() >= Z).then(|| {
                format!(
                    "{pair:?} channel {c}: {:.6} ± {sigma_g:.6}, expected {:.6} ± {sigma_r:.6}, z {z:.2}",
                    g.mean, r.mean
                )
            })
        })
    };
    let sums = functionals(width, height).into_iter().filter_map(|((part, horizontal), weights)| {
        let (g, r) = (tested.functional(&weights), truth.functional(&weights));
        let (z, axis) = (z_score(g, r, 0.0), if horizontal { "dx" } else { "dy" });
        (z.abs() >= Z).then(|| {
            let [sigma_g, sigma_r] = [g.variance.sqrt(), r.variance.sqrt()];
            format!(
                "sum of {axis} over {part:?}: {:.6} ± {sigma_g:.6}, expected {:.6} ± {sigma_r:.6}, z {z:.2}",
                g.mean, r.mean
            )
        })
    });
    pairs(width, height).enumerate().flat_map(describe).chain(sums).collect()
}

/// A number from the environment.
fn variable(name: &str) -> Option<u32> {
    std::env::var(name).ok().and_then(|s| s.parse().ok())
}

fn shares(shifts: &[u64; ShiftOutcome::COUNT]) -> String {
    let total = shifts.iter().sum::<u64>().max(1) as f64;
    let named = ShiftOutcome::NAMES.iter().zip(shifts).filter(|(_, n)| **n > 0);
    named.map(|(name, &n)| format!("{name} {:.1}%", 100.0 * n as f64 / total)).collect::<Vec<_>>().join(", ")
}

/// Renders gradients and reference over all seeds.
fn measure(scene: &TestScene) -> (Runs, Runs, Statistics) {
    let accel = accel(scene);
    let (mut tested, mut truth) = (Runs::default(), Runs::default());
    let mut statistics = Statistics::default();
    let scale = variable("GDPT_TEST_SCALE").unwrap_or(1);
    let first = u64::from(variable("GDPT_TEST_SEED").unwrap_or(0));
    for seed in first..first + SEEDS {
        let (film, done) =
            render(scene, &accel, &settings(scene, Kind::GradientPath, seed, scale * scene.spp));
        tested.push(&gradients(&film));
        statistics.add(&done);
        let reference = settings(scene, Kind::Path, seed + 1_000_000, scale * scene.reference_spp);
        truth.push(&differences(&render(scene, &accel, &reference).0.primal(Half::Both)));
    }
    (tested, truth, statistics)
}

fn check(scene: TestScene) {
    let start = Instant::now();
    let (tested, truth, statistics) = measure(&scene);
    let v = judge(&scene, &tested, &truth);
    let error = v.slope.variance.sqrt();
    let z_slope = (v.slope.mean - 1.0) / error;
    let report = format!(
        "{}: {} entries beyond {Z} (worst {:.2}), mean z {:.2}, worst sum {:.2}, slope {:.4} ± {error:.4}; {}; {:.1} s",
        scene.name,
        v.outside,
        v.worst,
        v.mean,
        v.worst_sum,
        v.slope.mean,
        shares(&statistics.shifts),
        start.elapsed().as_secs_f64(),
    );
    println!("{report}");
    for line in outliers(&scene, &tested, &truth) {
        println!("    {line}");
    }
    let allowed = (tested.len() / 3).div_ceil(10_000);
    assert!(v.outside <= allowed, "single differences are wrong: {report}");
    assert!(v.mean.abs() < Z, "the differences are wrong on average: {report}");
    assert!(v.worst_sum.abs() < Z, "sums of differences are wrong: {report}");
    assert!(z_slope.abs() < Z, "the scale of the differences is wrong: {report}");
}

/// One test a scene: its gradients (T2), and its primal against the path tracer's bits (T1).
macro_rules! scene_tests {
    ($($name:ident),+ $(,)?) => {
        mod of {
            $(#[test]
            fn $name() {
                super::check(super::scenes::$name());
            })+
        }

        #[test]
        fn primal_is_the_path_tracers_bit_by_bit() {
            $(check_primal(scenes::$name());)+
        }
    };
}

scene_tests!(
    diffuse_box,
    diffuse_box_small,
    diffuse_box_large,
    deep_white_box,
    penumbra,
    environment_occluders,
    point_light,
    spot_light,
    directional_light,
    walls_from_behind,
    one_sided_light,
    near_sphere_light,
    constant_environment,
    alpha_mask,
    alpha_blend,
    thin_lens,
    textured_plane,
    coarse_smooth_spheres,
    mirrored_instances,
    glossy_emitters,
    mirror_diffuse_border,
    normal_mapped_mirror,
    plastic_coat,
    glossy_metals,
    rough_metals_half_vector,
    metal_mixture,
    mixture_across_threshold,
    rough_glass_outside,
    rough_glass_reconnected,
    rough_glass_inside,
    rough_bubble,
    rough_glass_grazing,
    smooth_glass,
    light_behind_glass,
    thin_glass,
    absorption,
);

fn check_primal(scene: TestScene) {
    let accel = accel(&scene);
    let image = |kind| {
        let (film, _) = render(&scene, &accel, &settings(&scene, kind, 7, 19));
        (film.primal(Half::Both), film.direct())
    };
    let (expected, found) = (image(Kind::Path), image(Kind::GradientPath));
    let bits = |(primal, direct): &(gdpt::film::Plane, gdpt::film::Plane)| -> Vec<[u32; 3]> {
        primal.data.iter().chain(&direct.data).map(|rgb| rgb.map(f32::to_bits)).collect()
    };
    let (expected, found) = (bits(&expected), bits(&found));
    let differing = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0, "{}: pixels of {} that differ", scene.name, expected.len());
    assert!(expected.iter().any(|rgb| *rgb != [0; 3]), "{}: the image is black", scene.name);
}
