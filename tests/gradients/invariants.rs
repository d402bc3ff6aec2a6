//! What must hold of any image: exact zeros, furnaces, symmetry, borders, sampler, roulette, threads.

use super::common::scenes::{self, TestScene};
use super::common::seeds::{Runs, estimate, z_score};
use super::common::shapes::*;
use super::common::{Pair, accel, differences, gradients, pairs, render, settings};
use gdpt::film::{Half, Plane};
use gdpt::integrate::{Kind, Settings};
use gdpt::math::sampler::sample_4d;
use gdpt::scene::{Camera, Material, Projection};
use glam::{Affine3A, Vec3};

/// Bound on z-scores.
const Z: f64 = 4.0;

fn gradient_settings(scene: &TestScene, seed: u64, spp: u32) -> Settings {
    settings(scene, Kind::GradientPath, seed, spp)
}

/// Mean over the image and channels.
fn mean(image: &Plane) -> f64 {
    image.data.iter().flatten().map(|&v| f64::from(v)).sum::<f64>() / (3 * image.data.len()) as f64
}

/// A wall that fills the view.
fn lone_wall(material: Material) -> Builder {
    let mut b = Builder::default();
    b.quad(v(-9.0, -9.0, 0.0), v(18.0, 0.0, 0.0), v(0.0, 18.0, 0.0), material);
    b
}

fn facing() -> Camera {
    camera(v(0.3, 0.2, 2.0), v(0.0, 0.0, 0.0), 50.0)
}

// T7

#[test]
fn lone_plane_under_an_environment_has_gradients_of_exactly_zero() {
    for visible_spot in [0.0, 20.0] {
        let mut b = lone_wall(diffuse(0.8, 0.5, 0.3));
        b.environment(8, 4, |x, y| {
            Vec3::ONE + if (x, y) == (2, 1) { Vec3::splat(visible_spot) } else { Vec3::ZERO }
        });
        let scene = TestScene::new("lone_plane", b.scene, facing(), 6);
        let (film, _) = render(&scene, &accel(&scene), &gradient_settings(&scene, 5, 64));
        assert!(gradients(&film).iter().flatten().all(|&g| g == 0.0), "gradients that are not exactly zero");
        for direction in gdpt::film::Direction::ALL {
            assert!(film.gradient_square(direction).iter().all(|&g| g == 0.0), "a sample was not zero");
        }
        assert!(mean(&film.primal(Half::Both)) > 0.1);
    }
}

#[test]
fn parallel_view_of_a_plane_under_directional_light_is_constant() {
    let mut b = lone_wall(diffuse(0.8, 0.5, 0.3));
    b.light(gdpt::scene::PunctualKind::Directional, Vec3::ZERO, v(0.3, -0.5, -1.0), Vec3::splat(2.0));
    let camera = Camera { projection: Projection::Orthographic { ymag: 1.0 }, ..facing() };
    let scene = TestScene::new("parallel_view", b.scene, camera, 4);
    let (film, _) = render(&scene, &accel(&scene), &gradient_settings(&scene, 5, 16));
    assert!(gradients(&film).iter().flatten().all(|&g| g == 0.0));
    assert!(mean(&film.primal(Half::Both)) > 0.1);
}

// T8, S4, T16

/// The inside of an emitting, reflecting sphere: radiance emission / (1 − albedo) everywhere.
fn furnace(albedo: f32, max_depth: u32) -> TestScene {
    let mut b = Builder::default();
    let wall = b.material(Material { emission: Vec3::splat(0.5), ..diffuse(albedo, albedo, albedo) });
    let mut inside = sphere(Vec3::ZERO, 1.0, 12, false, wall);
    inside.triangles = inside.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    b.mesh(inside);
    let view = camera(v(0.1, 0.2, 0.3), v(-0.3, 0.0, -1.0), 70.0);
    TestScene { size: [16, 16], ..TestScene::new("furnace", b.scene, view, max_depth) }
}

#[test]
fn furnace_is_one_everywhere() {
    let scene = furnace(0.5, 64);
    let accel = accel(&scene);
    let (mut primal, mut gradient) = (Runs::default(), Runs::default());
    let seeds = 16;
    for seed in 0..seeds {
        let (film, _) = render(&scene, &accel, &gradient_settings(&scene, seed, 4096 / seeds as u32));
        let (p, d) = (film.primal(Half::Both), film.direct());
        let total: Vec<_> =
            p.data.iter().zip(&d.data).map(|(p, d)| std::array::from_fn(|c| p[c] + d[c])).collect();
        primal.push(&total);
        gradient.push(&gradients(&film));
    }
    let over = |select: &dyn Fn(usize, usize) -> bool| {
        let chosen = (0..256).filter(|i| select(i % 16, i / 16));
        let entries: Vec<usize> = chosen.map(|i| 3 * i).collect();
        let weight = 1.0 / entries.len() as f64;
        primal.functional(&entries.iter().map(|&e| (e, weight)).collect::<Vec<_>>())
    };
    let edge = |x: usize, y: usize| x == 0 || y == 0 || x == 15 || y == 15;
    let corner = |x: usize, y: usize| (x == 0 || x == 15) && (y == 0 || y == 15);
    let (all, edges, corners) = (over(&|_, _| true), over(&edge), over(&corner));
    println!("furnace: {:.5} ± {:.5}", all.mean, all.variance.sqrt());
    assert!((all.mean - 1.0).abs() < 0.002, "mean {}", all.mean);
    for (name, part) in [("edges", edges), ("corners", corners)] {
        let z = (part.mean - 1.0) / part.variance.sqrt();
        assert!(z.abs() < Z, "{name}: {} with z {z:.2}", part.mean);
    }
    let zero = zero_mean(&gradient);
    println!("furnace gradients: mean {:.2e}, z {:.2}", zero.0, zero.1);
    assert!(zero.1.abs() < Z, "gradients of a constant image: mean {:.2e}, z {:.2}", zero.0, zero.1);
}

/// Mean of all entries and its z-score against zero.
fn zero_mean(runs: &Runs) -> (f64, f64) {
    let weight = 1.0 / runs.len() as f64;
    let all = runs.functional(&(0..runs.len()).map(|e| (e, weight)).collect::<Vec<_>>());
    (all.mean, if all.mean == 0.0 { 0.0 } else { all.mean / all.variance.sqrt() })
}

#[test]
fn longest_path_ends_the_sum_of_layers() {
    for max_depth in [1, 2, 3, 4, 7, 12] {
        let scene = TestScene { size: [8, 8], ..furnace(0.7, max_depth) };
        let accel = accel(&scene);
        let values = (0..12).map(|seed| {
            let (film, _) = render(&scene, &accel, &gradient_settings(&scene, seed, 64));
            mean(&film.primal(Half::Both)) + mean(&film.direct())
        });
        let found = estimate(values.collect::<Vec<_>>().into_iter());
        let expected: f64 = (0..max_depth).map(|k| 0.5 * 0.7_f64.powi(k as i32)).sum();
        let z = (found.mean - expected) / found.variance.sqrt().max(1e-7);
        println!("depth {max_depth}: {:.5} for {expected:.5}, z {z:.2}", found.mean);
        assert!(z.abs() < Z, "depth {max_depth}: {} for {expected}, z {z:.2}", found.mean);
    }
}

#[test]
fn lossless_surfaces_under_a_white_environment_are_white() {
    let slab = |m: Material| {
        let mut b = Builder::default();
        b.cuboid(v(-9.0, -9.0, -0.5), v(9.0, 9.0, 0.0), m);
        b
    };
    let ball = |m: Material| {
        let mut b = Builder::default();
        b.sphere(Vec3::ZERO, 1.9, 16, true, m);
        b
    };
    let cases = [
        ("mirror", lone_wall(metal(Vec3::ONE, 0.0)), 0.0),
        ("narrow metal", lone_wall(metal(Vec3::ONE, 0.05)), 0.05),
        ("glass slab", slab(glass(1.5, 0.0)), 0.0),
        ("narrow glass slab", slab(glass(1.5, 0.05)), 0.05),
        ("glass ball", ball(glass(1.5, 0.0)), 0.0),
        ("bubble", ball(glass(0.75, 0.0)), 0.0),
    ];
    for (name, mut b, threshold) in cases {
        b.environment(4, 2, |_, _| Vec3::ONE);
        let scene = TestScene::new("white", b.scene, facing(), 30).threshold(threshold);
        let accel = accel(&scene);
        let (mut primal, mut gradient) = (Vec::new(), Runs::default());
        for seed in 0..16 {
            let (film, _) = render(&scene, &accel, &gradient_settings(&scene, seed, 64));
            primal.push(mean(&film.primal(Half::Both)));
            gradient.push(&gradients(&film));
        }
        let white = estimate(primal.into_iter());
        let (gradient_mean, z) = zero_mean(&gradient);
        println!(
            "{name}: {:.5} ± {:.5}, gradients {gradient_mean:.1e} (z {z:.2})",
            white.mean,
            white.variance.sqrt()
        );
        assert!((white.mean - 1.0).abs() < 0.002 + Z * white.variance.sqrt(), "{name}: {}", white.mean);
        assert!(z.abs() < Z || gradient_mean.abs() < 1e-6, "{name}: gradients {gradient_mean:.2e}, z {z:.2}");
    }
}

// T9

/// Gradient runs of a scene.
fn runs(scene: &TestScene, seeds: std::ops::Range<u64>, map: impl Fn(&[[f32; 3]]) -> Vec<[f32; 3]>) -> Runs {
    let accel = accel(scene);
    let mut runs = Runs::default();
    for seed in seeds {
        runs.push(&map(&gradients(&render(scene, &accel, &gradient_settings(scene, seed, scene.spp)).0)));
    }
    runs
}

/// Asserts that two sets of runs agree entry by entry and as a whole.
fn assert_agree(name: &str, a: &Runs, b: &Runs) {
    let z: Vec<f64> = (0..a.len()).map(|e| z_score(a.entry(e), b.entry(e), 1e-7)).collect();
    let outside = z.chunks(3).filter(|rgb| rgb.iter().any(|z| z.abs() > Z)).count();
    let weights: Vec<(usize, f64)> = (0..a.len())
        .map(|e| (e, a.entry(e).variance + b.entry(e).variance))
        .filter(|&(_, variance)| variance > 0.0)
        .map(|(e, variance)| (e, variance.sqrt().recip()))
        .collect();
    let all = z_score(a.functional(&weights), b.functional(&weights), 0.0);
    println!("{name}: {outside} of {} beyond {Z}, all together {all:.2}", a.len());
    assert!(outside <= (a.len() / 3).div_ceil(10_000), "{name}: {outside} entries differ");
    assert!(all.abs() < Z, "{name}: z of all {all:.2}");
}

/// The scene reflected at x = 0, with a proper camera that sees it reflected.
fn reflected(mut scene: TestScene) -> TestScene {
    let mirror = Affine3A::from_scale(v(-1.0, 1.0, 1.0));
    for instance in &mut scene.scene.instances {
        instance.to_world = mirror * instance.to_world;
        instance.is_identity = false;
    }
    if let Some(sky) = &mut scene.scene.environment {
        sky.rotation = -sky.rotation;
        sky.texels.chunks_mut(sky.width as usize).for_each(|row| row.reverse());
    }
    scene.camera.to_world = mirror * scene.camera.to_world * mirror;
    scene
}

#[test]
fn reflected_scene_has_reflected_gradients() {
    for build in [scenes::diffuse_box_small, scenes::rough_glass_outside, scenes::normal_mapped_mirror] {
        let scene = build();
        let [width, height] = scene.size.map(|n| n as usize);
        let order: Vec<_> = pairs(width, height).collect();
        let flip = |entries: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let at = |x: usize, y: usize, horizontal: bool| {
                let i = order.iter().position(|p| (p.x, p.y, p.horizontal) == (x, y, horizontal));
                entries[i.expect("every pair has a reflection")]
            };
            let one = |p: &Pair| {
                if p.horizontal {
                    at(width - 2 - p.x, p.y, true).map(|g| -g)
                } else {
                    at(width - 1 - p.x, p.y, false)
                }
            };
            order.iter().map(one).collect()
        };
        let direct = runs(&scene, 0..32, |g| g.to_vec());
        let image = runs(&reflected(scene), 100..132, flip);
        assert_agree(&format!("{} reflected", build().name), &direct, &image);
    }
}

#[test]
fn exchanged_axes_exchange_dx_and_dy() {
    for build in [scenes::diffuse_box_small, scenes::rough_metals_half_vector] {
        let square = || TestScene { size: [11, 11], ..build() };
        let scene = square();
        let mut turned = square();
        let m = &mut turned.camera.to_world.matrix3;
        (m.x_axis, m.y_axis) = (-m.y_axis, -m.x_axis);
        let order: Vec<_> = pairs(11, 11).collect();
        let exchange = |entries: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let at = |q: &Pair| {
                let i = order.iter().position(|p| (p.x, p.y, p.horizontal) == (q.y, q.x, !q.horizontal));
                entries[i.expect("every pair has an exchanged one")]
            };
            order.iter().map(at).collect()
        };
        let direct = runs(&scene, 0..32, |g| g.to_vec());
        let other = runs(&turned, 100..132, exchange);
        assert_agree(&format!("{} with axes exchanged", scene.name), &direct, &other);
    }
}

// T10

#[test]
fn roulette_changes_no_expectation() {
    for build in [scenes::deep_white_box, scenes::rough_glass_inside] {
        let scene = TestScene { size: [9, 7], max_depth: 24, ..build() };
        let accel = accel(&scene);
        let measure = |rr_depth: u32, seeds: std::ops::Range<u64>| {
            let mut runs = Runs::default();
            for seed in seeds {
                let settings = Settings { rr_depth, ..gradient_settings(&scene, seed, 32) };
                let (film, _) = render(&scene, &accel, &settings);
                let mut entries = gradients(&film);
                entries.extend(&film.primal(Half::Both).data);
                runs.push(&entries);
            }
            runs
        };
        let never = measure(u32::MAX, 0..32);
        for (rr_depth, seeds) in [(1, 100..132), (5, 200..232)] {
            assert_agree(
                &format!("{} roulette from {rr_depth}", scene.name),
                &measure(rr_depth, seeds),
                &never,
            );
        }
    }
}

// T15

#[test]
fn what_the_camera_sees_glow_is_in_no_gradient() {
    let mut b = Builder::default();
    b.environment(8, 4, |x, y| v(x as f32, y as f32, 1.0));
    b.quad(v(-0.4, -0.4, 0.0), v(0.8, 0.0, 0.0), v(0.0, 0.7, 0.0), emitter(Vec3::splat(7.0)));
    let scene = TestScene::new("glow", b.scene, facing(), 4);
    let (film, _) = render(&scene, &accel(&scene), &gradient_settings(&scene, 1, 16));
    assert!(gradients(&film).iter().flatten().all(|&g| g == 0.0));
    assert!(film.primal(Half::Both).data.iter().flatten().all(|&p| p == 0.0));
    let direct = film.direct();
    assert!(direct.data.contains(&[7.0; 3]) && mean(&direct) > 1.0);

    let scene = scenes::light_behind_glass();
    let (film, _) = render(&scene, &accel(&scene), &gradient_settings(&scene, 1, 64));
    let brightest = film.primal(Half::Both).data.iter().flatten().fold(0.0_f32, |a, &b| a.max(b));
    assert!(brightest > 2.0, "the light behind glass belongs to the primal: {brightest}");
    assert!(gradients(&film).iter().flatten().any(|&g| g.abs() > 0.5));
}

// T16

#[test]
fn films_of_one_row_column_or_pixel() {
    for size in [[1, 1], [1, 9], [9, 1], [5, 2]] {
        let scene = TestScene { size, ..scenes::penumbra() };
        let accel = accel(&scene);
        let (mut tested, mut truth) = (Runs::default(), Runs::default());
        for seed in 0..32 {
            let (film, _) = render(&scene, &accel, &gradient_settings(&scene, seed, 32));
            let path = render(&scene, &accel, &settings(&scene, Kind::Path, seed, 32)).0.primal(Half::Both);
            assert_eq!(film.primal(Half::Both), path, "{size:?}: primal");
            tested.push(&gradients(&film));
            let other = settings(&scene, Kind::Path, seed + 1000, 128);
            truth.push(&differences(&render(&scene, &accel, &other).0.primal(Half::Both)));
            let outside = if size[0] == 1 { film.dx(Half::Both) } else { Plane::new(1, 1) };
            assert!(outside.data.iter().flatten().all(|&g| g == 0.0), "{size:?}: dx of one column");
        }
        if tested.len() > 0 {
            assert_agree(&format!("film of {size:?}"), &tested, &truth);
        }
    }
}

// T17

/// Exponent of N in the variance of `estimate(n, stream)` over streams.
fn variance_exponent(mut estimate_of: impl FnMut(u32, u32) -> f64) -> f64 {
    let points = [4_u32, 16, 64, 256].map(|n| {
        let values: Vec<f64> = (0..256).map(|stream| estimate_of(n, stream)).collect();
        (f64::from(n).ln(), (256.0 * estimate(values.into_iter()).variance).ln())
    });
    let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let (mx, my) = (x.iter().sum::<f64>() / 4.0, y.iter().sum::<f64>() / 4.0);
    let up: f64 = x.iter().zip(&y).map(|(x, y)| (x - mx) * (y - my)).sum();
    up / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
}

#[test]
fn stratification_survives_in_every_dimension() {
    for set in [0, 3, 14] {
        for dimension in 0..4 {
            let exponent = variance_exponent(|n, stream| {
                let ramp = |i| f64::from(sample_4d(stream.wrapping_mul(0x9e37_79b9), i, set)[dimension]);
                (0..n).map(ramp).sum::<f64>() / f64::from(n)
            });
            println!("set {set} dimension {dimension}: variance ~ N^{exponent:.2}");
            assert!((-3.5..-1.8).contains(&exponent), "set {set} dimension {dimension}: N^{exponent:.2}");
        }
    }
}

#[test]
fn stratification_reaches_the_film() {
    // Very direct light of an emitter whose texture is a ramp in x.
    let mut b = Builder::default();
    let ramp = texture(2, 1, |x, _| [if x == 0 { 0 } else { 255 }; 4]);
    let screen = Material { emission_texture: b.texture(ramp), ..emitter(Vec3::ONE) };
    b.quad(v(-4.0, -4.0, 0.0), v(8.0, 0.0, 0.0), v(0.0, 8.0, 0.0), screen);
    let scene = TestScene { size: [1, 1], ..TestScene::new("ramp", b.scene, facing(), 1) };
    let accel = accel(&scene);
    let exponent = variance_exponent(|n, seed| {
        mean(&render(&scene, &accel, &settings(&scene, Kind::Path, u64::from(seed), n)).0.direct())
    });
    println!("very direct ramp: variance ~ N^{exponent:.2}");
    assert!((-3.5..-1.8).contains(&exponent), "N^{exponent:.2}");
}

// T18

#[test]
fn threads_change_no_bit() {
    let scene = TestScene { size: [37, 35], ..scenes::absorption() };
    let accel = accel(&scene);
    let images: Vec<_> = [1, 2, 5]
        .into_iter()
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
            let (film, statistics) =
                pool.install(|| render(&scene, &accel, &gradient_settings(&scene, 3, 11)));
            (film.primal(Half::Both), film.dx(Half::A), film.dy(Half::B), film.variance(), statistics.shifts)
        })
        .collect();
    assert!(images[0] == images[1] && images[0] == images[2]);
}

#[test]
fn crop_shows_the_same_pixels() {
    let scene = TestScene { size: [37, 35], ..scenes::plastic_coat() };
    let accel = accel(&scene);
    let whole_settings = gradient_settings(&scene, 3, 11);
    let (whole, _) = render(&scene, &accel, &whole_settings);
    for crop in [[0, 0, 37, 35], [3, 5, 18, 33], [16, 16, 32, 17], [36, 34, 37, 35]] {
        let (part, _) = render(&scene, &accel, &Settings { crop: Some(crop), ..whole_settings });
        let [x0, y0, x1, y1] = crop.map(|n| n as usize);
        let cut = |image: Plane| Plane::from_fn(x1 - x0, y1 - y0, |x, y| image.at(x + x0, y + y0));
        assert_eq!(part.primal(Half::Both), cut(whole.primal(Half::Both)), "{crop:?}");
        assert_eq!(part.direct(), cut(whole.direct()), "{crop:?}");
        // Gradients within the crop are the same but for rounding: where a neighbour is missing, the head hands a
        // path over earlier. Those over the border do not exist.
        let (dx, expected) = (part.dx(Half::Both), cut(whole.dx(Half::Both)));
        let inside = |x: usize| x + 1 < x1 - x0;
        for i in (0..dx.data.len()).filter(|i| inside(i % dx.width)) {
            let error = (0..3).map(|c| (dx.data[i][c] - expected.data[i][c]).abs()).fold(0.0, f32::max);
            assert!(error < 1e-6, "{crop:?}: dx of pixel {i} is off by {error}");
        }
    }
}

/// The extremes of the classification: everything glossy, then nothing; and pairs without weights.
#[test]
fn any_threshold_and_weighting_is_unbiased() {
    let cases = [
        ("everything glossy", scenes::constant_environment().threshold(f32::INFINITY), true),
        ("everything glossy, glass", scenes::thin_glass().threshold(f32::INFINITY), true),
        ("without pair weights", scenes::penumbra(), false),
        ("without pair weights, glossy", scenes::rough_metals_half_vector(), false),
    ];
    for (name, scene, pair_mis) in cases {
        let accel = accel(&scene);
        let (mut tested, mut truth) = (Runs::default(), Runs::default());
        for seed in 0..48 {
            let settings_of_pair = Settings { pair_mis, ..gradient_settings(&scene, seed, scene.spp) };
            tested.push(&gradients(&render(&scene, &accel, &settings_of_pair).0));
            let other = settings(&scene, Kind::Path, seed + 1000, scene.reference_spp);
            truth.push(&differences(&render(&scene, &accel, &other).0.primal(Half::Both)));
        }
        assert_agree(name, &tested, &truth);
    }
}
