//! The head: sixteen base paths and their sixty-four offsets, walked together vertex by vertex until every offset of
//! a base is settled, that is, connected to it or dead. Then the tail takes over (algorithm, sections 0, 6 and 17).
//!
//! Bookkeeping by ratios, safe in f32 and free of epsilons: with f and p products over the path so far, the base
//! has β = f_x / p_x, an offset β_y = J f_y / p_x and r = J p_y / p_x, J the product of all Jacobians. A dead offset
//! has r = 0 and β_y = 0. Contributions to a one-sided gradient are w (c_y − c_x) with power-2 weights w over
//! {NEE, BSDF} × {base, offset}.

use super::{ShiftOutcome, View};
use crate::accel::{Accel, Coherence, Rays};
use crate::math::{Compare, Mask, Rgb, Vec3x, f32x16, splat};
use crate::path::bounce::{Bounce, absorption, bounce, light_pdf};
use crate::path::direct::{self, DirectLight, Lit};
use crate::path::queue::{Arrival, Queues};
use crate::path::shift::{PairWeights, half_vector, is_diffuse, plan, reconnect};
use crate::path::tail::emission_weight;
use crate::path::trace::Tracer;
use crate::path::{Limits, Streams};
use crate::shade::Surface;

/// One offset path a lane.
#[derive(Clone, Copy, Default)]
pub struct Offset {
    /// Its own vertex y_k.
    pub surface: Surface,
    /// Once recently connected: direction from the base's vertex back to y_{k−1}.
    pub wo: Vec3x,
    /// J f_y / p_x.
    pub beta: Rgb,
    /// r = J p_y / p_x.
    pub ratio: f32x16,
    /// Has a vertex of its own.
    pub own: Mask,
    /// Shares the base's vertex but arrives from elsewhere.
    pub recent: Mask,
    /// Identical to the base from here on.
    pub connected: Mask,
    /// Lanes whose neighbour is in the film at all.
    pub exists: Mask,
}

/// What the base meets next, and what of it shines back.
struct Next {
    vertex: Surface,
    /// Lanes that left the scene into an environment.
    sky: Mask,
    /// Radiance that arrives at x_k from there.
    radiance: Rgb,
    /// ℓ: solid-angle pdf with which light sampling at x_k finds it.
    light_pdf: f32x16,
    /// (ℓ / b)²: light sampling against BSDF sampling for that radiance; 0 after a Dirac event.
    light_ratio2: f32x16,
    /// Diffuse for the shift: rough enough, or emitting, or the environment.
    diffuse: Mask,
}

/// The offset after one bounce, before it is written back.
struct Shifted {
    wo: Vec3x,
    beta: Rgb,
    ratio: f32x16,
    own: Mask,
    recent: Mask,
    /// Lanes in which NEE took no part for the pair at this bounce.
    without_nee: Mask,
    /// Squared pdf sum of the offset's techniques over the base's drawn one.
    weight: f32x16,
    /// Radiance that arrives at the offset's vertex from its next.
    radiance: Rgb,
}

/// Sixteen base paths with their offsets.
pub struct Head {
    /// The base's vertex x_k.
    pub surface: Surface,
    /// f_x / p_x.
    pub beta: Rgb,
    /// Squared product of relative indices along the base.
    pub eta_squared: f32x16,
    /// Base paths that are still walked here.
    pub active: Mask,
    /// Offsets by [`Direction`].
    pub offsets: [Offset; 4],
    /// Radiance of the base so far.
    pub radiance: Rgb,
    /// One-sided gradients so far, by [`Direction`].
    pub gradient: [Rgb; 4],
    /// What T is multiplied with for the gradient, by [`Direction`]; set once all offsets are settled.
    pub tail_factor: [Rgb; 4],
    /// Counts by [`ShiftOutcome`].
    pub outcomes: [u64; ShiftOutcome::COUNT],
}

/// What stays the same along a head's walk.
pub struct Walk<'a> {
    /// Camera and settings.
    pub view: &'a View<'a>,
    /// Random numbers of the lanes.
    pub streams: Streams,
    /// Slots of the lanes.
    pub slots: [u32; 16],
}

impl Walk<'_> {
    fn weights(&self) -> PairWeights {
        PairWeights { mis: self.view.settings.pair_mis }
    }

    fn is_diffuse(&self, surface: &Surface) -> Mask {
        is_diffuse(&surface.bsdf, self.view.settings.shift_threshold)
    }
}

impl Head {
    /// Walks to the end of the head; paths that go on are queued for the tail.
    pub fn walk<A: Accel>(&mut self, tracer: &mut Tracer<'_, A>, walk: &Walk<'_>, queues: &mut Queues) {
        let limits: Limits = walk.view.limits;
        let mut depth = 1;
        while depth < limits.max_depth && self.active.any() {
            self.direct_light(tracer, walk, depth);
            self.scatter(tracer, walk, depth, queues);
            depth += 1;
        }
    }

    fn count(&mut self, outcome: ShiftOutcome, lanes: Mask) {
        self.outcomes[outcome as usize] += u64::from(lanes.count());
    }

    /// The NEE event at x_k (section 6.1).
    fn direct_light<A: Accel>(&mut self, tracer: &mut Tracer<'_, A>, walk: &Walk<'_>, depth: u32) {
        let coherence = if depth == 1 { Coherence::Coherent } else { Coherence::Incoherent };
        let light =
            direct::sample(tracer, &self.surface, &walk.streams, depth, self.active, Mask::ALL, coherence);
        let Some(light) = light else { return };
        self.radiance += light.active.keep(self.beta * light.estimate());

        let base = self.beta * light.base.contribution(&light.point);
        let base_ratio = light.base.pdf_ratio(&light.point);
        let base_weight = splat(1.0) + base_ratio * base_ratio;
        let base_diffuse = walk.is_diffuse(&self.surface);
        for d in 0..4 {
            let offset = &self.offsets[d];
            // Area and environment lights: both diffuse connect, both glossy leave the event to the half-vector
            // copy, mixed pairs fail. Dirac lights are always connected: nothing else can make such paths.
            let offset_diffuse = walk.is_diffuse(&offset.surface);
            let both_glossy = !(base_diffuse | offset_diffuse | light.point.is_dirac);
            let pairs = light.point.is_dirac | (base_diffuse & offset_diffuse);
            let event = light.active & offset.exists.and_not(offset.own & both_glossy);
            let evaluated = event & (offset.recent | (offset.own & pairs));

            let mut radiance = offset.connected.keep(light.base.contribution(&light.point));
            let r2 = offset.ratio * offset.ratio;
            let mut offset_weight = offset.connected.keep(r2 * base_weight);
            if evaluated.any() {
                let (seen, pdf_ratio) =
                    offset_light(tracer, &self.surface, offset, &light, evaluated, coherence);
                radiance = evaluated.select(seen, radiance);
                // J ℓ_y / ℓ_x is 1: base and offset use the same point. Occlusion zeroes f and b, never ℓ.
                offset_weight = evaluated.select(r2 * (splat(1.0) + pdf_ratio * pdf_ratio), offset_weight);
            }
            let weight = walk.weights().weight(base_weight, offset_weight);
            let difference = offset.beta * radiance - base;
            self.gradient[d] += event.keep(difference * weight);
        }
    }

    /// The BSDF event: x_k to x_{k+1}, with everything that is shifted along (section 6.2).
    fn scatter<A: Accel>(
        &mut self,
        tracer: &mut Tracer<'_, A>,
        walk: &Walk<'_>,
        depth: u32,
        queues: &mut Queues,
    ) {
        let limits = &walk.view.limits;
        let step = bounce(
            tracer,
            &self.surface,
            self.beta,
            &mut self.eta_squared,
            &walk.streams,
            depth,
            limits,
            self.active,
        );
        let next = arrive(tracer, walk, &step);
        let beta = self.beta * step.factor();
        let dirac_pdf = step.sample.dirac.select(f32x16::ZERO, step.sample.pdf);
        let seen = (step.active & (next.sky | next.vertex.is_emitter)).keep(next.radiance);
        self.radiance += beta * (seen * emission_weight(dirac_pdf, next.light_pdf));

        let base = beta * seen;
        let is_last = depth + 1 >= limits.max_depth;
        for d in 0..4 {
            let shifted = self.shift(tracer, walk, &step, &next, d, is_last);
            let base_weight = shifted.without_nee.select(splat(1.0), splat(1.0) + next.light_ratio2);
            let weight = walk.weights().weight(base_weight, shifted.weight);
            let difference = shifted.beta * shifted.radiance - base;
            self.gradient[d] += (step.active & self.offsets[d].exists).keep(difference * weight);

            let offset = &mut self.offsets[d];
            offset.connected = offset.connected | offset.recent;
            (offset.own, offset.recent) = (shifted.own, shifted.recent);
            let alive = offset.own | offset.recent | offset.connected;
            offset.beta = alive.keep(shifted.beta);
            offset.ratio = alive.keep(shifted.ratio);
            offset.wo = shifted.wo;
        }
        self.beta = beta;
        self.surface = next.vertex;
        self.active = step.active & step.hits.valid;
        if !is_last {
            self.hand_over(walk, &step, depth + 1, queues);
        }
    }

    /// Gives the paths whose offsets are all settled to the tail.
    fn hand_over(&mut self, walk: &Walk<'_>, step: &Bounce, depth: u32, queues: &mut Queues) {
        let unsettled = self.offsets.iter().fold(Mask::NONE, |m, o| m | o.own | o.recent);
        let settled = self.active.and_not(unsettled);
        if settled.none() {
            return;
        }
        for (factor, offset) in self.tail_factor.iter_mut().zip(&self.offsets) {
            let weight = walk.weights().weight(splat(1.0), offset.ratio * offset.ratio);
            let value = offset.exists.keep((offset.beta - self.beta) * weight);
            *factor = settled.select(value, *factor);
        }
        let arrival = Arrival {
            slots: walk.slots,
            streams: walk.streams,
            hits: step.hits,
            wo: -step.sample.wi,
            beta: self.beta,
            radiance: self.radiance,
            tau: Rgb::grey(1.0),
            tail: Rgb::ZERO,
            eta_squared: self.eta_squared,
            bsdf_pdf: splat(-1.0),
        };
        queues.push(depth, settled, &arrival);
        self.active = self.active.and_not(settled);
    }

    /// Moves offset `d` along with the base's bounce.
    fn shift<A: Accel>(
        &mut self,
        tracer: &mut Tracer<'_, A>,
        walk: &Walk<'_>,
        step: &Bounce,
        next: &Next,
        d: usize,
        is_last: bool,
    ) -> Shifted {
        let offset = &self.offsets[d];
        let r2 = offset.ratio * offset.ratio;
        // Connected: everything is the base's.
        let mut out = Shifted {
            wo: offset.wo,
            beta: offset.connected.keep(offset.beta * step.factor()),
            ratio: offset.connected.keep(offset.ratio),
            own: Mask::NONE,
            recent: Mask::NONE,
            without_nee: Mask::NONE,
            weight: offset.connected.keep(r2 * (splat(1.0) + next.light_ratio2)),
            radiance: offset.connected.keep(next.radiance),
        };
        let recent = offset.recent & step.active;
        if recent.any() {
            self.shift_recent(step, next, d, recent, &mut out);
        }
        let offset = &self.offsets[d];
        let own = offset.own & step.active & (step.hits.valid | next.sky);
        if own.none() {
            return out;
        }
        let kinds = plan(
            step.sample.dirac,
            walk.is_diffuse(&self.surface),
            walk.is_diffuse(&offset.surface),
            next.diffuse,
        );
        out.without_nee = own & kinds.without_nee;
        self.count(ShiftOutcome::Mixed, own & kinds.mixed);
        // At the last vertex only emission counts.
        let connects = own & kinds.reconnect;
        let connects = if is_last { connects & (next.sky | next.vertex.is_emitter) } else { connects };
        if connects.any() {
            self.shift_reconnect(tracer, step, next, d, connects, &mut out);
        }
        let copies = own & kinds.half_vector;
        if copies.any() {
            self.shift_half_vector(tracer, walk, step, next, d, copies, &mut out);
        }
        out
    }

    /// Recently connected: only the direction to the previous vertex differs; J = 1.
    fn shift_recent(&self, step: &Bounce, next: &Next, d: usize, lanes: Mask, out: &mut Shifted) {
        let offset = &self.offsets[d];
        let (f, pdf) = self.surface.bsdf.eval(offset.wo, step.sample.wi);
        // A Dirac event of the base has no counterpart for another incoming direction.
        let smooth = !step.sample.dirac;
        let f = smooth.keep(f * absorption(&self.surface, step.sample.wi, &step.hits));
        let b = smooth.keep(pdf) / step.sample.pdf;
        let inverse = splat(1.0) / (step.sample.pdf * step.survival);
        out.beta = lanes.select(offset.beta * f * inverse, out.beta);
        out.ratio = lanes.select(offset.ratio * b, out.ratio);
        let r2 = offset.ratio * offset.ratio;
        out.weight = lanes.select(r2 * (next.light_ratio2 + b * b), out.weight);
        out.radiance = lanes.select(next.radiance, out.radiance);
    }

    /// Reconnects y_k to x_{k+1}, or to the base's direction into the environment (J = 1).
    fn shift_reconnect<A: Accel>(
        &mut self,
        tracer: &mut Tracer<'_, A>,
        step: &Bounce,
        next: &Next,
        d: usize,
        lanes: Mask,
        out: &mut Shifted,
    ) {
        let offset = &self.offsets[d];
        let y = &offset.surface;
        let link = reconnect(&self.surface, y, &next.vertex);
        let sky = next.sky;
        let wi = sky.select(step.sample.wi, link.wi);
        let jacobian = sky.select(splat(1.0), link.jacobian);
        let distance = sky.select(splat(f32::INFINITY), link.distance);
        let (f, pdf) = y.bsdf.eval(y.wo, wi);
        let scatters = lanes & jacobian.gt(f32x16::ZERO) & pdf.gt(f32x16::ZERO);
        let origin = y.spawn(wi);
        let rays = Rays {
            origin,
            direction: sky.select(wi, next.vertex.spawn(-wi) - origin),
            tnear: f32x16::ZERO,
            tfar: sky.select(splat(f32::INFINITY), splat(1.0)),
        };
        let visible = tracer.unoccluded(&rays, scatters, &step.segment, Coherence::Incoherent);

        let f = visible.keep(f * y.bsdf.transmittance(wi, distance) * jacobian);
        let b = visible.keep(pdf * jacobian) / step.sample.pdf;
        let inverse = splat(1.0) / (step.sample.pdf * step.survival);
        out.beta = lanes.select(offset.beta * f * inverse, out.beta);
        out.ratio = lanes.select(offset.ratio * b, out.ratio);
        // J ℓ_y = ℓ_x: the light's own measure cancels. It stays in the weight where the way is blocked.
        let r2 = offset.ratio * offset.ratio;
        out.weight = lanes.select(r2 * (next.light_ratio2 + b * b), out.weight);
        let radiance = sky.select(next.radiance, next.vertex.emission_towards(-wi));
        out.radiance = lanes.select(radiance, out.radiance);
        out.recent = visible & step.hits.valid;
        out.wo = out.recent.select(-wi, out.wo);
        self.count(ShiftOutcome::Reconnected, visible);
        self.count(ShiftOutcome::Occluded, scatters.and_not(visible));
        self.count(ShiftOutcome::ZeroBsdf, lanes.and_not(scatters));
    }

    /// Copies the half-vector, or takes y's Dirac lobe of the same kind, and traces on to y_{k+1}.
    fn shift_half_vector<A: Accel>(
        &mut self,
        tracer: &mut Tracer<'_, A>,
        walk: &Walk<'_>,
        step: &Bounce,
        next: &Next,
        d: usize,
        lanes: Mask,
        out: &mut Shifted,
    ) {
        let offset = &self.offsets[d];
        let y = &offset.surface;
        let dirac = step.sample.dirac;
        let copy = half_vector(&self.surface, step.sample.wi, y, step.sample.transmit);
        let (f, pdf) = y.bsdf.eval(y.wo, copy.wi);
        let mirror = y.bsdf.eval_dirac(y.wo, step.sample.transmit);
        let wi = dirac.select(mirror.wi, copy.wi);
        let f = dirac.select(mirror.f, f);
        let pdf = dirac.select(mirror.pdf, pdf);
        let jacobian = dirac.select(splat(1.0), copy.jacobian);
        let exists = lanes & dirac.select(mirror.valid, copy.valid) & pdf.gt(f32x16::ZERO);

        let rays = Rays::new(y.spawn(wi), wi);
        let hits = tracer.closest(&rays, exists, &step.segment, Coherence::Incoherent);
        let vertex = Surface::new(tracer.scene, &hits, exists & hits.valid, -wi);
        // Both arrive at a surface, or both in the environment; and where both vertices are diffuse because of a
        // glossy next one, the offset's next must be such, too, or the way back would reconnect.
        let same_end = (step.hits.valid & hits.valid) | (next.sky.and_not(hits.valid));
        let glossy_next = !(next.diffuse | vertex.is_emitter | walk.is_diffuse(&vertex));
        let valid = exists & same_end & (out.without_nee | (glossy_next & hits.valid));

        let f = valid.keep(f * absorption(y, wi, &hits) * jacobian);
        let b = valid.keep(pdf * jacobian) / step.sample.pdf;
        let inverse = splat(1.0) / (step.sample.pdf * step.survival);
        let ratio = offset.ratio * b;
        out.beta = lanes.select(offset.beta * f * inverse, out.beta);
        out.ratio = lanes.select(ratio, out.ratio);
        out.weight = lanes.select(ratio * ratio, out.weight);
        let sky = valid & next.sky;
        let behind = if_any(sky, || tracer.scene.lights.environment(wi));
        let radiance = sky.select(behind, (valid & vertex.is_emitter).keep(vertex.emission));
        out.radiance = lanes.select(radiance, out.radiance);
        out.own = valid & hits.valid;
        let offset = &mut self.offsets[d];
        offset.surface = out.own.select(vertex, offset.surface);
        self.count(ShiftOutcome::HalfVector, valid);
        self.count(ShiftOutcome::HalfVectorDomain, lanes.and_not(exists));
        self.count(ShiftOutcome::HalfVectorMismatch, exists.and_not(valid));
    }
}

/// The offset's side of an NEE event: radiance per unit throughput, and b_y J / ℓ_x.
fn offset_light<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    base: &Surface,
    offset: &Offset,
    light: &DirectLight,
    evaluated: Mask,
    coherence: Coherence,
) -> (Rgb, f32x16) {
    let point = &light.point;
    let base_is_lit = !light.base.contribution(point).is_zero();
    let mut lit = Lit::default();
    let recent = evaluated & offset.recent;
    if recent.any() {
        lit = direct::scatter(base, offset.wo, point, light.base.seen, recent);
        // The base's segment is shared; it was traced unless the base's BSDF is zero there.
        let untraced = recent & light.base.f.is_zero();
        let mut traced = lit;
        if untraced.any() {
            traced.visible = traced.visible & untraced;
            direct::shadow(tracer, base, &mut traced, &light.segment, base_is_lit, coherence);
        }
        lit.visible = untraced.select(traced.visible, lit.visible & light.base.visible);
        lit.bsdf_pdf = lit.visible.keep(lit.bsdf_pdf);
    }
    let own = evaluated & offset.own;
    if own.any() {
        let mut seen = direct::look(tracer, &offset.surface, point, own);
        direct::shadow(tracer, &offset.surface, &mut seen, &light.segment, base_is_lit, coherence);
        lit = own.select(seen, lit);
    }
    (lit.contribution(point), lit.pdf_ratio(point))
}

/// Evaluates `f` only where some lane needs it.
#[inline(always)]
fn if_any<T: Default>(lanes: Mask, f: impl FnOnce() -> T) -> T {
    if lanes.any() { f() } else { T::default() }
}

/// Evaluates where the base arrives.
fn arrive<A: Accel>(tracer: &Tracer<'_, A>, walk: &Walk<'_>, step: &Bounce) -> Next {
    let wi: Vec3x = step.sample.wi;
    let lights = &tracer.scene.lights;
    let vertex = Surface::new(tracer.scene, &step.hits, step.active & step.hits.valid, -wi);
    let sky = if lights.has_environment() { step.escaped() } else { Mask::NONE };
    let (environment, environment_pdf) = if_any(sky, || lights.environment_with_pdf(wi));
    let radiance = sky.select(environment, (step.hits.valid & vertex.is_emitter).keep(vertex.emission));
    let surface_pdf = step.hits.valid.keep(light_pdf(&vertex, wi, step.hits.t));
    let light_pdf = sky.select(environment_pdf, surface_pdf);
    let ratio = (!step.sample.dirac).keep(light_pdf / step.sample.pdf);
    let diffuse = sky | vertex.is_emitter | walk.is_diffuse(&vertex);
    Next { vertex, sky, radiance, light_pdf, light_ratio2: ratio * ratio, diffuse }
}
