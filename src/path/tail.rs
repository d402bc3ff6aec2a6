//! The tail: plain path tracing, sixteen paths at a time, and the whole of the `pt` integrator.
//!
//! Paths wait in queues by vertex number; a packet takes sixteen that stand at the same vertex, whichever pixels and
//! samples they belong to, so lanes stay full at depth. Each path owns a [`Slot`]; besides its radiance the slot
//! collects T, the radiance per unit of the throughput the path had when it entered the tail: the gradient of a
//! settled shift is a constant times T (algorithm, section 0).

use super::bounce::{Bounce, bounce, light_pdf};
use super::direct;
use super::trace::Tracer;
use super::{Limits, Streams};
use crate::accel::{Accel, Coherence, Hits};
use crate::math::{Compare, LANES, Mask, Rgb, Vec3x, f32x16, lanes, splat};
use crate::shade::Surface;

/// A path that has arrived at a surface and waits to go on.
#[derive(Clone, Copy, Debug)]
pub struct Waiting {
    /// Index of its slot.
    pub slot: u32,
    /// The hit it stands at.
    pub instance: u32,
    /// Triangle of the instance's mesh.
    pub primitive: u32,
    /// Barycentrics of the hit.
    pub uv: [f32; 2],
    /// Distance it came, m.
    pub distance: f32,
    /// Unit direction back to where it came from.
    pub wo: [f32; 3],
    /// Throughput ÷ pdf.
    pub beta: [f32; 3],
    /// The same since it entered the tail.
    pub tau: [f32; 3],
    /// Squared product of relative indices along the path.
    pub eta_squared: f32,
    /// Weight of what this vertex emits, against light sampling at the vertex before; 0 where that emission is
    /// already accounted for.
    pub emission_weight: f32,
}

/// What one sample of one pixel has gathered.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slot {
    /// Sampler stream of the pixel.
    pub seed: u32,
    /// Sample index.
    pub index: u32,
    /// Radiance without very direct light.
    pub radiance: [f32; 3],
    /// T: radiance gathered in the tail per unit throughput at its start.
    pub tail: [f32; 3],
}

/// Paths by the vertex they stand at: `queues[k]` holds those at x_k.
#[derive(Debug, Default)]
pub struct Queues {
    queues: Vec<Vec<Waiting>>,
}

impl Queues {
    /// Adds a path that stands at vertex `depth`.
    pub fn push(&mut self, depth: u32, path: Waiting) {
        let depth = depth as usize;
        if self.queues.len() <= depth {
            self.queues.resize_with(depth + 1, Vec::new);
        }
        self.queues[depth].push(path);
    }

    /// Adds the `active` lanes of sixteen paths that arrive at `hits`, vertex `depth`.
    pub fn push_lanes(
        &mut self,
        depth: u32,
        active: Mask,
        slots: &[u32; LANES],
        hits: &Hits,
        arrival: &Arrival,
    ) {
        for i in active.iter() {
            let rgb = |v: &Vec3x| v.lane(i).to_array();
            self.push(
                depth,
                Waiting {
                    slot: slots[i],
                    instance: hits.instance[i],
                    primitive: hits.primitive[i],
                    uv: [hits.u.as_array()[i], hits.v.as_array()[i]],
                    distance: hits.t.as_array()[i],
                    wo: rgb(&arrival.wo),
                    beta: rgb(&arrival.beta),
                    tau: rgb(&arrival.tau),
                    eta_squared: arrival.eta_squared.as_array()[i],
                    emission_weight: arrival.emission_weight.as_array()[i],
                },
            );
        }
    }
}

/// How sixteen paths arrive at their vertices (see [`Waiting`]).
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Unit direction back to where they came from.
    pub wo: Vec3x,
    /// Throughput ÷ pdf.
    pub beta: Rgb,
    /// The same since entering the tail.
    pub tau: Rgb,
    /// Squared product of relative indices.
    pub eta_squared: f32x16,
    /// Weight of what they meet there; 0 where its emission is accounted for.
    pub emission_weight: f32x16,
}

/// Sixteen waiting paths, turned into lanes.
struct Packet {
    active: Mask,
    slots: [u32; LANES],
    streams: Streams,
    hits: Hits,
    arrival: Arrival,
}

impl Packet {
    fn new(waiting: &[Waiting], slots: &[Slot]) -> Self {
        let at = |i: usize| &waiting[i.min(waiting.len() - 1)];
        let active = Mask::from_fn(|i| i < waiting.len());
        let slot = std::array::from_fn(|i| at(i).slot);
        let rgb = |f: fn(&Waiting) -> [f32; 3]| {
            Vec3x::new(lanes(|i| f(at(i))[0]), lanes(|i| f(at(i))[1]), lanes(|i| f(at(i))[2]))
        };
        Self {
            active,
            slots: slot,
            streams: Streams {
                seeds: slot.map(|s| slots[s as usize].seed),
                indices: slot.map(|s| slots[s as usize].index),
            },
            hits: Hits {
                valid: active,
                t: lanes(|i| at(i).distance),
                u: lanes(|i| at(i).uv[0]),
                v: lanes(|i| at(i).uv[1]),
                instance: std::array::from_fn(|i| at(i).instance),
                primitive: std::array::from_fn(|i| at(i).primitive),
            },
            arrival: Arrival {
                wo: rgb(|w| w.wo),
                beta: rgb(|w| w.beta),
                tau: rgb(|w| w.tau),
                eta_squared: lanes(|i| at(i).eta_squared),
                emission_weight: lanes(|i| at(i).emission_weight),
            },
        }
    }

    /// Adds radiance `per_unit` of throughput to the slots.
    #[inline]
    fn gather(&self, slots: &mut [Slot], lanes: Mask, beta: Rgb, tau: Rgb, per_unit: Rgb) {
        let (radiance, tail) = (beta * per_unit, tau * per_unit);
        for i in lanes.and_not(per_unit.is_zero()).iter() {
            let slot = &mut slots[self.slots[i] as usize];
            add(&mut slot.radiance, radiance.lane(i).to_array());
            add(&mut slot.tail, tail.lane(i).to_array());
        }
    }
}

/// Adds a colour to a sum.
#[inline(always)]
pub fn add(sum: &mut [f32; 3], value: [f32; 3]) {
    for c in 0..3 {
        sum[c] += value[c];
    }
}

/// Power heuristic (exponent 2) for an emitter found by the BSDF sampler with pdf `bsdf_pdf`, which light sampling
/// finds with pdf `light_pdf`; 1 after a Dirac event (`bsdf_pdf` 0).
#[inline(always)]
pub fn emission_weight(bsdf_pdf: f32x16, light_pdf: f32x16) -> f32x16 {
    let ratio = light_pdf / bsdf_pdf;
    bsdf_pdf.gt(f32x16::ZERO).select(splat(1.0) / (splat(1.0) + ratio * ratio), splat(1.0))
}

/// Walks all waiting paths to their ends.
pub fn run<A: Accel>(tracer: &mut Tracer<'_, A>, queues: &mut Queues, slots: &mut [Slot], limits: &Limits) {
    let mut depth = 1;
    while depth < queues.queues.len() {
        let waiting = std::mem::take(&mut queues.queues[depth]);
        for packet in waiting.chunks(LANES) {
            step(tracer, &Packet::new(packet, slots), depth as u32, queues, slots, limits);
        }
        // Hand the allocation back for the next wave.
        let mut empty = waiting;
        empty.clear();
        queues.queues[depth] = empty;
        depth += 1;
    }
}

/// One vertex of sixteen paths: emission, direct light, continuation.
fn step<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    packet: &Packet,
    depth: u32,
    queues: &mut Queues,
    slots: &mut [Slot],
    limits: &Limits,
) {
    let Arrival { wo, beta, tau, mut eta_squared, emission_weight: weight } = packet.arrival;
    let surface = Surface::new(tracer.scene, &packet.hits, packet.active, wo);

    // What the vertex emits, unless the head has already counted it.
    packet.gather(slots, packet.active & surface.is_emitter, beta, tau, surface.emission * weight);
    if depth >= limits.max_depth {
        return;
    }

    let streams = &packet.streams;
    if let Some(light) =
        direct::sample(tracer, &surface, streams, depth, packet.active, Mask::NONE, Coherence::Incoherent)
    {
        packet.gather(slots, light.active, beta, tau, light.estimate());
    }

    let next = bounce(tracer, &surface, beta, &mut eta_squared, streams, depth, limits, packet.active);
    let factor = next.factor();
    let (beta, tau) = (beta * factor, tau * factor);
    let bsdf_pdf = next.sample.dirac.select(f32x16::ZERO, next.sample.pdf);
    gather_environment(tracer, packet, &next, bsdf_pdf, beta, tau, slots);
    let arrived = next.active & next.hits.valid;
    let found = light_pdf(tracer.scene, &surface, next.sample.wi, &next.hits, arrived);
    let weight = emission_weight(bsdf_pdf, found);
    let arrival = Arrival { wo: -next.sample.wi, beta, tau, eta_squared, emission_weight: weight };
    queues.push_lanes(depth + 1, arrived, &packet.slots, &next.hits, &arrival);
}

/// Light from infinity for the lanes that left the scene.
fn gather_environment<A: Accel>(
    tracer: &Tracer<'_, A>,
    packet: &Packet,
    next: &Bounce,
    bsdf_pdf: f32x16,
    beta: Rgb,
    tau: Rgb,
    slots: &mut [Slot],
) {
    let escaped = next.escaped();
    let lights = &tracer.scene.lights;
    if escaped.none() || !lights.has_environment() {
        return;
    }
    let wi = next.sample.wi;
    let weight = emission_weight(bsdf_pdf, lights.environment_pdf(wi));
    packet.gather(slots, escaped, beta, tau, lights.environment(wi) * weight);
}
