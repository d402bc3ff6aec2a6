//! Scenes about transmission: solids and thin sheets, smooth and rough, from outside and inside.
//!
//! Rough ones raise the threshold of the shift, so that refraction copies half-vectors.

use super::super::shapes::*;
use super::TestScene;
use gdpt::scene::Material;
use glam::Vec3;

/// A smooth environment without a bright spot, a floor and a wall.
fn surroundings() -> Builder {
    let mut b = Builder::default();
    b.environment(8, 4, |x, y| v(0.4 + 0.15 * x as f32, 1.0, 1.6 - 0.3 * y as f32));
    b.quad(v(-3.0, 0.0, -3.0), v(0.0, 0.0, 6.0), v(6.0, 0.0, 0.0), diffuse(0.6, 0.5, 0.4));
    b.quad(v(-3.0, 0.0, -1.5), v(6.0, 0.0, 0.0), v(0.0, 1.0, 0.0), diffuse(0.3, 0.5, 0.7));
    b
}

fn view() -> gdpt::scene::Camera {
    camera(v(0.1, 0.8, 2.0), v(0.0, 0.4, 0.0), 45.0)
}

/// A block of which the left half has index 1.5 and the right half 1.33 (B5).
fn two_glasses(b: &mut Builder, roughness: f32) {
    b.cuboid(v(-0.8, 0.05, -0.3), v(-0.02, 0.9, 0.3), glass(1.5, roughness));
    b.cuboid(v(0.02, 0.05, -0.3), v(0.8, 0.9, 0.3), glass(1.33, roughness));
}

/// Rough glass of two indices side by side, seen from outside.
pub fn rough_glass_outside() -> TestScene {
    let mut b = surroundings();
    two_glasses(&mut b, 0.4);
    TestScene::new("rough_glass_outside", b.scene, view(), 5).threshold(0.3)
}

/// The same with the default threshold: reconnection through rough refraction.
pub fn rough_glass_reconnected() -> TestScene {
    let mut b = surroundings();
    two_glasses(&mut b, 0.6);
    TestScene::new("rough_glass_reconnected", b.scene, view(), 5)
}

/// From inside a solid whose far wall has two indices.
pub fn rough_glass_inside() -> TestScene {
    let mut b = surroundings();
    let (left, right) = (glass(1.5, 0.4), glass(1.33, 0.4));
    let height = v(0.0, 0.9, 0.0);
    b.quad(v(-0.8, 0.05, -0.4), height, v(0.8, 0.0, 0.0), left.clone());
    b.quad(v(0.0, 0.05, -0.4), height, v(0.8, 0.0, 0.0), right);
    b.quad(v(-0.8, 0.05, 1.0), v(1.6, 0.0, 0.0), height, left.clone());
    b.quad(v(-0.8, 0.05, -0.4), v(0.0, 0.0, 1.4), height, left.clone());
    b.quad(v(0.8, 0.05, 1.0), v(0.0, 0.0, -1.4), height, left.clone());
    b.quad(v(-0.8, 0.95, 1.0), v(1.6, 0.0, 0.0), v(0.0, 0.0, -1.4), left.clone());
    b.quad(v(-0.8, 0.05, -0.4), v(1.6, 0.0, 0.0), v(0.0, 0.0, 1.4), left);
    let inside = camera(v(0.05, 0.5, 0.9), v(0.0, 0.45, -0.4), 60.0);
    TestScene::new("rough_glass_inside", b.scene, inside, 6).threshold(0.3)
}

/// Bubbles of air in water, camera in the water: relative index below one (B5b).
pub fn rough_bubble() -> TestScene {
    let mut b = surroundings();
    b.sphere(v(-0.3, 0.5, 0.0), 0.45, 8, true, glass(1.0 / 1.33, 0.4));
    b.cuboid(v(0.3, 0.1, -0.3), v(0.8, 0.8, 0.3), glass(1.0 / 1.5, 0.3));
    TestScene::new("rough_bubble", b.scene, view(), 5).threshold(0.3)
}

/// A rough dielectric under grazing view (B6).
pub fn rough_glass_grazing() -> TestScene {
    let mut b = surroundings();
    b.cuboid(v(-0.9, 0.0, -1.0), v(0.9, 0.3, 1.0), glass(1.5, 0.5));
    let grazing = camera(v(0.0, 0.42, 2.2), v(0.0, 0.3, 0.0), 25.0);
    TestScene::new("rough_glass_grazing", b.scene, grazing, 5).threshold(0.3)
}

/// Smooth glass: a ball and a block, before a diffuse background.
pub fn smooth_glass() -> TestScene {
    let mut b = surroundings();
    b.sphere(v(-0.4, 0.45, 0.0), 0.4, 8, true, glass(1.5, 0.0));
    b.cuboid(v(0.2, 0.05, -0.3), v(0.8, 0.8, 0.3), glass(1.33, 0.0));
    TestScene::new("smooth_glass", b.scene, view(), 6)
}

/// An emitter behind smooth glass: not very direct, so it goes through the shift (T15).
pub fn light_behind_glass() -> TestScene {
    let mut b = Builder::default();
    b.quad(v(-2.0, 0.0, -2.0), v(0.0, 0.0, 4.0), v(4.0, 0.0, 0.0), diffuse(0.6, 0.6, 0.6));
    b.cuboid(v(-0.6, 0.1, 0.0), v(0.6, 1.0, 0.2), glass(1.5, 0.0));
    b.quad(v(-1.1, 0.1, -0.8), v(1.9, 0.0, 0.2), v(0.0, 1.4, 0.0), emitter(v(2.0, 3.0, 4.0)));
    TestScene::new("light_behind_glass", b.scene, view(), 5)
}

/// Thin sheets, smooth and rough, tinted.
pub fn thin_glass() -> TestScene {
    let mut b = surroundings();
    let sheet = |roughness, color: Vec3| Material {
        base_color: color.extend(1.0),
        is_solid: false,
        ..glass(1.5, roughness)
    };
    b.quad(v(-0.9, 0.1, 0.2), v(0.8, 0.0, -0.1), v(0.0, 0.9, 0.0), sheet(0.0, v(0.9, 0.6, 0.5)));
    b.quad(v(0.0, 0.1, 0.1), v(0.8, 0.0, 0.2), v(0.0, 0.9, 0.0), sheet(0.4, v(0.5, 0.8, 0.9)));
    TestScene::new("thin_glass", b.scene, view(), 5).threshold(0.3)
}

/// Absorbing solids, smooth and rough, one with a diffuse share.
pub fn absorption() -> TestScene {
    let mut b = surroundings();
    let absorbing = |m: Material, a: Vec3| Material { absorption: a, ..m };
    b.cuboid(v(-0.9, 0.05, -0.3), v(-0.3, 0.9, 0.3), absorbing(glass(1.5, 0.0), v(0.5, 1.5, 3.0)));
    b.cuboid(v(-0.2, 0.05, -0.3), v(0.3, 0.9, 0.3), absorbing(glass(1.4, 0.5), v(2.0, 0.5, 0.5)));
    let milky = Material { transmission: 0.5, ..glass(1.5, 0.5) };
    b.cuboid(v(0.4, 0.05, -0.3), v(0.9, 0.9, 0.3), absorbing(milky, v(0.2, 2.0, 0.4)));
    TestScene::new("absorption", b.scene, view(), 5)
}
