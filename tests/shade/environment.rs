//! S3, environment: look-up, rotation, sampling by the table against its own pdf and against quadrature.

use crate::Random;
use crate::chi_square::assert_follows;
use gdpt::math::{LANES, Vec3x};
use gdpt::scene::{Environment, Scene};
use gdpt::shade::ShadeScene;
use glam::{DVec3, Quat, Vec3};
use std::f64::consts::{PI, TAU};

const WIDTH: u32 = 24;
const HEIGHT: u32 = 12;
const SAMPLES: usize = 1_000_000;

/// A dim sky with two suns, one at the zenith and one across the seam, and a black patch.
fn sky(rotation: f32) -> Scene {
    let texels = (0..HEIGHT)
        .flat_map(|row| (0..WIDTH).map(move |column| (row, column)))
        .map(|(row, column)| match (row, column) {
            (4, 0) | (4, 23) => Vec3::new(80.0, 60.0, 30.0),
            (0, 7) => Vec3::splat(40.0),
            (6..10, 8..14) => Vec3::ZERO,
            _ => Vec3::new(0.2, 0.3, 0.5) * (1.0 + 0.1 * column as f32),
        })
        .collect();
    let environment = Environment { width: WIDTH, height: HEIGHT, texels, rotation, visible: true };
    Scene { environment: Some(environment), ..Scene::default() }
}

/// The direction of texture coordinates, before rotation.
fn direction(u: f64, v: f64) -> Vec3 {
    let (sin_phi, cos_phi) = (TAU * u).sin_cos();
    let (sin, cos) = (PI * v).sin_cos();
    DVec3::new(sin * sin_phi, cos, -sin * cos_phi).as_vec3()
}

/// The inverse of [`direction`].
fn coordinates(d: Vec3) -> (f64, f64) {
    let d = d.as_dvec3().normalize();
    ((d.x.atan2(-d.z) / TAU).rem_euclid(1.0), d.y.clamp(-1.0, 1.0).acos() / PI)
}

#[test]
fn texel_centres_show_their_texels_turned_by_the_rotation() {
    for rotation in [0.0, 1.0, -2.5] {
        let scene = sky(rotation);
        let prepared = ShadeScene::new(&scene);
        let texels = &scene.environment.as_ref().expect("made above").texels;
        let turn = Quat::from_rotation_y(rotation);
        for (i, texel) in texels.iter().enumerate() {
            let u = ((i as u32 % WIDTH) as f64 + 0.5) / f64::from(WIDTH);
            let v = ((i as u32 / WIDTH) as f64 + 0.5) / f64::from(HEIGHT);
            let seen = prepared.lights.environment(Vec3x::splat(turn * direction(u, v))).lane(2);
            assert!((seen - *texel).length() < 1e-3, "{seen} for {texel} at {u} {v}");
        }
        // Half-way between the two texels of the seam.
        let seam = turn * direction(0.0, 4.5 / f64::from(HEIGHT));
        let seen = prepared.lights.environment(Vec3x::splat(seam)).lane(0);
        assert!((seen - Vec3::new(80.0, 60.0, 30.0)).length() < 1e-3);
    }
}

#[test]
fn directions_follow_the_pdf_and_agree_with_queries() {
    // Finer than texels, so that the density within them is tested too.
    const COLUMNS: usize = 4 * WIDTH as usize;
    const ROWS: usize = 4 * HEIGHT as usize;
    for rotation in [0.0, 1.0] {
        let scene = sky(rotation);
        let prepared = ShadeScene::new(&scene);
        let back = Quat::from_rotation_y(-rotation);
        let mut random = Random::new(31);
        let mut observed = vec![0.0; ROWS * COLUMNS];
        let mut differing = 0;
        for _ in 0..SAMPLES / LANES {
            let point = prepared.lights.sample(&prepared, random.wide(), random.wide(), random.wide());
            assert!(point.is_env.all() && point.valid.all());
            let query = prepared.lights.environment_with_pdf(point.p).1;
            for lane in 0..LANES {
                let d = point.p.lane(lane);
                assert!((d.length() - 1.0).abs() < 1e-5);
                let (u, v) = coordinates(back * d);
                let (row, column) = ((v * ROWS as f64) as usize, (u * COLUMNS as f64) as usize);
                observed[row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)] += 1.0;
                let (pdf, query) = (point.pdf.as_array()[lane], query.as_array()[lane]);
                differing += usize::from((pdf - query).abs() > 1e-4 * pdf);
            }
        }
        // A direction within rounding of a texel's edge may be queried in the neighbour.
        assert!(differing < SAMPLES / 10_000, "{differing} queries differ");
        let n = (SAMPLES / LANES * LANES) as f64;
        let mut expected = vec![0.0; ROWS * COLUMNS];
        for (i, cell) in expected.iter_mut().enumerate() {
            let u = ((i % COLUMNS) as f64 + 0.5) / COLUMNS as f64;
            // pdf · sin θ is constant over a cell, being inside one texel.
            let v = ((i / COLUMNS) as f64 + 0.5) / ROWS as f64;
            let d = Quat::from_rotation_y(rotation) * direction(u, v);
            let pdf = f64::from(prepared.lights.environment_with_pdf(Vec3x::splat(d)).1.as_array()[0]);
            *cell = n * pdf * (PI * v).sin() * TAU * PI / (ROWS * COLUMNS) as f64;
        }
        assert!((expected.iter().sum::<f64>() / n - 1.0).abs() < 1e-4, "the pdf does not integrate to 1");
        assert_follows("environment", &observed, &expected, 2);
    }
}

#[test]
fn importance_sampling_integrates_what_quadrature_does() {
    let scene = sky(0.6);
    let prepared = ShadeScene::new(&scene);
    let mut random = Random::new(41);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..SAMPLES / LANES {
        let point = prepared.lights.sample(&prepared, random.wide(), random.wide(), random.wide());
        let seen = prepared.lights.seen_from(&prepared, &point, Vec3x::ZERO);
        for lane in 0..LANES {
            let value = f64::from(seen.radiance.lane(lane).y / point.pdf.as_array()[lane]);
            sum += value;
            squares += value * value;
            assert_eq!(seen.distance.as_array()[lane], f32::INFINITY);
            assert_eq!(seen.geometry.as_array()[lane], 1.0);
            assert_eq!(seen.wi.lane(lane), point.p.lane(lane));
        }
    }
    let n = (SAMPLES / LANES * LANES) as f64;
    let mean = sum / n;
    let error = ((squares / n - mean * mean) / n).sqrt();
    const STEPS: usize = 1536;
    let mut exact = 0.0;
    for i in 0..STEPS * STEPS / 2 / LANES {
        let at = |lane: usize| {
            let i = i * LANES + lane;
            let u = ((i % STEPS) as f64 + 0.5) / STEPS as f64;
            (u, ((i / STEPS) as f64 + 0.5) / (STEPS / 2) as f64)
        };
        let radiance = prepared.lights.environment(Vec3x::lanes(|lane| direction(at(lane).0, at(lane).1)));
        exact +=
            (0..LANES).map(|lane| f64::from(radiance.lane(lane).y) * (PI * at(lane).1).sin()).sum::<f64>();
    }
    exact *= TAU * PI / (STEPS * STEPS / 2) as f64;
    assert!((mean - exact).abs() < 4.0 * error && error < 1e-3 * exact, "{mean} ± {error} for {exact}");
}

#[test]
fn a_black_environment_is_none() {
    let mut scene = sky(0.0);
    if let Some(environment) = &mut scene.environment {
        environment.texels.fill(Vec3::ZERO);
    }
    let prepared = ShadeScene::new(&scene);
    assert!(prepared.lights.is_empty() && !prepared.lights.has_environment());
    let mut random = Random::new(1);
    let (d, u) = (random.directions(), random.wide());
    assert!(prepared.lights.environment(d).is_zero().all());
    assert_eq!(prepared.lights.environment_with_pdf(d).1.to_array(), [0.0; LANES]);
    assert!(prepared.lights.sample(&prepared, u, u, u).valid.none());
}
