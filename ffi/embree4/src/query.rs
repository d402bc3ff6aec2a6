//! Tracing: closest hits and occlusion, in packets of 16, 8 and 1.

use crate::packet::{Ray1, Ray8, Ray16, RayHit1, RayHit8, RayHit16, Valid8, Valid16};
use crate::scene::Scene;
use embree4_sys as sys;

/// Whether the rays of a packet start close together and run alike. Decides speed, never the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// They do: the packet stays together.
    Coherent,
    /// They do not: rays are traced on their own.
    Incoherent,
}

impl Coherence {
    #[inline(always)]
    fn flags(self) -> sys::RTCRayQueryFlags {
        match self {
            Self::Coherent => sys::RTC_RAY_QUERY_FLAG_COHERENT,
            Self::Incoherent => sys::RTC_RAY_QUERY_FLAG_INCOHERENT,
        }
    }
}

#[inline(always)]
fn intersect_arguments(coherence: Coherence) -> sys::RTCIntersectArguments {
    sys::RTCIntersectArguments {
        flags: coherence.flags(),
        feature_mask: sys::RTC_FEATURE_FLAG_ALL,
        ..Default::default()
    }
}

#[inline(always)]
fn occluded_arguments(coherence: Coherence) -> sys::RTCOccludedArguments {
    sys::RTCOccludedArguments {
        flags: coherence.flags(),
        feature_mask: sys::RTC_FEATURE_FLAG_ALL,
        ..Default::default()
    }
}

/// Finite rays only: a ray with a NaN costs fifty others.
impl Scene {
    /// Closest hits of the active rays; the others keep what they have.
    #[inline(always)]
    pub fn intersect16(&self, active: &Valid16, rays: &mut RayHit16, coherence: Coherence) {
        let mut arguments = intersect_arguments(coherence);
        // SAFETY: the scene is committed and alive; mask and packet are initialised, aligned to 64 bytes and of
        // the layout of the headers (sys' layout test); the arguments have no callbacks.
        unsafe { sys::rtcIntersect16(active.0.as_ptr(), self.handle(), &mut rays.0, &mut arguments) }
    }

    /// Sets `tfar` to −∞ where something lies between the ends of an active ray.
    #[inline(always)]
    pub fn occluded16(&self, active: &Valid16, rays: &mut Ray16, coherence: Coherence) {
        let mut arguments = occluded_arguments(coherence);
        // SAFETY: as in `intersect16`.
        unsafe { sys::rtcOccluded16(active.0.as_ptr(), self.handle(), &mut rays.0, &mut arguments) }
    }

    /// [`Scene::intersect16`] for 8 rays.
    #[inline(always)]
    pub fn intersect8(&self, active: &Valid8, rays: &mut RayHit8, coherence: Coherence) {
        let mut arguments = intersect_arguments(coherence);
        // SAFETY: as in `intersect16`, with an alignment of 32 bytes.
        unsafe { sys::rtcIntersect8(active.0.as_ptr(), self.handle(), &mut rays.0, &mut arguments) }
    }

    /// [`Scene::occluded16`] for 8 rays.
    #[inline(always)]
    pub fn occluded8(&self, active: &Valid8, rays: &mut Ray8, coherence: Coherence) {
        let mut arguments = occluded_arguments(coherence);
        // SAFETY: as in `intersect16`, with an alignment of 32 bytes.
        unsafe { sys::rtcOccluded8(active.0.as_ptr(), self.handle(), &mut rays.0, &mut arguments) }
    }

    /// [`Scene::intersect16`] for one ray.
    #[inline(always)]
    pub fn intersect1(&self, ray: &mut RayHit1, coherence: Coherence) {
        let mut arguments = intersect_arguments(coherence);
        // SAFETY: as in `intersect16`, with an alignment of 16 bytes and no mask.
        unsafe { sys::rtcIntersect1(self.handle(), &mut ray.0, &mut arguments) }
    }

    /// [`Scene::occluded16`] for one ray.
    #[inline(always)]
    pub fn occluded1(&self, ray: &mut Ray1, coherence: Coherence) {
        let mut arguments = occluded_arguments(coherence);
        // SAFETY: as in `intersect16`, with an alignment of 16 bytes and no mask.
        unsafe { sys::rtcOccluded1(self.handle(), &mut ray.0, &mut arguments) }
    }
}
