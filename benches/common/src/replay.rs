//! Ray tracing that costs nothing and ray tracing whose time is known: wrappers around an [`Accel`].

use gdpt::accel::{Accel, Coherence, Hits, Rays, Visible};
use gdpt::math::Mask;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::time::Instant;

/// Traces through another and keeps the answers.
pub struct Recorder<'a, A> {
    inner: &'a A,
    hits: Mutex<Vec<Hits>>,
    occluded: Mutex<Vec<Mask>>,
    coherent: AtomicU64,
}

impl<'a, A: Accel> Recorder<'a, A> {
    /// Records what `inner` answers.
    pub fn new(inner: &'a A) -> Self {
        Self { inner, hits: Mutex::default(), occluded: Mutex::default(), coherent: AtomicU64::new(0) }
    }

    /// Packets so far whose rays were said to run alike.
    pub fn coherent_packets(&self) -> u64 {
        self.coherent.load(Relaxed)
    }

    fn note(&self, coherence: Coherence) {
        self.coherent.fetch_add(u64::from(coherence == Coherence::Coherent), Relaxed);
    }

    /// The answers, in order.
    pub fn replay(self) -> Replay {
        let recorded = "no thread died while it recorded";
        Replay {
            hits: self.hits.into_inner().expect(recorded),
            occluded: self.occluded.into_inner().expect(recorded),
            next: [const { AtomicUsize::new(0) }; 2],
        }
    }
}

impl<A: Accel> Accel for Recorder<'_, A> {
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits {
        self.note(coherence);
        let hits = self.inner.intersect16(rays, active, visible, coherence);
        self.hits.lock().expect("no thread died while it recorded").push(hits);
        hits
    }

    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Mask {
        self.note(coherence);
        let occluded = self.inner.occluded16(rays, active, visible, coherence);
        self.occluded.lock().expect("no thread died while it recorded").push(occluded);
        occluded
    }
}

/// Gives the recorded answers in their order, whatever is asked: for one thread that repeats the same work, so that
/// what it counts is the renderer's own.
pub struct Replay {
    hits: Vec<Hits>,
    occluded: Vec<Mask>,
    next: [AtomicUsize; 2],
}

impl Replay {
    /// Whether all answers were asked for.
    pub fn is_finished(&self) -> bool {
        let [hits, occluded] = &self.next;
        hits.load(Relaxed) == self.hits.len() && occluded.load(Relaxed) == self.occluded.len()
    }
}

impl Accel for Replay {
    fn intersect16(&self, _: &Rays, _: Mask, _: Visible, _: Coherence) -> Hits {
        self.hits[self.next[0].fetch_add(1, Relaxed)]
    }

    fn occluded16(&self, _: &Rays, _: Mask, _: Visible, _: Coherence) -> Mask {
        self.occluded[self.next[1].fetch_add(1, Relaxed)]
    }
}

/// Sums the wall time spent inside another; for one thread.
pub struct Timed<'a, A> {
    inner: &'a A,
    nanoseconds: AtomicU64,
    calls: AtomicU64,
}

impl<'a, A: Accel> Timed<'a, A> {
    /// Times `inner`.
    pub fn new(inner: &'a A) -> Self {
        Self { inner, nanoseconds: AtomicU64::new(0), calls: AtomicU64::new(0) }
    }

    /// The share of `wall` seconds, during which it was called, that passed inside; reading the clock left out.
    pub fn share(&self, wall: f64) -> f64 {
        let readings = 100_000;
        let start = Instant::now();
        (0..readings).for_each(|_| {
            std::hint::black_box(Instant::now());
        });
        let reading = start.elapsed().as_secs_f64() / f64::from(readings) * self.calls.load(Relaxed) as f64;
        // A call reads the clock twice; half of each reading falls between the two.
        (self.nanoseconds.load(Relaxed) as f64 * 1e-9 - reading) / (wall - 2.0 * reading)
    }

    fn time<T>(&self, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let value = work();
        self.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Relaxed);
        self.calls.fetch_add(1, Relaxed);
        value
    }
}

impl<A: Accel> Accel for Timed<'_, A> {
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits {
        self.time(|| self.inner.intersect16(rays, active, visible, coherence))
    }

    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Mask {
        self.time(|| self.inner.occluded16(rays, active, visible, coherence))
    }
}
