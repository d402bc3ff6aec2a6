//! Rendering in passes, until enough is known or the time is up.
//!
//! Without a [`Stop`] there is one pass. Otherwise the first pass has [`FIRST`] samples a pixel, and each further one
//! takes what seems missing, at most three times what there is:
//!
//! * **error**: relMSE falls as one over the number of samples, so the solve after each pass tells how many are
//!   needed; a pass adds at least a quarter, which keeps the solves few. The same samples are taken on any machine.
//! * **time**: half of what is left is spent in a pass, until nothing is left but what the solve and the files take.
//!   That is measured by a trial solve after the first pass. How many samples fit depends on the machine, the samples
//!   themselves do not.

use super::job::Stop;
use crate::film::{Film, Half};
use crate::integrate::{Settings, Statistics};
use std::time::Instant;

/// Samples a pixel of the first pass: enough for two halves.
const FIRST: u32 = 2;
/// Samples a pixel of the first pass where an error is to be reached: fewer tell nothing.
const FIRST_FOR_ERROR: u32 = 8;
/// Samples that are rendered together; a pass is a multiple where it can.
const WAVE: u32 = 8;
/// Files take about this share of the time of a solve.
const WRITING: f64 = 1.0;

/// What a render in passes asks its surroundings for.
pub(super) trait Passes {
    /// Renders the samples of `settings`; nothing once the work is cancelled.
    fn pass(&mut self, settings: &Settings) -> Option<(Film, Statistics)>;
    /// Solves for the image as it stands, and returns its estimated relMSE.
    fn trial(&mut self, film: &Film) -> Option<f64>;
}

/// The film of all passes, or nothing once the work is cancelled. `start` is when the clock of [`Stop::seconds`]
/// began.
pub(super) fn run(
    settings: &Settings,
    stop: &Stop,
    start: Instant,
    passes: &mut impl Passes,
) -> Option<(Film, Statistics)> {
    if *stop == Stop::default() {
        return passes.pass(settings);
    }
    let first = if stop.error.is_some() && stop.seconds.is_none() { FIRST_FOR_ERROR } else { FIRST };
    let mut next = first.min(settings.spp);
    let mut result: Option<(Film, Statistics)> = None;
    let mut rendering = 0.0;
    let mut solving = None;
    loop {
        let done = result.as_ref().map_or(0, |(film, _)| film.samples(Half::Both));
        let begin = Instant::now();
        let pass = Settings { first_sample: settings.first_sample + done, spp: next, ..*settings };
        let (film, statistics) = passes.pass(&pass)?;
        rendering += begin.elapsed().as_secs_f64();
        let (film, _) = match &mut result {
            None => result.insert((film, statistics)),
            Some(sum) => {
                sum.0.add(&film);
                sum.1.add(&statistics);
                sum
            }
        };
        let done = done + next;
        if done >= settings.spp {
            return result;
        }
        let (mut wanted, mut least) = (settings.spp - done, 1);
        if let Some(target) = stop.error {
            let begin = Instant::now();
            let error = passes.trial(film);
            solving.get_or_insert_with(|| begin.elapsed().as_secs_f64());
            if error.is_some_and(|e| e <= target * target) {
                return result;
            }
            let missing = f64::from(done) * (error.unwrap_or(f64::INFINITY) / (target * target) - 1.0);
            wanted = wanted.min(missing.ceil().min(f64::from(u32::MAX)) as u32);
            least = done / 4;
        }
        if let Some(limit) = stop.seconds {
            let trial = *solving.get_or_insert_with(|| {
                let begin = Instant::now();
                passes.trial(film);
                begin.elapsed().as_secs_f64()
            });
            let left = limit - start.elapsed().as_secs_f64() - trial * (1.0 + WRITING);
            let fit = (left / (rendering / f64::from(done))).max(0.0) as u32;
            // The last samples that fit come in one pass; a quarter of a wave is not worth another.
            let fit = if fit > 2 * WAVE { fit / 2 } else { fit };
            if fit < 1 {
                return result;
            }
            wanted = wanted.min(fit);
            least = least.min(fit);
        }
        let size = wanted.max(least).min(3 * done).min(settings.spp - done);
        next = if size > WAVE { size / WAVE * WAVE } else { size };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes no time and reports an error that falls as it should.
    struct Ideal {
        spent: Vec<(u32, u32)>,
        solves: u32,
    }

    impl Passes for Ideal {
        fn pass(&mut self, settings: &Settings) -> Option<(Film, Statistics)> {
            self.spent.push((settings.first_sample, settings.spp));
            let mut film = Film::new(1, 1, false, false);
            film.add_samples(settings.first_sample, settings.spp);
            Some((film, Statistics::default()))
        }

        fn trial(&mut self, film: &Film) -> Option<f64> {
            self.solves += 1;
            Some(4.0 / f64::from(film.samples(Half::Both)))
        }
    }

    #[test]
    fn an_error_is_reached_with_few_solves_and_few_samples_too_many() {
        for target in [0.5, 0.2, 0.11, 0.05, 0.02] {
            let mut ideal = Ideal { spent: Vec::new(), solves: 0 };
            let settings = Settings { spp: 1 << 16, first_sample: 100, ..Settings::default() };
            let stop = Stop { error: Some(target), seconds: None };
            let (film, _) = run(&settings, &stop, Instant::now(), &mut ideal).expect("not cancelled");
            let (done, needed) = (film.samples(Half::Both), (4.0 / (target * target)).ceil() as u32);
            assert!(done >= needed && done <= (needed + needed / 4 + WAVE), "{target}: {done} of {needed}");
            assert!(ideal.solves <= 9, "{target}: {} solves", ideal.solves);
            let mut next = 100;
            for (first, spp) in ideal.spent {
                assert_eq!(first, next);
                next += spp;
            }
        }
    }

    #[test]
    fn all_samples_are_taken_where_time_and_error_allow() {
        for stop in [
            Stop::default(),
            Stop { seconds: Some(1e9), error: None },
            Stop { seconds: Some(1e9), error: Some(1e-9) },
        ] {
            let mut ideal = Ideal { spent: Vec::new(), solves: 0 };
            let settings = Settings { spp: 301, ..Settings::default() };
            let (film, _) = run(&settings, &stop, Instant::now(), &mut ideal).expect("not cancelled");
            assert_eq!(film.samples(Half::Both), 301);
        }
    }

    #[test]
    fn no_time_is_the_first_pass() {
        let mut ideal = Ideal { spent: Vec::new(), solves: 0 };
        let stop = Stop { seconds: Some(0.0), error: None };
        let (film, _) = run(&Settings::default(), &stop, Instant::now(), &mut ideal).expect("not cancelled");
        assert_eq!(film.samples(Half::Both), FIRST);
    }
}
