//! Scenes about opaque materials: mirrors, glossy metals around the threshold, coats, mixtures, normal maps.

use super::super::shapes::*;
use super::TestScene;
use gdpt::scene::Material;
use glam::{Vec3, Vec4};

/// A grey floor, a back wall and a large light above.
fn stage(light: f32) -> Builder {
    let mut b = Builder::default();
    b.quad(v(-2.0, 0.0, -1.0), v(0.0, 0.0, 4.0), v(4.0, 0.0, 0.0), diffuse(0.7, 0.7, 0.7));
    b.quad(v(-2.0, 0.0, -1.0), v(4.0, 0.0, 0.0), v(0.0, 2.5, 0.0), diffuse(0.6, 0.4, 0.3));
    b.quad(v(-0.8, 2.0, -0.6), v(1.6, 0.0, 0.0), v(0.0, 0.0, 1.6), emitter(Vec3::splat(light)));
    b
}

fn stage_view() -> gdpt::scene::Camera {
    camera(v(0.1, 0.9, 2.2), v(0.0, 0.4, 0.0), 50.0)
}

/// Emitters whose own surface is a mirror, and a metal below the threshold (B2).
pub fn glossy_emitters() -> TestScene {
    let mut b = stage(2.0);
    let mirror = Material { emission: v(3.0, 2.0, 1.0), ..metal(v(0.8, 0.8, 0.8), 0.0) };
    let glossy = Material { emission: v(1.0, 2.0, 3.0), ..metal(v(0.8, 0.8, 0.8), 0.026) };
    b.quad(v(-0.9, 0.1, -0.4), v(0.7, 0.0, -0.2), v(0.0, 0.8, 0.0), mirror);
    b.quad(v(0.1, 0.1, -0.6), v(0.7, 0.0, 0.3), v(0.0, 0.8, 0.0), glossy);
    TestScene::new("glossy_emitters", b.scene, stage_view(), 4)
}

/// A mirror beside a diffuse tile under a tiny light (B11).
pub fn mirror_diffuse_border() -> TestScene {
    let mut b = Builder::default();
    let a = v(0.0, 0.0, 2.0);
    b.quad(v(-1.0, 0.0, -1.0), a, v(1.0, 0.0, 0.0), metal(v(0.9, 0.9, 0.9), 0.0));
    b.quad(v(0.0, 0.0, -1.0), a, v(1.0, 0.0, 0.0), diffuse(0.7, 0.7, 0.7));
    b.quad(v(-1.0, 0.0, -1.0), v(2.0, 0.0, 0.0), v(0.0, 1.5, 0.0), diffuse(0.6, 0.5, 0.3));
    b.quad(v(-0.05, 1.5, 0.0), v(0.1, 0.0, 0.0), v(0.0, 0.0, 0.1), emitter(Vec3::splat(200.0)));
    TestScene::new("mirror_diffuse_border", b.scene, camera(v(0.1, 0.9, 1.8), v(0.0, 0.1, 0.0), 45.0), 4)
}

/// A normal map of smooth bumps.
fn bumps(b: &mut Builder, material: Material) -> Material {
    let byte = |x: f32| (127.5 + 127.5 * x).round() as u8;
    let map = texture(8, 8, |x, y| {
        let slope = |i: u32| 0.25 * (i as f32 * std::f32::consts::TAU / 8.0).sin();
        let n = v(slope(x), slope(y), 1.0).normalize();
        [byte(n.x), byte(n.y), byte(n.z), 255]
    });
    Material { normal_texture: b.texture(map), ..material }
}

/// A bumpy mirror and a bumpy rough metal treated as glossy (B17).
pub fn normal_mapped_mirror() -> TestScene {
    let mut b = stage(3.0);
    let mirror = bumps(&mut b, metal(v(0.9, 0.8, 0.7), 0.0));
    let rough = bumps(&mut b, metal(v(0.7, 0.8, 0.9), 0.3));
    b.quad(v(-0.9, 0.05, -0.3), v(0.8, 0.0, -0.2), v(0.0, 1.0, 0.0), mirror);
    b.quad(v(0.0, 0.05, -0.5), v(0.9, 0.0, 0.3), v(0.0, 1.0, 0.0), rough);
    TestScene::new("normal_mapped_mirror", b.scene, stage_view(), 4).threshold(0.2)
}

/// Diffuse below a perfectly smooth coat: both kinds of event at one vertex, beside a mirror and a diffuse tile.
pub fn plastic_coat() -> TestScene {
    let mut b = stage(3.0);
    b.quad(v(-1.0, 0.05, -0.3), v(0.8, 0.0, -0.2), v(0.0, 1.0, 0.0), plastic(v(0.7, 0.2, 0.2), 0.0));
    b.quad(v(-0.2, 0.05, -0.5), v(0.5, 0.0, 0.0), v(0.0, 1.0, 0.0), metal(v(0.9, 0.9, 0.9), 0.0));
    b.sphere(v(0.6, 0.4, 0.1), 0.4, 8, true, plastic(v(0.2, 0.6, 0.3), 0.0));
    TestScene::new("plastic_coat", b.scene, stage_view(), 4)
}

/// Metals just below and far above the threshold, side by side.
///
/// The environment keeps every reflection busy: with a black one, a light that only the far tail of a narrow lobe
/// reaches is found by light sampling alone, and no run is long enough to see the noise of the gradient there.
pub fn glossy_metals() -> TestScene {
    let mut b = stage(3.0);
    b.environment(8, 4, |x, y| v(0.3 + 0.1 * x as f32, 0.7, 0.2 + 0.2 * y as f32));
    let width = v(0.6, 0.0, 0.0);
    for (i, roughness) in [0.026, 0.5, 0.03, 0.25].into_iter().enumerate() {
        let origin = v(-1.2 + 0.6 * i as f32, 0.05, -0.5);
        b.quad(origin, width, v(0.0, 1.0, -0.2), metal(v(0.9, 0.7, 0.5), roughness));
    }
    TestScene::new("glossy_metals", b.scene, stage_view(), 4)
}

/// The same with a high threshold: all of them copy half-vectors, over curved surfaces, too.
pub fn rough_metals_half_vector() -> TestScene {
    let mut b = stage(3.0);
    b.quad(v(-1.2, 0.05, -0.5), v(1.2, 0.0, 0.0), v(0.0, 1.0, -0.2), metal(v(0.9, 0.7, 0.5), 0.5));
    b.sphere(v(0.5, 0.45, 0.0), 0.45, 8, true, metal(v(0.6, 0.8, 0.9), 0.4));
    TestScene::new("rough_metals_half_vector", b.scene, stage_view(), 4).threshold(0.3)
}

/// Metalness from a texture, between a dielectric and a metal.
pub fn metal_mixture() -> TestScene {
    let mut b = stage(3.0);
    let map = texture(5, 5, |x, y| [0, (60 + 40 * y) as u8, (20 + 50 * x) as u8, 255]);
    let mixture = Material {
        base_color: Vec4::new(0.8, 0.6, 0.3, 1.0),
        metallic_roughness_texture: b.texture(map),
        ..Material::default()
    };
    b.quad(v(-1.0, 0.05, -0.4), v(2.0, 0.0, -0.1), v(0.0, 1.2, 0.0), mixture);
    TestScene::new("metal_mixture", b.scene, stage_view(), 4)
}

/// A mixture of a lobe on the glossy side of the threshold and a diffuse one.
pub fn mixture_across_threshold() -> TestScene {
    let mut b = stage(3.0);
    let coat = |metallic| Material { metallic, ..plastic(v(0.6, 0.5, 0.7), 0.35) };
    b.quad(v(-1.0, 0.05, -0.4), v(1.0, 0.0, -0.1), v(0.0, 1.2, 0.0), coat(0.4));
    b.quad(v(0.0, 0.05, -0.5), v(1.0, 0.0, 0.1), v(0.0, 1.2, 0.0), coat(0.0));
    TestScene::new("mixture_across_threshold", b.scene, stage_view(), 4).threshold(0.2)
}
