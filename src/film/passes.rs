//! Films of several passes, added up; and a film whose differences come from another.

use super::{Direction, Features, Film, Half, HalfSums, Plane};

impl Film {
    /// Adds the samples of another film of the same size and kind.
    ///
    /// # Panics
    /// Where they differ in size or kind: a mistake of the caller.
    pub fn add(&mut self, other: &Self) {
        assert!(
            (self.width, self.height, self.has_gradients) == (other.width, other.height, other.has_gradients),
            "films of one size and kind"
        );
        let counts = [&*self, other].map(|film| film.samples(Half::Both) as f32);
        for (mine, theirs) in self.halves.iter_mut().zip(&other.halves) {
            mine.samples += theirs.samples;
            add_planes(&mut mine.primal, &theirs.primal);
            mine.gradient.iter_mut().zip(&theirs.gradient).for_each(|(a, b)| add_planes(a, b));
        }
        add_planes(&mut self.direct, &other.direct);
        add_planes(&mut self.primal_square, &other.primal_square);
        for (mine, theirs) in self.gradient_square.iter_mut().zip(&other.gradient_square) {
            mine.iter_mut().zip(theirs).for_each(|(a, b)| *a += b);
        }
        if let (Some(mine), Some(theirs)) = (&mut self.features, &other.features) {
            mine.add(theirs, counts);
        }
        self.dropped_samples += other.dropped_samples;
    }

    /// A film whose differences are those of the means of `common`, a film of as many samples whose pixels share
    /// their random numbers.
    pub fn with_differences_of(mut self, common: &Self) -> Self {
        self.has_gradients = true;
        self.gradient_square = std::array::from_fn(|_| vec![0.0; self.width * self.height]);
        let (width, height) = (self.width, self.height);
        for (half, other) in self.halves.iter_mut().zip(&common.halves) {
            let scale = half.samples as f32 / other.samples.max(1) as f32;
            half.gradient = std::array::from_fn(|_| Plane::new(width, height));
            for direction in [Direction::Right, Direction::Down] {
                half.gradient[direction as usize] = one_sided(other, direction, scale);
            }
        }
        self.dropped_samples += common.dropped_samples;
        self
    }
}

/// The difference to the neighbour in `direction` of the sums of a half, times `scale`; zero at the border.
fn one_sided(half: &HalfSums, direction: Direction, scale: f32) -> Plane {
    let (dx, dy) = direction.step();
    let primal = &half.primal;
    Plane::from_fn(primal.width, primal.height, |x, y| {
        let (nx, ny) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
        if nx >= primal.width || ny >= primal.height {
            return [0.0; 3];
        }
        let (here, there) = (primal.at(x, y), primal.at(nx, ny));
        std::array::from_fn(|c| scale * (there[c] - here[c]))
    })
}

fn add_planes(a: &mut Plane, b: &Plane) {
    for (a, b) in a.data.iter_mut().zip(&b.data) {
        a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
    }
}

impl Features {
    /// Means over both, each having `counts` samples a pixel. The normals' lengths are lost; their means are those of
    /// unit normals.
    fn add(&mut self, other: &Self, counts: [f32; 2]) {
        let total = (counts[0] + counts[1]).max(1.0);
        for i in 0..self.coverage.len() {
            let (a, b) = (self.coverage[i] * counts[0], other.coverage[i] * counts[1]);
            self.coverage[i] = (a + b) / total;
            if b == 0.0 {
                continue;
            }
            let share = b / (a + b);
            let mix = |a: f32, b: f32| if share < 1.0 { a + share * (b - a) } else { b };
            self.depth[i] = mix(self.depth[i], other.depth[i]);
            let planes = [
                (&mut self.normal, &other.normal),
                (&mut self.position, &other.position),
                (&mut self.albedo, &other.albedo),
            ];
            for (mine, theirs) in planes {
                let theirs = theirs.data[i];
                mine.data[i].iter_mut().zip(theirs).for_each(|(a, b)| *a = mix(*a, b));
            }
            let normal = glam::Vec3::from(self.normal.data[i]).normalize_or_zero();
            self.normal.data[i] = normal.to_array();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{FilmTile, PixelSample};
    use super::*;

    fn sample(x: usize, y: usize, index: u32) -> PixelSample {
        let value = (x * 7 + y * 3) as f32 * 0.25 + index as f32 * 0.5;
        let hit = !(x + y + index as usize).is_multiple_of(3);
        PixelSample {
            primal: [value, 2.0 * value, 0.5],
            direct: [0.125; 3],
            gradient: [[0.25 * value; 3], [0.5; 3], [-0.75; 3], [1.0; 3]],
            depth: if hit { 2.0 + index as f32 } else { f32::INFINITY },
            normal: [0.0, 0.0, 1.0],
            position: [value, 1.0, 2.0],
            albedo: [0.5, 0.25, value],
        }
    }

    fn film(range: std::ops::Range<u32>) -> Film {
        let mut film = Film::new(5, 4, true, true);
        let mut tile = FilmTile::new(0, 0, 5, 4);
        for index in range.clone() {
            (0..20).for_each(|i| tile.add(i % 5, i / 5, index, &sample(i % 5, i / 5, index)));
        }
        film.merge(&tile);
        film.add_samples(range.start, range.end - range.start);
        film
    }

    #[test]
    fn passes_add_up_to_the_whole() {
        let whole = film(0..11);
        let mut sum = film(0..4);
        sum.add(&film(4..5));
        sum.add(&film(5..11));
        for half in [Half::Both, Half::A, Half::B] {
            assert_eq!(sum.samples(half), whole.samples(half));
            assert_eq!(sum.measured(half), whole.measured(half));
        }
        assert_eq!((sum.direct(), sum.variance()), (whole.direct(), whole.variance()));
        assert_eq!(sum.gradient_square(Direction::Left), whole.gradient_square(Direction::Left));
        let (a, b) = (sum.features.expect("measured"), whole.features.expect("measured"));
        let near = |a: f32, b: f32| a == b || (a - b).abs() < 1e-5 * b.abs();
        for i in 0..20 {
            assert!(near(a.coverage[i], b.coverage[i]) && near(a.depth[i], b.depth[i]), "pixel {i}");
            assert!((0..3).all(|c| near(a.position.data[i][c], b.position.data[i][c])), "pixel {i}");
            assert!((0..3).all(|c| near(a.albedo.data[i][c], b.albedo.data[i][c])), "pixel {i}");
        }
    }

    #[test]
    fn differences_of_another_film() {
        let (own, common) = (film(0..4), film(4..8));
        let both = own.clone().with_differences_of(&common);
        let image = common.primal(Half::A);
        let dx = both.dx(Half::A);
        for y in 0..4 {
            for x in 0..4 {
                let want = image.at(x + 1, y)[0] - image.at(x, y)[0];
                assert!((dx.at(x, y)[0] - want).abs() < 1e-5, "{x}, {y}");
            }
        }
        assert_eq!(both.primal(Half::Both), own.primal(Half::Both));
    }
}
