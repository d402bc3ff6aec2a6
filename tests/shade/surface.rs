//! What surfaces gather: positions, normals under transforms, normal maps, coordinates, emission, coverage, offsets.

use crate::Random;
use crate::scenes::{
    area_pdf, emitter, hit, hits, matte, one_square, place, receiver, reference, square, texture,
};
use gdpt::math::{Mask, Vec3x, splat};
use gdpt::scene::{AlphaMode, Material, Scene, TextureRef};
use gdpt::shade::{ShadeScene, Surface, alpha};
use glam::{Affine2, Affine3A, Quat, Vec2, Vec3, Vec4};

/// The surface of lane 0 for a hit seen from `wo`.
fn surface(scene: &Scene, primitive: u32, u: f32, v: f32, wo: Vec3) -> Surface {
    Surface::new(&ShadeScene::new(scene), &hit(0, primitive, u, v), Mask::ALL, Vec3x::splat(wo.normalize()))
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).length() < 1e-5
}

#[test]
fn position_and_normal_follow_the_instance() {
    let rotation = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.4);
    let moved = Affine3A::from_scale_rotation_translation(
        Vec3::new(2.0, 0.5, 3.0),
        rotation,
        Vec3::new(1.0, 2.0, -3.0),
    );
    for to_world in [Affine3A::IDENTITY, moved] {
        let scene = one_square(matte(), to_world);
        let s = surface(&scene, 0, 0.25, 0.5, Vec3::Y);
        // Corners (0,0), (1,0), (1,1) with weights 0.25, 0.25, 0.5.
        assert!(close(s.p.lane(3), to_world.transform_point3(Vec3::new(0.75, 0.5, 0.0))));
        let normal = to_world.matrix3.inverse().transpose() * Vec3::Z;
        assert!(close(s.ng.lane(3), normal.normalize()));
        assert!(close(s.bsdf.frame.n.lane(3), s.ng.lane(3)));
    }
}

#[test]
fn a_mirroring_instance_keeps_its_front() {
    // Mirrored in x: the winding in the world turns, the front does not: it is still the side of the image of +z.
    let mirrored = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    let turned_over = Affine3A::from_scale(Vec3::new(1.0, 1.0, -2.0));
    for (to_world, front) in [(Affine3A::IDENTITY, Vec3::Z), (mirrored, Vec3::Z), (turned_over, Vec3::NEG_Z)]
    {
        let mut scene = one_square(emitter(Vec3::ONE), to_world);
        scene.meshes[0].normals = Some(vec![Vec3::Z; 4]);
        let s = surface(&scene, 1, 0.3, 0.3, front);
        assert!(close(s.ng.lane(0), front) && close(s.bsdf.frame.n.lane(0), front), "{to_world}");
        assert_eq!(s.emission.lane(0), Vec3::ONE);
        assert_eq!(surface(&scene, 1, 0.3, 0.3, -front).emission.lane(0), Vec3::ZERO);
    }
}

#[test]
fn shading_normals_use_the_inverse_transpose_and_the_front() {
    let to_world = Affine3A::from_scale(Vec3::new(4.0, 1.0, 1.0));
    let slanted = Vec3::new(0.6, 0.0, 0.8);
    for sign in [1.0, -1.0] {
        let mut scene = one_square(matte(), to_world);
        scene.meshes[0].normals = Some(vec![slanted * sign; 4]);
        let s = surface(&scene, 0, 0.2, 0.2, Vec3::Z);
        // Normals against the winding are turned to its front.
        let expected = Vec3::new(0.6 / 4.0, 0.0, 0.8).normalize();
        assert!(close(s.bsdf.frame.n.lane(5), expected), "{}", s.bsdf.frame.n.lane(5));
        assert!(close(s.ng.lane(5), Vec3::Z));
    }
}

#[test]
fn normal_maps_turn_the_frame_in_tangent_space() {
    // (x, y, z) = (0.6, 0, 0.8) within the rounding of bytes; then the same in y.
    let texels = [[204, 128, 230, 255], [128, 204, 230, 255]];
    let decode = |t: [u8; 4]| Vec3::from([t[0], t[1], t[2]].map(|x| f32::from(x) / 127.5 - 1.0));
    for (texel, map) in texels.into_iter().map(|t| (t, decode(t))) {
        for (sign, scale) in [(1.0, 1.0), (-1.0, 1.0), (1.0, 0.5)] {
            for to_world in [Affine3A::IDENTITY, Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))] {
                let material = Material { normal_texture: Some(reference()), normal_scale: scale, ..matte() };
                let mut scene = one_square(material, to_world);
                scene.textures.push(texture(1, &[texel], false, true));
                scene.meshes[0].normals = Some(vec![Vec3::Z; 4]);
                scene.meshes[0].tangents = Some(vec![Vec4::new(1.0, 0.0, 0.0, sign); 4]);
                let n = surface(&scene, 0, 0.2, 0.3, Vec3::Z).bsdf.frame.n.lane(7);
                // In object space: tangent x, bitangent sign · y, normal z; then as any normal to the world.
                let object = Vec3::new(map.x * scale, map.y * scale * sign, map.z);
                let expected = to_world.matrix3.inverse().transpose() * object;
                assert!(close(n, expected.normalize()), "{n} for {expected}, sign {sign}, {to_world}");
            }
        }
    }
}

#[test]
fn base_colour_is_factor_times_texture_times_vertex_colour() {
    let transform = Affine2::from_translation(Vec2::new(0.5, 0.0));
    let texels = [[255, 0, 0, 255], [0, 255, 0, 128]];
    for (uv_set, expected) in [(0, Vec3::new(0.0, 0.5 * 0.25, 0.0)), (1, Vec3::new(0.5 * 0.25, 0.0, 0.0))] {
        let material = Material {
            base_color: Vec4::splat(0.5),
            base_color_texture: Some(TextureRef { texture: 0, uv_set, transform }),
            ..matte()
        };
        let mut scene = one_square(material, Affine3A::IDENTITY);
        scene.textures.push(texture(2, &texels, true, false));
        scene.meshes[0].colors = Some(vec![Vec4::splat(0.25); 4]);
        // uv of set 0 is (0.35, 0.1), of set 1 (0.7, 0.2); both are moved by half the image.
        let s = surface(&scene, 0, 0.25, 0.1, Vec3::Z);
        assert!(close(s.albedo.lane(0), expected), "{}", s.albedo.lane(0));
        let (f, _) = s.bsdf.eval(Vec3x::splat(Vec3::Z), Vec3x::splat(Vec3::Z));
        assert!(close(f.lane(0), expected * std::f32::consts::FRAC_1_PI), "specular 0 is Lambert");
    }
}

#[test]
fn coverage_reads_alpha_by_its_mode() {
    let texels = [[255, 255, 255, 255], [255, 255, 255, 51]];
    for (mode, expected) in [
        (AlphaMode::Opaque, [1.0, 1.0]),
        (AlphaMode::Mask(0.3), [1.0, 0.0]),
        (AlphaMode::Mask(0.05), [1.0, 1.0]),
        (AlphaMode::Blend, [0.8, 0.16]),
    ] {
        let material = Material {
            alpha_mode: mode,
            base_color: Vec4::new(1.0, 1.0, 1.0, 0.8),
            base_color_texture: Some(reference()),
            ..matte()
        };
        let mut scene = one_square(material, Affine3A::IDENTITY);
        scene.textures.push(texture(2, &texels, true, false));
        let scene = ShadeScene::new(&scene);
        for (x, expected) in [0.3, 0.7].into_iter().zip(expected) {
            let coverage = alpha(&scene, &hit(0, 0, x - 0.1, 0.1), Mask::from_bits(0xff));
            assert!((coverage.as_array()[7] - expected).abs() < 1e-6, "{mode:?} at {x}");
            assert_eq!(coverage.as_array()[8], 0.0);
        }
    }
}

#[test]
fn emission_leaves_the_front_or_both_sides() {
    let radiance = Vec3::new(3.0, 2.0, 1.0);
    let two_sided = Material { double_sided: true, ..emitter(radiance) };
    let unlit = Material { unlit: true, base_color: radiance.extend(1.0), ..Material::default() };
    for (material, back, sampled) in
        [(emitter(radiance), Vec3::ZERO, true), (two_sided, radiance, true), (unlit, radiance, false)]
    {
        let scene = one_square(material, Affine3A::IDENTITY);
        let (above, below) =
            (surface(&scene, 0, 0.2, 0.2, Vec3::ONE), surface(&scene, 0, 0.2, 0.2, -Vec3::ONE));
        assert_eq!(above.emission.lane(1), radiance);
        assert_eq!(below.emission.lane(1), back);
        assert!(above.is_emitter.all() && below.is_emitter.all());
        assert_eq!(area_pdf(&ShadeScene::new(&scene), &receiver(Vec3::Z, Vec3::NEG_Z), 0, 0) > 0.0, sampled);
        assert!(above.bsdf.has_smooth().none());
    }
    let dark = one_square(matte(), Affine3A::IDENTITY);
    assert!(ShadeScene::new(&dark).lights.is_empty());
    let s = surface(&dark, 0, 0.2, 0.2, Vec3::Z);
    assert!(s.is_emitter.none() && s.emission.is_zero().all());
}

#[test]
fn lanes_differ_and_inactive_lanes_are_default() {
    let mut scene = one_square(matte(), Affine3A::IDENTITY);
    scene.materials.push(emitter(Vec3::X));
    place(&mut scene, square(1), Affine3A::from_translation(Vec3::new(0.0, 0.0, 5.0)));
    let prepared = ShadeScene::new(&scene);
    let mut mixed = hit(0, 0, 0.1, 0.1);
    mixed.instance = std::array::from_fn(|i| (i % 2) as u32);
    mixed.valid = Mask::from_bits(0x7fff);
    let s = Surface::new(&prepared, &mixed, Mask::from_bits(0xfffe), Vec3x::splat(Vec3::Z));
    assert_eq!(s.is_emitter.bits(), 0x2aaa);
    assert_eq!((s.p.lane(1).z, s.p.lane(2).z), (5.0, 0.0));
    for idle in [0, 15] {
        assert_eq!((s.p.lane(idle), s.ng.lane(idle)), (Vec3::ZERO, Vec3::ZERO));
    }
    assert_eq!((s.bsdf.has_smooth() | s.bsdf.has_dirac()).bits() & 0x8001, 0);
}

#[test]
fn rays_start_on_the_side_they_leave_by_beyond_rounding() {
    let rotation = Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.6);
    let to_world =
        Affine3A::from_scale_rotation_translation(Vec3::splat(7.0), rotation, Vec3::new(100.0, -40.0, 3.0));
    let scene = one_square(matte(), to_world);
    let prepared = ShadeScene::new(&scene);
    let mut random = Random::new(5);
    let normal = rotation.as_dquat() * glam::DVec3::Z;
    for _ in 0..2000 {
        let u = random.wide() * splat(0.5);
        let surface = hits(0, 0, u, random.wide() * splat(0.5));
        let w = random.directions();
        let s = Surface::new(&prepared, &surface, Mask::ALL, w);
        let origin = s.spawn(w);
        for lane in 0..16 {
            let height = (origin.lane(lane).as_dvec3() - glam::DVec3::new(100.0, -40.0, 3.0)).dot(normal);
            let side = f64::from(w.lane(lane).dot(s.ng.lane(lane)));
            assert!(height * side.signum() > 1e-4 && height.abs() < 2e-3, "{height} for {side}");
        }
    }
}
