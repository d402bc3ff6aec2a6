//! S1: each warp has the density it claims and undoes with its inverse.

use crate::Random;
use crate::chi_square::assert_follows;
use gdpt::math::warp::{
    cosine_hemisphere_pdf, square_to_cosine_hemisphere, square_to_disk, square_to_triangle,
};
use gdpt::math::{LANES, f32x16};
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

const ROWS: usize = 101;
const COLUMNS: usize = 202;
const SAMPLES: usize = 1_000_000;

/// Histogram of pairs that ought to be uniform over the unit square.
fn assert_uniform(what: &str, mut pair: impl FnMut(f32x16, f32x16) -> [(f32, f32); LANES]) {
    let mut random = Random::new(1);
    let mut counts = vec![0.0; ROWS * COLUMNS];
    for _ in 0..SAMPLES / LANES {
        for (a, b) in pair(random.wide(), random.wide()) {
            assert!((0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b), "{what}: {a} {b}");
            let row = ((a * ROWS as f32) as usize).min(ROWS - 1);
            let column = ((b * COLUMNS as f32) as usize).min(COLUMNS - 1);
            counts[row * COLUMNS + column] += 1.0;
        }
    }
    let expected = vec![(SAMPLES / LANES * LANES) as f64 / counts.len() as f64; counts.len()];
    assert_follows(what, &counts, &expected, 3);
}

/// Angle over a full turn, in 0..1.
fn turn(x: f32, y: f32) -> f32 {
    (y.atan2(x) / TAU).rem_euclid(1.0)
}

#[test]
fn disk_is_uniform() {
    assert_uniform("disk", |u, v| {
        let (x, y) = square_to_disk(u, v);
        let (x, y) = (x.to_array(), y.to_array());
        std::array::from_fn(|i| ((x[i] * x[i] + y[i] * y[i]).min(1.0), turn(x[i], y[i])))
    });
}

#[test]
fn hemisphere_is_cosine_weighted() {
    assert_uniform("hemisphere", |u, v| {
        let w = square_to_cosine_hemisphere(u, v);
        std::array::from_fn(|i| {
            let w = w.lane(i);
            assert!((w.length() - 1.0).abs() < 1e-5 && w.z > 0.0);
            ((w.z * w.z).min(1.0), turn(w.x, w.y))
        })
    });
    let integral: f64 = (0..1000)
        .map(|i| f64::from(cosine_hemisphere_pdf(f32x16::splat((i as f32 + 0.5) / 1000.0)).as_array()[0]))
        .sum();
    assert!((integral / 1000.0 * std::f64::consts::TAU - 1.0).abs() < 1e-5);
}

#[test]
fn triangle_is_uniform() {
    assert_uniform("triangle", |u, v| {
        let (b1, b2) = square_to_triangle(u, v);
        let (b1, b2) = (b1.to_array(), b2.to_array());
        std::array::from_fn(|i| {
            let s = b1[i] + b2[i];
            assert!(b1[i] >= 0.0 && b2[i] >= 0.0 && s <= 1.0);
            ((s * s).min(1.0), if s > 0.0 { (b2[i] / s).min(1.0) } else { 0.0 })
        })
    });
}

/// The square point of a disk point.
fn disk_to_square(x: f32, y: f32) -> (f32, f32) {
    let r = x.hypot(y);
    let phi = y.atan2(x);
    let (a, b) = if x.abs() > y.abs() {
        let r = r.copysign(x);
        let phi = if x < 0.0 { if phi < 0.0 { phi + PI } else { phi - PI } } else { phi };
        (r, r * phi / FRAC_PI_4)
    } else {
        let r = r.copysign(y);
        let phi = if y < 0.0 { phi + PI } else { phi };
        (r * (FRAC_PI_2 - phi) / FRAC_PI_4, r)
    };
    (0.5 * (a + 1.0), 0.5 * (b + 1.0))
}

#[test]
fn inverses_undo_the_warps() {
    let mut random = Random::new(2);
    for _ in 0..10_000 {
        let (u, v) = (random.wide(), random.wide());
        let (x, y) = square_to_disk(u, v);
        let w = square_to_cosine_hemisphere(u, v);
        let (b1, b2) = square_to_triangle(u, v);
        for i in 0..LANES {
            let (u, v) = (u.as_array()[i], v.as_array()[i]);
            let close = |what: &str, (a, b): (f32, f32)| {
                assert!((a - u).abs() < 1e-5 && (b - v).abs() < 1e-5, "{what}: {a} {b} for {u} {v}");
            };
            close("disk", disk_to_square(x.as_array()[i], y.as_array()[i]));
            close("hemisphere", disk_to_square(w.lane(i).x, w.lane(i).y));
            let (b1, b2) = (b1.as_array()[i], b2.as_array()[i]);
            close("triangle", if b2 > b1 { (2.0 * b1, b1 + b2) } else { (b1 + b2, 2.0 * b2) });
        }
    }
}
