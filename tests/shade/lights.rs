//! S3, lights: selection, points on triangles, what receivers see, against frequencies and closed forms.

use crate::Random;
use crate::chi_square::assert_follows;
use crate::scenes::{emitter, hit, matte, one_square, place, reference, square, texture};
use gdpt::math::{LANES, Mask, Vec3x, f32x16, splat};
use gdpt::scene::{AlphaMode, Environment, Material, PunctualKind, PunctualLight, Scene};
use gdpt::shade::{ShadeScene, Surface, solid_angle_pdf};
use glam::{Affine3A, DVec3, Quat, Vec3, Vec4};

const SAMPLES: usize = 1_000_000;

/// Area pdf of a triangle of instance `instance`, as a hit on it reports it.
fn query(scene: &ShadeScene, instance: u32, primitive: u32) -> f64 {
    let s = Surface::new(scene, &hit(instance, primitive, 0.2, 0.3), Mask::ALL, Vec3x::splat(Vec3::Z));
    f64::from(s.light_pdf.as_array()[0])
}

/// A light of some kind, shining down from 2 m.
fn punctual(kind: PunctualKind) -> PunctualLight {
    PunctualLight {
        kind,
        position: Vec3::new(0.0, 2.0, 0.0),
        direction: Vec3::NEG_Y,
        intensity: Vec3::new(4.0, 2.0, 1.0),
    }
}

/// Squares at z = 0, 1, 2, 3 of different size, strength and sides; three punctual lights; an environment.
fn many() -> Scene {
    let radiances = [1.0, 5.0, 0.5, 0.0];
    let materials = radiances
        .iter()
        .enumerate()
        .map(|(i, &l)| Material { double_sided: i == 2, ..emitter(Vec3::splat(l)) });
    let mut scene = Scene { materials: materials.collect(), ..Scene::default() };
    for i in 0..4 {
        let scale = Vec3::new(1.0 + i as f32, 1.0, if i == 1 { -1.0 } else { 1.0 });
        let lift = Vec3::new(0.0, 0.0, i as f32);
        place(&mut scene, square(i), Affine3A::from_scale_rotation_translation(scale, Quat::IDENTITY, lift));
    }
    let spot = PunctualKind::Spot { cos_inner: 0.9, cos_outer: 0.7 };
    scene.lights = [PunctualKind::Point, spot, PunctualKind::Directional].map(punctual).to_vec();
    let texels = vec![Vec3::ONE; 8];
    scene.environment = Some(Environment { width: 4, height: 2, texels, rotation: 0.0, visible: true });
    scene
}

#[test]
fn selection_probabilities_sum_to_one_and_frequencies_follow_them() {
    let scene = many();
    let prepared = ShadeScene::new(&scene);
    // Outcomes: a triangle each (two a square), punctual lights by position or direction, the environment.
    let mut expected = vec![0.0; 12];
    for instance in 0..4_u32 {
        for primitive in 0..2 {
            let area = 0.5 * (1.0 + f64::from(instance));
            expected[(2 * instance + primitive) as usize] = query(&prepared, instance, primitive) * area;
        }
    }
    assert_eq!((expected[6], expected[7]), (0.0, 0.0), "a black triangle is selected");
    let mut observed = vec![0.0; 12];
    let mut random = Random::new(53);
    for _ in 0..SAMPLES / LANES {
        let point = prepared.lights.sample(&prepared, random.wide(), random.wide(), random.wide());
        let kinds = [point.is_area, point.is_env, point.is_dirac].map(Mask::bits);
        assert_eq!((kinds[0] ^ kinds[1] ^ kinds[2], kinds[0] & kinds[1] & kinds[2]), (0xffff, 0));
        let seen = prepared.lights.seen_from(&prepared, &point, Vec3x::splat(Vec3::new(0.2, 0.1, 9.0)));
        for lane in 0..LANES {
            let p = point.p.lane(lane);
            let pdf = f64::from(point.pdf.as_array()[lane]);
            let outcome = if point.is_area.get(lane) {
                let instance = p.z.round() as usize;
                let triangle = 2 * instance + usize::from(p.y > p.x / (1.0 + instance as f32));
                let exact = query_cached(&expected, triangle);
                assert!((pdf - exact).abs() <= 1e-4 * exact, "{pdf} sampled, {exact} queried");
                triangle
            } else if point.is_env.get(lane) {
                11
            } else {
                let outcome = match (seen.distance.as_array()[lane].is_infinite(), point.ng.lane(lane)) {
                    (true, _) => 10,
                    _ if is_spot(&prepared, &point, lane) => 9,
                    _ => 8,
                };
                expected[outcome] = pdf;
                outcome
            };
            observed[outcome] += 1.0;
        }
    }
    expected[11] = 0.5;
    let sum: f64 = expected.iter().sum();
    assert!((sum - 1.0).abs() < 1e-6, "probabilities sum to {sum}");
    let n = (SAMPLES / LANES * LANES) as f64;
    expected.iter_mut().for_each(|e| *e *= n);
    assert_follows("light selection", &observed, &expected, 1);
}

/// Area pdf of a triangle of `many` from its probability.
fn query_cached(probabilities: &[f64], triangle: usize) -> f64 {
    probabilities[triangle] / (0.5 * (1.0 + (triangle / 2) as f64))
}

/// A spot is dark to a receiver above it, a point light is not.
fn is_spot(scene: &ShadeScene, point: &gdpt::shade::LightPoint, lane: usize) -> bool {
    let above = scene.lights.seen_from(scene, point, Vec3x::splat(Vec3::new(0.0, 5.0, 0.0)));
    above.radiance.lane(lane) == Vec3::ZERO
}

#[test]
fn the_environment_alone_is_always_selected() {
    let scene = Scene { environment: many().environment, ..Scene::default() };
    let prepared = ShadeScene::new(&scene);
    let pdf = prepared.lights.environment_with_pdf(Vec3x::splat(Vec3::new(0.48, 0.6, 0.64))).1.as_array()[0];
    // Density ∝ sin θ of the row's middle over sin θ: here the rows are equal and sin θ = 0.8.
    assert!((pdf - 1.0 / (2.0 * std::f32::consts::PI.powi(2) * 0.8)).abs() < 1e-5);
}

/// Irradiance from a polygon of radiance 1 (Lambert): half the sum of edge angles × cosine of edge planes.
fn polygon_irradiance(corners: &[DVec3], p: DVec3, n: DVec3) -> f64 {
    let to: Vec<DVec3> = corners.iter().map(|c| (*c - p).normalize()).collect();
    (0..to.len())
        .map(|i| {
            let (a, b) = (to[i], to[(i + 1) % to.len()]);
            0.5 * a.dot(b).clamp(-1.0, 1.0).acos() * a.cross(b).normalize().dot(n)
        })
        .sum::<f64>()
        .abs()
}

#[test]
fn area_lights_give_the_irradiance_of_their_polygon() {
    let to_world = Affine3A::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::new(0.1, -0.3, 0.0));
    let scene = one_square(emitter(Vec3::ONE), to_world);
    let prepared = ShadeScene::new(&scene);
    let (p, n) = (Vec3::new(0.2, 0.1, 1.5), Vec3::new(0.3, 0.2, -1.0).normalize());
    let mut random = Random::new(61);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..4 * SAMPLES / LANES {
        let point = prepared.lights.sample(&prepared, random.wide(), random.wide(), random.wide());
        let seen = prepared.lights.seen_from(&prepared, &point, Vec3x::splat(p));
        for lane in 0..LANES {
            let wi = seen.wi.lane(lane);
            let (g, pdf) = (seen.geometry.as_array()[lane], point.pdf.as_array()[lane]);
            let value = f64::from(seen.radiance.lane(lane).x * g * wi.dot(n).max(0.0) / pdf);
            sum += value;
            squares += value * value;
            let (d, q) = (seen.distance.as_array()[lane], point.p.lane(lane));
            assert!(((p + wi * d) - q).length() < 1e-5);
            assert!((g - wi.dot(-point.ng.lane(lane)).abs() / (d * d)).abs() < 1e-5 * g);
            // The end of the shadow ray lies on the receiver's side of the light.
            assert!((seen.target.lane(lane) - q).dot(p - q) > 0.0);
        }
    }
    let count = (4 * SAMPLES / LANES * LANES) as f64;
    let mean = sum / count;
    let error = ((squares / count - mean * mean) / count).sqrt();
    let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
    let corners = corners.map(|c| to_world.transform_point3(c).as_dvec3());
    let exact = polygon_irradiance(&corners, p.as_dvec3(), n.as_dvec3());
    assert!((mean - exact).abs() < 1e-3 * exact && error < 3e-4 * exact, "{mean} ± {error} for {exact}");
}

#[test]
fn solid_angle_pdfs_integrate_to_one_over_the_light() {
    // The same density from a hit: light_pdf · d² / |cos|, integrated over directions through the light's square.
    let scene = one_square(emitter(Vec3::ONE), Affine3A::IDENTITY);
    let prepared = ShadeScene::new(&scene);
    let p = DVec3::new(0.3, 0.6, 0.8);
    const STEPS: usize = 400;
    let mut integral = 0.0;
    for i in 0..STEPS * STEPS {
        let x = ((i % STEPS) as f64 + 0.5) / STEPS as f64;
        let y = ((i / STEPS) as f64 + 0.5) / STEPS as f64;
        let to = p - DVec3::new(x, y, 0.0);
        let (d2, cos) = (to.length_squared(), to.z / to.length());
        let pdf = solid_angle_pdf(splat(query(&prepared, 0, 0) as f32), splat(d2 as f32), splat(cos as f32));
        integral += f64::from(pdf.as_array()[0]) * cos / d2 / (STEPS * STEPS) as f64;
    }
    assert!((integral - 1.0).abs() < 1e-3, "{integral}");
    assert_eq!(solid_angle_pdf(splat(1.0), splat(1.0), f32x16::ZERO).as_array()[0], 0.0);
}

#[test]
fn one_sided_lights_are_dark_behind() {
    for (two_sided, mirrored) in [(false, false), (true, false), (false, true)] {
        let flip = Vec3::new(if mirrored { -1.0 } else { 1.0 }, 1.0, 1.0);
        let material = Material { double_sided: two_sided, ..emitter(Vec3::ONE) };
        let scene = one_square(material, Affine3A::from_scale(flip));
        let prepared = ShadeScene::new(&scene);
        let u = splat(0.4);
        let point = prepared.lights.sample(&prepared, u, u, u);
        let seen =
            |z: f32| prepared.lights.seen_from(&prepared, &point, Vec3x::splat(Vec3::new(0.3, 0.3, z)));
        assert_eq!(seen(1.0).radiance.lane(0), Vec3::ONE);
        assert_eq!(seen(-1.0).radiance.lane(0), Vec3::splat(f32::from(u8::from(two_sided))));
        // Geometry does not depend on the side: the pdf of light sampling does not look at the receiver.
        assert_eq!(seen(1.0).geometry.to_array(), seen(-1.0).geometry.to_array());
        assert!(seen(-1.0).target.lane(0).z < 0.0 && seen(1.0).target.lane(0).z > 0.0);
        // On the light itself: nothing, and no NaN.
        let at = prepared.lights.seen_from(&prepared, &point, point.p);
        assert_eq!((at.radiance.lane(0), at.geometry.as_array()[0]), (Vec3::ZERO, 0.0));
    }
}

#[test]
fn textured_and_covered_emission_is_the_one_a_ray_meets() {
    let material = Material {
        emission_texture: Some(reference()),
        base_color: Vec4::new(1.0, 1.0, 1.0, 0.25),
        alpha_mode: AlphaMode::Blend,
        ..emitter(Vec3::splat(2.0))
    };
    let mut scene = one_square(material, Affine3A::IDENTITY);
    scene.textures.push(texture(2, &[[255, 188, 0, 255], [0, 10, 255, 255]], true, true));
    let prepared = ShadeScene::new(&scene);
    let mut random = Random::new(71);
    for _ in 0..200 {
        let point = prepared.lights.sample(&prepared, random.wide(), random.wide(), random.wide());
        let seen = prepared.lights.seen_from(&prepared, &point, Vec3x::splat(Vec3::new(0.5, 0.5, 1.0)));
        for lane in 0..LANES {
            // Triangle 0 has corners (0,0), (1,0), (1,1): u = x − y, v = y; triangle 1 (0,0), (1,1), (0,1).
            let p = point.p.lane(lane);
            let upper = p.y > p.x;
            let (u, v) = if upper { (p.x, p.y - p.x) } else { (p.x - p.y, p.y) };
            let up = Vec3x::splat(Vec3::Z);
            let s = Surface::new(&prepared, &hit(0, u32::from(upper), u, v), Mask::ALL, up);
            let met = s.emission.lane(0) * 0.25;
            assert!(
                (seen.radiance.lane(lane) - met).length() < 1e-4,
                "{} for {met}",
                seen.radiance.lane(lane)
            );
        }
    }
}

#[test]
fn emission_behind_a_black_texture_is_not_sampled() {
    let material = Material { emission_texture: Some(reference()), ..emitter(Vec3::ONE) };
    let mut scene = one_square(material, Affine3A::IDENTITY);
    scene.textures.push(texture(1, &[[0, 0, 0, 255]], true, true));
    let prepared = ShadeScene::new(&scene);
    assert!(prepared.lights.is_empty());
    assert_eq!(query(&prepared, 0, 0), 0.0);
    assert!(ShadeScene::new(&one_square(matte(), Affine3A::IDENTITY)).lights.is_empty());
}

#[test]
fn punctual_lights_fall_off_as_the_extension_says() {
    let spot = PunctualKind::Spot { cos_inner: 0.9, cos_outer: 0.7 };
    let intensity = Vec3::new(4.0, 2.0, 1.0);
    // Receivers under the light at an angle of cosine c, 3 m away.
    for (kind, c, expected) in [
        (PunctualKind::Point, 0.3_f32, 1.0 / 9.0),
        (PunctualKind::Point, -0.8, 1.0 / 9.0),
        (spot, 0.95, 1.0 / 9.0),
        (spot, 0.8, 0.25 / 9.0),
        (spot, 0.65, 0.0),
        (spot, -1.0, 0.0),
        (PunctualKind::Directional, 0.3, 1.0),
    ] {
        let scene = Scene { lights: vec![punctual(kind)], ..Scene::default() };
        let prepared = ShadeScene::new(&scene);
        let u = splat(0.3);
        let point = prepared.lights.sample(&prepared, u, u, u);
        assert!(point.is_dirac.all() && point.valid.all());
        assert_eq!(point.pdf.as_array()[0], 1.0);
        let away = Vec3::new((1.0 - c * c).sqrt(), -c, 0.0);
        let p = Vec3::new(0.0, 2.0, 0.0) + away * 3.0;
        let seen = prepared.lights.seen_from(&prepared, &point, Vec3x::splat(p));
        let (radiance, wi) = (seen.radiance.lane(4), seen.wi.lane(4));
        assert!((radiance - intensity * expected).length() < 1e-5, "{kind:?} at {c}: {radiance}");
        assert_eq!(seen.geometry.as_array()[4], 1.0);
        if kind == PunctualKind::Directional {
            assert_eq!((wi, seen.distance.as_array()[4]), (Vec3::Y, f32::INFINITY));
        } else {
            assert!((wi + away).length() < 1e-6 && (seen.distance.as_array()[4] - 3.0).abs() < 1e-5);
            assert!((seen.target.lane(4) - Vec3::new(0.0, 2.0, 0.0)).length() < 1e-6);
        }
    }
}
