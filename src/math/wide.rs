//! Sixteen lanes at a time: floats (`wide::f32x16`), masks, vectors, colours and frames.
//!
//! Lane i of every value belongs to ray i of a packet. Wide code reads like scalar code with selects; control
//! flow asks a [`Mask`] whether any lane is left.

use glam::Vec3;
use std::ops::{Add, AddAssign, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};
pub use wide::f32x16;
use wide::u32x16;

/// Lanes of a packet.
pub const LANES: usize = 16;

/// Builds sixteen floats from a function of the lane.
#[inline(always)]
pub fn lanes(f: impl FnMut(usize) -> f32) -> f32x16 {
    f32x16::new(std::array::from_fn(f))
}

/// The same float in all lanes.
#[inline(always)]
pub fn splat(x: f32) -> f32x16 {
    f32x16::splat(x)
}

/// One truth value a lane, stored as all-ones or all-zero bits.
#[derive(Clone, Copy, Debug)]
pub struct Mask(pub f32x16);

impl Mask {
    /// No lane.
    pub const NONE: Self = Self(f32x16::new([0.0; LANES]));
    /// All lanes.
    pub const ALL: Self = Self(f32x16::new([f32::from_bits(u32::MAX); LANES]));

    /// Lane i is set where bit i is.
    #[inline(always)]
    pub fn from_bits(bits: u16) -> Self {
        Self(lanes(|i| f32::from_bits(0u32.wrapping_sub(u32::from(bits >> i) & 1))))
    }

    /// Builds a mask from a function of the lane.
    #[inline(always)]
    pub fn from_fn(mut f: impl FnMut(usize) -> bool) -> Self {
        Self(lanes(|i| f32::from_bits(if f(i) { u32::MAX } else { 0 })))
    }

    /// Bit i is set where lane i is.
    #[inline(always)]
    pub fn bits(self) -> u16 {
        self.0.to_bitmask() as u16
    }

    /// Whether any lane is set.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.any()
    }

    /// Whether no lane is set.
    #[inline(always)]
    pub fn none(self) -> bool {
        !self.0.any()
    }

    /// Whether all lanes are set.
    #[inline(always)]
    pub fn all(self) -> bool {
        self.0.all()
    }

    /// Whether lane `i` is set.
    #[inline(always)]
    pub fn get(self, i: usize) -> bool {
        self.bits() >> i & 1 != 0
    }

    /// How many lanes are set.
    #[inline(always)]
    pub fn count(self) -> u32 {
        self.bits().count_ones()
    }

    /// The indices of the set lanes, ascending.
    #[inline(always)]
    pub fn iter(self) -> impl Iterator<Item = usize> {
        let mut bits = self.bits();
        std::iter::from_fn(move || {
            let lane = bits.trailing_zeros() as usize;
            (bits != 0).then(|| {
                bits &= bits - 1;
                lane
            })
        })
    }

    /// `a` where set, `b` elsewhere.
    #[inline(always)]
    pub fn select<T: Select>(self, a: T, b: T) -> T {
        T::select(self, a, b)
    }

    /// `x` where set, zero elsewhere.
    #[inline(always)]
    pub fn keep<T: Select + Default>(self, x: T) -> T {
        T::select(self, x, T::default())
    }

    /// Lanes set here and not in `other`.
    #[inline(always)]
    pub fn and_not(self, other: Self) -> Self {
        self & !other
    }
}

impl Default for Mask {
    fn default() -> Self {
        Self::NONE
    }
}

impl BitAnd for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, o: Self) -> Self {
        Self(self.0 & o.0)
    }
}

impl BitOr for Mask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, o: Self) -> Self {
        Self(self.0 | o.0)
    }
}

impl Not for Mask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
}

/// What a [`Mask`] can choose between, lane by lane.
pub trait Select: Copy {
    /// `a` where `mask` is set, `b` elsewhere.
    fn select(mask: Mask, a: Self, b: Self) -> Self;
}

impl Select for f32x16 {
    #[inline(always)]
    fn select(mask: Mask, a: Self, b: Self) -> Self {
        mask.0.select(a, b)
    }
}

impl Select for Mask {
    #[inline(always)]
    fn select(mask: Mask, a: Self, b: Self) -> Self {
        (mask & a) | b.and_not(mask)
    }
}

impl Select for [u32; LANES] {
    #[inline(always)]
    fn select(mask: Mask, a: Self, b: Self) -> Self {
        let bits = mask.bits();
        std::array::from_fn(|i| if bits >> i & 1 != 0 { a[i] } else { b[i] })
    }
}

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

impl<T: Select, const N: usize> Select for [T; N] {
    #[inline(always)]
    fn select(m: Mask, a: Self, b: Self) -> Self {
        std::array::from_fn(|i| m.select(a[i], b[i]))
    }
}

/// Implements [`Select`] and [`Permute`] for a struct, field by field.
#[macro_export]
macro_rules! lanewise {
    ($type:ty { $($field:ident),+ $(,)? }) => {
        impl $crate::math::Select for $type {
            #[inline(always)]
            fn select(m: $crate::math::Mask, a: Self, b: Self) -> Self {
                Self { $($field: m.select(a.$field, b.$field)),+ }
            }
        }
        impl $crate::math::Permute for $type {
            #[inline(always)]
            fn permute(a: &Self, b: &Self, pick: $crate::math::Pick) -> Self {
                Self { $($field: $crate::math::Permute::permute(&a.$field, &b.$field, pick)),+ }
            }
        }
    };
}

lanewise!(Vec3x { x, y, z });
lanewise!(Frame { s, t, n });

/// Comparisons of sixteen floats that give a [`Mask`]; false where either side is NaN (`differs`: true).
pub trait Compare {
    /// `self < o`
    fn lt(self, o: Self) -> Mask;
    /// `self <= o`
    fn le(self, o: Self) -> Mask;
    /// `self > o`
    fn gt(self, o: Self) -> Mask;
    /// `self >= o`
    fn ge(self, o: Self) -> Mask;
    /// `self == o`
    fn same(self, o: Self) -> Mask;
    /// `self != o`
    fn differs(self, o: Self) -> Mask;
}

impl Compare for f32x16 {
    #[inline(always)]
    fn lt(self, o: Self) -> Mask {
        Mask(self.simd_lt(o))
    }
    #[inline(always)]
    fn le(self, o: Self) -> Mask {
        Mask(self.simd_le(o))
    }
    #[inline(always)]
    fn gt(self, o: Self) -> Mask {
        Mask(self.simd_gt(o))
    }
    #[inline(always)]
    fn ge(self, o: Self) -> Mask {
        Mask(self.simd_ge(o))
    }
    #[inline(always)]
    fn same(self, o: Self) -> Mask {
        Mask(self.simd_eq(o))
    }
    #[inline(always)]
    fn differs(self, o: Self) -> Mask {
        Mask(self.simd_ne(o))
    }
}

/// Sixteen three-vectors, or sixteen RGB colours (then `x, y, z` are R, G, B).
#[derive(Clone, Copy, Debug, Default)]
pub struct Vec3x {
    /// First component.
    pub x: f32x16,
    /// Second component.
    pub y: f32x16,
    /// Third component.
    pub z: f32x16,
}

/// Sixteen RGB colours, linear Rec.709.
pub type Rgb = Vec3x;

impl Vec3x {
    /// All zero.
    pub const ZERO: Self = Self { x: f32x16::ZERO, y: f32x16::ZERO, z: f32x16::ZERO };

    /// From three components.
    #[inline(always)]
    pub fn new(x: f32x16, y: f32x16, z: f32x16) -> Self {
        Self { x, y, z }
    }

    /// The same vector in all lanes.
    #[inline(always)]
    pub fn splat(v: Vec3) -> Self {
        Self::new(splat(v.x), splat(v.y), splat(v.z))
    }

    /// The same number in all components of all lanes.
    #[inline(always)]
    pub fn grey(v: f32) -> Self {
        Self::new(splat(v), splat(v), splat(v))
    }

    /// One float a lane, the same in all components.
    #[inline(always)]
    pub fn all(v: f32x16) -> Self {
        Self::new(v, v, v)
    }

    /// Builds sixteen vectors from a function of the lane.
    #[inline(always)]
    pub fn lanes(mut f: impl FnMut(usize) -> Vec3) -> Self {
        let v: [Vec3; LANES] = std::array::from_fn(&mut f);
        Self::new(lanes(|i| v[i].x), lanes(|i| v[i].y), lanes(|i| v[i].z))
    }

    /// The vector of lane `i`.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> Vec3 {
        Vec3::new(self.x.as_array()[i], self.y.as_array()[i], self.z.as_array()[i])
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> f32x16 {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z * o.z))
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        Self::new(
            self.y.mul_sub(o.z, self.z * o.y),
            self.z.mul_sub(o.x, self.x * o.z),
            self.x.mul_sub(o.y, self.y * o.x),
        )
    }

    /// Squared length.
    #[inline(always)]
    pub fn length_squared(self) -> f32x16 {
        self.dot(self)
    }

    /// Length.
    #[inline(always)]
    pub fn length(self) -> f32x16 {
        self.length_squared().sqrt()
    }

    /// Unit vector of the same direction; not finite for the zero vector.
    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * (splat(1.0) / self.length())
    }

    /// Largest component.
    #[inline(always)]
    pub fn max_component(self) -> f32x16 {
        self.x.fast_max(self.y).fast_max(self.z)
    }

    /// Largest absolute component.
    #[inline(always)]
    pub fn max_abs(self) -> f32x16 {
        Self::new(self.x.abs(), self.y.abs(), self.z.abs()).max_component()
    }

    /// Luminance of a linear Rec.709 colour.
    #[inline(always)]
    pub fn luminance(self) -> f32x16 {
        self.x * splat(0.2126) + self.y * splat(0.7152) + self.z * splat(0.0722)
    }

    /// Lanes in which all components are zero.
    #[inline(always)]
    pub fn is_zero(self) -> Mask {
        self.max_abs().same(f32x16::ZERO)
    }

    /// Lanes in which all components are finite.
    #[inline(always)]
    pub fn is_finite(self) -> Mask {
        Mask(self.x.is_finite() & self.y.is_finite() & self.z.is_finite())
    }

    /// `self * s + o`, fused.
    #[inline(always)]
    pub fn mul_add(self, s: f32x16, o: Self) -> Self {
        Self::new(self.x.mul_add(s, o.x), self.y.mul_add(s, o.y), self.z.mul_add(s, o.z))
    }
}

impl Add for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl AddAssign for Vec3x {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Sub for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Neg for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self::new(-self.x, -self.y, -self.z)
    }
}

/// Scaling, lane by lane.
impl Mul<f32x16> for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f32x16) -> Self {
        Self::new(self.x * s, self.y * s, self.z * s)
    }
}

/// Component-wise product, as of colours.
impl Mul for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self::new(self.x * o.x, self.y * o.y, self.z * o.z)
    }
}

impl Div<f32x16> for Vec3x {
    type Output = Self;
    #[inline(always)]
    fn div(self, s: f32x16) -> Self {
        self * (splat(1.0) / s)
    }
}

/// Sixteen right-handed orthonormal frames; local z is `n`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame {
    /// Local x in world coordinates.
    pub s: Vec3x,
    /// Local y in world coordinates.
    pub t: Vec3x,
    /// Local z in world coordinates.
    pub n: Vec3x,
}

impl Frame {
    /// A frame around the unit vectors `n` (Duff et al. 2017, "Building an Orthonormal Basis, Revisited").
    #[inline(always)]
    pub fn from_normal(n: Vec3x) -> Self {
        let one = splat(1.0);
        let sign = n.z.ge(f32x16::ZERO).select(one, -one);
        let a = -one / (sign + n.z);
        let b = n.x * n.y * a;
        let s = Vec3x::new(one + sign * n.x * n.x * a, sign * b, -sign * n.x);
        let t = Vec3x::new(b, sign + n.y * n.y * a, -n.y);
        Self { s, t, n }
    }

    /// World to local.
    #[inline(always)]
    pub fn to_local(&self, v: Vec3x) -> Vec3x {
        Vec3x::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[inline(always)]
    pub fn to_world(&self, v: Vec3x) -> Vec3x {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}
