//! Path tracing: primary hits block by block, then the tail of [`crate::path::tail`] for everything else.

use super::block::Block;
use super::wave::Region;
use super::{Integrator, Statistics, View};
use crate::accel::Accel;
use crate::film::{FilmTile, PixelSample};
use crate::math::{Rgb, f32x16, splat};
use crate::path::tail::{self, Arrival, Queues};
use crate::path::trace::Tracer;

/// The path tracer.
pub struct Path;

/// An arrival at the first surface, whose emission is very direct light and not part of the path.
pub fn first_arrival(wo: crate::math::Vec3x) -> Arrival {
    Arrival {
        wo,
        beta: Rgb::grey(1.0),
        tau: Rgb::grey(1.0),
        eta_squared: splat(1.0),
        emission_weight: f32x16::ZERO,
    }
}

/// Writes the very direct light and the features of a block's primary hits to its samples.
pub fn write_primary(
    samples: &mut [PixelSample],
    slots: &[u32],
    block: &Block,
    primary: &super::block::Primary,
    direct: Rgb,
) {
    for i in block.inside.iter() {
        let sample = &mut samples[slots[i] as usize];
        sample.direct = direct.lane(i).to_array();
        if primary.hits.valid.get(i) {
            sample.depth = primary.hits.t.as_array()[i];
            sample.normal = primary.surface.bsdf.frame.n.lane(i).to_array();
            sample.position = primary.surface.p.lane(i).to_array();
            sample.albedo = primary.surface.albedo.lane(i).to_array();
        } else {
            sample.depth = f32::INFINITY;
        }
    }
}

impl Integrator for Path {
    const HAS_GRADIENTS: bool = false;

    fn wave<A: Accel>(
        &self,
        view: &View<'_>,
        tracer: &mut Tracer<'_, A>,
        region: &Region,
        wave: std::ops::Range<u32>,
        tile: &mut FilmTile,
        _statistics: &mut Statistics,
    ) {
        let mut slots = region.slots(view.settings.seed, &wave);
        let mut samples = vec![PixelSample::default(); slots.len()];
        let mut queues = Queues::default();
        for block in Block::of_region(region, view.settings.seed) {
            for index in wave.clone() {
                let primary = block.primary(view, tracer, index);
                let lanes = block.slots(region, index - wave.start);
                let direct = primary.direct(tracer);
                write_primary(&mut samples, &lanes, &block, &primary, direct);
                if view.limits.max_depth > 1 {
                    let arrival = first_arrival(-primary.direction);
                    queues.push_lanes(1, primary.hits.valid, &lanes, &primary.hits, &arrival);
                }
            }
        }
        tail::run(tracer, &mut queues, &mut slots, &view.limits);
        for (sample, slot) in samples.iter_mut().zip(&slots) {
            sample.primal = slot.radiance;
        }
        region.develop(&wave, &samples, tile);
    }
}
