//! Path tracing against Mitsuba 3: the scenes and images of tests/reference.
//!
//! For each scene: the relative difference of the mean radiance is below 0.3 %; no block of 8×8 pixels differs
//! significantly (α = 0.01 over all blocks and channels, both standard errors taken into account); nor does the whole
//! image in any channel (|z| < 4). The block test must notice our own image with one percent of its light taken away.

#[path = "common/stats.rs"]
mod stats;

use crate::stats::{Estimate, block_means, largest, sidak_threshold, worst, z_scores};
use exr::prelude::*;
use gdpt::accel::EmbreeAccel;
use gdpt::film::Half;
use gdpt::integrate::{self, Kind, Settings, ShadeScene};
use gdpt::scene::{self, Environment};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Independent renderings, and samples a pixel of each.
const RUNS: u64 = 32;
const SPP: u32 = 128;
/// Pixels a side of a block.
const SIDE: usize = 8;
/// Largest relative difference of the means.
const TOLERANCE: f64 = 0.003;
/// Largest |z| of the mean of a channel.
const GLOBAL_Z: f64 = 4.0;

/// What Mitsuba rendered.
struct Reference {
    image: Estimate,
    max_depth: u32,
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

fn read_reference(name: &str) -> Reference {
    let path = folder().join(format!("{name}.exr"));
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let layer = &image.layer_data;
    let plane = |prefix: &str| -> Vec<[f64; 3]> {
        let channels = ["R", "G", "B"].map(|c| {
            let name = format!("{prefix}.{c}");
            let list = &layer.channel_data.list;
            let channel = list.iter().find(|channel| channel.name.eq(name.as_str()));
            let samples = &channel.unwrap_or_else(|| panic!("no channel {name}")).sample_data;
            samples.values_as_f32().map(f64::from).collect::<Vec<_>>()
        });
        (0..channels[0].len()).map(|i| [0, 1, 2].map(|c: usize| channels[c][i])).collect()
    };
    let attributes = image.attributes.other.iter().chain(&layer.attributes.other);
    let max_depth = attributes
        .filter(|(key, _)| **key == *"maxDepth")
        .find_map(
            |(_, value)| if let AttributeValue::I32(depth) = value { Some(*depth as u32) } else { None },
        )
        .expect("render.py writes maxDepth");
    Reference {
        image: Estimate {
            width: layer.size.width(),
            height: layer.size.height(),
            mean: plane("mean"),
            sem: plane("sem"),
            // At least 32 runs: what is tested are sums over many pixels, whose errors are independent.
            freedom: 31.0,
        },
        max_depth,
    }
}

/// Independent renderings of the scene, very direct light included.
fn render(name: &str, reference: &Reference) -> Vec<Vec<[f32; 3]>> {
    let mut scene = scene::load(&folder().join(format!("{name}.glb")), &Default::default())
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.report.warnings.is_empty(), "{name}: {:?}", scene.report.warnings);
    let sky = folder().join(format!("{name}-sky.exr"));
    if sky.exists() {
        scene.environment =
            Some(Environment::load(&sky, 1.0, 0.0, true).unwrap_or_else(|error| panic!("{error}")));
    }
    let accel = EmbreeAccel::new(&scene, 0, false, None).expect("a small scene");
    let settings = |seed| Settings {
        kind: Kind::Path,
        width: reference.image.width as u32,
        height: reference.image.height as u32,
        spp: SPP,
        max_depth: reference.max_depth,
        seed,
        ..Settings::default()
    };
    let prepared = ShadeScene::new(&scene);
    (0..RUNS)
        .map(|seed| {
            let never = AtomicBool::new(false);
            let (film, _) =
                integrate::run(&prepared, &accel, &scene.cameras[0], &settings(seed), &|_, _| (), &never);
            assert_eq!(film.dropped_samples, 0, "{name}: samples that are not finite");
            let (primal, direct) = (film.primal(Half::Both).data, film.direct().data);
            primal.iter().zip(&direct).map(|(p, d)| std::array::from_fn(|c| p[c] + d[c])).collect()
        })
        .collect()
}

fn compare(name: &str) {
    let reference = read_reference(name);
    let (width, height) = (reference.image.width, reference.image.height);
    let runs = render(name, &reference);
    // Means over blocks before the spread over runs: pixels may share random numbers.
    let in_blocks = |side: usize| {
        let runs: Vec<_> = runs.iter().map(|run| block_means(width, height, run, side)).collect();
        Estimate::from_runs(width / side, height / side, &runs)
    };
    let (ours, theirs) = (in_blocks(SIDE), reference.image.blocks(SIDE));
    let scores = z_scores(&ours, &theirs);
    let threshold = sidak_threshold(0.01, 3 * scores.len());
    let whole = z_scores(&in_blocks(width), &reference.image.blocks(width));
    let relative = ours.grand_mean() / theirs.grand_mean() - 1.0;
    let (cell, channel, z) = worst(&scores);
    let (x, y) = (cell % ours.width * SIDE, cell / ours.width * SIDE);
    let report = format!(
        "{name}: mean {:.5} against {:.5} ({:+.3} %), z of the whole {:+.2?}; worst block ({x}, {y}), channel \
         {channel}: {:.5} against {:.5}, z = {z:+.2}, threshold {threshold:.2}",
        ours.grand_mean(),
        theirs.grand_mean(),
        100.0 * relative,
        whole[0],
        ours.mean[cell][channel],
        theirs.mean[cell][channel],
    );
    println!("{report}");
    let found = largest(&z_scores(&ours.scaled(0.99), &theirs)) > threshold;
    assert!(found, "{name}: one percent less light goes unnoticed");
    assert!(relative.abs() < TOLERANCE, "{report}");
    assert!(largest(&whole) < GLOBAL_Z, "{report}");
    assert!(z.abs() < threshold, "{report}");
}

macro_rules! scenes {
    ($($name:ident: $what:literal,)*) => {$(
        #[doc = $what]
        #[test]
        fn $name() {
            compare(stringify!($name));
        }
    )*};
}

scenes! {
    cornell: "Diffuse surfaces and an area light.",
    metal: "A white metal of roughness 0.4 and a mirror.",
    glass: "Solid glass, smooth and of roughness 0.4.",
    textured: "Textures, interpolated normals, an environment with a bright spot.",
    lights: "Point, spot and directional light.",
    pane: "A thin dielectric.",
    leaves: "Surfaces that alpha opens.",
    twosided: "Walls seen from behind and a smooth-shaded ball.",
}
