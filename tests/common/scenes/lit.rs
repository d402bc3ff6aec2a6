//! Scenes about lights, visibility and the camera: diffuse surfaces only.

use super::super::shapes::*;
use super::TestScene;
use gdpt::scene::{AlphaMode, Material, PunctualKind, Wrap};
use glam::Vec3;

/// A coloured room with a box in it and a light at the ceiling, all lengths times `scale`.
fn room(scale: f32, grey: f32) -> Builder {
    let mut b = Builder::default();
    let s = |x, y, z| v(x, y, z) * scale;
    b.room(s(-1.0, 0.0, -1.0), s(1.0, 2.0, 1.6), grey, true);
    b.quad(s(-0.4, 1.98, -0.5), s(0.8, 0.0, 0.0), s(0.0, 0.0, 0.7), emitter(v(6.0, 5.0, 4.0)));
    b.cuboid(s(-0.1, 0.0, -0.5), s(0.5, 0.7, 0.1), diffuse(0.7, 0.6, 0.4));
    b
}

fn room_at_scale(name: &'static str, scale: f32) -> TestScene {
    let view = camera(v(0.1, 1.0, 1.5) * scale, v(0.0, 0.8, -0.5) * scale, 70.0);
    TestScene::new(name, room(scale, 0.65).scene, view, 5)
}

/// The diffuse room.
pub fn diffuse_box() -> TestScene {
    TestScene { size: [19, 9], ..room_at_scale("diffuse_box", 1.0) }
}

/// The same in millimetres (B4).
pub fn diffuse_box_small() -> TestScene {
    room_at_scale("diffuse_box_small", 1e-3)
}

/// The same in kilometres (B4).
pub fn diffuse_box_large() -> TestScene {
    room_at_scale("diffuse_box_large", 1e3)
}

/// Albedo 0.9 all around and paths that only roulette ends (B3).
pub fn deep_white_box() -> TestScene {
    let mut b = Builder::default();
    b.room(v(-1.0, 0.0, -1.0), v(1.0, 2.0, 1.6), 0.9, false);
    b.quad(v(-0.6, 1.98, -0.5), v(1.2, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(Vec3::splat(1.0)));
    b.cuboid(v(-0.1, 0.0, -0.5), v(0.5, 0.7, 0.1), diffuse(0.9, 0.9, 0.9));
    let view = camera(v(0.1, 1.0, 1.5), v(0.0, 0.8, -0.5), 70.0);
    TestScene { size: [9, 7], ..TestScene::new("deep_white_box", b.scene, view, 60).samples(16, 64) }
}

/// A floor in the penumbra of a blocker under an area light (B1).
pub fn penumbra() -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.8, 0.8));
    b.quad(v(-0.5, 2.0, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(Vec3::splat(8.0)));
    b.quad(v(-0.3, 1.0, -0.4), v(0.7, 0.0, 0.1), v(0.0, 0.0, 0.6), diffuse(0.5, 0.5, 0.5));
    TestScene::new("penumbra", b.scene, camera(v(0.2, 0.7, 1.6), v(0.0, 0.0, 0.0), 60.0), 3)
}

/// A floor with occluders under an environment that has a bright spot (B1 for environments).
pub fn environment_occluders() -> TestScene {
    let mut b = Builder::default();
    b.environment(16, 8, |x, y| {
        let spot = if (3..5).contains(&x) && (1..3).contains(&y) { 12.0 } else { 0.0 };
        v(0.3 + spot, 0.5 + spot, 0.8 + 0.7 * spot)
    });
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.7, 0.6));
    b.cuboid(v(-0.4, 0.0, -0.4), v(0.1, 0.8, 0.1), diffuse(0.3, 0.6, 0.7));
    b.cuboid(v(0.3, 0.0, -0.2), v(0.6, 0.4, 0.3), diffuse(0.7, 0.3, 0.3));
    TestScene::new("environment_occluders", b.scene, camera(v(0.3, 0.9, 2.0), v(0.0, 0.3, 0.0), 55.0), 4)
}

/// A floor with a box under one punctual light.
fn punctual(name: &'static str, kind: PunctualKind, intensity: f32) -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.8, 0.7));
    b.cuboid(v(-0.3, 0.0, -0.3), v(0.3, 0.5, 0.3), diffuse(0.7, 0.4, 0.3));
    b.quad(v(-1.0, 0.0, -0.8), v(2.0, 0.0, 0.0), v(0.0, 2.0, 0.0), diffuse(0.5, 0.6, 0.7));
    b.light(kind, v(0.7, 1.3, 0.6), v(-0.7, -1.2, -0.5), Vec3::splat(intensity));
    TestScene::new(name, b.scene, camera(v(0.3, 0.9, 2.0), v(0.0, 0.3, 0.0), 50.0), 4)
}

/// A point light (B7).
pub fn point_light() -> TestScene {
    punctual("point_light", PunctualKind::Point, 3.0)
}

/// A spot light whose cone ends in view (B7).
pub fn spot_light() -> TestScene {
    punctual("spot_light", PunctualKind::Spot { cos_inner: 0.95, cos_outer: 0.85 }, 5.0)
}

/// A directional light (B7).
pub fn directional_light() -> TestScene {
    punctual("directional_light", PunctualKind::Directional, 2.0)
}

/// Walls and lights seen from behind (B9).
pub fn walls_from_behind() -> TestScene {
    let mut b = Builder::default();
    // A floor that faces down, a wall that faces away, a light that shines on both sides, one that does not.
    b.quad(v(-3.0, 0.0, -3.0), v(6.0, 0.0, 0.0), v(0.0, 0.0, 6.0), diffuse(0.8, 0.8, 0.8));
    b.quad(v(-1.5, 0.0, -0.8), v(0.0, 2.0, 0.0), v(3.0, 0.0, 0.0), diffuse(0.6, 0.5, 0.7));
    let both_sides = Material { double_sided: true, ..emitter(v(4.0, 3.0, 2.0)) };
    b.quad(v(-0.6, 0.4, -0.3), v(0.0, 0.5, 0.0), v(0.5, 0.0, 0.2), both_sides);
    b.quad(v(0.3, 0.5, -0.2), v(0.0, 0.5, 0.0), v(0.5, 0.0, 0.1), emitter(v(2.0, 3.0, 4.0)));
    TestScene::new("walls_from_behind", b.scene, camera(v(0.0, 0.8, 2.0), v(0.0, 0.4, -0.2), 55.0), 4)
}

/// The floor on both sides of a standing light that shines on one: a point of the light is dark for one end of a
/// pair and bright for the other, and both must weight it alike.
pub fn one_sided_light() -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.8, 0.8));
    b.quad(v(-0.8, 0.15, 0.0), v(1.6, 0.0, 0.1), v(0.0, 0.8, 0.0), emitter(Vec3::splat(3.0)));
    let below = camera(v(0.05, 0.4, 0.9), v(0.0, 0.0, 0.05), 30.0);
    TestScene::new("one_sided_light", b.scene, below, 2).samples(128, 128)
}

/// A tessellated sphere light close to the floor (B9c, B10).
pub fn near_sphere_light() -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.8, 0.8));
    b.sphere(v(0.0, 0.35, 0.0), 0.25, 6, false, emitter(v(3.0, 3.0, 2.5)));
    b.cuboid(v(0.4, 0.0, -0.1), v(0.6, 0.3, 0.2), diffuse(0.5, 0.6, 0.7));
    TestScene::new("near_sphere_light", b.scene, camera(v(0.2, 0.8, 1.4), v(0.1, 0.1, 0.0), 50.0), 4)
}

/// A smooth sphere and a floor under a constant environment (B10).
pub fn constant_environment() -> TestScene {
    let mut b = Builder::default();
    b.environment(4, 2, |_, _| Vec3::ONE);
    b.sphere(v(0.0, 0.5, 0.0), 0.5, 10, true, diffuse(0.7, 0.5, 0.4));
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.6, 0.6, 0.6));
    TestScene::new("constant_environment", b.scene, camera(v(0.2, 0.8, 1.8), v(0.0, 0.4, 0.0), 50.0), 4)
}

/// A blend and a mask between light and floor, and before the camera.
fn coverage(name: &'static str, mode: AlphaMode) -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.8, 0.8, 0.8));
    b.quad(v(-0.5, 2.0, -0.5), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(Vec3::splat(6.0)));
    let mut holes = texture(4, 4, |x, y| [200, 150, 100, if (x + y).is_multiple_of(2) { 235 } else { 40 }]);
    holes.wrap = [Wrap::Repeat, Wrap::Mirror];
    let leaf =
        Material { base_color_texture: b.texture(holes), ..with_alpha(diffuse(0.9, 0.9, 0.9), mode, 0.9) };
    b.quad(v(-0.6, 0.9, -0.6), v(1.2, 0.0, 0.1), v(0.0, 0.0, 1.2), leaf.clone());
    b.quad(v(-0.7, 0.0, 0.5), v(0.9, 0.0, 0.1), v(0.0, 0.6, 0.0), leaf);
    TestScene::new(name, b.scene, camera(v(0.1, 0.7, 1.7), v(0.0, 0.2, 0.0), 55.0), 4)
}

/// alphaMode MASK.
pub fn alpha_mask() -> TestScene {
    coverage("alpha_mask", AlphaMode::Mask(0.5))
}

/// alphaMode BLEND.
pub fn alpha_blend() -> TestScene {
    coverage("alpha_blend", AlphaMode::Blend)
}

/// The diffuse room through a lens with a wide aperture.
pub fn thin_lens() -> TestScene {
    let mut scene = room_at_scale("thin_lens", 1.0);
    scene.camera.lens_radius = 0.08;
    scene.camera.focus_distance = 1.2;
    scene
}

/// A plane with a fine colour texture under an area light, beside an emissive texture.
pub fn textured_plane() -> TestScene {
    let mut b = Builder::default();
    let check =
        |x: u32, y: u32| if (x + y).is_multiple_of(2) { [250, 200, 30, 255] } else { [20, 60, 220, 255] };
    let mut image = texture(6, 6, check);
    image.srgb = true;
    image.linear_filter = false;
    let floor = Material { base_color_texture: b.texture(image), ..diffuse(0.9, 0.9, 0.9) };
    b.quad(v(-1.0, 0.0, -1.0), v(0.0, 0.0, 2.0), v(2.0, 0.0, 0.0), floor);
    let glow = texture(4, 4, |x, y| [(60 * x + 20) as u8, (50 * y + 40) as u8, 120, 255]);
    let screen = Material { emission_texture: b.texture(glow), ..emitter(Vec3::splat(5.0)) };
    b.quad(v(-0.7, 0.1, -0.9), v(1.4, 0.0, 0.0), v(0.0, 0.8, 0.0), screen);
    TestScene::new("textured_plane", b.scene, camera(v(0.2, 0.8, 1.5), v(0.0, 0.2, 0.0), 50.0), 3)
}

/// Coarse facets with the normals of a sphere.
pub fn coarse_smooth_spheres() -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.7, 0.7, 0.7));
    b.quad(v(-0.5, 1.8, -0.2), v(1.0, 0.0, 0.0), v(0.0, 0.0, 1.0), emitter(Vec3::splat(6.0)));
    b.sphere(v(-0.35, 0.4, 0.0), 0.4, 4, true, diffuse(0.7, 0.3, 0.2));
    b.sphere(v(0.5, 0.35, 0.2), 0.35, 3, true, plastic(v(0.2, 0.4, 0.7), 0.5));
    TestScene::new("coarse_smooth_spheres", b.scene, camera(v(0.1, 0.7, 1.8), v(0.05, 0.3, 0.0), 50.0), 4)
}

/// Instances, one of which mirrors; a light among them.
pub fn mirrored_instances() -> TestScene {
    use glam::{Affine3A, Quat};
    let mut b = Builder::default();
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.7, 0.7, 0.7));
    let ball = b.material(diffuse(0.7, 0.4, 0.3));
    let light = b.material(emitter(v(5.0, 5.0, 4.0)));
    let turn = Quat::from_rotation_y(0.4);
    let place = |scale: Vec3, at: Vec3| Affine3A::from_scale_rotation_translation(scale, turn, at);
    b.place(sphere(Vec3::ZERO, 1.0, 5, true, ball), place(v(-0.3, 0.4, 0.3), v(-0.4, 0.4, 0.0)));
    b.place(cuboid(v(-1.0, -1.0, -1.0), Vec3::ONE, ball), place(v(0.2, -0.3, 0.2), v(0.4, 0.3, -0.1)));
    let down = quad(v(-0.5, 0.0, -0.5), Vec3::X, Vec3::Z, light);
    b.place(down, place(v(1.0, 1.0, -1.0), v(0.0, 1.6, 0.2)));
    TestScene::new("mirrored_instances", b.scene, camera(v(0.1, 0.7, 1.8), v(0.0, 0.3, 0.0), 50.0), 4)
}
