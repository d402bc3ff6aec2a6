//! Measuring on machines that others use too: sides take turns within one run, and what counts is the median over the
//! rounds of the ratio within a round.

use gdpt::study::usage::cpu_seconds;
use std::time::Instant;

/// What a piece of work took, s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cost {
    /// User and system time of all threads of this process.
    pub cpu: f64,
    /// Time on the wall.
    pub wall: f64,
}

impl Cost {
    /// The CPU seconds, as a function for [`Rounds::ratio`].
    pub fn cpu(self) -> f64 {
        self.cpu
    }

    /// The wall seconds, as a function for [`Rounds::ratio`].
    pub fn wall(self) -> f64 {
        self.wall
    }
}

/// The result of `work` and what it took.
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, Cost) {
    let (cpu, start) = (cpu_seconds(), Instant::now());
    let value = work();
    (value, Cost { cpu: cpu_seconds() - cpu, wall: start.elapsed().as_secs_f64() })
}

/// The cost alone.
pub fn cost<T>(work: impl FnOnce() -> T) -> Cost {
    timed(|| std::hint::black_box(work())).1
}

/// The middle one; the upper of the two of an even number.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A side of a comparison: does its work and says what it took.
pub type Side<'a> = Box<dyn FnMut() -> Cost + 'a>;

/// Costs of several sides, `[side][round]`.
#[derive(Clone, Debug)]
pub struct Rounds(Vec<Vec<Cost>>);

impl Rounds {
    /// Lets the sides take turns, forwards and backwards, `rounds` times.
    pub fn alternate(rounds: usize, mut sides: Vec<Side<'_>>) -> Self {
        let mut costs = vec![Vec::with_capacity(rounds); sides.len()];
        for round in 0..rounds {
            for turn in 0..sides.len() {
                let side = if round % 2 == 0 { turn } else { sides.len() - 1 - turn };
                costs[side].push(sides[side]());
            }
        }
        Self(costs)
    }

    /// Medians of a side.
    pub fn cost(&self, side: usize) -> Cost {
        let of = |what: fn(Cost) -> f64| median(self.0[side].iter().map(|&c| what(c)));
        Cost { cpu: of(Cost::cpu), wall: of(Cost::wall) }
    }

    /// Median over the rounds of the seconds of `side` over those of `other`.
    pub fn ratio(&self, side: usize, other: usize, seconds: fn(Cost) -> f64) -> f64 {
        median(self.0[side].iter().zip(&self.0[other]).map(|(&a, &b)| seconds(a) / seconds(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdpt::study::usage::{peak_memory, resident_memory};
    use std::cell::RefCell;

    #[test]
    fn sides_take_turns_and_ratios_are_of_one_round() {
        let order = RefCell::new(Vec::new());
        let side = |name: char, seconds: [f64; 3]| -> Side<'_> {
            let (order, mut round) = (&order, 0);
            Box::new(move || {
                order.borrow_mut().push(name);
                round += 1;
                Cost { cpu: seconds[round - 1], wall: 1.0 }
            })
        };
        // The machine slows down by ten in the second round: the ratio does not notice.
        let rounds = Rounds::alternate(3, vec![side('a', [2.0, 20.0, 2.0]), side('b', [1.0, 10.0, 1.0])]);
        assert_eq!(*order.borrow(), ['a', 'b', 'b', 'a', 'a', 'b']);
        assert_eq!(rounds.ratio(0, 1, Cost::cpu), 2.0);
        assert_eq!(rounds.cost(0).cpu, 2.0);
        assert_eq!(rounds.ratio(0, 1, Cost::wall), 1.0);
    }

    #[test]
    fn work_takes_time_and_memory() {
        let cost = cost(|| (0..20_000_000u64).fold(1u64, |a, b| a.rotate_left(7) ^ b));
        assert!(cost.cpu > 0.0 && cost.wall > 0.0);
        const BYTES: usize = 64 << 20;
        let held = std::hint::black_box(vec![1_u8; BYTES]);
        let while_held = resident_memory();
        drop(held);
        // Absent where the system does not say.
        for memory in [while_held, peak_memory()].into_iter().flatten() {
            assert!(memory >= BYTES as u64);
        }
    }
}
