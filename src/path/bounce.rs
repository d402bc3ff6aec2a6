//! The continuation of a path: BSDF sample, Russian roulette, the next vertex and what it emits.

use super::trace::{Segment, SegmentKind, Tracer};
use super::{Limits, Streams};
use crate::accel::{Accel, Coherence, Hits, Rays};
use crate::math::{Compare, Mask, Rgb, Select, Vec3x, f32x16, splat};
use crate::shade::{BsdfSample, Receiver, ShadeScene, Surface};

/// One step from x_k to x_{k+1}.
#[derive(Clone, Copy)]
pub struct Bounce {
    /// What the BSDF sampler drew at x_k; `f` includes absorption up to x_{k+1}.
    pub sample: BsdfSample,
    /// Probability with which Russian roulette let the path live.
    pub survival: f32x16,
    /// Lanes that go on: to a surface or out of the scene.
    pub active: Mask,
    /// Coverage thresholds on the way.
    pub segment: Segment,
    /// Where they arrive; lanes without `valid` left the scene.
    pub hits: Hits,
}

impl Bounce {
    /// What the bounce does to a throughput: f / (pdf · survival).
    #[inline(always)]
    pub fn factor(&self) -> Rgb {
        self.active.keep(self.sample.f * (splat(1.0) / (self.sample.pdf * self.survival)))
    }

    /// Lanes that left the scene.
    #[inline(always)]
    pub fn escaped(&self) -> Mask {
        self.active.and_not(self.hits.valid)
    }
}

/// Samples the BSDF at x_`depth`, plays Russian roulette with throughput `beta` and `eta_squared` (the squared
/// product of relative indices so far, updated here) and traces on.
#[inline]
pub fn bounce<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    surface: &Surface,
    beta: Rgb,
    eta_squared: &mut f32x16,
    streams: &Streams,
    depth: u32,
    limits: &Limits,
    active: Mask,
) -> Bounce {
    let [lobe, u, v, roulette] = streams.scatter(depth);
    let mut sample = surface.bsdf.sample(surface.wo, lobe, u, v, active);
    let mut active = active & sample.valid;
    *eta_squared = active.select(*eta_squared * sample.eta * sample.eta, *eta_squared);
    let mut survival = splat(1.0);
    if depth >= limits.rr_depth {
        // Transmission compresses radiance by 1/η²; a path inside glass is not less important for it.
        let throughput = (beta * sample.f * (splat(1.0) / sample.pdf)).max_component() * *eta_squared;
        survival = throughput.fast_min(splat(0.95));
        active = active & roulette.lt(survival);
    }
    let segment = Segment::new(streams, depth, SegmentKind::Scatter);
    let rays = Rays::new(surface.spawn(sample.wi), sample.wi);
    let hits = if active.any() {
        tracer.closest(&rays, active, &segment, Coherence::Incoherent)
    } else {
        Hits::NONE
    };
    sample.f = sample.f * absorption(surface, sample.wi, &hits);
    Bounce { sample, survival, active, segment, hits }
}

/// What is left of light on the way from `surface` along `wi` to `hits`; 1 for rays that leave the scene.
#[inline(always)]
pub fn absorption(surface: &Surface, wi: Vec3x, hits: &Hits) -> Rgb {
    let inside = surface.bsdf.transmittance(wi, hits.valid.keep(hits.t));
    Rgb::select(hits.valid, inside, Rgb::grey(1.0))
}

/// The solid-angle pdf ℓ with which light sampling at `from` finds the points `hits`, where a ray from there along
/// `wi` arrives; 0 where they are not on a sampled light.
///
/// With the base's ray and the offset's vertex as `from` it is J ℓ_y: the light point's measure cancels.
#[inline(always)]
pub fn light_pdf(scene: &ShadeScene, from: &Surface, wi: Vec3x, hits: &Hits, active: Mask) -> f32x16 {
    scene.lights.hit_pdf(&Receiver::new(from), hits, wi, active)
}
