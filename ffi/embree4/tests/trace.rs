//! Builds and traces through the safe API: every packet width against the others and against arithmetic, masks,
//! instances, refused arguments, memory budgets.

use embree4::*;
use glam::{Affine3A, Quat, Vec3, Vec3A, Vec4};
use std::sync::Arc;

type Mesh = (Arc<[Vec3A]>, Arc<[[u32; 3]]>);

const OPTIONS: SceneOptions = SceneOptions { quality: BuildQuality::High, robust: false };

fn device() -> Device {
    Device::new(DeviceConfig { threads: 2, ..Default::default() }).expect("Embree is installed")
}

/// The unit square in the plane z = `z`. The fourth lane of a vertex is padding and holds a NaN here.
fn square(z: f32) -> Mesh {
    let corner = |x, y| Vec3A::from_vec4(Vec4::new(x, y, z, f32::NAN));
    let positions = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    (Arc::from(positions), Arc::from([[0, 1, 2], [0, 2, 3]]))
}

/// `n × n` squares of a bumpy surface.
fn terrain(n: u32) -> Mesh {
    let at = |i: u32| i as f32 / n as f32;
    let vertex = |i: u32| {
        let (x, y) = (at(i % (n + 1)), at(i / (n + 1)));
        Vec3A::new(x, y, 0.1 * (20.0 * x).sin() * (17.0 * y).cos())
    };
    let quad = |i: u32| {
        let a = i / n * (n + 1) + i % n;
        [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
    };
    ((0..(n + 1) * (n + 1)).map(vertex).collect(), (0..n * n).flat_map(quad).collect())
}

fn scene_of(device: &Device, meshes: &[(u32, &Mesh, u32)]) -> Scene {
    let mut builder = SceneBuilder::new(device, OPTIONS).expect("a scene");
    for &(id, mesh, mask) in meshes {
        builder.triangles(id, mesh.0.clone(), mesh.1.clone(), mask).expect("a valid mesh");
    }
    builder.commit().expect("a commit")
}

/// Sixteen rays down the z axis from z = 2 over a 4 × 4 raster of the unit square.
fn downwards(mask: u32) -> Ray16 {
    let x = std::array::from_fn(|i| (i % 4) as f32 * 0.25 + 0.1);
    let y = std::array::from_fn(|i| (i / 4) as f32 * 0.25 + 0.13);
    Ray16::new([x, y, [2.0; 16]], [[0.0; 16], [0.0; 16], [-1.0; 16]], [0.0; 16], [f32::INFINITY; 16], mask)
}

#[test]
fn hits_of_a_square_are_exact_and_inactive_lanes_are_untouched() {
    let scene = scene_of(&device(), &[(7, &square(0.5), 1)]);
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let mut rays = RayHit16::new(downwards(1));
        let active = 0b1010_1111_0101_0110u16;
        scene.intersect16(&Valid16::from_bits(active), &mut rays, coherence);
        for i in 0..16 {
            if active >> i & 1 == 0 {
                assert_eq!(rays.geometry()[i], INVALID_ID);
                assert_eq!(rays.t()[i], f32::INFINITY);
                continue;
            }
            let (x, y) = ((i % 4) as f32 * 0.25 + 0.1, (i / 4) as f32 * 0.25 + 0.13);
            assert_eq!((rays.geometry()[i], rays.instance()[i]), (7, INVALID_ID));
            assert_eq!(rays.t()[i], 1.5);
            // Triangle 0 is (0,0) (1,0) (1,1), triangle 1 is (0,0) (1,1) (0,1).
            let (primitive, u, v) = if x > y { (0, x - y, y) } else { (1, x, y - x) };
            assert_eq!(rays.primitive()[i], primitive, "lane {i}");
            assert!((rays.u()[i] - u).abs() < 1e-6 && (rays.v()[i] - v).abs() < 1e-6, "lane {i}");
        }
        let mut shadow = downwards(1);
        scene.occluded16(&Valid16::from_bits(active), &mut shadow, coherence);
        for i in 0..16 {
            let expected = if active >> i & 1 == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
            assert_eq!(shadow.tfar()[i], expected);
        }
    }
}

#[test]
fn all_packet_widths_agree_to_the_last_bit() {
    let scene = scene_of(&device(), &[(0, &terrain(40), 1)]);
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    let mut hits = 0;
    for round in 0..200 {
        let origin: [[f32; 16]; 3] = [0.0, 0.0, 1.0].map(|z| std::array::from_fn(|_| random() + z));
        let direction: [[f32; 16]; 3] = [0.0, 0.0, -1.0].map(|z| std::array::from_fn(|_| random() - 0.5 + z));
        let (near, far) = ([0.0; 16], [10.0; 16]);
        let mut wide = RayHit16::new(Ray16::new(origin, direction, near, far, 1));
        let coherence = if round % 2 == 0 { Coherence::Coherent } else { Coherence::Incoherent };
        scene.intersect16(&Valid16::new([-1; 16]), &mut wide, coherence);
        let half = |a: [f32; 16], from: usize| std::array::from_fn(|i| a[from + i]);
        let mut halves = [0, 8].map(|at| {
            let ray = Ray8::new(
                origin.map(|o| half(o, at)),
                direction.map(|d| half(d, at)),
                [0.0; 8],
                [10.0; 8],
                1,
            );
            RayHit8::new(ray)
        });
        for (at, rays) in halves.iter_mut().enumerate() {
            scene.intersect8(&Valid8::from_bits(0xff), rays, coherence);
            let mut shadow = rays_of(&origin, &direction, at * 8);
            scene.occluded8(&Valid8::from_bits(0xff), &mut shadow, coherence);
            for i in 0..8 {
                assert_eq!(shadow.tfar()[i] < 0.0, rays.geometry()[i] != INVALID_ID);
            }
        }
        for i in 0..16 {
            let ray = Ray1::new(origin.map(|o| o[i]), direction.map(|d| d[i]), 0.0, 10.0, 1);
            let (mut single, mut shadow) = (RayHit1::new(ray), ray);
            scene.intersect1(&mut single, coherence);
            scene.occluded1(&mut shadow, coherence);
            let half = &halves[i / 8];
            let of_single = (single.t(), single.uv(), single.primitive(), single.geometry());
            let of_half = (
                half.t()[i % 8],
                [half.u()[i % 8], half.v()[i % 8]],
                half.primitive()[i % 8],
                half.geometry()[i % 8],
            );
            let of_wide = (wide.t()[i], [wide.u()[i], wide.v()[i]], wide.primitive()[i], wide.geometry()[i]);
            assert_eq!(of_single, of_wide);
            assert_eq!(of_half, of_wide);
            assert_eq!(shadow.tfar() < 0.0, of_wide.3 != INVALID_ID);
            hits += u32::from(of_wide.3 != INVALID_ID);
        }
    }
    assert!((1000..3100).contains(&hits), "both hits and misses are needed: {hits} of 3200");
}

fn rays_of(origin: &[[f32; 16]; 3], direction: &[[f32; 16]; 3], from: usize) -> Ray8 {
    let half = |a: &[f32; 16]| std::array::from_fn(|i| a[from + i]);
    let three = |a: &[[f32; 16]; 3]| [half(&a[0]), half(&a[1]), half(&a[2])];
    Ray8::new(three(origin), three(direction), [0.0; 8], [10.0; 8], 1)
}

#[test]
fn masks_choose_geometry_and_instances() {
    let device = device();
    let child = scene_of(&device, &[(0, &square(0.0), u32::MAX)]);
    let mut builder = SceneBuilder::new(&device, OPTIONS).expect("a scene");
    let (positions, indices) = square(0.5);
    builder.triangles(3, positions, indices, 2).expect("a valid mesh");
    builder.instance(4, &child, Affine3A::from_translation(Vec3::Z), 1).expect("a valid instance");
    let scene = builder.commit().expect("a commit");
    let all = Valid16::new([-1; 16]);
    for (mask, ids, t) in [
        (1, (0, 4), 1.0),
        (2, (3, INVALID_ID), 1.5),
        (3, (0, 4), 1.0),
        (4, (INVALID_ID, INVALID_ID), f32::INFINITY),
    ] {
        let mut rays = RayHit16::new(downwards(mask));
        scene.intersect16(&all, &mut rays, Coherence::Coherent);
        let mut shadow = downwards(mask);
        scene.occluded16(&all, &mut shadow, Coherence::Incoherent);
        for i in 0..16 {
            assert_eq!((rays.geometry()[i], rays.instance()[i]), ids, "mask {mask}");
            assert_eq!(rays.t()[i], t, "mask {mask}");
            assert_eq!(shadow.tfar()[i] < 0.0, ids.0 != INVALID_ID, "mask {mask}");
        }
    }
}

#[test]
fn an_instance_is_hit_where_its_transform_puts_it() {
    let device = device();
    let child = scene_of(&device, &[(0, &terrain(8), 1)]);
    // The sign of the determinant differs between the two.
    for scale in [Vec3::new(2.0, 0.5, 1.5), Vec3::new(2.0, -0.5, 1.5)] {
        let rotation = Quat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.7);
        let to_world = Affine3A::from_scale_rotation_translation(scale, rotation, Vec3::new(0.5, 0.5, 0.1))
            * Affine3A::from_translation(Vec3::new(-0.5, -0.5, 0.0));
        let mut builder = SceneBuilder::new(&device, OPTIONS).expect("a scene");
        builder.instance(9, &child, to_world, 1).expect("a valid instance");
        let scene = builder.commit().expect("a commit");
        let (positions, indices) = terrain(8);
        let moved: Arc<[Vec3A]> = positions.iter().map(|&p| to_world.transform_point3a(p)).collect();
        let baked = scene_of(&device, &[(9, &(moved, indices), 1)]);
        let all = Valid16::new([-1; 16]);
        let mut of_instance = RayHit16::new(downwards(1));
        let mut of_baked = RayHit16::new(downwards(1));
        scene.intersect16(&all, &mut of_instance, Coherence::Coherent);
        baked.intersect16(&all, &mut of_baked, Coherence::Coherent);
        let mut hits = 0;
        for i in 0..16 {
            assert_eq!(of_instance.instance()[i], of_baked.geometry()[i]);
            assert_eq!(of_instance.primitive()[i], of_baked.primitive()[i]);
            if of_baked.geometry()[i] == 9 {
                assert!((of_instance.t()[i] - of_baked.t()[i]).abs() < 1e-5);
                assert!((of_instance.u()[i] - of_baked.u()[i]).abs() < 1e-4);
                hits += 1;
            }
        }
        assert!(hits >= 4, "{hits}");
    }
}

#[test]
fn scenes_outlive_builders_meshes_children_and_device() {
    let scene = {
        let device = device();
        let child = scene_of(&device, &[(0, &square(0.0), 1)]);
        let mut builder = SceneBuilder::new(&device, OPTIONS).expect("a scene");
        builder.instance(1, &child, Affine3A::IDENTITY, 1).expect("a valid instance");
        builder.commit().expect("a commit")
    };
    let hits: Vec<u32> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..4)
            .map(|_| {
                scope.spawn(|| {
                    let mut rays = RayHit16::new(downwards(1));
                    scene.intersect16(&Valid16::new([-1; 16]), &mut rays, Coherence::Coherent);
                    rays.instance()[5]
                })
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().expect("no panic")).collect()
    });
    assert_eq!(hits, [1; 4]);
}

#[test]
fn empty_scenes_and_empty_meshes_are_scenes() {
    let device = device();
    let nothing: Mesh = (Arc::from([]), Arc::from([]));
    for scene in [scene_of(&device, &[]), scene_of(&device, &[(0, &nothing, 1)])] {
        let mut rays = RayHit16::new(downwards(1));
        scene.intersect16(&Valid16::new([-1; 16]), &mut rays, Coherence::Coherent);
        assert_eq!(rays.geometry(), &[INVALID_ID; 16]);
    }
}

#[test]
fn bad_arguments_are_refused_before_embree_reads_them() {
    let device = device();
    let mut builder = SceneBuilder::new(&device, OPTIONS).expect("a scene");
    let (positions, indices) = square(0.0);
    let out_of_range: Arc<[[u32; 3]]> = Arc::from([[0, 1, 4]]);
    assert!(matches!(builder.triangles(0, positions.clone(), out_of_range, 1), Err(Error::Invalid(_))));
    assert!(matches!(
        builder.triangles(INVALID_ID, positions.clone(), indices.clone(), 1),
        Err(Error::Invalid(_))
    ));
    builder.triangles(0, positions.clone(), indices.clone(), 1).expect("a valid mesh");
    let taken = builder.triangles(0, positions, indices, 1);
    assert!(matches!(taken, Err(Error::Embree(_))), "an id in use: {taken:?}");
    let child = scene_of(&device, &[(0, &square(0.0), 1)]);
    for transform in [
        Affine3A::ZERO,
        Affine3A::from_scale(Vec3::new(1.0, 1.0, f32::NAN)),
        Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0)),
    ] {
        assert!(matches!(builder.instance(1, &child, transform, 1), Err(Error::Invalid(_))));
    }
    builder.instance(1, &child, Affine3A::IDENTITY, 1).expect("a valid instance");
    let nested = builder.commit().expect("a commit");
    let mut builder = SceneBuilder::new(&device, OPTIONS).expect("a scene");
    assert!(matches!(builder.instance(0, &nested, Affine3A::IDENTITY, 1), Err(Error::Invalid(_))));
    let other = scene_of(&self::device(), &[(0, &square(0.0), 1)]);
    assert!(matches!(builder.instance(0, &other, Affine3A::IDENTITY, 1), Err(Error::Invalid(_))));
}

/// Every budget below what the build needs ends in an error that says so, leaks nothing and leaves the device fit
/// for use.
#[test]
fn a_memory_budget_is_an_error_and_not_a_crash() {
    let mesh = terrain(60);
    let build = |max_memory| {
        let device = Device::new(DeviceConfig { threads: 2, max_memory, ..Default::default() })?;
        let mut builder = SceneBuilder::new(&device, OPTIONS)?;
        builder.triangles(0, mesh.0.clone(), mesh.1.clone(), 1)?;
        let result = builder.commit().map(|_| ());
        assert_eq!(device.memory_used(), 0, "all of it is given back with the scene");
        result.map(|()| device.memory_peak())
    };
    let peak = build(None).expect("no limit");
    assert!(peak > 100_000, "the monitor saw {peak} bytes");
    build(Some(2 * peak)).expect("twice what it takes");
    let mut refused = 0;
    for step in 0..100 {
        match build(Some(peak / 2 * step / 100)) {
            Err(Error::OutOfMemory(text)) => {
                assert!(!text.is_empty() && !text.contains('\n'), "{text}");
                refused += 1;
            }
            other => assert!(other.is_ok(), "{other:?}"),
        }
    }
    assert!(refused >= 80, "half of the peak cannot be enough: {refused} of 100 refused");
    assert_eq!(Arc::strong_count(&mesh.0), 1, "no scene holds the mesh any more");
}
