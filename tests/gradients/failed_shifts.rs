//! Shifts that are made to fail, from outside: a backend that hides what the ring's camera rays meet, so that the
//! offset paths over the border of a block are dead from the start.
//!
//! Hidden from both ends, a pair falls back to the difference of two independent images, exactly. Hidden by a rule
//! that both ends agree on, it stays unbiased. Hidden from one end only it must be wrong, and these statistics must
//! see it.

use super::common::scenes::{self, TestScene};
use super::common::seeds::{Runs, z_score};
use super::common::{accel, differences, gradients, pairs, render, settings};
use gdpt::accel::{Accel, Coherence, Hits, Rays, Visible};
use gdpt::film::Half;
use gdpt::integrate::{Kind, ShiftOutcome};
use gdpt::math::{Mask, Vec3x, f32x16};
use gdpt::scene::{Camera, Projection};
use glam::Vec3;

/// Which lanes of the ring to hide, from the film positions of their rays.
type Hide = fn(x: f32, y: f32, lane: usize) -> bool;

/// A backend that hides lanes of the ring.
struct Saboteur<'a, A: Accel> {
    accel: A,
    camera: &'a Camera,
    size: [u32; 2],
    hide: Hide,
}

impl<A: Accel> Saboteur<'_, A> {
    /// Film position of the pinhole camera's ray in direction `d`.
    fn film(&self, d: Vec3) -> [f32; 2] {
        let Projection::Perspective { yfov } = self.camera.projection else {
            unreachable!("a perspective camera")
        };
        let local = self.camera.to_world.matrix3.transpose() * d;
        let half_height = 0.5 * self.size[1] as f32;
        let scale = half_height / (0.5 * yfov).tan() / -local.z;
        [local.x * scale + 0.5 * self.size[0] as f32, half_height - local.y * scale]
    }

    /// In a block lane 4 is one row below lane 0, in the ring it is five.
    fn is_ring(&self, d: &Vec3x) -> bool {
        self.film(d.lane(4))[1] - self.film(d.lane(0))[1] > 2.0
    }
}

impl<A: Accel> Accel for Saboteur<'_, A> {
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits {
        let mut hits = self.accel.intersect16(rays, active, visible, coherence);
        if coherence == Coherence::Coherent && self.is_ring(&rays.direction) {
            let hidden = Mask::from_fn(|lane| {
                let [x, y] = self.film(rays.direction.lane(lane));
                (self.hide)(x, y, lane)
            });
            hits.valid = hits.valid.and_not(hidden);
        }
        hits
    }

    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Mask {
        self.accel.occluded16(rays, active, visible, coherence)
    }
}

/// Entries whose two pixels lie in different blocks.
fn across_blocks(scene: &TestScene) -> Vec<usize> {
    let [width, height] = scene.size.map(|n| n as usize);
    pairs(width, height)
        .enumerate()
        .filter(|(_, p)| if p.horizontal { p.x % 4 == 3 } else { p.y % 4 == 3 })
        .map(|(i, _)| i)
        .collect()
}

/// The worst z-score over the entries between blocks, and that of the sums over their pairs' rows and columns.
fn worst(scene: &TestScene, hide: Hide, seeds: u64) -> (f64, usize) {
    let accel = accel(scene);
    let saboteur =
        Saboteur { accel: super::common::accel(scene), camera: &scene.camera, size: scene.size, hide };
    let (mut tested, mut truth) = (Runs::default(), Runs::default());
    for seed in 0..seeds {
        let (film, _) = render(scene, &saboteur, &settings(scene, Kind::GradientPath, seed, scene.spp));
        tested.push(&gradients(&film));
        let reference = settings(scene, Kind::Path, seed + 1_000_000, scene.reference_spp);
        truth.push(&differences(&render(scene, &accel, &reference).0.primal(Half::Both)));
    }
    let z: Vec<f64> = across_blocks(scene)
        .iter()
        .flat_map(|&i| (3 * i)..(3 * i + 3))
        .map(|e| z_score(tested.entry(e), truth.entry(e), 0.0).abs())
        .collect();
    (
        z.iter().fold(0.0, |a, &b| f64::max(a, b)),
        z.chunks(3).filter(|rgb| rgb.iter().any(|&z| z > 4.0)).count(),
    )
}

/// With w = 1 everywhere the two sides add up to the primal of the same samples: NEE, BSDF and tail weights of a
/// dead offset are the path tracer's own.
fn assert_falls_back_to_the_primal(scene: TestScene) {
    let saboteur =
        Saboteur { accel: accel(&scene), camera: &scene.camera, size: scene.size, hide: |_, _, _| true };
    let (film, statistics) = render(&scene, &saboteur, &settings(&scene, Kind::GradientPath, 3, 16));
    let (measured, expected) = (gradients(&film), differences(&film.primal(Half::Both)));
    assert!(statistics.shifts[ShiftOutcome::NoPrimaryHit as usize] > 0);
    let scale = film.primal(Half::Both).data.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
    for i in across_blocks(&scene) {
        for c in 0..3 {
            let error = (measured[i][c] - expected[i][c]).abs();
            assert!(
                error <= 2e-6 * scale,
                "{}: entry {i}: {} is not {}",
                scene.name,
                measured[i][c],
                expected[i][c]
            );
        }
    }
}

#[test]
fn all_shifts_failing_leave_the_difference_of_two_images() {
    assert_falls_back_to_the_primal(scenes::diffuse_box());
    assert_falls_back_to_the_primal(scenes::deep_white_box());
    assert_falls_back_to_the_primal(scenes::glossy_emitters());
    assert_falls_back_to_the_primal(scenes::plastic_coat());
    assert_falls_back_to_the_primal(scenes::glossy_metals());
    assert_falls_back_to_the_primal(scenes::rough_glass_outside());
    assert_falls_back_to_the_primal(scenes::absorption());
    assert_falls_back_to_the_primal(scenes::alpha_blend());
    assert_falls_back_to_the_primal(scenes::spot_light());
    assert_falls_back_to_the_primal(scenes::environment_occluders());
}

#[test]
fn shifts_failing_by_a_rule_of_the_pair_stay_unbiased() {
    let scene = scenes::diffuse_box();
    // Base and offset share the position in the pixel, so both ends see the same rule.
    let (z, outside) = worst(&scene, |x, _, _| x.rem_euclid(1.0) < 0.5, 48);
    println!("symmetric failures: worst z {z:.2}, {outside} entries beyond 4");
    assert!(outside <= 1 && z < 5.0, "symmetric failures bias: worst z {z:.2}, {outside} beyond 4");
}

#[test]
fn shifts_failing_from_one_end_only_are_detected() {
    let scene = scenes::diffuse_box();
    let (z, outside) = worst(&scene, |_, _, lane| lane < 4, 16);
    println!("one-sided failures: worst z {z:.2}, {outside} entries beyond 4");
    assert!(outside > 5, "one-sided failures went unseen: worst z {z:.2}, {outside} beyond 4");
}

#[test]
fn the_saboteur_knows_film_positions() {
    let scene = scenes::penumbra();
    let saboteur =
        Saboteur { accel: accel(&scene), camera: &scene.camera, size: scene.size, hide: |_, _, _| false };
    let [width, height] = scene.size;
    let at = |x: f32| f32x16::splat(x);
    let rays = scene.camera.rays(at(3.25), at(7.5), width, height, at(0.5), at(0.5));
    let [x, y] = saboteur.film(rays.direction.lane(0));
    assert!((x - 3.25).abs() < 1e-3 && (y - 7.5).abs() < 1e-3, "({x}, {y})");
}
