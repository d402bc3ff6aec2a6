//! Lanes moved within a packet and across a pair of them.

use super::{LANES, Mask, f32x16, lanes};
use wide::u32x16;

/// Which lane of a pair of packets each lane of a new packet comes from.
#[derive(Clone, Copy, Debug)]
pub struct Pick {
    index: u32x16,
    from_second: Mask,
}

impl Pick {
    /// Lane i comes from lane `from[i]` of the first packet, or lane `from[i] − 16` of the second.
    pub fn new(from: [usize; LANES]) -> Self {
        Self {
            index: u32x16::new(from.map(|i| (i % LANES) as u32)),
            from_second: Mask::from_fn(|i| from[i] >= LANES),
        }
    }

    /// The set lanes of one packet, moved to the front in ascending order; what follows has no meaning.
    #[inline(always)]
    pub fn compress(lanes: Mask) -> Self {
        let mut index = [0; LANES];
        for (to, lane) in lanes.iter().enumerate() {
            index[to] = lane as u32;
        }
        Self { index: u32x16::new(index), from_second: Mask::NONE }
    }

    /// Picks from one packet.
    #[inline(always)]
    pub fn of(self, a: f32x16) -> f32x16 {
        if cfg!(target_feature = "avx512f") {
            bytemuck::cast(bytemuck::cast::<_, u32x16>(a).shuffle(self.index))
        } else {
            // `wide` shuffles within halves there.
            let (a, index) = (a.as_array(), self.index.as_array());
            lanes(|i| a[index[i] as usize % LANES])
        }
    }
}

/// What lanes can be picked from, across a pair of packets.
pub trait Permute: Copy {
    /// The picked lanes of `a` and `b`.
    fn permute(a: &Self, b: &Self, pick: Pick) -> Self;
}

impl Permute for f32x16 {
    #[inline(always)]
    fn permute(a: &Self, b: &Self, pick: Pick) -> Self {
        pick.from_second.select(pick.of(*b), pick.of(*a))
    }
}

impl Permute for Mask {
    #[inline(always)]
    fn permute(a: &Self, b: &Self, pick: Pick) -> Self {
        Self(f32x16::permute(&a.0, &b.0, pick))
    }
}

impl<T: Permute, const N: usize> Permute for [T; N] {
    #[inline(always)]
    fn permute(a: &Self, b: &Self, pick: Pick) -> Self {
        std::array::from_fn(|i| T::permute(&a[i], &b[i], pick))
    }
}
