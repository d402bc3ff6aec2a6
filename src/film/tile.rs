//! A tile of the film: private to the thread that renders it, summed in f64, merged once.

use super::{Features, Film, Plane};

/// The neighbour an offset path goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Direction {
    /// x + 1
    Right = 0,
    /// x − 1
    Left = 1,
    /// y − 1 (row above)
    Up = 2,
    /// y + 1 (row below)
    Down = 3,
}

impl Direction {
    /// All four, in the order of their indices.
    pub const ALL: [Self; 4] = [Self::Right, Self::Left, Self::Up, Self::Down];

    /// The step (x, y) in pixels, y pointing down.
    pub fn step(self) -> (isize, isize) {
        match self {
            Self::Right => (1, 0),
            Self::Left => (-1, 0),
            Self::Up => (0, -1),
            Self::Down => (0, 1),
        }
    }
}

/// One finished sample of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelSample {
    /// Radiance without very direct light.
    pub primal: [f32; 3],
    /// Very direct light.
    pub direct: [f32; 3],
    /// One-sided differences (offset − base), by [`Direction`]; zero towards neighbours outside the film.
    pub gradient: [[f32; 3]; 4],
    /// Distance of the first hit, m; infinite without one.
    pub depth: f32,
    /// Shading normal of the first hit.
    pub normal: [f32; 3],
    /// Position of the first hit.
    pub position: [f32; 3],
    /// Base colour of the first hit.
    pub albedo: [f32; 3],
}

/// Sums of one pixel.
#[derive(Clone, Copy, Debug, Default)]
struct PixelSums {
    primal: [[f64; 3]; 2],
    gradient: [[[f64; 3]; 4]; 2],
    direct: [f64; 3],
    primal_square: [f64; 3],
    gradient_square: [f64; 4],
    samples: f64,
    hits: f64,
    depth: f64,
    normal: [f64; 3],
    position: [f64; 3],
    albedo: [f64; 3],
}

/// A rectangle of the film under work.
#[derive(Clone, Debug)]
pub struct FilmTile {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    pixels: Vec<PixelSums>,
    dropped_samples: u64,
}

fn add(sum: &mut [f64; 3], value: [f32; 3]) {
    for c in 0..3 {
        sum[c] += f64::from(value[c]);
    }
}

fn luminance(v: [f32; 3]) -> f64 {
    0.2126 * f64::from(v[0]) + 0.7152 * f64::from(v[1]) + 0.0722 * f64::from(v[2])
}

impl FilmTile {
    /// An empty tile whose left upper pixel is (x, y).
    pub fn new(x: usize, y: usize, width: usize, height: usize) -> Self {
        Self { x, y, width, height, pixels: vec![PixelSums::default(); width * height], dropped_samples: 0 }
    }

    /// Adds sample `index` of the pixel at (x, y) of the tile. A sample that is not finite is dropped whole, so
    /// that primal and gradients keep telling of the same samples, and counted.
    pub fn add(&mut self, x: usize, y: usize, index: u32, s: &PixelSample) {
        let finite = |v: &[f32; 3]| v.iter().all(|v| v.is_finite());
        if !(finite(&s.primal) && finite(&s.direct) && s.gradient.iter().all(finite)) {
            self.dropped_samples += 1;
            return;
        }
        let pixel = &mut self.pixels[y * self.width + x];
        let half = (index & 1) as usize;
        pixel.samples += 1.0;
        add(&mut pixel.primal[half], s.primal);
        add(&mut pixel.direct, s.direct);
        for d in 0..4 {
            add(&mut pixel.gradient[half][d], s.gradient[d]);
            pixel.gradient_square[d] += luminance(s.gradient[d]).powi(2);
        }
        for c in 0..3 {
            pixel.primal_square[c] += f64::from(s.primal[c]).powi(2);
        }
        if s.depth.is_finite() {
            pixel.hits += 1.0;
            pixel.depth += f64::from(s.depth);
            add(&mut pixel.normal, s.normal);
            add(&mut pixel.position, s.position);
            add(&mut pixel.albedo, s.albedo);
        }
    }

    /// Adds the sums of this tile to `film`.
    pub(super) fn write_to(&self, film: &mut Film) {
        film.dropped_samples += self.dropped_samples;
        for (row, pixels) in self.pixels.chunks_exact(self.width).enumerate() {
            for (column, sums) in pixels.iter().enumerate() {
                let i = (self.y + row) * film.width + self.x + column;
                for half in 0..2 {
                    accumulate(&mut film.halves[half].primal, i, sums.primal[half]);
                    if film.has_gradients {
                        for d in 0..4 {
                            accumulate(&mut film.halves[half].gradient[d], i, sums.gradient[half][d]);
                        }
                    }
                }
                accumulate(&mut film.direct, i, sums.direct);
                accumulate(&mut film.primal_square, i, sums.primal_square);
                if film.has_gradients {
                    for d in 0..4 {
                        film.gradient_square[d][i] += sums.gradient_square[d] as f32;
                    }
                }
                if let Some(features) = &mut film.features {
                    write_features(features, i, sums);
                }
            }
        }
    }
}

fn accumulate(plane: &mut Plane, i: usize, sum: [f64; 3]) {
    for (value, sum) in plane.data[i].iter_mut().zip(sum) {
        *value += sum as f32;
    }
}

fn write_features(features: &mut Features, i: usize, sums: &PixelSums) {
    let n = 1.0 / sums.hits;
    let mean = |v: [f64; 3]| if sums.hits > 0.0 { v.map(|v| (v * n) as f32) } else { [0.0; 3] };
    features.coverage[i] = (sums.hits / sums.samples.max(1.0)) as f32;
    features.depth[i] = if sums.hits > 0.0 { (sums.depth * n) as f32 } else { f32::INFINITY };
    let normal = glam::Vec3::from(mean(sums.normal)).normalize_or_zero();
    features.normal.data[i] = normal.to_array();
    features.position.data[i] = mean(sums.position);
    features.albedo.data[i] = mean(sums.albedo);
}
