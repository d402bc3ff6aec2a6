//! Buffers: the means of a film, as solvers and files need them.

use super::{Features, Film, Half, Plane};

/// A measured image and its measured differences.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measured {
    /// Radiance without very direct light.
    pub primal: Plane,
    /// I(x + 1, y) − I(x, y); the last column says nothing.
    pub dx: Plane,
    /// I(x, y + 1) − I(x, y), y down; the last row says nothing.
    pub dy: Plane,
}

/// Everything a solver reads and what is added to its image.
#[derive(Clone, Debug, Default)]
pub struct Buffers {
    /// Means over all samples.
    pub all: Measured,
    /// Means over the samples of even and of odd index, which are independent; `None` where a half has no sample.
    pub halves: Option<[Measured; 2]>,
    /// Very direct light.
    pub direct: Plane,
    /// What the camera rays meet first.
    pub features: Option<Features>,
}

impl Film {
    /// The means of the samples of `half`; black differences where none were measured.
    pub fn measured(&self, half: Half) -> Measured {
        let difference = |plane: Plane| {
            if self.has_gradients { plane } else { Plane::new(self.width, self.height) }
        };
        let (dx, dy) = if self.has_gradients { (self.dx(half), self.dy(half)) } else { Default::default() };
        Measured { primal: self.primal(half), dx: difference(dx), dy: difference(dy) }
    }

    /// The means that solvers and files need.
    pub fn buffers(&self) -> Buffers {
        let both_halves = self.samples(Half::A) > 0 && self.samples(Half::B) > 0;
        Buffers {
            all: self.measured(Half::Both),
            halves: both_halves.then(|| [self.measured(Half::A), self.measured(Half::B)]),
            direct: self.direct(),
            features: self.features.clone(),
        }
    }
}
