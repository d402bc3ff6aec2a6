//! Next-event estimation: one point on a light a vertex.
//!
//! The point is chosen without looking at the receiver, so a shifted path evaluates the same point (bug B10 of the
//! reference implementation cannot arise). With p the pdf of the point in its own measure (m⁻² on an area light) and
//! g = |cos θ_light| / d² the solid-angle pdf is ℓ = p / g and the estimate f L g / p.

use super::Streams;
use super::trace::{Segment, SegmentKind, Tracer};
use crate::accel::{Accel, Coherence, Rays};
use crate::math::{Compare, Mask, Rgb, Vec3x, f32x16, splat};
use crate::shade::{LightPoint, LightSeen, Surface};

/// A light point as one vertex sees it, with the BSDF towards it.
#[derive(Clone, Copy, Default)]
pub struct Lit {
    /// The light from here.
    pub seen: LightSeen,
    /// BSDF × cosine towards the light, absorption on the way included.
    pub f: Rgb,
    /// Solid-angle pdf b of the BSDF sampler for that direction; 0 where it cannot produce this path: Dirac
    /// lights, and occluded segments once visibility is known.
    pub bsdf_pdf: f32x16,
    /// Whether nothing is in between.
    pub visible: Mask,
}

/// One NEE event: the shared point and what the base vertex makes of it.
#[derive(Clone, Copy)]
pub struct DirectLight {
    /// The point, shared by base and offsets.
    pub point: LightPoint,
    /// Coverage thresholds on the way, shared by base and offsets.
    pub segment: Segment,
    /// Lanes with an event: a smooth lobe and a light.
    pub active: Mask,
    /// As seen from the base.
    pub base: Lit,
}

impl Lit {
    /// Radiance scattered, per unit throughput, before any weight: f L g / p; zero where not visible.
    #[inline(always)]
    pub fn contribution(&self, point: &LightPoint) -> Rgb {
        self.visible.keep(self.f * self.seen.radiance * (self.seen.geometry / point.pdf))
    }

    /// b / ℓ: how much likelier the BSDF sampler finds this direction than light sampling did.
    #[inline(always)]
    pub fn pdf_ratio(&self, point: &LightPoint) -> f32x16 {
        self.bsdf_pdf * self.seen.geometry / point.pdf
    }
}

/// Looks at `point` from `surface`; visibility is still open (assumed free).
#[inline(always)]
pub fn look<A: Accel>(tracer: &Tracer<'_, A>, surface: &Surface, point: &LightPoint, active: Mask) -> Lit {
    let seen = tracer.scene.lights.seen_from(tracer.scene, point, surface.p);
    scatter(surface, surface.wo, point, seen, active)
}

/// What `surface` scatters of `point`, as seen from it, towards `wo`; visibility is still open.
#[inline(always)]
pub fn scatter(surface: &Surface, wo: Vec3x, point: &LightPoint, seen: LightSeen, active: Mask) -> Lit {
    let (f, pdf) = surface.bsdf.eval(wo, seen.wi);
    let active = active & seen.geometry.gt(f32x16::ZERO);
    let f = active.keep(f * surface.bsdf.transmittance(seen.wi, seen.distance));
    Lit { seen, f, bsdf_pdf: active.and_not(point.is_dirac).keep(pdf), visible: active }
}

/// Settles the visibility of `lit` where BSDF and, unless `even_if_dark`, radiance are not zero anyway.
///
/// A dark side of a light matters to a pair whose other path sees the bright side: as long as nothing is in between,
/// the BSDF sampler could have found the point, and both ends must count that technique alike.
#[inline]
pub fn shadow<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    surface: &Surface,
    lit: &mut Lit,
    segment: &Segment,
    even_if_dark: Mask,
    coherence: Coherence,
) {
    let wanted = lit.visible.and_not(lit.f.is_zero() | lit.seen.radiance.is_zero().and_not(even_if_dark));
    let infinite = lit.seen.distance.same(splat(f32::INFINITY));
    let origin = surface.spawn(lit.seen.wi);
    let rays = Rays {
        origin,
        direction: infinite.select(lit.seen.wi, lit.seen.target - origin),
        tnear: f32x16::ZERO,
        tfar: infinite.select(splat(f32::INFINITY), splat(1.0)),
    };
    lit.visible = tracer.unoccluded(&rays, wanted, segment, coherence);
    lit.bsdf_pdf = lit.visible.keep(lit.bsdf_pdf);
}

/// Draws a light point for the base vertices x_`depth` and settles its visibility.
pub fn sample<A: Accel>(
    tracer: &mut Tracer<'_, A>,
    surface: &Surface,
    streams: &Streams,
    depth: u32,
    active: Mask,
    even_if_dark: Mask,
    coherence: Coherence,
) -> Option<DirectLight> {
    let active = active & surface.bsdf.has_smooth();
    if active.none() || tracer.scene.lights.is_empty() {
        return None;
    }
    let [select, u, v, _] = streams.light(depth);
    let point = tracer.scene.lights.sample(tracer.scene, select, u, v);
    let active = active & point.valid;
    let segment = Segment::new(streams, depth, SegmentKind::Light);
    let mut base = look(tracer, surface, &point, active);
    shadow(tracer, surface, &mut base, &segment, even_if_dark, coherence);
    Some(DirectLight { point, segment, active, base })
}

impl DirectLight {
    /// The path tracer's estimate per unit throughput: power heuristic between NEE and BSDF sampling.
    #[inline(always)]
    pub fn estimate(&self) -> Rgb {
        let ratio = self.base.pdf_ratio(&self.point);
        let weight = splat(1.0) / (splat(1.0) + ratio * ratio);
        self.base.visible.keep(self.base.contribution(&self.point) * weight)
    }
}

crate::lanewise!(Lit { seen, f, bsdf_pdf, visible });
