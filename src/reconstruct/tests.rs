//! Oracles and properties of the solvers: algorithm tests T11, T12, T14 and the solver's reliability rows.

mod frequency;

use super::multigrid::Multigrid;
use super::rows::Problem;
use super::*;
use crate::film::Measured as Planes;
use faer::prelude::Solve;

const NAN: [f32; 3] = [f32::NAN; 3];

/// SplitMix64, with the distributions the tests need.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }

    fn plane(&mut self, width: usize, height: usize, sigma: f32) -> Plane {
        Plane::from_fn(width, height, |_, _| std::array::from_fn(|_| sigma * self.normal() as f32))
    }
}

impl Planes {
    fn solve(&self, method: Method, alpha: f32) -> Plane {
        reconstruct(&Input::new(self), method, Alpha::Fixed(alpha)).image
    }

    /// The consistent problem of `image`, NaN where nothing may be read.
    fn of(image: &Plane) -> Self {
        let (w, h) = (image.width, image.height);
        let to = |sx: usize, sy: usize| {
            Plane::from_fn(w, h, |x, y| {
                if x + sx < w && y + sy < h { sub(image.at(x + sx, y + sy), image.at(x, y)) } else { NAN }
            })
        };
        Self { primal: image.clone(), dx: to(1, 0), dy: to(0, 1) }
    }

    /// White noise of deviation `primal` and `gradient` on top of `image`.
    fn noisy(image: &Plane, primal: f32, gradient: f32, seed: u64) -> Self {
        let mut noise = Noise(seed);
        let exact = Self::of(image);
        let mut add = |p: &Plane, sigma| zip(p, &noise.plane(p.width, p.height, sigma), |a, b| a + b);
        Self {
            primal: add(&exact.primal, primal),
            dx: add(&exact.dx, gradient),
            dy: add(&exact.dy, gradient),
        }
    }

    fn map(&self, f: impl Fn(&Plane) -> Plane) -> Self {
        Self { primal: f(&self.primal), dx: f(&self.dx), dy: f(&self.dy) }
    }
}

fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|c| a[c] - b[c])
}

fn zip(a: &Plane, b: &Plane, f: impl Fn(f32, f32) -> f32) -> Plane {
    let data = a.data.iter().zip(&b.data).map(|(a, b)| std::array::from_fn(|c| f(a[c], b[c])));
    Plane { data: data.collect(), ..*a }
}

fn scaled(p: &Plane, factor: f32) -> Plane {
    zip(p, p, |a, _| a * factor)
}

/// A picture with edges, a ramp and colours.
fn picture(width: usize, height: usize) -> Plane {
    Plane::from_fn(width, height, |x, y| {
        let block = if (x / 11 + y / 7) % 2 == 0 { 0.9 } else { 0.2 };
        let ramp = 0.3 * y as f32 / height as f32 + 0.1 * (x as f32 * 0.3).sin();
        [block + ramp, 0.5 * block + ramp, 0.25 * block + 0.5 * ramp]
    })
}

fn max_difference(a: &Plane, b: &Plane) -> f32 {
    assert!(a.data.iter().chain(&b.data).flatten().all(|v| v.is_finite()), "finite images");
    a.data.iter().flatten().zip(b.data.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

fn mse(a: &Plane, b: &Plane) -> f64 {
    let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
    a.data.iter().flatten().zip(b.data.iter().flatten()).map(square).sum::<f64>() / (3 * a.data.len()) as f64
}

fn means(p: &Plane) -> [f64; 3] {
    std::array::from_fn(|c| p.data.iter().map(|v| f64::from(v[c])).sum::<f64>() / p.data.len() as f64)
}

/// The rows of K for a W×H film and one channel: α x, then the differences inside the film.
fn dense_rows(w: usize, h: usize, alpha: f64) -> Vec<Vec<(usize, f64)>> {
    let mut rows: Vec<_> = (0..w * h).map(|i| vec![(i, alpha)]).collect();
    for i in 0..w * h {
        if i % w + 1 < w {
            rows.push(vec![(i + 1, 1.0), (i, -1.0)]);
        }
        if i / w + 1 < h {
            rows.push(vec![(i + w, 1.0), (i, -1.0)]);
        }
    }
    rows
}

/// Least squares by a dense factorisation in f64, rows of missing data left out.
fn dense_l2(planes: &Planes, alpha: f64, channel: usize) -> Vec<f64> {
    let (w, h) = (planes.primal.width, planes.primal.height);
    let mut a = faer::Mat::<f64>::zeros(w * h, w * h);
    let mut b = faer::Mat::<f64>::zeros(w * h, 1);
    for row in dense_rows(w, h, alpha) {
        let value = match row[..] {
            [(i, _)] => alpha * f64::from(planes.primal.data[i][channel]),
            [(j, _), (i, _)] if j == i + 1 && w > 1 => f64::from(planes.dx.data[i][channel]),
            [_, (i, _)] => f64::from(planes.dy.data[i][channel]),
            _ => unreachable!("rows have one or two entries"),
        };
        if value.is_nan() {
            continue;
        }
        for &(i, ki) in &row {
            b[(i, 0)] += ki * value;
            for &(j, kj) in &row {
                a[(i, j)] += ki * kj;
            }
        }
    }
    let x = a.llt(faer::Side::Lower).expect("positive definite").solve(&b);
    (0..w * h).map(|i| x[(i, 0)]).collect()
}

#[test]
fn transform_agrees_with_a_dense_solve() {
    let (w, h, alpha) = (12, 12, 0.2f32);
    let planes = Planes::noisy(&picture(w, h), 0.3, 0.1, 1);
    let problem = Problem::new(&planes);
    let y64: Vec<f64> = l2::correction(&problem, alpha);
    let image = planes.solve(Method::L2, alpha);
    for c in 0..3 {
        let oracle = dense_l2(&planes, f64::from(alpha), c);
        let size = oracle.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        for (i, want) in oracle.iter().enumerate() {
            let got = f64::from(planes.primal.data[i][c]) + y64[(3 * (i / w) + c) * w + i % w];
            assert!((got - want).abs() < 1e-8 * size, "f64, pixel {i}: {got} against {want}");
            assert!((f64::from(image.data[i][c]) - want).abs() < 1e-6 * size, "f32, pixel {i}");
        }
    }
}

#[test]
fn every_film_shape_agrees_with_a_dense_solve() {
    for (w, h) in [(1, 1), (1, 9), (9, 1), (2, 2), (3, 2), (17, 5), (5, 18), (33, 3)] {
        let planes = Planes::noisy(&picture(w, h), 0.3, 0.1, 2);
        let image = planes.solve(Method::L2, 0.3);
        assert!(planes.solve(Method::L1, 0.3).data.iter().flatten().all(|v| v.is_finite()), "{w}x{h}");
        for c in 0..3 {
            for (i, want) in dense_l2(&planes, f64::from(0.3f32), c).iter().enumerate() {
                assert!((f64::from(image.data[i][c]) - want).abs() < 3e-6, "{w}x{h}, pixel {i}");
            }
        }
    }
    let empty = Planes::of(&Plane::new(0, 0));
    for method in [Method::L1, Method::L2, Method::None] {
        assert!(empty.solve(method, 0.2).data.is_empty());
    }
}

#[test]
fn missing_rows_are_left_out() {
    let mut planes = Planes::noisy(&picture(12, 12), 0.3, 0.1, 3);
    for i in [0, 17, 77, 78, 90] {
        planes.primal.data[i] = NAN;
    }
    for i in [5, 40, 100] {
        planes.dx.data[i] = NAN;
        planes.dy.data[i + 2] = NAN;
    }
    let solution = reconstruct(&Input::new(&planes), Method::L2, Alpha::Fixed(0.2));
    assert_eq!(solution.missing, 11);
    assert!(solution.residual <= 1e-6, "{}", solution.residual);
    for c in 0..3 {
        for (i, want) in dense_l2(&planes, f64::from(0.2f32), c).iter().enumerate() {
            assert!((f64::from(solution.image.data[i][c]) - want).abs() < 1e-5, "pixel {i}");
        }
    }
}

#[test]
fn one_bad_pixel_stays_local() {
    let clean = Planes::noisy(&picture(64, 48), 0.3, 0.05, 4);
    for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, f32::MAX] {
        let mut planes = clean.clone();
        planes.primal.data[20 * 64 + 30][1] = bad;
        planes.dx.data[10 * 64 + 50] = [bad; 3];
        planes.dy.data[40 * 64 + 5][2] = bad;
        for method in [Method::L1, Method::L2, Method::None] {
            let solution = reconstruct(&Input::new(&planes), method, Alpha::Fixed(0.2));
            assert_eq!(solution.missing, 3);
            let difference = zip(&solution.image, &clean.solve(method, 0.2), |a, b| a - b);
            assert!(difference.data.iter().flatten().all(|v| v.is_finite()));
            let near = |i: usize| {
                let (x, y) = ((i % 64) as f32, (i / 64) as f32);
                [(30.0, 20.0), (50.0, 10.0), (5.0, 40.0)].iter().any(|c| (x - c.0).hypot(y - c.1) < 16.0)
            };
            let far = difference.data.iter().enumerate().filter(|(i, _)| !near(*i)).flat_map(|(_, v)| v);
            assert!(far.fold(0.0f32, |m, v| m.max(v.abs())) < 0.01, "{method:?} {bad}");
        }
    }
    let nothing = Planes::of(&Plane::from_fn(9, 7, |_, _| NAN));
    for method in [Method::L1, Method::L2, Method::None] {
        assert!(nothing.solve(method, 0.2).data.iter().flatten().all(|v| *v == 0.0), "{method:?}");
    }
}

#[test]
fn operator_is_adjoint_symmetric_and_positive() {
    let (w, h, alpha) = (9, 7, 0.2);
    let rows = dense_rows(w, h, alpha);
    let mut noise = Noise(5);
    let x: Vec<f64> = (0..w * h).map(|_| noise.normal()).collect();
    let y: Vec<f64> = (0..rows.len()).map(|_| noise.normal()).collect();
    let kx: Vec<f64> = rows.iter().map(|row| row.iter().map(|(i, k)| k * x[*i]).sum()).collect();
    // The adjoint as the solver forms it: from planes whose primal is zero.
    let mut planes = Planes { primal: Plane::new(w, h), dx: Plane::new(w, h), dy: Plane::new(w, h) };
    for (row, y) in rows.iter().zip(&y).skip(w * h) {
        let plane = if row[0].0 == row[1].0 + 1 { &mut planes.dx } else { &mut planes.dy };
        plane.data[row[1].0] = [*y as f32; 3];
    }
    let divergence: Vec<f64> = Problem::new(&planes).divergence(1.0);
    let adjoint = |i: usize| alpha * y[i] + divergence[3 * (i / w) * w + i % w];
    let left: f64 = kx.iter().zip(&y).map(|(a, b)| a * b).sum();
    let right: f64 = (0..w * h).map(|i| x[i] * adjoint(i)).sum();
    assert!((left - right).abs() < 1e-5 * left.abs().max(1.0), "{left} {right}");

    // Symmetry and positivity of the multigrid operator with weights of all sizes.
    let mut multigrid = Multigrid::new(w, h);
    multigrid.set_weights(|weights| {
        for i in 0..w * h {
            weights.w0[i] = 0.04 * noise.uniform() as f32;
            weights.wx[i] = if i % w + 1 < w { noise.uniform().powi(8) as f32 } else { 0.0 };
            weights.wy[i] = if i / w + 1 < h { noise.uniform().powi(8) as f32 } else { 0.0 };
        }
    });
    let mut vector = || (0..3 * w * h).map(|_| noise.normal() as f32).collect::<Vec<_>>();
    let (a, b) = (vector(), vector());
    let product = |v: &[f32]| {
        let mut out = vec![0.0; v.len()];
        multigrid.subtract_product(v, &mut out);
        out
    };
    let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let (ab, ba, aa) = (dot(&product(&a), &b), dot(&a, &product(&b)), -dot(&product(&a), &a));
    assert!((ab - ba).abs() < 1e-5 * aa, "{ab} {ba}");
    assert!(aa > 0.0);
}

#[test]
fn conjugate_gradients_agree_with_the_transform() {
    for alpha in [0.02f32, 0.2, 1.0] {
        let planes = Planes::noisy(&picture(61, 40), 0.3, 0.05, 6);
        let problem = Problem::new(&planes);
        let (primal, gradient) = l2::row_weights(alpha);
        let mut r = problem.divergence::<f32>(gradient);
        let mut x = vec![0.0; r.len()];
        let mut multigrid = Multigrid::new(61, 40);
        multigrid.set_weights(|weights| {
            for i in 0..61 * 40 {
                weights.w0[i] = primal as f32;
                weights.wx[i] = if i % 61 < 60 { gradient as f32 } else { 0.0 };
                weights.wy[i] = if i / 61 < 39 { gradient as f32 } else { 0.0 };
            }
        });
        let enough = l2::norm_square(&r) * 1e-13;
        let (steps, left) = multigrid.conjugate_gradients(&mut x, &mut r, 60, enough);
        assert!(left <= enough && steps <= 25, "alpha {alpha}: {steps} steps");
        assert!(max_difference(&problem.image(&x), &planes.solve(Method::L2, alpha)) < 1e-5, "alpha {alpha}");
    }
}

#[test]
fn consistent_data_return_the_image() {
    let image = picture(61, 37);
    let planes = Planes::of(&image);
    for alpha in [0.01, 0.2, 5.0] {
        for method in [Method::L1, Method::L2] {
            assert!(max_difference(&planes.solve(method, alpha), &image) < 1e-5);
        }
    }
    // A constant offset of the primal shifts the image by it.
    let shifted = Planes { primal: zip(&image, &image, |a, _| a + 0.5), ..planes };
    for method in [Method::L1, Method::L2] {
        let back = zip(&shifted.solve(method, 0.2), &image, |a, b| a - b - 0.5);
        assert!(max_difference(&back, &Plane::new(61, 37)) < 1e-5, "{method:?}");
    }
}

#[test]
fn limits_of_alpha() {
    let planes = Planes::noisy(&picture(40, 31), 0.3, 0.05, 7);
    for alpha in [1e4f32, 1e19, f32::INFINITY] {
        for method in [Method::L1, Method::L2] {
            assert!(
                max_difference(&planes.solve(method, alpha), &planes.primal) < 1e-5,
                "{method:?} {alpha}"
            );
        }
    }
    let image = picture(40, 31);
    let integrated = Planes { primal: Noise(8).plane(40, 31, 0.3), ..Planes::of(&image) };
    for alpha in [1e-4f32, 1e-30] {
        let result = integrated.solve(Method::L2, alpha);
        let (want, primal, mean) = (means(&image), means(&integrated.primal), means(&result));
        for c in 0..3 {
            assert!((mean[c] - primal[c]).abs() < 1e-6);
            for (a, b) in result.data.iter().zip(&image.data) {
                assert!((f64::from(a[c]) - primal[c] - (f64::from(b[c]) - want[c])).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn mean_is_preserved() {
    for (w, h, alpha) in [(64, 64, 0.2), (100, 37, 0.01), (1, 50, 0.2), (128, 90, 1e-6)] {
        let planes = Planes::noisy(&picture(w, h), 0.3, 0.05, 9);
        let (before, after) = (means(&planes.primal), means(&planes.solve(Method::L2, alpha)));
        for c in 0..3 {
            assert!((before[c] - after[c]).abs() < 1e-6 * before[c].abs(), "{w}x{h}: {before:?} {after:?}");
        }
    }
}

#[test]
fn least_squares_is_linear_and_scales() {
    let a = Planes::noisy(&picture(50, 41), 0.3, 0.05, 10);
    let b = Planes::noisy(&picture(50, 41), 0.2, 0.1, 11);
    let add = |a: &Plane, b: &Plane| zip(a, b, |a, b| a + b);
    let sum = Planes { primal: add(&a.primal, &b.primal), dx: add(&a.dx, &b.dx), dy: add(&a.dy, &b.dy) };
    let apart = add(&a.solve(Method::L2, 0.2), &b.solve(Method::L2, 0.2));
    assert!(max_difference(&sum.solve(Method::L2, 0.2), &apart) < 1e-6 * 3.0);
    for (method, tolerance) in [(Method::L2, 0.0), (Method::L1, 0.0)] {
        let image = a.solve(method, 0.2);
        for factor in [0.5f32.powi(10), 2f32.powi(10)] {
            let other = scaled(&a.map(|p| scaled(p, factor)).solve(method, 0.2), 1.0 / factor);
            assert!(max_difference(&other, &image) <= tolerance, "{method:?} {factor}");
        }
        let other = scaled(&a.map(|p| scaled(p, 1e-3)).solve(method, 0.2), 1e3);
        assert!(max_difference(&other, &image) < 1e-4, "{method:?}");
    }
}

#[test]
fn flips_transposition_and_channels() {
    let (w, h) = (48, 34);
    let planes = Planes::noisy(&picture(w, h), 0.3, 0.05, 12);
    let mirror = |p: &Plane| Plane::from_fn(w, h, |x, y| p.at(w - 1 - x, y));
    let transpose = |p: &Plane| Plane::from_fn(h, w, |x, y| p.at(y, x));
    let rotate = |p: &Plane| Plane { data: p.data.iter().map(|v| [v[2], v[0], v[1]]).collect(), ..*p };
    let flipped = Planes {
        primal: mirror(&planes.primal),
        dx: Plane::from_fn(w, h, |x, y| if x + 1 < w { planes.dx.at(w - 2 - x, y).map(|v| -v) } else { NAN }),
        dy: mirror(&planes.dy),
    };
    let turned =
        Planes { primal: transpose(&planes.primal), dx: transpose(&planes.dy), dy: transpose(&planes.dx) };
    for (method, tolerance) in [(Method::L2, 1e-6), (Method::L1, 1e-4)] {
        let image = planes.solve(method, 0.2);
        assert!(max_difference(&flipped.solve(method, 0.2), &mirror(&image)) < tolerance, "{method:?} flip");
        assert!(
            max_difference(&turned.solve(method, 0.2), &transpose(&image)) < tolerance,
            "{method:?} turn"
        );
        let rotated = planes.map(rotate).solve(method, 0.2);
        assert!(max_difference(&rotated, &rotate(&image)) < tolerance, "{method:?} channels");
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let planes = Planes::noisy(&picture(90, 70), 0.3, 0.05, 13);
    let run = |threads, method| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| planes.solve(method, 0.2))
    };
    for method in [Method::L1, Method::L2] {
        assert!(run(1, method) == run(2, method) && run(1, method) == run(5, method), "{method:?}");
    }
}

/// One difference in a hundred gets an exponential outlier of mean 10.
fn with_outliers(image: &Plane, seed: u64) -> Planes {
    let mut planes = Planes::noisy(image, 0.1, 0.02, seed);
    let mut noise = Noise(seed + 1);
    for v in &mut planes.dx.data {
        if noise.uniform() < 0.01 {
            *v = v.map(|v| v - 10.0 * noise.uniform().ln() as f32);
        }
    }
    planes
}

#[test]
fn l1_shrugs_off_outliers() {
    let image = picture(64, 64);
    let planes = with_outliers(&image, 14);
    let (l1, l2) = (mse(&planes.solve(Method::L1, 0.2), &image), mse(&planes.solve(Method::L2, 0.2), &image));
    assert!(l1 < 0.004 && l2 > 20.0 * l1, "L1 {l1}, L2 {l2}");
}

#[test]
fn l1_reaches_the_objective_of_a_long_run() {
    let image = picture(64, 64);
    for planes in [Planes::noisy(&image, 0.3, 0.06, 15), with_outliers(&image, 16)] {
        let problem = Problem::new(&planes);
        let objective = |image: &Plane| {
            let w = image.width;
            let correction: Vec<f32> = (0..3 * w * image.height)
                .map(|i| {
                    let (row, x) = (i / w, i % w);
                    let at = row / 3 * w + x;
                    image.data[at][row % 3] - problem.primal.data[at][row % 3]
                })
                .collect();
            l1::objective(&problem, 0.2, &correction)
        };
        let long = l1::Schedule { outer: 64, steps: 40, reg: 1.0, decay: 0.7, tolerance: -1.0 };
        let best = objective(&l1::solve_with(&problem, 0.2, long).image);
        let solution = reconstruct(&Input::new(&planes), Method::L1, Alpha::Fixed(0.2));
        let ours = objective(&solution.image);
        assert!(ours < 1.005 * best, "{ours} against {best}");
        assert!(solution.residual < 0.005, "{}", solution.residual);
    }
}

#[test]
fn channels_share_their_weights_in_l1_only() {
    let planes = Planes::noisy(&picture(32, 32), 0.3, 0.05, 17);
    let mut red = planes.clone();
    red.dx.data[16 * 32 + 16][0] += 5.0;
    let change = |method| {
        let (a, b) = (planes.solve(method, 0.2), red.solve(method, 0.2));
        [0, 1, 2].map(|c| a.data.iter().zip(&b.data).map(|(a, b)| (a[c] - b[c]).abs()).fold(0.0, f32::max))
    };
    let (l1, l2) = (change(Method::L1), change(Method::L2));
    assert!(l1[1] > 1e-3 && l1[2] > 1e-3, "{l1:?}");
    assert!(l2[0] > 1.0 && l2[1] < 1e-6 && l2[2] < 1e-6, "{l2:?}");
}
