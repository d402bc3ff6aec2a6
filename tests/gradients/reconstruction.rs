//! End to end: the mean over seeds of the L2 reconstruction is the path-traced image (T13). The L1 reconstruction is
//! biased by design; how much is printed and bounded.

use super::common::scenes::{self, TestScene};
use super::common::seeds::{Runs, z_score};
use super::common::{accel, render, settings};
use gdpt::film::{Film, Half};
use gdpt::integrate::Kind;
use gdpt::reconstruct::{Alpha, Input, Method, reconstruct};

fn image(film: &Film, method: Method) -> Vec<[f32; 3]> {
    reconstruct(&Input::new(&film.measured(Half::Both)), method, Alpha::Fixed(0.2)).image.data
}

fn check(scene: TestScene) {
    let accel = accel(&scene);
    let (mut l2, mut l1, mut truth) = (Runs::default(), Runs::default(), Runs::default());
    for seed in 0..64 {
        let (film, _) = render(&scene, &accel, &settings(&scene, Kind::GradientPath, seed, scene.spp));
        l2.push(&image(&film, Method::L2));
        l1.push(&image(&film, Method::L1));
        let reference = settings(&scene, Kind::Path, seed + 1_000_000, scene.reference_spp);
        truth.push(&render(&scene, &accel, &reference).0.primal(Half::Both).data);
    }
    let z: Vec<f64> = (0..l2.len()).map(|e| z_score(l2.entry(e), truth.entry(e), 1e-6)).collect();
    let outside = z.chunks(3).filter(|rgb| rgb.iter().any(|z| z.abs() > 4.0)).count();
    let everything: Vec<(usize, f64)> = (0..l2.len()).map(|e| (e, 1.0 / l2.len() as f64)).collect();
    let (mean, expected) = (l2.functional(&everything), truth.functional(&everything));
    let total = z_score(mean, expected, 0.0);
    let bias = l1.functional(&everything).mean / expected.mean - 1.0;
    let report = format!(
        "{}: {outside} pixels of L2 beyond 4, mean {:.6} for {:.6} (z {total:.2}); L1 is {:+.3}% off",
        scene.name,
        mean.mean,
        expected.mean,
        100.0 * bias
    );
    println!("{report}");
    let pixels = l2.len() / 3;
    assert!(outside <= pixels.div_ceil(10_000), "{report}");
    assert!(total.abs() < 4.0, "{report}");
    assert!(bias.abs() < 0.01, "{report}");
}

#[test]
fn l2_is_unbiased_in_a_diffuse_box() {
    check(scenes::diffuse_box());
}

#[test]
fn l2_is_unbiased_through_glass() {
    check(scenes::rough_glass_outside());
    check(scenes::smooth_glass());
}

#[test]
fn l2_is_unbiased_under_an_environment() {
    check(scenes::environment_occluders());
}
