//! What the statistical tests share: scenes built in code, renders of them, statistics over seeds.

pub mod scenes;
pub mod seeds;
pub mod shapes;

use gdpt::accel::{Accel, EmbreeAccel};
use gdpt::film::{Film, Half, Plane};
use gdpt::integrate::{Kind, Settings, ShadeScene, Statistics, run};
use scenes::TestScene;
use std::sync::atomic::AtomicBool;

/// The backend of the statistical tests.
pub fn accel(scene: &TestScene) -> impl Accel {
    EmbreeAccel::new(&scene.scene, 1, true, None).expect("Embree builds small scenes")
}

/// The settings a test scene asks for.
pub fn settings(scene: &TestScene, kind: Kind, seed: u64, spp: u32) -> Settings {
    let [width, height] = scene.size;
    let (max_depth, shift_threshold) = (scene.max_depth, scene.shift_threshold);
    Settings { kind, width, height, spp, seed, max_depth, shift_threshold, ..Settings::default() }
}

/// Renders; no sample may be dropped.
pub fn render<A: Accel>(scene: &TestScene, accel: &A, settings: &Settings) -> (Film, Statistics) {
    let never = AtomicBool::new(false);
    let prepared = ShadeScene::new(&scene.scene);
    let (film, statistics) = run(&prepared, accel, &scene.camera, settings, &|_, _| (), &never);
    assert_eq!(film.dropped_samples, 0, "{}: samples that are not finite", scene.name);
    (film, statistics)
}

/// One of the two gradient images as a list: x differences of all pairs, then y differences.
pub fn gradients(film: &Film) -> Vec<[f32; 3]> {
    let (dx, dy) = (film.dx(Half::Both), film.dy(Half::Both));
    pairs(film.width, film.height)
        .map(|p| if p.horizontal { dx.at(p.x, p.y) } else { dy.at(p.x, p.y) })
        .collect()
}

/// The finite differences of an image in the order of [`gradients`].
pub fn differences(image: &Plane) -> Vec<[f32; 3]> {
    pairs(image.width, image.height)
        .map(|p| {
            let (a, b) = (
                image.at(p.x, p.y),
                if p.horizontal { image.at(p.x + 1, p.y) } else { image.at(p.x, p.y + 1) },
            );
            std::array::from_fn(|c| b[c] - a[c])
        })
        .collect()
}

/// A pair of neighbours; (x, y) is its left or upper pixel.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Towards x + 1, else y + 1.
    pub horizontal: bool,
}

/// All pairs of neighbours of an image: the horizontal ones first, row by row.
pub fn pairs(width: usize, height: usize) -> impl Iterator<Item = Pair> {
    let list = move |horizontal: bool| {
        let (w, h) = if horizontal { (width - 1, height) } else { (width, height - 1) };
        (0..w * h).map(move |i| Pair { x: i % w, y: i / w, horizontal })
    };
    list(true).chain(list(false))
}
