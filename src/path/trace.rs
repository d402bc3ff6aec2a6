//! Rays through alpha-tested and alpha-blended surfaces, with counters.
//!
//! Partial coverage is a random geometry: on each segment of a path, a triangle is there where its alpha exceeds a
//! threshold that is a pure function of (sample stream, sample, segment, triangle). Along one segment a triangle is
//! met once, so products of coverages come out right; and a shifted path replays the base's thresholds, so for the
//! shift a pass-through is no event at all.

use super::Streams;
use crate::accel::{Accel, Coherence, Hits, Rays, Visible};
use crate::math::sampler::hash;
use crate::math::{Compare, Mask, Vec3x, f32x16, splat};
use crate::shade::{ShadeScene, alpha};

/// How much was traced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RayCounts {
    /// Rays of all kinds.
    pub total: u64,
    /// Packets of closest-hit rays.
    pub intersect_packets: u64,
    /// Packets of visibility rays.
    pub occluded_packets: u64,
}

impl RayCounts {
    /// Active lanes a packet, on average; 0 without packets.
    pub fn active_lanes_mean(&self) -> f64 {
        self.total as f64 / (self.intersect_packets + self.occluded_packets).max(1) as f64
    }

    /// Adds what another thread counted.
    pub fn add(&mut self, other: &Self) {
        self.total += other.total;
        self.intersect_packets += other.intersect_packets;
        self.occluded_packets += other.occluded_packets;
    }
}

/// The coverage thresholds of one segment of sixteen paths.
#[derive(Clone, Copy, Debug)]
pub struct Segment {
    streams: Streams,
    salt: u32,
}

/// What a segment is for: its thresholds are independent of those of the other kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SegmentKind {
    /// From vertex k to vertex k + 1 (k = 0 is the camera).
    Scatter,
    /// From vertex k to a point on a light.
    Light,
}

impl Segment {
    /// The segment of `kind` that starts at vertex `depth`.
    #[inline]
    pub fn new(streams: &Streams, depth: u32, kind: SegmentKind) -> Self {
        Self { streams: *streams, salt: 0x8000_0000 | depth << 1 | u32::from(kind == SegmentKind::Light) }
    }

    /// Threshold in [0, 1) of a triangle.
    #[inline]
    fn threshold(&self, lane: usize, instance: u32, primitive: u32) -> f32 {
        let sample = hash(self.streams.seeds[lane], self.streams.indices[lane]);
        (hash(hash(hash(sample, self.salt), instance), primitive) >> 8) as f32 / (1 << 24) as f32
    }
}

/// Traces packets through a scene.
pub struct Tracer<'a, A: Accel> {
    /// The scene with its light tables.
    pub scene: &'a ShadeScene<'a>,
    accel: &'a A,
    has_coverage: bool,
    /// Counted so far.
    pub counts: RayCounts,
}

/// Surfaces a ray may pass before it is given up as blocked; only a scene of stacked sheets gets there.
const MAX_LAYERS: usize = 512;

impl<'a, A: Accel> Tracer<'a, A> {
    /// A tracer of one thread.
    pub fn new(scene: &'a ShadeScene<'a>, accel: &'a A) -> Self {
        let has_coverage = scene.scene.meshes.iter().any(|mesh| {
            scene.scene.materials.get(mesh.material as usize).is_some_and(|material| material.has_coverage())
        });
        Self { scene, accel, has_coverage, counts: RayCounts::default() }
    }

    fn intersect(&mut self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits {
        self.counts.intersect_packets += 1;
        self.counts.total += u64::from(active.count());
        self.accel.intersect16(rays, active, visible, coherence)
    }

    /// Lanes of `hits` whose surface is not there on this segment.
    fn passes(&self, hits: &Hits, segment: &Segment) -> Mask {
        let alpha = alpha(self.scene, hits, hits.valid);
        let open = hits.valid & alpha.lt(splat(1.0));
        if open.none() {
            return Mask::NONE;
        }
        open & Mask::from_fn(|i| {
            open.get(i) && alpha.as_array()[i] <= segment.threshold(i, hits.instance[i], hits.primitive[i])
        })
    }

    /// Closest hits that are there on `segment`.
    pub fn closest(&mut self, rays: &Rays, active: Mask, segment: &Segment, coherence: Coherence) -> Hits {
        let mut hits = self.intersect(rays, active, Visible::All, coherence);
        if !self.has_coverage {
            return hits;
        }
        let mut rays = *rays;
        let mut passing = self.passes(&hits, segment);
        for _ in 0..MAX_LAYERS {
            if passing.none() {
                return hits;
            }
            rays.tnear = passing.select(beyond(hits.t), rays.tnear);
            let next = self.intersect(&rays, passing, Visible::All, Coherence::Incoherent);
            hits = Hits {
                valid: passing.select(next.valid, hits.valid),
                t: passing.select(next.t, hits.t),
                u: passing.select(next.u, hits.u),
                v: passing.select(next.v, hits.v),
                instance: passing.select(next.instance, hits.instance),
                primitive: passing.select(next.primitive, hits.primitive),
            };
            passing = passing & self.passes(&hits, segment);
        }
        hits
    }

    /// Lanes whose ray meets nothing that is there on `segment`.
    pub fn unoccluded(&mut self, rays: &Rays, active: Mask, segment: &Segment, coherence: Coherence) -> Mask {
        if active.none() {
            return active;
        }
        self.counts.occluded_packets += 1;
        self.counts.total += u64::from(active.count());
        let first = if self.has_coverage { Visible::Opaque } else { Visible::All };
        let mut open = active.and_not(self.accel.occluded16(rays, active, first, coherence));
        if !self.has_coverage {
            return open;
        }
        let mut rays = *rays;
        let mut checking = open;
        for _ in 0..MAX_LAYERS {
            if checking.none() {
                return open;
            }
            let hits = self.intersect(&rays, checking, Visible::Coverage, coherence);
            let passing = self.passes(&hits, segment);
            open = open.and_not(hits.valid.and_not(passing) & checking);
            checking = checking & passing;
            rays.tnear = checking.select(beyond(hits.t), rays.tnear);
        }
        open.and_not(checking)
    }

    /// Lanes in which the segment from `origin` to `target` is free. Both ends already lie off their surfaces.
    pub fn connects(
        &mut self,
        origin: Vec3x,
        target: Vec3x,
        active: Mask,
        segment: &Segment,
        coherence: Coherence,
    ) -> Mask {
        let rays = Rays { tfar: splat(1.0), ..Rays::new(origin, target - origin) };
        self.unoccluded(&rays, active, segment, coherence)
    }
}

/// A distance just beyond `t`, so that the triangle met at `t` is not met again.
#[inline(always)]
fn beyond(t: f32x16) -> f32x16 {
    t.mul_add(splat(1.0 + 4.0 * f32::EPSILON), splat(f32::MIN_POSITIVE))
}
