//! The block: 4×4 pixels are the sixteen lanes of one packet, their sixteen edge neighbours (four a side, no
//! corners) the lanes of a second packet, the ring.
//!
//! Block and ring share sub-pixel jitter and lens sample, so the primary hit of the offset path of pixel i towards
//! its neighbour j is the primary hit of lane j: all 64 offset paths start for the price of one more coherent packet.

use super::wave::Region;
use super::{Filter, Settings, View};
use crate::accel::{Accel, Coherence, Hits, Rays};
use crate::film::Direction;
use crate::math::sampler::{Stream, sample_4d};
use crate::math::{LANES, Mask, Rgb, Vec3x, lanes, splat};
use crate::path::Streams;
use crate::path::trace::{Segment, SegmentKind, Tracer};
use crate::shade::Surface;

/// Side of a block in pixels.
pub const SIDE: u32 = 4;

/// A block of the film's grid; (x, y) is its left upper pixel.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// Left column.
    pub x: u32,
    /// Top row.
    pub y: u32,
    /// Lanes that belong to the tile.
    pub inside: Mask,
    /// Streams of the pixels.
    pub seeds: [u32; LANES],
    /// Stream of the block.
    seed: u32,
}

/// Offset of a lane of the ring from the block's left upper pixel: lanes 0–3 above, 4–7 below, 8–11 left, 12–15
/// right.
fn ring_offset(lane: usize) -> (i64, i64) {
    let along = (lane % 4) as i64;
    match lane / 4 {
        0 => (along, -1),
        1 => (along, i64::from(SIDE)),
        2 => (-1, along),
        _ => (i64::from(SIDE), along),
    }
}

/// Where each lane's neighbour in `direction` is found: lanes 0–15 are the block's, 16–31 the ring's.
pub fn neighbours(direction: Direction) -> [usize; LANES] {
    std::array::from_fn(|lane| {
        let (x, y) = (lane % 4, lane / 4);
        match direction {
            Direction::Right if x == 3 => LANES + 12 + y,
            Direction::Left if x == 0 => LANES + 8 + y,
            Direction::Up if y == 0 => LANES + x,
            Direction::Down if y == 3 => LANES + 4 + x,
            Direction::Right => lane + 1,
            Direction::Left => lane - 1,
            Direction::Up => lane - 4,
            Direction::Down => lane + 4,
        }
    })
}

/// The primary hits of sixteen pixels for one sample.
pub struct Primary {
    /// What the camera rays met.
    pub hits: Hits,
    /// It evaluated.
    pub surface: Surface,
    /// Camera ray directions.
    pub direction: Vec3x,
}

impl Block {
    /// The blocks of a tile.
    pub fn of_region(region: &Region, settings: &Settings) -> Vec<Self> {
        let common = |s: Stream| if settings.common_random_numbers { s.common() } else { s };
        let start = |from: u32| from / SIDE * SIDE;
        let mut blocks = Vec::new();
        for y in (start(region.y0)..region.y1).step_by(SIDE as usize) {
            for x in (start(region.x0)..region.x1).step_by(SIDE as usize) {
                let pixel = |lane: usize| (x + lane as u32 % SIDE, y + lane as u32 / SIDE);
                blocks.push(Self {
                    x,
                    y,
                    inside: Mask::from_fn(|i| {
                        let (x, y) = pixel(i);
                        region.contains(x, y)
                    }),
                    seeds: std::array::from_fn(|i| {
                        let (x, y) = pixel(i);
                        common(Stream::Pixel(x, y)).seed(settings.seed)
                    }),
                    seed: common(Stream::Block(x / SIDE, y / SIDE)).seed(settings.seed),
                });
            }
        }
        blocks
    }

    /// The slots of the block's pixels; those of lanes outside are 0 and must not be used.
    pub fn slots(&self, region: &Region, wave_index: u32) -> [u32; LANES] {
        std::array::from_fn(|i| {
            if self.inside.get(i) {
                region.slot(self.x + i as u32 % SIDE, self.y + i as u32 / SIDE, wave_index)
            } else {
                0
            }
        })
    }

    /// Streams of the pixels at one sample index.
    pub fn streams(&self, index: u32) -> Streams {
        Streams { seeds: self.seeds, indices: [index; LANES] }
    }

    /// Lanes of the ring that lie in the film.
    pub fn ring_inside(&self, region: &Region) -> Mask {
        Mask::from_fn(|i| {
            let (dx, dy) = ring_offset(i);
            region.film_contains(i64::from(self.x) + dx, i64::from(self.y) + dy)
        })
    }

    /// Lanes whose neighbour in `direction` lies in the film.
    pub fn has_neighbour(&self, direction: Direction, region: &Region) -> Mask {
        let (dx, dy) = direction.step();
        Mask::from_fn(|i| {
            let (x, y) = (i64::from(self.x) + i as i64 % 4, i64::from(self.y) + i as i64 / 4);
            region.film_contains(x + dx as i64, y + dy as i64)
        })
    }

    /// Primary hits of the block's own pixels.
    pub fn primary<A: Accel>(&self, view: &View<'_>, tracer: &mut Tracer<'_, A>, index: u32) -> Primary {
        self.trace(view, tracer, index, self.inside, |i| ((i % 4) as i64, (i / 4) as i64))
    }

    /// Primary hits of the ring, `active` lanes.
    pub fn ring<A: Accel>(
        &self,
        view: &View<'_>,
        tracer: &mut Tracer<'_, A>,
        index: u32,
        active: Mask,
    ) -> Primary {
        self.trace(view, tracer, index, active, ring_offset)
    }

    fn trace<A: Accel>(
        &self,
        view: &View<'_>,
        tracer: &mut Tracer<'_, A>,
        index: u32,
        active: Mask,
        offset: fn(usize) -> (i64, i64),
    ) -> Primary {
        let settings = view.settings;
        let [u, v, lens_u, lens_v] = sample_4d(self.seed, index, 0);
        let (jitter_x, jitter_y) = (settings.filter.sample(u), settings.filter.sample(v));
        let x = lanes(|i| (i64::from(self.x) + offset(i).0) as f32 + jitter_x);
        let y = lanes(|i| (i64::from(self.y) + offset(i).1) as f32 + jitter_y);
        let rays = view.camera.rays(x, y, settings.width, settings.height, splat(lens_u), splat(lens_v));
        // The thresholds of partial coverage are shared by block and ring, like the jitter.
        let streams = Streams { seeds: [self.seed; LANES], indices: [index; LANES] };
        let segment = Segment::new(&streams, 0, SegmentKind::Scatter);
        let packet = Rays::new(rays.origin, rays.direction);
        let hits = tracer.closest(&packet, active, &segment, Coherence::Coherent);
        let surface = Surface::new(tracer.scene, &hits, hits.valid, -rays.direction);
        Primary { hits, surface, direction: rays.direction }
    }
}

impl Primary {
    /// Very direct light: emission of the first surface, or the environment behind everything.
    pub fn direct<A: Accel>(&self, tracer: &Tracer<'_, A>) -> Rgb {
        let lights = &tracer.scene.lights;
        let visible = tracer.scene.scene.environment.as_ref().is_some_and(|e| e.visible);
        let behind = if visible { lights.environment(self.direction) } else { Rgb::ZERO };
        (self.hits.valid & self.surface.is_emitter).keep(self.surface.emission)
            + (!self.hits.valid).keep(behind)
    }
}

impl Filter {
    /// Position in the pixel for a uniform number: [0, 1) for the box, beyond it for wider filters.
    fn sample(self, u: f32) -> f32 {
        match self {
            Self::Box => u,
            Self::Gaussian => 0.5 + invert_cdf(u, 2.0, |x| (-2.0 * x * x).exp()),
            Self::BlackmanHarris => {
                let radius = 1.65;
                0.5 + invert_cdf(u, radius, |x| {
                    let phase = std::f32::consts::PI * (x / radius + 1.0);
                    0.35875 - 0.48829 * phase.cos() + 0.14128 * (2.0 * phase).cos()
                        - 0.01168 * (3.0 * phase).cos()
                })
            }
        }
    }
}

/// Inverts the cumulative distribution of a density on [−radius, radius], tabulated in 64 steps, linear between.
fn invert_cdf(u: f32, radius: f32, density: impl Fn(f32) -> f32) -> f32 {
    const STEPS: usize = 64;
    let width = 2.0 * radius / STEPS as f32;
    let weight = |i: usize| density((i as f32 + 0.5) * width - radius);
    let total: f32 = (0..STEPS).map(weight).sum();
    let mut rest = u * total;
    for i in 0..STEPS {
        let w = weight(i);
        if rest < w || i + 1 == STEPS {
            return (i as f32 + (rest / w).min(1.0)) * width - radius;
        }
        rest -= w;
    }
    radius
}
