//! LDR-FLIP: how different two pictures look when flipped back and forth (Andersson, Nilsson, Akenine-Möller,
//! Oskarsson, Åström, Fairchild 2020, "FLIP: A Difference Evaluator for Alternating Images"), by its authors' own
//! code in the crate `nv-flip`.
//!
//! It takes pictures for the screen, 8-bit sRGB, not radiance: its value depends on exposure and tone mapping, which
//! are the caller's to state. The viewer sits 0.7 m from a screen 0.7 m and 3840 pixels wide. 0 is no difference
//! anyone sees, 1 the largest there is.

/// Distance and width of the screen, m, and its pixels across: the method's own default.
const SCREEN: (f32, f32, f32) = (0.7, 0.7, 3840.0);

/// The mean of LDR-FLIP over two pictures of `width`×`height` 8-bit sRGB pixels; `None` where either is not of that
/// size, or has no pixel.
pub fn mean(test: &[u8], reference: &[u8], width: usize, height: usize) -> Option<f64> {
    let bytes = width.checked_mul(height)?.checked_mul(3)?;
    if bytes == 0 || test.len() != bytes || reference.len() != bytes {
        return None;
    }
    let (columns, rows) = (u32::try_from(width).ok()?, u32::try_from(height).ok()?);
    let picture = |data| nv_flip::FlipImageRgb8::with_data(columns, rows, data);
    let (distance, screen, pixels) = SCREEN;
    let per_degree = nv_flip::pixels_per_degree(distance, pixels, screen);
    let map = nv_flip::flip(picture(reference), picture(test), per_degree).to_vec();
    Some(map.iter().map(|v| f64::from(*v)).sum::<f64>() / map.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_differ_by_nothing_and_sizes_must_agree() {
        let picture: Vec<u8> = (0..24 * 16 * 3).map(|i| (i * 37 % 256) as u8).collect();
        assert_eq!(mean(&picture, &picture, 24, 16), Some(0.0));
        assert!(mean(&picture, &picture, 16, 16).is_none() && mean(&[], &[], 0, 4).is_none());
        let (black, white) = (vec![0; 12], vec![255; 12]);
        let far = mean(&black, &white, 2, 2).expect("one size");
        assert!(far > 0.9 && far <= 1.0, "{far}");
    }
}
