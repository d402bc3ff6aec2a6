//! Gradient-domain path tracing (Kettunen, Manzi, Aittala, Lehtinen, Durand, Zwicker 2015): the path tracer's image
//! and its differences to the four neighbours.
//!
//! Per block and sample: two coherent packets give the first vertex of 16 base and 64 offset paths; the head walks
//! them until all offsets are settled; the tail is plain path tracing, and its radiance T enters the gradients by a
//! factor known when it starts.

use super::block::{Block, Primary, neighbours};
use super::head::{Head, Offset, Walk};
use super::path::write_primary;
use super::wave::{Region, Scratch};
use super::{Integrator, ShiftOutcome, Statistics, View};
use crate::accel::Accel;
use crate::film::{Direction, FilmTile, PixelSample};
use crate::math::{Mask, Permute, Pick, Rgb, Vec3x, f32x16, splat};
use crate::path::tail::{self, Slot};
use crate::path::trace::Tracer;
use crate::shade::Surface;

/// The gradient-domain path tracer.
pub struct GradientPath;

/// The offsets' first vertices: lane permutations of block and ring. `picks` and `exists`: where each direction's
/// neighbours are found, and in which lanes there is one.
fn first_offsets(picks: &[Pick; 4], exists: &[Mask; 4], primary: &Primary, ring: &Primary) -> [Offset; 4] {
    std::array::from_fn(|d| {
        let (pick, exists) = (picks[d], exists[d]);
        let met = Mask::permute(&primary.hits.valid, &ring.hits.valid, pick);
        let own = exists & met & primary.hits.valid;
        Offset {
            surface: Surface::permute(&primary.surface, &ring.surface, pick),
            wo: Vec3x::ZERO,
            beta: own.keep(Rgb::grey(1.0)),
            ratio: own.keep(splat(1.0)),
            own,
            recent: Mask::NONE,
            connected: Mask::NONE,
            exists,
        }
    })
}

/// Adds the head's results to samples and slots.
fn write_head(
    head: &Head,
    block: &Block,
    slots: &[u32],
    samples: &mut [PixelSample],
    tails: &mut [Slot],
    factors: &mut [[[f32; 3]; 4]],
) {
    for i in block.inside.iter() {
        let slot = slots[i] as usize;
        tails[slot].radiance = head.radiance.lane(i).to_array();
        samples[slot].gradient = head.gradient.map(|g| g.lane(i).to_array());
        factors[slot] = head.tail_factor.map(|f| f.lane(i).to_array());
    }
}

impl Integrator for GradientPath {
    const HAS_GRADIENTS: bool = true;

    fn wave<A: Accel>(
        &self,
        view: &View<'_>,
        tracer: &mut Tracer<'_, A>,
        region: &Region,
        wave: std::ops::Range<u32>,
        tile: &mut FilmTile,
        scratch: &mut Scratch,
        statistics: &mut Statistics,
    ) {
        let Scratch { slots, samples, factors, queues } = scratch.reset(region, &wave);
        let picks = Direction::ALL.map(|direction| Pick::new(neighbours(direction)));
        for block in Block::of_region(region, view.settings) {
            let ring_inside = block.ring_inside(region);
            let exists =
                Direction::ALL.map(|direction| block.has_neighbour(direction, region) & block.inside);
            for index in wave.clone() {
                let primary = block.primary(view, tracer, index);
                let lanes = block.slots(region, index - wave.start);
                let direct = primary.direct(tracer);
                write_primary(samples, &lanes, &block, &primary, direct);
                if primary.hits.valid.none() || view.limits.max_depth < 2 {
                    continue;
                }
                let ring = block.ring(view, tracer, index, ring_inside);
                let offsets = first_offsets(&picks, &exists, &primary, &ring);
                let mut head = Head {
                    surface: primary.surface,
                    beta: Rgb::grey(1.0),
                    eta_squared: f32x16::splat(1.0),
                    active: primary.hits.valid,
                    offsets,
                    radiance: Rgb::ZERO,
                    gradient: [Rgb::ZERO; 4],
                    tail_factor: [Rgb::ZERO; 4],
                    outcomes: [0; ShiftOutcome::COUNT],
                };
                let missed = offsets.iter().map(|o| (o.exists & primary.hits.valid).and_not(o.own).count());
                head.outcomes[ShiftOutcome::NoPrimaryHit as usize] = missed.map(u64::from).sum();
                let walk = Walk { view, streams: block.streams(index), slots: lanes };
                head.walk(tracer, &walk, queues);
                write_head(&head, &block, &lanes, samples, slots, factors);
                for (sum, count) in statistics.shifts.iter_mut().zip(head.outcomes) {
                    *sum += count;
                }
            }
        }
        tail::run(tracer, queues, slots, &view.limits);
        for ((sample, slot), factors) in samples.iter_mut().zip(slots.iter()).zip(factors.iter()) {
            sample.primal = slot.radiance;
            for (gradient, factor) in sample.gradient.iter_mut().zip(factors) {
                for c in 0..3 {
                    gradient[c] += factor[c] * slot.tail[c];
                }
            }
        }
        region.develop(&wave, samples, tile);
    }
}
