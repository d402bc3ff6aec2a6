//! Where paths wait for the tail: columns of a structure of arrays, one queue a vertex number. Lanes that go on are
//! compressed to the front of each column's next sixteen floats, so a packet that is taken out is full and costs
//! one load a column.

use super::Streams;
use crate::accel::Hits;
use crate::math::{LANES, Mask, Pick, Rgb, Vec3x, f32x16};

/// Columns of a path: slot, stream seed, sample index; the hit (instance, triangle, u, v, distance); direction back,
/// throughput, radiance; throughput and radiance since the tail began; squared relative index; pdf.
const COLUMNS: usize = 25;

/// How sixteen paths arrive at their vertices, and what they have gathered on the way.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Where each path's result goes.
    pub slots: [u32; LANES],
    /// Random numbers of the paths.
    pub streams: Streams,
    /// The vertices.
    pub hits: Hits,
    /// Unit direction back to where they came from.
    pub wo: Vec3x,
    /// Throughput ÷ pdf.
    pub beta: Rgb,
    /// Radiance gathered so far, without very direct light.
    pub radiance: Rgb,
    /// Throughput since the tail began.
    pub tau: Rgb,
    /// T: radiance gathered in the tail per unit throughput at its start.
    pub tail: Rgb,
    /// Squared product of relative indices along the path.
    pub eta_squared: f32x16,
    /// Solid-angle pdf of the direction they came by; 0 after a Dirac event, negative where the emission of this
    /// vertex is already accounted for.
    pub bsdf_pdf: f32x16,
}

/// Paths that stand at the same vertex.
#[derive(Debug, Default)]
struct Queue {
    len: usize,
    columns: [Vec<f32>; COLUMNS],
}

/// Paths by the vertex they stand at: queue k holds those at x_k.
#[derive(Debug, Default)]
pub struct Queues {
    queues: Vec<Queue>,
    /// Memory of emptied queues, for those that follow: two are in use at a time and stay in the cache.
    spare: Vec<Queue>,
}

#[inline(always)]
fn as_floats(words: [u32; LANES]) -> f32x16 {
    bytemuck::cast(words)
}

#[inline(always)]
fn as_words(floats: f32x16) -> [u32; LANES] {
    bytemuck::cast(floats)
}

impl Arrival {
    #[inline(always)]
    fn columns(&self) -> [f32x16; COLUMNS] {
        let (h, s) = (&self.hits, &self.streams);
        let [wo, beta, l, tau, t] = [self.wo, self.beta, self.radiance, self.tau, self.tail];
        [
            as_floats(self.slots),
            as_floats(s.seeds),
            as_floats(s.indices),
            as_floats(h.instance),
            as_floats(h.primitive),
            h.u,
            h.v,
            h.t,
            wo.x,
            wo.y,
            wo.z,
            beta.x,
            beta.y,
            beta.z,
            l.x,
            l.y,
            l.z,
            tau.x,
            tau.y,
            tau.z,
            t.x,
            t.y,
            t.z,
            self.eta_squared,
            self.bsdf_pdf,
        ]
    }

    #[inline(always)]
    fn from_columns(c: &[f32x16; COLUMNS], active: Mask) -> Self {
        let vector = |i: usize| Vec3x::new(c[i], c[i + 1], c[i + 2]);
        let [instance, primitive] = [as_words(c[3]), as_words(c[4])];
        Self {
            slots: as_words(c[0]),
            streams: Streams { seeds: as_words(c[1]), indices: as_words(c[2]) },
            hits: Hits { valid: active, t: c[7], u: c[5], v: c[6], instance, primitive },
            wo: vector(8),
            beta: vector(11),
            radiance: vector(14),
            tau: vector(17),
            tail: vector(20),
            eta_squared: c[23],
            bsdf_pdf: c[24],
        }
    }
}

impl Queue {
    #[inline(always)]
    fn push(&mut self, lanes: Mask, arrival: &Arrival) {
        let (start, end) = (self.len, self.len + LANES);
        if self.columns[0].len() < end {
            let capacity = end.next_power_of_two();
            self.columns.iter_mut().for_each(|column| column.resize(capacity, 0.0));
        }
        let pick = Pick::compress(lanes);
        for (column, value) in self.columns.iter_mut().zip(arrival.columns()) {
            column[start..end].copy_from_slice(pick.of(value).as_array());
        }
        self.len += lanes.count() as usize;
    }

    /// The sixteen paths from `start` on, fewer at the end; their mask is that of the hits.
    #[inline(always)]
    fn packet(&self, start: usize) -> Arrival {
        let left = self.len - start;
        let active = if left >= LANES { Mask::ALL } else { Mask::from_bits((1 << left) - 1) };
        let mut columns = [f32x16::ZERO; COLUMNS];
        for (to, column) in columns.iter_mut().zip(&self.columns) {
            let mut floats = [0.0; LANES];
            floats.copy_from_slice(&column[start..start + LANES]);
            *to = f32x16::new(floats);
        }
        Arrival::from_columns(&columns, active)
    }
}

impl Queues {
    /// Adds the set lanes of sixteen paths that arrive at vertex `depth`.
    pub fn push(&mut self, depth: u32, lanes: Mask, arrival: &Arrival) {
        if lanes.none() {
            return;
        }
        let depth = depth as usize;
        if self.queues.len() <= depth {
            self.queues.resize_with(depth + 1, Queue::default);
        }
        let queue = &mut self.queues[depth];
        if queue.columns[0].is_empty() {
            *queue = self.spare.pop().unwrap_or_default();
        }
        queue.push(lanes, arrival);
    }

    /// Hands over all paths at vertex `depth`, sixteen at a time, with the queues to push those that go on to.
    /// Returns false where no path has come that far.
    pub fn drain(&mut self, depth: u32, mut each: impl FnMut(&Arrival, &mut Self)) -> bool {
        let Some(queue) = self.queues.get_mut(depth as usize) else { return false };
        let mut queue = std::mem::take(queue);
        for start in (0..queue.len).step_by(LANES) {
            each(&queue.packet(start), self);
        }
        queue.len = 0;
        if !queue.columns[0].is_empty() {
            self.spare.push(queue);
        }
        true
    }
}
