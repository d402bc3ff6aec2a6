//! S3, the light tree: its pdfs against their sum, its samples against the pdfs, its estimates against sums over all
//! lights, for many lights and for lights that degenerate.

use crate::Random;
use crate::chi_square::assert_follows;
use crate::scenes::{emitter, hit, place, sample};
use gdpt::math::{LANES, Mask, Vec3x, splat};
use gdpt::scene::{Material, Mesh, PunctualKind, PunctualLight, Scene};
use gdpt::shade::{Receiver, ShadeScene};
use glam::{Affine3A, Vec3, Vec3A};

/// A mesh of loose triangles.
fn soup(corners: &[Vec3], material: u32) -> Mesh {
    let count = corners.len() as u32 / 3;
    Mesh {
        name: "soup".into(),
        positions: corners.iter().copied().map(Vec3A::from).collect(),
        triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        normals: None,
        tangents: None,
        uvs: [None, None],
        colors: None,
        material,
    }
}

/// A point of [−1, 1]³.
fn point(random: &mut Random) -> Vec3 {
    Vec3::from_array(std::array::from_fn(|_| 2.0 * random.float() - 1.0))
}

/// A random triangle of about this size, m.
fn triangle(random: &mut Random, centre: Vec3, size: f32) -> [Vec3; 3] {
    std::array::from_fn(|_| centre + size * point(random))
}

/// Triangles in front of a floor and behind it, of many sizes and strengths, one- and two-sided; points and spots.
fn scattered(count: usize, seed: u32) -> Scene {
    let mut random = Random::new(seed);
    let mut scene = Scene::default();
    for material in 0..4_u32 {
        let mut corners = Vec::new();
        for _ in 0..count / 4 {
            let size = 0.3 * random.float().powi(4) + 1e-3;
            let centre = 5.0 * point(&mut random);
            corners.extend(triangle(&mut random, centre, size));
        }
        let radiance = Vec3::new(1.0, 2.0, 0.5) * 10.0_f32.powi(material as i32 - 2);
        scene.materials.push(Material { double_sided: material == 3, ..emitter(radiance) });
        place(&mut scene, soup(&corners, material), Affine3A::IDENTITY);
    }
    for i in 0..count / 10 {
        let kind = if i % 2 == 0 {
            PunctualKind::Point
        } else {
            PunctualKind::Spot { cos_inner: 0.9, cos_outer: random.float() * 0.8 }
        };
        scene.lights.push(PunctualLight {
            kind,
            position: 5.0 * point(&mut random),
            direction: point(&mut random).normalize(),
            intensity: Vec3::splat(0.1 + random.float()),
        });
    }
    scene
}

/// Lights that are hard to tell apart or to bound.
fn degenerate() -> Vec<(&'static str, Scene)> {
    let mut random = Random::new(7);
    let of = |corners: &[Vec3]| {
        let mut scene = Scene { materials: vec![emitter(Vec3::ONE)], ..Scene::default() };
        place(&mut scene, soup(corners, 0), Affine3A::IDENTITY);
        scene
    };
    let one = triangle(&mut random, Vec3::ZERO, 1.0);
    let mut with_slivers = one.to_vec();
    for _ in 0..20 {
        let (a, b) = (point(&mut random), point(&mut random));
        with_slivers.extend([a, b, 0.5 * (a + b), a, a, a]);
    }
    let mut huge = triangle(&mut random, Vec3::ZERO, 100.0).to_vec();
    // Distances from 10⁻⁶ m up, on a line: a tree by cost alone would be a list.
    let mut line = Vec::new();
    for i in 0..400 {
        let centre = point(&mut random);
        huge.extend(triangle(&mut random, centre, 1e-3));
        let x = 1e-6 * 1.04_f32.powi(i);
        line.extend([Vec3::X * x, Vec3::new(x, 1e-7, 0.0), Vec3::new(x, 0.0, 1e-7)]);
    }
    let light = PunctualLight {
        kind: PunctualKind::Point,
        position: Vec3::ONE,
        direction: Vec3::X,
        intensity: Vec3::ONE,
    };
    vec![
        ("one light", of(&one)),
        ("in one place", of(&one.repeat(500))),
        ("slivers", of(&with_slivers)),
        ("one huge, many small", of(&huge)),
        ("exponential line", of(&line)),
        ("points in one place", Scene { lights: vec![light; 50], ..Scene::default() }),
    ]
}

/// A receiver in each lane: anywhere near the lights, some on a light, some lit from both sides.
fn receivers(scene: &Scene, random: &mut Random, size: f32) -> Receiver {
    let corners: Vec<Vec3> =
        scene.meshes.iter().flat_map(|m| m.positions.iter().map(|&p| Vec3::from(p))).collect();
    let p: [Vec3; LANES] = std::array::from_fn(|lane| match corners.len() {
        0 => size * point(random),
        n if lane % 4 == 0 => corners[(random.float() * n as f32) as usize],
        _ => size * point(random),
    });
    let n: [Vec3; LANES] = std::array::from_fn(|_| point(random).normalize());
    Receiver {
        p: Vec3x::lanes(|i| p[i]),
        n: Vec3x::lanes(|i| n[i]),
        both_sides: Mask::from_fn(|i| i % 3 == 0),
    }
}

/// Probability of each triangle for each receiver, lane by lane.
fn triangle_probabilities(prepared: &ShadeScene, from: &Receiver) -> Vec<[f64; LANES]> {
    let mut all = Vec::new();
    for (i, mesh) in prepared.scene.meshes.iter().enumerate() {
        for (k, triangle) in mesh.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|v| Vec3::from(mesh.positions[v as usize]));
            let cross = (b - a).cross(c - a);
            // A ray of length 1 along the normal: the density is that of the area.
            let wi = Vec3x::splat(cross.normalize_or_zero());
            let pdf = prepared.lights.hit_pdf(from, &hit(i as u32, k as u32, 0.3, 0.3), wi, Mask::ALL);
            let area = 0.5 * f64::from(cross.length());
            all.push(pdf.to_array().map(|pdf| f64::from(pdf) * area));
        }
    }
    all
}

/// The punctual light that a sample is on.
fn punctual_index(scene: &Scene, p: Vec3) -> usize {
    scene.lights.iter().position(|light| light.position == p).expect("a sample lies on a light")
}

#[test]
fn probabilities_sum_to_one() {
    let mut random = Random::new(11);
    let mut scenes = degenerate();
    scenes.extend([("10", scattered(8, 1)), ("1000", scattered(1000, 2)), ("5000", scattered(5000, 3))]);
    for (name, mut scene) in scenes {
        // Probabilities of punctual lights are known where they are drawn; see the next test.
        if !scene.meshes.is_empty() {
            scene.lights.clear();
        }
        let prepared = ShadeScene::new(&scene);
        for size in [0.1, 1.0, 6.0, 100.0] {
            let from = receivers(&scene, &mut random, size);
            if scene.meshes.is_empty() {
                let point = sample(&prepared, &from, &mut random);
                assert!(point.pdf.to_array().iter().all(|&pdf| (pdf - 0.02).abs() < 1e-6), "{name}");
                continue;
            }
            let probabilities = triangle_probabilities(&prepared, &from);
            for lane in 0..LANES {
                let sum: f64 = probabilities.iter().map(|p| p[lane]).sum();
                assert!((sum - 1.0).abs() < 1e-5, "{name}, size {size}: probabilities sum to {sum}");
            }
        }
    }
}

#[test]
fn frequencies_follow_the_probabilities() {
    let scene = scattered(800, 5);
    let prepared = ShadeScene::new(&scene);
    let mut random = Random::new(13);
    let from = receivers(&scene, &mut random, 5.0);
    let mut expected = triangle_probabilities(&prepared, &from);
    let triangles = expected.len();
    expected.resize(triangles + scene.lights.len(), [0.0; LANES]);
    let mut observed = vec![[0.0; LANES]; expected.len()];
    const ROUNDS: usize = 20_000;
    for _ in 0..ROUNDS {
        let point = sample(&prepared, &from, &mut random);
        let again = prepared.lights.pdf_from(&point, &from, Mask::ALL);
        assert_eq!(point.pdf.to_array(), again.to_array(), "the same receiver has another pdf");
        for lane in 0..LANES {
            let p = point.p.lane(lane);
            let index = if point.is_dirac.get(lane) {
                let index = triangles + punctual_index(&scene, p);
                expected[index][lane] = f64::from(point.pdf.as_array()[lane]);
                index
            } else {
                containing(&scene, p)
            };
            observed[index][lane] += 1.0;
        }
    }
    for lane in 0..LANES {
        let column = |table: &[[f64; LANES]]| -> Vec<f64> { table.iter().map(|row| row[lane]).collect() };
        let mut expected = column(&expected);
        let sum: f64 = expected.iter().sum();
        // Punctual lights that were never drawn are missing.
        assert!(sum < 1.0 + 1e-5 && sum > 0.99, "lane {lane}: {sum}");
        expected.iter_mut().for_each(|e| *e *= ROUNDS as f64);
        assert_follows("light tree", &column(&observed), &expected, LANES);
    }
}

/// The triangle that holds a point on a light: the one in whose plane and between whose edges it lies best.
fn containing(scene: &Scene, p: Vec3) -> usize {
    let distance = |[a, b, c]: [Vec3; 3]| {
        let n = (b - a).cross(c - a);
        let area = n.length();
        let inside =
            [(a, b), (b, c), (c, a)].map(|(a, b)| (b - a).cross(p - a).dot(n) / (area * (b - a).length()));
        (n.dot(p - a) / area).abs().max(-inside.into_iter().fold(f32::INFINITY, f32::min))
    };
    let all = scene.meshes.iter().flat_map(|mesh| {
        mesh.triangles.iter().map(|t| distance(t.map(|v| Vec3::from(mesh.positions[v as usize]))))
    });
    all.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).expect("there are triangles").0
}

#[test]
fn whatever_shines_at_a_receiver_can_be_selected() {
    let mut random = Random::new(17);
    let mut lit = 0;
    for (name, scene) in degenerate().into_iter().chain([("scattered", scattered(2000, 6))]) {
        let prepared = ShadeScene::new(&scene);
        for round in 0..300 {
            // Points are drawn for one receiver and looked at from another.
            let size = [0.1, 1.0, 6.0, 30.0][round % 4];
            let (drawer, looker) =
                (receivers(&scene, &mut random, size), receivers(&scene, &mut random, size));
            let point = sample(&prepared, &drawer, &mut random);
            let seen = prepared.lights.seen_from(&prepared, &point, looker.p);
            let pdf = prepared.lights.pdf_from(&point, &looker, Mask::ALL);
            for lane in 0..LANES {
                let cos = seen.wi.lane(lane).dot(looker.n.lane(lane));
                let receives = cos > 0.0 || looker.both_sides.get(lane);
                let bright = seen.radiance.lane(lane).max_element() * seen.geometry.as_array()[lane] > 0.0;
                if receives && bright {
                    lit += 1;
                    assert!(
                        pdf.as_array()[lane] > 0.0,
                        "{name}: a light of pdf 0 gives light under cos {cos}"
                    );
                }
            }
        }
    }
    assert!(lit > 10_000, "{lit} lit pairs");
}

/// Irradiance of a receiver on the side of its normal, by quadrature over every triangle and the sum over all
/// punctual lights.
fn brute_force(prepared: &ShadeScene, p: Vec3, n: Vec3) -> f64 {
    let scene = prepared.scene;
    let mut sum = 0.0;
    for mesh in &scene.meshes {
        let material = &scene.materials[mesh.material as usize];
        for triangle in mesh.triangles.iter() {
            let [a, b, c] = triangle.map(|v| Vec3::from(mesh.positions[v as usize]));
            let cross = (b - a).cross(c - a);
            const STEPS: usize = 8;
            for i in 0..STEPS * STEPS {
                // Two half-squares of a parallelogram's cells, folded onto the triangle.
                let (mut u, mut v) = ((i % STEPS) as f32 + 1.0 / 3.0, (i / STEPS) as f32 + 1.0 / 3.0);
                if u + v >= STEPS as f32 {
                    (u, v) = (STEPS as f32 - u, STEPS as f32 - v);
                }
                let to = a + (b - a) * (u / STEPS as f32) + (c - a) * (v / STEPS as f32) - p;
                let d2 = to.length_squared();
                let cos = -to.dot(cross) / (d2.sqrt() * cross.length());
                let cos = if material.double_sided { cos.abs() } else { cos.max(0.0) };
                let area = 0.5 * cross.length() / (STEPS * STEPS) as f32;
                sum += f64::from(material.emission.x * cos * (to.dot(n) / d2.sqrt()).max(0.0) / d2 * area);
            }
        }
    }
    for light in &scene.lights {
        let to = light.position - p;
        let (d2, wi) = (to.length_squared(), to.normalize());
        let falloff = match light.kind {
            PunctualKind::Spot { cos_inner, cos_outer } => {
                let cos = -wi.dot(light.direction);
                ((cos - cos_outer) / (cos_inner - cos_outer)).clamp(0.0, 1.0).powi(2)
            }
            _ => 1.0,
        };
        sum += f64::from(light.intensity.x * falloff * wi.dot(n).max(0.0) / d2);
    }
    sum
}

#[test]
fn estimates_equal_the_sum_over_all_lights() {
    // Lights above and around, receivers well apart from them: the quadrature is exact there to a part in 10⁴.
    let mut scene = scattered(400, 9);
    for mesh in &mut scene.meshes {
        let mut positions = mesh.positions.to_vec();
        for triangle in positions.chunks_exact_mut(3) {
            let centre = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
            let lift = Vec3A::Y * (2.0 - centre.y + centre.y.abs());
            triangle.iter_mut().for_each(|p| *p += lift);
        }
        mesh.positions = positions.into();
    }
    for light in &mut scene.lights {
        light.position.y = 2.0 + light.position.y.abs();
    }
    let prepared = ShadeScene::new(&scene);
    let mut random = Random::new(19);
    let (mut z_squares, mut tested) = (0.0, 0);
    for _ in 0..20 {
        let (p, n) = (5.0 * point(&mut random) * Vec3::new(1.0, 0.2, 1.0), point(&mut random).normalize());
        let exact = brute_force(&prepared, p, n);
        if exact == 0.0 {
            continue;
        }
        let from = crate::scenes::receiver(p, n);
        let (mut sum, mut squares) = (0.0, 0.0);
        const ROUNDS: usize = 8000;
        for _ in 0..ROUNDS {
            let light = sample(&prepared, &from, &mut random);
            let seen = prepared.lights.seen_from(&prepared, &light, from.p);
            let cos = seen.wi.dot(from.n).fast_max(splat(0.0));
            let value = light.valid.keep(seen.radiance.x * seen.geometry * cos / light.pdf);
            for value in value.to_array().map(f64::from) {
                sum += value;
                squares += value * value;
            }
        }
        let count = (ROUNDS * LANES) as f64;
        let mean = sum / count;
        let error = ((squares / count - mean * mean) / count).sqrt();
        assert!(error < 0.02 * exact, "{mean} ± {error} for {exact}");
        let z = (mean - exact) / error.hypot(1e-4 * exact);
        assert!(z.abs() < 4.0, "{mean} ± {error} for {exact}");
        z_squares += z * z;
        tested += 1;
    }
    println!("{tested} receivers, mean squared score {}", z_squares / f64::from(tested));
    assert!(tested > 15 && z_squares < 2.0 * f64::from(tested), "{z_squares} over {tested}");
}

#[test]
fn near_lights_are_preferred() {
    // A street of equal lamps that shine down: by power each would have 1 in 1000.
    let mut corners = Vec::new();
    for i in 0..1000 {
        let lamp = Vec3::new(2.0 * i as f32, 3.0, 0.0);
        corners.extend([lamp, lamp + Vec3::X * 0.1, lamp + Vec3::Z * 0.1]);
    }
    let mut scene = Scene { materials: vec![emitter(Vec3::ONE)], ..Scene::default() };
    place(&mut scene, soup(&corners, 0), Affine3A::IDENTITY);
    let prepared = ShadeScene::new(&scene);
    let from = crate::scenes::receiver(Vec3::new(1000.0, 0.0, 0.0), Vec3::Y);
    let probabilities = triangle_probabilities(&prepared, &from);
    let at = |i: usize| probabilities[i][0];
    let near: f64 = (495..=505).map(at).sum();
    println!("nearest {}, eleven nearest {near}", at(500));
    assert!(at(500) > 0.1 && near > 0.7);
}
