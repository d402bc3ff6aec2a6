//! Path tracing: primary hits block by block, then the tail of [`crate::path::tail`] for everything else.

use super::block::{Block, Primary};
use super::wave::{Region, Scratch};
use super::{Integrator, Statistics, View};
use crate::accel::Accel;
use crate::film::{FilmTile, PixelSample};
use crate::math::{LANES, Rgb, f32x16, splat};
use crate::path::Streams;
use crate::path::queue::Arrival;
use crate::path::tail;
use crate::path::trace::Tracer;

/// The path tracer.
pub struct Path;

/// Arrivals at the first surface, whose emission is very direct light and not part of the path.
fn first_arrival(slots: [u32; LANES], streams: Streams, primary: &Primary) -> Arrival {
    Arrival {
        slots,
        streams,
        hits: primary.hits,
        wo: -primary.direction,
        beta: Rgb::grey(1.0),
        radiance: Rgb::ZERO,
        tau: Rgb::grey(1.0),
        tail: Rgb::ZERO,
        eta_squared: splat(1.0),
        emission_weight: f32x16::ZERO,
    }
}

/// Writes the very direct light and the features of a block's primary hits to its samples.
pub fn write_primary(
    samples: &mut [PixelSample],
    slots: &[u32],
    block: &Block,
    primary: &Primary,
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
        scratch: &mut Scratch,
        _statistics: &mut Statistics,
    ) {
        let Scratch { slots, samples, queues, .. } = scratch.reset(region, &wave);
        for block in Block::of_region(region, view.settings) {
            for index in wave.clone() {
                let primary = block.primary(view, tracer, index);
                let lanes = block.slots(region, index - wave.start);
                let direct = primary.direct(tracer);
                write_primary(samples, &lanes, &block, &primary, direct);
                if view.limits.max_depth > 1 {
                    let arrival = first_arrival(lanes, block.streams(index), &primary);
                    queues.push(1, primary.hits.valid, &arrival);
                }
            }
        }
        tail::run(tracer, queues, slots, &view.limits);
        for (sample, slot) in samples.iter_mut().zip(slots.iter()) {
            sample.primal = slot.radiance;
        }
        region.develop(&wave, samples, tile);
    }
}
