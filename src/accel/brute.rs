//! Every ray against every triangle, in f64: the oracle that the other backends are tested against.
//!
//! Möller and Trumbore 1997, "Fast, Minimum Storage Ray/Triangle Intersection". Linear in the number of triangles,
//! so it is for small scenes only. Instances are flattened to world space in f32, as a renderer sees them.

use super::flat::{Triangles, flatten};
use super::{Accel, Coherence, Hits, Rays, Visible};
use crate::error::Result;
use crate::math::{LANES, Mask, f32x16};
use crate::scene::Scene;
use glam::DVec3;

/// The triangles of all instances, in world space.
pub struct BruteAccel {
    /// First vertex and the two edges that leave it.
    triangles: Vec<[DVec3; 3]>,
    source: Triangles,
}

/// One intersection: distance, barycentrics, index of the triangle.
struct Hit {
    t: f64,
    u: f64,
    v: f64,
    triangle: usize,
}

impl BruteAccel {
    /// Flattens `scene`.
    pub fn new(scene: &Scene) -> Result<Self> {
        let source = flatten(scene)?;
        let triangles = source
            .vertices
            .iter()
            .map(|&[a, b, c]| {
                let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
                [a, b - a, c - a]
            })
            .collect();
        Ok(Self { triangles, source })
    }

    /// Closest hit of lane `i`.
    fn closest(&self, rays: &Rays, i: usize, visible: Visible) -> Option<Hit> {
        let (origin, direction) = (rays.origin.lane(i).as_dvec3(), rays.direction.lane(i).as_dvec3());
        let tnear = f64::from(rays.tnear.as_array()[i]);
        let mut tfar = f64::from(rays.tfar.as_array()[i]);
        let mut best = None;
        for (triangle, &[a, ab, ac]) in self.triangles.iter().enumerate() {
            if !self.source.is_visible(triangle, visible) {
                continue;
            }
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            if determinant == 0.0 {
                continue;
            }
            let s = origin - a;
            let q = s.cross(ab);
            let (u, v) = (s.dot(p) / determinant, direction.dot(q) / determinant);
            let t = ac.dot(q) / determinant;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > tnear && t <= tfar {
                tfar = t;
                best = Some(Hit { t, u, v, triangle });
            }
        }
        best
    }
}

impl Accel for BruteAccel {
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, _: Coherence) -> Hits {
        let mut valid = 0u16;
        let (mut t, mut u, mut v) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
        let (mut instance, mut primitive) = ([0; LANES], [0; LANES]);
        for i in active.iter() {
            if let Some(hit) = self.closest(rays, i, visible) {
                valid |= 1 << i;
                (t[i], u[i], v[i]) = (hit.t as f32, hit.u as f32, hit.v as f32);
                [instance[i], primitive[i]] = self.source.ids[hit.triangle];
            }
        }
        Hits {
            valid: Mask::from_bits(valid),
            t: f32x16::new(t),
            u: f32x16::new(u),
            v: f32x16::new(v),
            instance,
            primitive,
        }
    }

    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, _: Coherence) -> Mask {
        Mask::from_fn(|i| active.get(i) && self.closest(rays, i, visible).is_some())
    }
}
