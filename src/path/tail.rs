//! The tail: plain path tracing, sixteen paths at a time, and the whole of the `pt` integrator.
//!
//! Paths wait in queues by vertex number; a packet takes sixteen that stand at the same vertex, whichever pixels and
//! samples they belong to, so lanes stay full at depth. A path carries its radiance along and leaves it in its
//! [`Slot`] where it ends. Besides, it gathers T, the radiance per unit of the throughput it had when it entered the
//! tail: the gradient of a settled shift is a constant times T (algorithm, section 0).

use super::Limits;
use super::bounce::{bounce, light_pdf};
use super::direct;
use super::queue::{Arrival, Queues};
use super::trace::Tracer;
use crate::accel::{Accel, Coherence};
use crate::math::{Compare, Mask, Rgb, f32x16, splat};
use crate::shade::Surface;

/// What one sample of one pixel has gathered.
#[derive(Clone, Copy, Debug, Default)]
pub struct Slot {
    /// Radiance without very direct light.
    pub radiance: [f32; 3],
    /// T: radiance gathered in the tail per unit throughput at its start.
    pub tail: [f32; 3],
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
    while queues.drain(depth, |packet, queues| step(tracer, packet, depth, queues, slots, limits)) {
        depth += 1;
    }
}

/// One vertex of sixteen paths: emission, direct light, continuation.
#[inline]
fn step<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    packet: &Arrival,
    depth: u32,
    queues: &mut Queues,
    slots: &mut [Slot],
    limits: &Limits,
) {
    let active = packet.hits.valid;
    let (wo, streams) = (packet.wo, &packet.streams);
    let mut path = *packet;
    let surface = Surface::new(tracer.scene, &packet.hits, active, wo);

    // What the vertex emits, unless the head has already counted it.
    let emits = active & surface.is_emitter & packet.bsdf_pdf.ge(f32x16::ZERO);
    if emits.any() {
        let weight = emission_weight(packet.bsdf_pdf, light_pdf(&surface, -wo, packet.hits.t));
        path.gather(emits.keep(surface.emission * weight));
    }
    if depth >= limits.max_depth {
        return path.finish(active, slots);
    }
    let light = direct::sample(tracer, &surface, streams, depth, active, Mask::NONE, Coherence::Incoherent);
    if let Some(light) = light {
        path.gather(light.active.keep(light.estimate()));
    }

    let next = bounce(tracer, &surface, path.beta, &mut path.eta_squared, streams, depth, limits, active);
    let factor = next.factor();
    (path.beta, path.tau) = (path.beta * factor, path.tau * factor);
    path.bsdf_pdf = next.sample.dirac.select(f32x16::ZERO, next.sample.pdf);
    let escaped = next.escaped();
    let lights = &tracer.scene.lights;
    if escaped.any() && lights.has_environment() {
        let (radiance, pdf) = lights.environment_with_pdf(next.sample.wi);
        path.gather(escaped.keep(radiance * emission_weight(path.bsdf_pdf, pdf)));
    }
    let goes_on = next.active & next.hits.valid;
    path.finish(active.and_not(goes_on), slots);
    path.hits = next.hits;
    path.wo = -next.sample.wi;
    queues.push(depth + 1, goes_on, &path);
}

impl Arrival {
    /// Adds radiance `per_unit` of throughput.
    #[inline(always)]
    fn gather(&mut self, per_unit: Rgb) {
        self.radiance += self.beta * per_unit;
        self.tail += self.tau * per_unit;
    }

    /// Leaves the results of the paths that end in their slots.
    #[inline(always)]
    fn finish(&self, lanes: Mask, slots: &mut [Slot]) {
        for i in lanes.iter() {
            slots[self.slots[i] as usize] =
                Slot { radiance: self.radiance.lane(i).to_array(), tail: self.tail.lane(i).to_array() };
        }
    }
}
