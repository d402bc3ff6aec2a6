//! The weighted image, cleaned where its own noise says so: what is left of the noise sits in single pixels along
//! silhouettes and in corners, where every shift fails and the primal and all four differences of a pixel hang on the
//! same samples. No weighting of the rows can mend that; the neighbours can.
//!
//! A regression on features of the first hit (albedo, normal, position) over small windows predicts each pixel,
//! [`super::regression`]. The detail it misses, d = image − prediction, is kept to the extent that it is real: with
//! d_A and d_B from the images of the independent halves, S = E[d_A d_B] is the power of the true detail (the noise of
//! the halves is independent), V = E[(d_A − d_B)²]/4 that of the noise, and k = S/(S + V) is Wiener's factor. As the
//! number of samples grows V vanishes and k goes to one: the image is consistent, whatever the features miss. S comes
//! from a wide neighbourhood, V from a narrow one, so that a single bad pixel gives way to its neighbours.
//!
//! Two rounds, with growing windows. Given k the image is linear in the planes.

use super::noise::smooth;
use super::regression::{FEATURES, Guide, regress};
use crate::film::{Features, Plane};
use rayon::prelude::*;

/// Radii of the windows, pixels, round by round.
const RADII: [usize; 2] = [1, 3];
/// Standard deviation of the neighbourhood of S, pixels.
const WIDE: f32 = 2.0;
/// The same of V.
const NARROW: f32 = 0.7;
/// V is at least this share of what it is in the wide neighbourhood.
const SHARE: f32 = 0.6;
/// Distance of neighbouring pixels' positions in the features: small against the range of normals and albedo.
const STEP: f32 = 0.007;
/// Variance at which a pixel has half a say in the regression, in medians.
const DOUBT: f32 = 3.0;

/// Cleans the images of two halves. Returns the square of the error that the shrinkage adds, for each pixel.
pub(super) fn clean(features: &Features, halves: &mut [Plane; 2]) -> Vec<f32> {
    let (width, height) = (halves[0].width, halves[0].height);
    let variance = per_pixel(halves, |a, b| (0.5 * (a - b)).powi(2));
    let wide = smooth(&variance, width, 1.0, 1.0);
    let mut sorted: Vec<f32> = wide.iter().copied().filter(|v| *v > 0.0).collect();
    let mut added = vec![0.0; variance.len()];
    if sorted.is_empty() {
        return added;
    }
    let middle = sorted.len() / 2;
    let doubt = DOUBT * *sorted.select_nth_unstable_by(middle, f32::total_cmp).1;
    let weights = wide.par_iter().zip(&variance).map(|(w, v)| doubt / (w.max(0.3 * v) + doubt)).collect();
    let guide = Guide { width, height, features: prepare(features, width), weights };
    for radius in RADII {
        let predicted = regress(&guide, [&halves[0], &halves[1]], radius);
        shrink(halves, &predicted, &mut added);
    }
    added
}

/// A figure of each pixel: the mean over the channels.
fn per_pixel([a, b]: &[Plane; 2], f: impl Fn(f32, f32) -> f32 + Sync) -> Vec<f32> {
    let mean = |(a, b): (&[f32; 3], &[f32; 3])| (f(a[0], b[0]) + f(a[1], b[1]) + f(a[2], b[2])) / 3.0;
    a.data.par_iter().zip(&b.data).map(mean).collect()
}

/// Moves both images towards their predictions.
fn shrink(halves: &mut [Plane; 2], predicted: &[Plane; 2], added: &mut [f32]) {
    let width = halves[0].width;
    let detail = [0, 1].map(|i| {
        let data = halves[i].data.par_iter().zip(&predicted[i].data);
        let data = data.map(|(x, p)| std::array::from_fn(|c| x[c] - p[c])).collect();
        Plane { data, ..Plane { width, height: halves[i].height, data: Vec::new() } }
    });
    let power = smooth(&per_pixel(&detail, |a, b| a * b), width, WIDE, WIDE);
    let noise = per_pixel(&detail, |a, b| (0.5 * (a - b)).powi(2));
    let (narrow, wide) = (smooth(&noise, width, NARROW, NARROW), smooth(&noise, width, WIDE, WIDE));
    let keep: Vec<f32> = power
        .par_iter()
        .zip(narrow.par_iter().zip(&wide))
        .map(|(s, (narrow, wide))| {
            let (s, v) = (s.max(0.0), narrow.max(SHARE * wide));
            if v > 0.0 { s / (s + v) } else { 1.0 }
        })
        .collect();
    for (half, (detail, predicted)) in halves.iter_mut().zip(detail.iter().zip(predicted)) {
        let sources = keep.par_iter().zip(&detail.data).zip(&predicted.data);
        half.data.par_iter_mut().zip(sources).for_each(|(x, ((k, d), p))| {
            *x = std::array::from_fn(|c| p[c] + k * d[c]);
        });
    }
    added.par_iter_mut().zip(keep.par_iter().zip(&power)).for_each(|(added, (k, s))| {
        *added = k * k * *added + (1.0 - k).powi(2) * s.max(0.0);
    });
}

/// The features of the regression: grey albedo, normal, position in steps of the median distance of neighbours.
fn prepare(features: &Features, width: usize) -> Vec<[f32; FEATURES]> {
    let position = &features.position.data;
    let hit = |i: usize| features.coverage[i] > 0.0 && position[i].iter().all(|v| v.is_finite());
    let pixels = position.len();
    let stride = (pixels >> 16).max(1);
    let neighbours = (0..pixels).step_by(stride).filter(|&i| i % width + 1 < width && hit(i) && hit(i + 1));
    let mut distances: Vec<f32> = neighbours
        .map(|i| (0..3).map(|c| (position[i + 1][c] - position[i][c]).powi(2)).sum::<f32>().sqrt())
        .collect();
    let middle = distances.len() / 2;
    let median =
        if distances.is_empty() { 0.0 } else { *distances.select_nth_unstable_by(middle, f32::total_cmp).1 };
    let scale = if median > 0.0 { STEP / median } else { 0.0 };
    let first = (0..pixels).find(|&i| hit(i)).map_or([0.0; 3], |i| position[i]);
    (0..pixels)
        .into_par_iter()
        .map(|i| {
            let (albedo, normal) = (features.albedo.data[i], features.normal.data[i]);
            let place = if hit(i) { position[i] } else { first };
            let place: [f32; 3] = std::array::from_fn(|c| scale * (place[c] - first[c]));
            let all = [
                (albedo[0] + albedo[1] + albedo[2]) / 3.0,
                normal[0],
                normal[1],
                normal[2],
                place[0],
                place[1],
                place[2],
            ];
            all.map(|v| if v.is_finite() { v } else { 0.0 })
        })
        .collect()
}
