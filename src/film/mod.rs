//! The film: what an integrator measured, pixel by pixel, and what a solver needs of it.
//!
//! Every write of a sample goes to its own pixel: the four one-sided gradient sums live at the base pixel, and the
//! differences dx, dy are formed once, before the solve: dx(i→i+1) = mean g_right(i) − mean g_left(i+1), dy alike
//! with y pointing down. No races, no atomics: tiles merge in any order to the same bits.
//!
//! All radiance is W·m⁻²·sr⁻¹, linear Rec.709. 160 bytes a pixel without the feature layers.

pub mod buffers;
mod passes;
pub mod plane;
pub mod tile;

pub use buffers::{Buffers, Measured};
pub use plane::Plane;
pub use tile::{Direction, FilmTile, PixelSample};

/// Which samples: all of them, or one of the two halves (even and odd sample indices), which are independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Half {
    /// Both halves.
    Both,
    /// Samples of even index.
    A,
    /// Samples of odd index.
    B,
}

/// Sums over the samples of one half.
#[derive(Clone, Debug, Default)]
pub(crate) struct HalfSums {
    /// Samples a pixel in this half.
    pub samples: u32,
    /// Radiance without very direct light.
    pub primal: Plane,
    /// One-sided differences (offset − base) to the four neighbours, by [`Direction`].
    pub gradient: [Plane; 4],
}

/// Means over the samples of what the camera ray meets first; without weights where it meets nothing.
#[derive(Clone, Debug, Default)]
pub struct Features {
    /// Share of the samples that meet a surface, 0 to 1.
    pub coverage: Vec<f32>,
    /// Distance along the ray, m; infinite where nothing is met.
    pub depth: Vec<f32>,
    /// Unit shading normal, world space.
    pub normal: Plane,
    /// Position, m, world space.
    pub position: Plane,
    /// Base colour.
    pub albedo: Plane,
}

/// Everything measured for one image.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Whether gradients were measured.
    pub has_gradients: bool,
    pub(crate) halves: [HalfSums; 2],
    /// Sum of emission seen directly and environment behind everything.
    pub(crate) direct: Plane,
    /// Sum of squares of the primal samples.
    pub(crate) primal_square: Plane,
    /// Sum of squares of the luminance of the one-sided gradient samples, by [`Direction`].
    pub(crate) gradient_square: [Vec<f32>; 4],
    /// Feature layers, where asked for.
    pub features: Option<Features>,
    /// Samples dropped because they were not finite.
    pub dropped_samples: u64,
}

impl Film {
    /// An empty film; gradient planes are allocated only where `has_gradients`.
    pub fn new(width: usize, height: usize, has_gradients: bool, with_features: bool) -> Self {
        let plane = || Plane::new(width, height);
        let gradient = || if has_gradients { plane() } else { Plane::default() };
        let half = || HalfSums { samples: 0, primal: plane(), gradient: std::array::from_fn(|_| gradient()) };
        Self {
            width,
            height,
            has_gradients,
            halves: [half(), half()],
            direct: plane(),
            primal_square: plane(),
            gradient_square: std::array::from_fn(|_| vec![0.0; gradient().data.len()]),
            features: with_features.then(|| Features {
                coverage: vec![0.0; width * height],
                depth: vec![0.0; width * height],
                normal: plane(),
                position: plane(),
                albedo: plane(),
            }),
            dropped_samples: 0,
        }
    }

    /// Samples a pixel in `half`.
    pub fn samples(&self, half: Half) -> u32 {
        match half {
            Half::Both => self.halves[0].samples + self.halves[1].samples,
            Half::A => self.halves[0].samples,
            Half::B => self.halves[1].samples,
        }
    }

    /// Mean of the sums that `get` picks from each half.
    fn mean(&self, half: Half, get: impl Fn(&HalfSums) -> &Plane) -> Plane {
        let [a, b] = [get(&self.halves[0]), get(&self.halves[1])];
        let n = 1.0 / self.samples(half).max(1) as f32;
        let data = match half {
            Half::Both => {
                a.data.iter().zip(&b.data).map(|(a, b)| std::array::from_fn(|c| (a[c] + b[c]) * n)).collect()
            }
            Half::A => a.data.iter().map(|v| v.map(|v| v * n)).collect(),
            Half::B => b.data.iter().map(|v| v.map(|v| v * n)).collect(),
        };
        Plane { width: self.width, height: self.height, data }
    }

    /// Mean radiance without very direct light: the path-traced image.
    pub fn primal(&self, half: Half) -> Plane {
        self.mean(half, |h| &h.primal)
    }

    /// Mean very direct light: what the camera sees of emitters and of the environment without a bounce.
    pub fn direct(&self) -> Plane {
        let n = 1.0 / self.samples(Half::Both).max(1) as f32;
        Plane {
            data: self.direct.data.iter().map(|v| v.map(|v| v * n)).collect(),
            ..Plane { width: self.width, height: self.height, data: Vec::new() }
        }
    }

    /// Difference towards one neighbour: entry (x, y) estimates I(x + dx, y + dy) − I(x, y); zero where the
    /// neighbour is outside.
    fn difference(&self, half: Half, forth: Direction, back: Direction) -> Plane {
        let forward = self.mean(half, |h| &h.gradient[forth as usize]);
        let backward = self.mean(half, |h| &h.gradient[back as usize]);
        let (dx, dy) = forth.step();
        Plane::from_fn(self.width, self.height, |x, y| {
            let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            if nx >= self.width || ny >= self.height {
                return [0.0; 3];
            }
            let (f, b) = (forward.at(x, y), backward.at(nx, ny));
            std::array::from_fn(|c| f[c] - b[c])
        })
    }

    /// Mean horizontal differences, I(x + 1, y) − I(x, y); the last column is zero.
    pub fn dx(&self, half: Half) -> Plane {
        self.difference(half, Direction::Right, Direction::Left)
    }

    /// Mean vertical differences, I(x, y + 1) − I(x, y) with y pointing down; the last row is zero.
    pub fn dy(&self, half: Half) -> Plane {
        self.difference(half, Direction::Down, Direction::Up)
    }

    /// Variance of the mean primal, a channel and pixel; zero below two samples.
    pub fn variance(&self) -> Plane {
        let n = self.samples(Half::Both) as f32;
        let mean = self.primal(Half::Both);
        let data =
            mean.data.iter().zip(&self.primal_square.data).map(|(m, s)| {
                std::array::from_fn(|c| {
                    if n < 2.0 { 0.0 } else { ((s[c] / n - m[c] * m[c]).max(0.0)) / (n - 1.0) }
                })
            });
        Plane { width: self.width, height: self.height, data: data.collect() }
    }

    /// Mean squared luminance of the one-sided gradient samples towards `direction`.
    pub fn gradient_square(&self, direction: Direction) -> Vec<f32> {
        let n = 1.0 / self.samples(Half::Both).max(1) as f32;
        self.gradient_square[direction as usize].iter().map(|s| s * n).collect()
    }

    /// Adds a finished tile; tiles must not overlap, each pixel receives each sample once.
    pub fn merge(&mut self, tile: &FilmTile) {
        tile.write_to(self);
    }

    /// Counts `samples` more samples a pixel whose first index is `first`; call once after all tiles of a pass.
    pub fn add_samples(&mut self, first: u32, samples: u32) {
        let even = (first + samples).div_ceil(2) - first.div_ceil(2);
        self.halves[0].samples += even;
        self.halves[1].samples += samples - even;
    }
}
