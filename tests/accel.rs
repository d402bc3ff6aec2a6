//! Every ray-tracing backend against brute force in f64: the same hits, masks, intervals and lanes.
//!
//! A backend may differ from the oracle only where rounding decides: at the edge of a triangle, at the end of the
//! interval, or between two surfaces at the same distance. How far "at" reaches follows from f32's precision, the
//! distance and the angle of incidence.

use gdpt::accel::{Accel, BruteAccel, Coherence, EmbreeAccel, Hits, ObvhsAccel, Rays, Visible};
use gdpt::error::Result;
use gdpt::math::sampler::hash;
use gdpt::math::{LANES, Mask, Vec3x, lanes, splat};
use gdpt::scene::{AlphaMode, Instance, Material, Mesh, Scene};
use glam::{Affine3A, DVec3, Quat, Vec3, Vec3A};

/// Builds a backend.
type Build = fn(&Scene) -> Result<Box<dyn Accel>>;

/// The backends under test, each with its name.
const BACKENDS: [(&str, Build); 4] = [
    ("brute", |scene| Ok(Box::new(BruteAccel::new(scene)?))),
    ("obvhs", |scene| Ok(Box::new(ObvhsAccel::new(scene)?))),
    ("embree", |scene| Ok(Box::new(EmbreeAccel::new(scene, 2, false, None)?))),
    ("robust embree", |scene| Ok(Box::new(EmbreeAccel::new(scene, 2, true, None)?))),
];

const HINTS: [Coherence; 2] = [Coherence::Coherent, Coherence::Incoherent];
const VISIBLE: [Visible; 3] = [Visible::All, Visible::Opaque, Visible::Coverage];

/// Random numbers from a fixed seed: a hashed counter.
struct Random {
    seed: u32,
    count: u32,
}

impl Random {
    fn new(seed: u32) -> Self {
        Self { seed, count: 0 }
    }

    fn bits(&mut self) -> u32 {
        self.count += 1;
        hash(self.seed, self.count)
    }

    fn unit(&mut self) -> f32 {
        (self.bits() >> 8) as f32 / (1u32 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    fn point(&mut self, size: f32) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| self.between(-size, size)))
    }
}

fn material(alpha_mode: AlphaMode) -> Material {
    Material { alpha_mode, ..Material::default() }
}

fn mesh(positions: Vec<Vec3A>, triangles: Vec<[u32; 3]>, material: u32) -> Mesh {
    Mesh {
        name: "test".into(),
        positions: positions.into(),
        triangles: triangles.into(),
        normals: None,
        tangents: None,
        uvs: [None, None],
        colors: None,
        material,
    }
}

fn placed(mesh: u32, to_world: Affine3A) -> Instance {
    Instance { mesh, to_world, is_identity: to_world == Affine3A::IDENTITY }
}

/// `count` random triangles within ±1, from slivers to large.
fn soup(random: &mut Random, count: u32, material: u32) -> Mesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let centre = random.point(1.0);
        let size = 0.8 * random.unit().powi(2) + 0.01;
        positions.extend((0..3).map(|_| Vec3A::from(centre + random.point(size))));
    }
    mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(), material)
}

/// One soup that is opaque and one that alpha can open.
fn soup_scene() -> Scene {
    let mut random = Random::new(1);
    Scene {
        meshes: vec![soup(&mut random, 300, 0), soup(&mut random, 300, 1)],
        instances: vec![placed(0, Affine3A::IDENTITY), placed(1, Affine3A::IDENTITY)],
        materials: vec![material(AlphaMode::Opaque), material(AlphaMode::Mask(0.5))],
        ..Scene::default()
    }
}

/// A mesh placed once, and one placed six times: turned, scaled unevenly, mirrored.
fn instanced_scene() -> Scene {
    let mut random = Random::new(2);
    let mut instances = vec![placed(0, Affine3A::IDENTITY)];
    for i in 0..6 {
        let mirror = if i % 2 == 0 { 1.0 } else { -1.0 };
        instances.push(placed(
            1,
            Affine3A::from_scale_rotation_translation(
                Vec3::new(0.3 * mirror, 0.5, 0.2 + 0.1 * i as f32),
                Quat::from_rotation_y(random.between(0.0, 6.0)) * Quat::from_rotation_x(random.unit()),
                random.point(1.0),
            ),
        ));
    }
    Scene {
        meshes: vec![soup(&mut random, 100, 0), soup(&mut random, 100, 1)],
        instances,
        materials: vec![material(AlphaMode::Opaque), material(AlphaMode::Blend)],
        ..Scene::default()
    }
}

/// Packets from anywhere to anywhere: directions of any length, some along an axis, some with a bounded interval.
fn packet(random: &mut Random) -> Rays {
    let origin = Vec3x::lanes(|_| random.point(1.5));
    let direction = Vec3x::lanes(|i| {
        let mut d = (random.point(0.7) - origin.lane(i)) * 10f32.powf(random.between(-2.0, 2.0));
        if i % 5 == 4 {
            d *= [Vec3::X, Vec3::Y, Vec3::Z][i % 3];
        }
        d
    });
    let mut rays = Rays::new(origin, direction);
    let length = direction.length();
    rays.tnear = lanes(|i| if i % 3 == 0 { random.unit() / length.as_array()[i] } else { 0.0 });
    rays.tfar =
        lanes(|i| if i % 4 == 0 { 2.0 * random.unit() / length.as_array()[i] } else { f32::INFINITY });
    rays
}

/// How well lane `i` is known against triangle (instance, primitive): barycentrics and distance from the plane
/// equation in f64, and the error in barycentrics that f32 may make.
struct Exact {
    t: f64,
    bary: [f64; 3],
    tolerance: f64,
    t_tolerance: f64,
}

fn exact(scene: &Scene, rays: &Rays, i: usize, instance: u32, primitive: u32) -> Exact {
    let placed = scene.instances[instance as usize];
    let mesh = &scene.meshes[placed.mesh as usize];
    let [a, b, c] = mesh.triangles[primitive as usize].map(|k| {
        let p = placed.to_world.transform_point3a(mesh.positions[k as usize]);
        DVec3::new(p.x.into(), p.y.into(), p.z.into())
    });
    let (o, d) = (rays.origin.lane(i).as_dvec3(), rays.direction.lane(i).as_dvec3());
    let n = (b - a).cross(c - a);
    let t = n.dot(a - o) / n.dot(d);
    let p = o + d * t;
    let weight = |x: DVec3, y: DVec3| (x - p).cross(y - p).dot(n) / n.length_squared();
    let bary = [weight(b, c), weight(c, a), weight(a, b)];
    let longest = (b - a).length().max((c - a).length()).max((c - b).length());
    let height = n.length() / longest;
    let cosine = (n.dot(d) / (n.length() * d.length())).abs();
    let reach = (p - o).length() + o.length() + longest;
    // An error in the plane of the triangle, in units of its height; and along the ray, in units of the direction.
    let tolerance = 16.0 * f64::from(f32::EPSILON) * reach / (height * cosine);
    Exact { t, bary, tolerance, t_tolerance: tolerance * longest / d.length() }
}

impl Exact {
    /// Whether rounding may decide between hit and miss.
    fn is_doubtful(&self, rays: &Rays, i: usize) -> bool {
        let (tnear, tfar) = (f64::from(rays.tnear.as_array()[i]), f64::from(rays.tfar.as_array()[i]));
        self.bary.iter().any(|w| w.abs() < self.tolerance)
            || (self.t - tnear).abs() < self.t_tolerance
            || (self.t - tfar).abs() < self.t_tolerance
    }
}

/// Holds the hits of a backend against the oracle's. Returns how many lanes hit alike.
fn compare(name: &str, scene: &Scene, rays: &Rays, found: &Hits, oracle: &Hits) -> u32 {
    let mut alike = 0;
    for i in 0..LANES {
        let ids = |hits: &Hits| hits.valid.get(i).then(|| (hits.instance[i], hits.primitive[i]));
        let (ours, theirs) = (ids(found), ids(oracle));
        let known = |(instance, primitive)| exact(scene, rays, i, instance, primitive);
        if ours == theirs {
            let Some(known) = ours.map(known) else { continue };
            let bary = [found.u, found.v].map(|x| f64::from(x.as_array()[i]));
            let t = f64::from(found.t.as_array()[i]);
            for (value, expected, tolerance) in [
                (bary[0], known.bary[1], known.tolerance),
                (bary[1], known.bary[2], known.tolerance),
                (t, known.t, known.t_tolerance),
            ] {
                assert!(
                    (value - expected).abs() <= tolerance,
                    "{name}, lane {i}: {value} instead of {expected} ± {tolerance}"
                );
            }
            alike += 1;
        } else {
            let (ours, theirs) = (ours.map(known), theirs.map(known));
            let doubtful = [&ours, &theirs].into_iter().flatten().any(|k| k.is_doubtful(rays, i));
            let tie = ours
                .as_ref()
                .zip(theirs.as_ref())
                .is_some_and(|(a, b)| (a.t - b.t).abs() <= a.t_tolerance + b.t_tolerance);
            assert!(
                doubtful || tie,
                "{name}, lane {i}: {:?} instead of {:?}, ray {:?} -> {:?}",
                ids(found),
                ids(oracle),
                rays.origin.lane(i),
                rays.direction.lane(i)
            );
        }
    }
    alike
}

fn against_brute(scene: &Scene, seed: u32, least_hits: u32) {
    let brute = BruteAccel::new(scene).expect("finite scene");
    for (name, build) in BACKENDS {
        let accel = build(scene).expect("finite scene");
        let mut random = Random::new(seed);
        let (mut alike, mut packets) = (0, 0);
        for k in 0..1000 {
            let rays = packet(&mut random);
            let visible = VISIBLE[k % 3];
            let oracle = brute.intersect16(&rays, Mask::ALL, visible, Coherence::Incoherent);
            let hits = accel.intersect16(&rays, Mask::ALL, visible, HINTS[k % 2]);
            alike += compare(name, scene, &rays, &hits, &oracle);
            packets += 1;
            let occluded = accel.occluded16(&rays, Mask::ALL, visible, HINTS[k % 2]);
            for i in 0..LANES {
                if occluded.get(i) != hits.valid.get(i) {
                    let hit = if hits.valid.get(i) { &hits } else { &oracle };
                    assert!(hit.valid.get(i), "{name}, lane {i}: occluded by nothing");
                    let known = exact(scene, &rays, i, hit.instance[i], hit.primitive[i]);
                    assert!(known.is_doubtful(&rays, i), "{name}, lane {i}: occluded and intersect differ");
                }
            }
        }
        assert!(alike > least_hits * packets, "{name}: only {alike} equal hits in {packets} packets");
    }
}

#[test]
fn triangle_soup_is_hit_as_by_brute_force() {
    against_brute(&soup_scene(), 3, 3);
}

#[test]
fn instances_are_hit_as_by_brute_force() {
    against_brute(&instanced_scene(), 4, 3);
}

#[test]
fn inactive_lanes_report_nothing_and_change_nothing() {
    let scene = soup_scene();
    for (name, build) in BACKENDS {
        let accel = build(&scene).expect("finite scene");
        let mut random = Random::new(5);
        let mut hit = 0;
        for _ in 0..200 {
            let mut rays = packet(&mut random);
            let active = Mask::from_bits(random.bits() as u16);
            let full = accel.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Incoherent);
            let shadow = accel.occluded16(&rays, Mask::ALL, Visible::All, Coherence::Incoherent);
            // What lies in an inactive lane is nobody's business.
            rays.origin.x = active.select(rays.origin.x, splat(f32::NAN));
            rays.direction.y = active.select(rays.direction.y, splat(f32::INFINITY));
            let part = accel.intersect16(&rays, active, Visible::All, Coherence::Incoherent);
            assert_eq!(part.valid.bits(), full.valid.bits() & active.bits(), "{name}");
            for i in part.valid.iter() {
                assert_eq!(part.t.as_array()[i], full.t.as_array()[i], "{name}");
                assert_eq!(
                    (part.instance[i], part.primitive[i]),
                    (full.instance[i], full.primitive[i]),
                    "{name}"
                );
            }
            let part = accel.occluded16(&rays, active, Visible::All, Coherence::Incoherent);
            assert_eq!(part.bits(), shadow.bits() & active.bits(), "{name}");
            hit += part.count();
        }
        assert!(hit > 200, "{name}: too few hits to tell");
    }
}

/// Squares of two triangles across the z axis at z = 1, 2, 3; the second can be opened by alpha.
fn stack_scene() -> Scene {
    let square = |z: f32, material| {
        let at = |x, y| Vec3A::new(x, y, z);
        let corners = vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
        mesh(corners, vec![[0, 1, 2], [0, 2, 3]], material)
    };
    Scene {
        meshes: vec![square(1.0, 0), square(2.0, 1), square(3.0, 0)],
        instances: (0..3).map(|m| placed(m, Affine3A::IDENTITY)).collect(),
        materials: vec![material(AlphaMode::Opaque), material(AlphaMode::Mask(0.5))],
        ..Scene::default()
    }
}

#[test]
fn interval_is_open_at_tnear_and_closed_at_tfar() {
    let scene = stack_scene();
    // (tnear, tfar, instance that is hit); the direction is half a unit long, so that t is twice z.
    let below = |x: f32| f32::from_bits(x.to_bits() - 1);
    let cases = [
        (0.0, f32::INFINITY, Some(0)),
        (2.0, f32::INFINITY, Some(1)),
        (below(2.0), f32::INFINITY, Some(0)),
        (4.0, f32::INFINITY, Some(2)),
        (6.0, f32::INFINITY, None),
        (0.0, 2.0, Some(0)),
        (0.0, below(2.0), None),
        (2.0, 4.0, Some(1)),
        (2.0, below(4.0), None),
        (3.0, 3.5, None),
    ];
    for (name, build) in BACKENDS {
        let accel = build(&scene).expect("finite scene");
        for (tnear, tfar, expected) in cases {
            let mut rays =
                Rays::new(Vec3x::splat(Vec3::new(0.25, 0.5, 0.0)), Vec3x::splat(Vec3::new(0.0, 0.0, 0.5)));
            (rays.tnear, rays.tfar) = (splat(tnear), splat(tfar));
            let hits = accel.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Coherent);
            let found = hits.valid.get(7).then_some(hits.instance[7]);
            assert_eq!(found, expected, "{name}: ({tnear}, {tfar}]");
            let occluded = accel.occluded16(&rays, Mask::ALL, Visible::All, Coherence::Coherent);
            assert_eq!(occluded.all(), expected.is_some(), "{name}: ({tnear}, {tfar}]");
            assert_eq!(occluded.any(), expected.is_some(), "{name}: ({tnear}, {tfar}]");
        }
    }
}

#[test]
fn short_distances_and_lengths_do_not_matter() {
    let scene = stack_scene();
    for (name, build) in BACKENDS {
        let accel = build(&scene).expect("finite scene");
        // From just before the first square, and with a direction so long that all distances are tiny.
        for (z, length) in [(1.0 - 1e-6, 1.0), (0.0, 1e6), (1.0 - 1e-6, 1e3), (0.0, 1e-6)] {
            let rays =
                Rays::new(Vec3x::splat(Vec3::new(0.25, 0.5, z)), Vec3x::splat(Vec3::new(0.0, 0.0, length)));
            let hits = accel.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Coherent);
            assert!(hits.valid.all() && hits.instance == [0; LANES], "{name}: from z = {z}, length {length}");
        }
    }
}

#[test]
fn visibility_chooses_by_alpha() {
    let scene = stack_scene();
    for (name, build) in BACKENDS {
        let accel = build(&scene).expect("finite scene");
        let mut rays = Rays::new(Vec3x::splat(Vec3::new(0.25, 0.5, 1.5)), Vec3x::splat(Vec3::Z));
        for (visible, expected) in [(Visible::All, 1), (Visible::Opaque, 2), (Visible::Coverage, 1)] {
            let hits = accel.intersect16(&rays, Mask::ALL, visible, Coherence::Incoherent);
            assert_eq!(hits.instance, [expected; LANES], "{name}: {visible:?}");
        }
        rays.tfar = splat(1.0);
        for (visible, expected) in [(Visible::All, true), (Visible::Opaque, false), (Visible::Coverage, true)]
        {
            let occluded = accel.occluded16(&rays, Mask::ALL, visible, Coherence::Incoherent);
            assert_eq!(occluded.all(), expected, "{name}: {visible:?}");
        }
    }
}

#[test]
fn small_scenes_are_no_special_case() {
    let rays = Rays::new(Vec3x::splat(Vec3::new(0.25, 0.5, 0.0)), Vec3x::splat(Vec3::Z));
    for (name, build) in BACKENDS {
        let empty = build(&Scene::default()).expect("nothing to go wrong");
        assert!(
            empty.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Coherent).valid.none(),
            "{name}"
        );
        assert!(empty.occluded16(&rays, Mask::ALL, Visible::All, Coherence::Coherent).none(), "{name}");

        let mut one = stack_scene();
        one.instances.truncate(1);
        one.meshes[0].triangles = [[0, 2, 3]].into();
        let accel = build(&one).expect("finite scene");
        let hits = accel.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Coherent);
        assert!(hits.valid.all() && hits.primitive == [0; LANES], "{name}");
        // (0.25, 0.5) = 0.25 of the first corner + 0.625 of the second + 0.125 of the third.
        assert_eq!((hits.u.as_array()[3], hits.v.as_array()[3]), (0.625, 0.125), "{name}");

        let mut copies = stack_scene();
        copies.instances = (0..5000).map(|_| placed(0, Affine3A::IDENTITY)).collect();
        let accel = build(&copies).expect("coincident triangles are no error");
        assert!(accel.occluded16(&rays, Mask::ALL, Visible::All, Coherence::Coherent).all(), "{name}");
    }
}
