//! The denoiser beside our own reconstruction: it takes noise away, its guides have a say, and a build without it
//! says so.

use assert_cmd::cargo::cargo_bin;
use gdpt::analyze::metrics::compare;
use gdpt::denoise;
use gdpt::film::Plane;
use gdpt::store::exr;
use std::path::Path;
use std::process::{Command, Output};

const SKIPPED: &str =
    "skipped: built without the denoiser; OIDN_DIR=... cargo test --release --features denoise";

fn render(folder: &Path, more: &[&str]) -> Output {
    let common = ["render", "builtin:cornell-box", "--size", "96x96", "--integrator", "pt", "-q"];
    let mut command = Command::new(cargo_bin!("gdpt"));
    command.current_dir(folder).args(common).args(more).output().expect("the program starts")
}

fn read(folder: &Path, name: &str) -> Plane {
    exr::read_file(&folder.join(name)).expect("an image of our own").plane("").expect("colours")
}

#[test]
fn takes_noise_away_and_leaves_the_image_as_it_is() {
    let folder = tempfile::tempdir().expect("a private folder");
    let path = folder.path();
    if !denoise::AVAILABLE {
        let refused = render(path, &["-o", "a.exr", "--denoise", "b.exr"]);
        let text = String::from_utf8_lossy(&refused.stderr);
        assert!(refused.status.code() == Some(2) && text.contains("--features denoise"), "{text}");
        println!("{SKIPPED}");
        return;
    }
    let noisy = render(path, &["--spp", "8", "-o", "a.exr", "--denoise", "b.exr"]);
    assert!(noisy.status.success(), "{}", String::from_utf8_lossy(&noisy.stderr));
    assert!(render(path, &["--spp", "8", "-o", "plain.exr"]).status.success());
    assert!(render(path, &["--spp", "2048", "--seed", "1", "-o", "reference.exr"]).status.success());
    assert_eq!(read(path, "a.exr"), read(path, "plain.exr"), "the image itself is not denoised");
    let reference = read(path, "reference.exr");
    let error = |name| compare(&read(path, name), &reference).expect("one size");
    let (before, after) = (error("a.exr"), error("b.exr"));
    assert!(after.rel_mse < 0.3 * before.rel_mse, "{} after {}", after.rel_mse, before.rel_mse);
    assert!(after.nan_pixels == 0 && after.mean_difference.abs() < 0.05, "{}", after.mean_difference);
    let document = exr::read_file(&path.join("b.exr")).expect("an image of our own");
    assert_eq!(document.attributes.get("gdpt/denoiser").map(String::as_str), Some("oidn"));
    assert_eq!(document.attributes.get("gdpt/norm").map(String::as_str), Some("none"));
}

#[test]
fn guides_have_a_say() {
    if !denoise::AVAILABLE {
        println!("{SKIPPED}");
        return;
    }
    // Noise about a checkerboard that the albedo shows: with it the edges stay.
    let (width, height) = (96, 96);
    let board = |x: usize, y: usize| if (x / 3 + y / 3).is_multiple_of(2) { 0.2 } else { 0.7 };
    let noise = |i: usize| (gdpt::math::sampler::hash(i as u32, 7) as f32 / 2f32.powi(32) - 0.5) * 3.0;
    let truth = Plane::from_fn(width, height, |x, y| [board(x, y); 3]);
    let image =
        Plane::from_fn(width, height, |x, y| [(board(x, y) * (1.0 + noise(y * width + x))).max(0.0); 3]);
    let normal = Plane::from_fn(width, height, |_, _| [0.0, 0.0, 1.0]);
    let flat = Plane::from_fn(width, height, |_, _| [0.5; 3]);
    let error = |albedo: &Plane| {
        let image = denoise::image(&image, albedo, &normal).expect("the library is there");
        compare(&image, &truth).expect("one size").mse
    };
    let (guided, blind) = (error(&truth), error(&flat));
    assert!(guided < 0.5 * blind, "with albedo {guided}, without {blind}");
}
