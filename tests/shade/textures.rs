//! Texture look-ups: wrap modes, filter, sRGB, transform, coordinate sets.

use crate::scenes::texture;
use gdpt::scene::{Scene, TextureRef, Wrap};
use gdpt::shade::texture::{Decoder, srgb_to_linear};
use glam::{Affine2, Vec2, Vec4};

/// Four texels in a row, red 0, 51, 102, 255 (0, 0.2, 0.4, 1).
const ROW: [[u8; 4]; 4] = [[0, 0, 0, 255], [51, 0, 0, 255], [102, 0, 0, 255], [255, 0, 0, 255]];

#[test]
fn wrap_modes_continue_the_image() {
    let decoder = Decoder::default();
    // Columns −5..9 by nearest texel.
    let expect = [
        (Wrap::Repeat, [3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0]),
        (Wrap::Mirror, [3, 3, 2, 1, 0, 0, 1, 2, 3, 3, 2, 1, 0, 0]),
        (Wrap::Clamp, [0, 0, 0, 0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 3]),
    ];
    for (mode, columns) in expect {
        let mut image = texture(4, &ROW, false, false);
        image.wrap = [mode, mode];
        for (i, column) in columns.into_iter().enumerate() {
            let u = (i as f32 - 5.0 + 0.5) / 4.0;
            let red = decoder.lookup(&image, Vec2::new(u, 7.3)).x;
            assert_eq!(red, f32::from(ROW[column][0]) / 255.0, "{mode:?} at column {}", i as i32 - 5);
        }
    }
}

#[test]
fn bilinear_filter_meets_texel_centres_and_runs_straight_between() {
    let decoder = Decoder::default();
    let image = texture(4, &ROW, false, true);
    for (i, texel) in ROW.iter().enumerate() {
        let red = decoder.lookup(&image, Vec2::new((i as f32 + 0.5) / 4.0, 0.5)).x;
        assert!((red - f32::from(texel[0]) / 255.0).abs() < 1e-6);
    }
    let between = decoder.lookup(&image, Vec2::new(1.75 / 4.0, 0.5)).x;
    assert!((between - (0.75 * 0.2 + 0.25 * 0.4)).abs() < 1e-6);
    // Over the border the image repeats: half the last, half the first texel.
    assert!((decoder.lookup(&image, Vec2::new(1.0, 0.5)).x - 0.5).abs() < 1e-6);
    let rows = texture(1, &[[0; 4], [255; 4]], false, true);
    assert!((decoder.lookup(&rows, Vec2::new(0.3, 0.5)).x - 0.5).abs() < 1e-6);
}

#[test]
fn srgb_is_decoded_before_filtering_and_alpha_never() {
    let decoder = Decoder::default();
    let image = texture(2, &[[0, 0, 0, 0], [255, 188, 10, 188]], true, true);
    let at = |u| decoder.lookup(&image, Vec2::new(u, 0.5));
    let second = at(0.75);
    for (value, byte) in [(second.x, 255.0), (second.y, 188.0), (second.z, 10.0)] {
        let x: f64 = byte / 255.0;
        let exact = if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) };
        assert!((f64::from(value) - exact).abs() < 1e-6, "{byte}: {value} for {exact}");
        assert_eq!(value, srgb_to_linear(byte as f32 / 255.0));
    }
    assert!((second.w - 188.0 / 255.0).abs() < 1e-6);
    assert!((at(0.5) - 0.5 * second).length() < 1e-6);
    assert!((decoder.mean(&image) - 0.5 * second).length() < 1e-6);
}

#[test]
fn transform_and_coordinate_set_are_honoured() {
    let decoder = Decoder::default();
    let scene = Scene { textures: vec![texture(4, &ROW, false, false)], ..Scene::default() };
    let transform = Affine2::from_scale_angle_translation(Vec2::new(2.0, 1.0), 0.0, Vec2::new(0.25, 0.0));
    let look = |uv_set| {
        let uv = [Vec2::new(0.05, 0.5), Vec2::new(0.15, 0.5)];
        decoder.lookup_ref(&scene, &TextureRef { texture: 0, uv_set, transform }, uv)
    };
    assert_eq!(look(0), Vec4::new(0.2, 0.0, 0.0, 1.0));
    assert_eq!(look(1), Vec4::new(0.4, 0.0, 0.0, 1.0));
}

#[test]
fn extreme_coordinates_stay_inside() {
    let decoder = Decoder::default();
    for mode in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
        for linear in [false, true] {
            let mut image = texture(4, &ROW, true, linear);
            image.wrap = [mode, mode];
            for x in [0.0, -0.0, 1.0, -1e-8, 1e9, -1e9, f32::MAX, f32::MIN, f32::INFINITY, f32::NAN] {
                decoder.lookup(&image, Vec2::new(x, -x));
            }
        }
    }
}
