//! From a method's name to its solver, with the error of what comes out.

use super::estimate::ErrorEstimate;
use super::noise::Noise;
use super::rows::Problem;
use super::weighted::Solver;
use super::{Alpha, Found, Input, Method, Solution, guided, l1, l2};
use crate::film::{Measured, Plane};
use rayon::prelude::*;

/// α where nothing tells a better one.
const USUAL_ALPHA: f32 = 0.2;

/// Relative residual at which the weighted image is done: its error is then far below the noise.
const TOLERANCE: f64 = 1e-3;
/// The same for the image of the noise, of which the size matters and no more.
const ROUGH: f64 = 3e-2;

fn resolve(alpha: Alpha, input: &Input) -> f32 {
    match alpha {
        Alpha::Fixed(alpha) => {
            assert!(alpha > 0.0, "alpha must be positive");
            alpha
        }
        Alpha::Auto => input.halves.and_then(|h| Noise::new(h).ratio()).unwrap_or(USUAL_ALPHA),
    }
}

fn solution(
    found: Found,
    method: Method,
    alpha: Option<f32>,
    missing: usize,
    halves: Option<[Plane; 2]>,
) -> Solution {
    let error = halves.map(|[a, b]| ErrorEstimate::new(&found.image, [&a, &b], None));
    let Found { image, residual, iterations } = found;
    Solution { image, method, alpha, residual, iterations, missing, error }
}

/// L1 or L2, and the same for the halves.
pub(super) fn uniform(input: &Input, method: Method, alpha: Alpha) -> Solution {
    let alpha = resolve(alpha, input);
    let solve = |measured: &Measured| {
        let problem = Problem::new(measured);
        let found =
            if method == Method::L1 { l1::solve(&problem, alpha) } else { l2::solve(&problem, alpha) };
        (found, problem.missing)
    };
    let (found, missing) = solve(input.all);
    let halves = input.halves.map(|[a, b]| [a, b].map(|half| solve(half).0.image));
    solution(found, method, Some(alpha), missing, halves)
}

/// Weighted or guided; L1 where nothing tells the weights, weighted where nothing guides.
pub(super) fn weighted(input: &Input, alpha: Alpha, method: Method) -> Solution {
    let Some(halves) = input.halves else { return uniform(input, Method::L1, alpha) };
    let difference = half_difference(halves);
    let problems = [Problem::new(input.all), Problem::new(&difference)];
    let mut solver = Solver::new(&problems, halves);
    let whole = solver.solve(&problems[0], TOLERANCE);
    let half = solver.solve(&problems[1], ROUGH);
    let mut images = [1.0, -1.0].map(|sign| combined(&whole.image, &half.image, |x, d| x + sign * d));
    let guide = input.features.filter(|_| method == Method::Guided);
    let bias = guide.map(|features| guided::clean(features, &mut images));
    let [a, b] = &images;
    let image = if bias.is_some() { combined(a, b, |a, b| 0.5 * (a + b)) } else { whole.image };
    Solution {
        error: Some(ErrorEstimate::new(&image, [a, b], bias.as_deref())),
        image,
        method: if bias.is_some() { Method::Guided } else { Method::Weighted },
        alpha: None,
        residual: whole.residual,
        iterations: whole.iterations,
        missing: problems[0].missing,
    }
}

fn combined(a: &Plane, b: &Plane, f: impl Fn(f32, f32) -> f32 + Sync) -> Plane {
    let data = a.data.par_iter().zip(&b.data).map(|(a, b)| std::array::from_fn(|c| f(a[c], b[c])));
    Plane { width: a.width, height: a.height, data: data.collect() }
}

/// Half the difference of two halves: the noise of their mean.
fn half_difference([a, b]: &[Measured; 2]) -> Measured {
    let half = |a: &Plane, b: &Plane| combined(a, b, |a, b| 0.5 * (a - b));
    Measured { primal: half(&a.primal, &b.primal), dx: half(&a.dx, &b.dx), dy: half(&a.dy, &b.dy) }
}

/// The method whose estimated error is the least.
pub(super) fn best(input: &Input, alpha: Alpha) -> Solution {
    if input.halves.is_none() {
        return uniform(input, Method::L1, alpha);
    }
    let error = |s: &Solution| s.error.as_ref().map_or(f64::INFINITY, |e| e.rel_mse);
    let tried = [
        weighted(input, alpha, Method::Guided),
        weighted(input, alpha, Method::Weighted),
        uniform(input, Method::L2, Alpha::Auto),
    ];
    tried.into_iter().min_by(|a, b| error(a).total_cmp(&error(b))).expect("three were tried")
}

/// The primal as it is.
pub(super) fn primal(input: &Input) -> Solution {
    let problem = Problem::new(input.all);
    let halves = input.halves.map(|[a, b]| [a.primal.clone(), b.primal.clone()]);
    let found = Found { image: problem.primal.clone().into_owned(), residual: 0.0, iterations: 0 };
    solution(found, Method::None, None, problem.missing, halves)
}
