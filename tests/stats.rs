//! The statistics that other tests rely on, held against tables and against noise of known spread.

#[path = "common/stats.rs"]
mod stats;

use crate::stats::{Estimate, block_means, largest, normal_of_t, sidak_threshold, worst, z_scores};
use gdpt::math::sampler::hash;

/// Sum of twelve hashed uniforms: near enough to normal, mean 0, variance 1.
fn noise(run: u32, cell: u32) -> f32 {
    (0..12).map(|k| hash(hash(run, cell), k) as f32 / 4_294_967_296.0).sum::<f32>() - 6.0
}

fn noisy(seed: u32, runs: u32, mean: f32) -> Estimate {
    let run = |r| (0..64 * 64).map(|i| [0, 1, 2].map(|c| mean + noise(seed + r, 3 * i + c))).collect();
    Estimate::from_runs(64, 64, &(0..runs).map(run).collect::<Vec<_>>())
}

#[test]
fn thresholds_are_those_of_the_tables() {
    assert!((sidak_threshold(0.05, 1) - 1.959_964).abs() < 1e-5);
    assert!((sidak_threshold(0.01, 1) - 2.575_829).abs() < 1e-5);
    // 1 − 0.99^(1/192) = 5.2344e-5
    assert!((sidak_threshold(0.01, 192) - 4.0443).abs() < 1e-3, "{}", sidak_threshold(0.01, 192));
    // The two-sided 95 % point of Student's t at ten degrees of freedom is 2.228139.
    assert!((normal_of_t(2.228_139, 10.0) - 1.959_964).abs() < 1e-4);
    assert!((normal_of_t(-2.228_139, 10.0) + 1.959_964).abs() < 1e-4);
}

#[test]
fn equal_images_pass_and_scores_are_standard() {
    let (a, b) = (noisy(1000, 12, 20.0), noisy(2000, 12, 20.0));
    // 12288 cells of twelve runs: the mean is known to 1/√147456 = 0.0026.
    assert!((a.grand_mean() - 20.0).abs() < 4.0 * 0.0026, "{}", a.grand_mean());
    let scores = z_scores(&a, &b);
    let variance = scores.iter().flatten().map(|z| z * z).sum::<f64>() / (3 * scores.len()) as f64;
    // 12288 scores: the standard error of their variance is √(2 / 12288) = 0.0128.
    assert!((variance - 1.0).abs() < 4.0 * 0.0128, "variance of the scores {variance}");
    assert!(largest(&scores) < sidak_threshold(0.001, 3 * scores.len()), "{:?}", worst(&scores));
    let scores = z_scores(&a.blocks(8), &b.blocks(8));
    assert!(largest(&scores) < sidak_threshold(0.001, 3 * scores.len()), "{:?}", worst(&scores));
}

#[test]
fn lost_energy_is_found() {
    let (a, b) = (noisy(1000, 12, 20.0), noisy(2000, 12, 20.0));
    let scores = z_scores(&a.scaled(0.99).blocks(8), &b.blocks(8));
    assert!(largest(&scores) > sidak_threshold(0.01, 3 * scores.len()));
}

#[test]
fn block_means_of_runs_are_blocks_of_means() {
    let run: Vec<[f32; 3]> = (0..64 * 32).map(|i| [i as f32, 1.0, noise(7, i)]).collect();
    let direct = block_means(64, 32, &run, 8);
    let estimate = Estimate::from_runs(64, 32, &[run.clone(), run]).blocks(8);
    assert_eq!((estimate.width, estimate.height), (8, 4));
    for (a, b) in direct.iter().flatten().zip(estimate.mean.iter().flatten()) {
        assert!((f64::from(*a) - b).abs() <= 1e-5 * b.abs().max(1.0));
    }
}
