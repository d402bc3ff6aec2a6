//! From a method's name to its solver, with the error of what comes out.

use super::estimate::ErrorEstimate;
use super::noise::Noise;
use super::rows::Problem;
use super::weighted::Solver;
use super::{Alpha, Found, Input, Method, Solution, l1, l2};
use crate::film::{Measured, Plane};

/// α where nothing tells a better one.
const USUAL_ALPHA: f32 = 0.2;

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
    let error = halves.map(|[a, b]| ErrorEstimate::new(&found.image, [&a, &b]));
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

/// Weighted; L1 where nothing tells the weights.
pub(super) fn weighted(input: &Input, alpha: Alpha) -> Solution {
    let Some(halves) = input.halves else { return uniform(input, Method::L1, alpha) };
    let problem = Problem::new(input.all);
    let mut solver = Solver::new(&problem, halves);
    let found = solver.solve(&problem);
    let [a, b] = [&halves[0], &halves[1]].map(|half| solver.solve(&Problem::new(half)).image);
    solution(found, Method::Weighted, None, problem.missing, Some([a, b]))
}

/// The method whose estimated error is the least.
pub(super) fn best(input: &Input, alpha: Alpha) -> Solution {
    if input.halves.is_none() {
        return uniform(input, Method::L1, alpha);
    }
    let error = |s: &Solution| s.error.as_ref().map_or(f64::INFINITY, |e| e.rel_mse);
    let tried = [weighted(input, alpha), uniform(input, Method::L2, alpha)];
    tried.into_iter().min_by(|a, b| error(a).total_cmp(&error(b))).expect("two were tried")
}

/// The primal as it is.
pub(super) fn primal(input: &Input) -> Solution {
    let problem = Problem::new(input.all);
    let halves = input.halves.map(|[a, b]| [a.primal.clone(), b.primal.clone()]);
    let found = Found { image: problem.primal.clone().into_owned(), residual: 0.0, iterations: 0 };
    solution(found, Method::None, None, problem.missing, halves)
}
