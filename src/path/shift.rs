//! The shift of a path to a neighbouring pixel, one bounce at a time: which kind of shift a bounce takes, where the
//! offset path goes, and the Jacobian of it (algorithm, sections 4, 5 and 17).
//!
//! Every decision uses only data that is the same from both ends, so that the shift back finds the base path again;
//! an accept that is not symmetric biases the gradient. Superscripts of the paper: x is the base, y the offset. ω_s
//! is the sampled direction, ω_p the direction to the previous vertex.

use crate::math::{Compare, Mask, Vec3x, f32x16, splat};
use crate::shade::{Bsdf, Surface};

/// Weights between the two paths of a pair.
#[derive(Clone, Copy, Debug)]
pub struct PairWeights {
    /// Power-2 weights over {NEE, BSDF} × {base, offset}; without: ½ wherever the shift exists.
    pub mis: bool,
}

impl PairWeights {
    /// The weight of an event, from the squared pdfs of the base's techniques (`base`: the one that was drawn is 1)
    /// and of the offset's, Jacobian included (`offset`; 0 where the shift failed).
    #[inline(always)]
    pub fn weight(&self, base: f32x16, offset: f32x16) -> f32x16 {
        if self.mis {
            splat(1.0) / (base + offset)
        } else {
            offset.gt(f32x16::ZERO).select(splat(0.5), splat(1.0)) / base
        }
    }
}

/// Lanes whose smooth events are diffuse for the shift: the least rough smooth lobe is rougher than `threshold`.
/// A surface without smooth lobes is not.
#[inline(always)]
pub fn is_diffuse(bsdf: &Bsdf, threshold: f32) -> Mask {
    bsdf.smooth_alpha().gt(splat(threshold))
}

/// What a bounce does with an offset that is not connected yet.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Reconnect to the base's next vertex, or to the same direction of the environment.
    pub reconnect: Mask,
    /// Copy the half-vector.
    pub half_vector: Mask,
    /// Lanes of `half_vector` in which NEE took no part for this pair: both vertices glossy, or a Dirac event.
    pub without_nee: Mask,
    /// Smooth event between a diffuse and a glossy vertex: fails, base keeps NEE in its weight.
    pub mixed: Mask,
}

/// Decides the shift of a bounce. `next_is_diffuse`: emitters and the environment count as diffuse.
#[inline(always)]
pub fn plan(dirac: Mask, base_is_diffuse: Mask, offset_is_diffuse: Mask, next_is_diffuse: Mask) -> Plan {
    let both_diffuse = base_is_diffuse & offset_is_diffuse;
    let both_glossy = !(base_is_diffuse | offset_is_diffuse);
    let smooth = !dirac;
    Plan {
        reconnect: smooth & both_diffuse & next_is_diffuse,
        half_vector: dirac | (smooth & (both_glossy | both_diffuse.and_not(next_is_diffuse))),
        without_nee: dirac | (smooth & both_glossy),
        mixed: smooth.and_not(both_diffuse | both_glossy),
    }
}

/// |dω^y/dω^x| of two vertices that see the same point z, with its geometric normal (section 5.3), and the unit
/// direction and distance from y.
#[derive(Clone, Copy, Debug)]
pub struct Reconnection {
    /// Unit direction from y to z.
    pub wi: Vec3x,
    /// Distance from y to z, m.
    pub distance: f32x16,
    /// The Jacobian; 0 where z is seen edge-on from y.
    pub jacobian: f32x16,
}

/// Connects `y` to the vertex `z` that follows `x`.
#[inline(always)]
pub fn reconnect(x: &Surface, y: &Surface, z: &Surface) -> Reconnection {
    let (to_z_from_x, to_z_from_y) = (z.p - x.p, z.p - y.p);
    let (d2_x, d2_y) = (to_z_from_x.length_squared(), to_z_from_y.length_squared());
    let (d_x, d_y) = (d2_x.sqrt(), d2_y.sqrt());
    // cos / d² with cos = |n · (z − p)| / d.
    let seen_from_x = z.ng.dot(to_z_from_x).abs() / (d2_x * d_x);
    let seen_from_y = z.ng.dot(to_z_from_y).abs() / (d2_y * d_y);
    let defined = seen_from_x.gt(f32x16::ZERO) & d2_y.gt(f32x16::ZERO);
    Reconnection { wi: to_z_from_y / d_y, distance: d_y, jacobian: defined.keep(seen_from_y / seen_from_x) }
}

/// The direction of an offset path that copies the base's half-vector.
#[derive(Clone, Copy, Debug)]
pub struct HalfVector {
    /// Unit world direction ω_s^y.
    pub wi: Vec3x,
    /// |dω_s^y/dω_s^x|.
    pub jacobian: f32x16,
    /// Lanes in which the copy exists: no total internal reflection, same kind of event, same sides.
    pub valid: Mask,
}

/// Copies the half-vector of the smooth event (x, ω_p^x → `wi`) in x's shading frame into y's (sections 5.1, 5.2).
/// `transmit`: the base's event crosses the surface.
#[inline]
pub fn half_vector(x: &Surface, wi: Vec3x, y: &Surface, transmit: Mask) -> HalfVector {
    let (p_x, s_x) = (x.bsdf.frame.to_local(x.wo), x.bsdf.frame.to_local(wi));
    let p_y = y.bsdf.frame.to_local(y.wo);
    let (eta_x, eta_y) = (x.bsdf.relative_ior(x.wo), y.bsdf.relative_ior(y.wo));
    let one = splat(1.0);
    // Thin walls and matched indices go straight through: there is no half-vector to copy, ω_s = −ω_p mirrored.
    let straight_x = transmit & eta_x.same(one);
    let straight_y = transmit & eta_y.same(one);

    // Reflection: h ∥ ω_p + ω_s. Transmission: h ∥ ω_p + η ω_s. A thin rough wall is its reflection lobe mirrored
    // to the other side, so its half-vector is that of the mirrored direction.
    let mirrored = Vec3x::new(s_x.x, s_x.y, -s_x.z);
    let s_for_h = straight_x.select(mirrored, s_x);
    let eta_for_h = transmit.and_not(straight_x).select(eta_x, one);
    let sum_x = p_x + s_for_h * eta_for_h;
    let h = sum_x.normalize();
    // h into the hemisphere of the macro normal, then to the side that each path comes from.
    let h = h.z.lt(f32x16::ZERO).select(-h, h);
    let h_y = p_y.z.lt(f32x16::ZERO).select(-h, h);
    let cos_p = p_y.dot(h_y);

    let reflected = h_y * (cos_p + cos_p) - p_y;
    // Snell about h: ω_s = −ω_p/η + (cos_p/η − cos_t) h.
    let sin2_t = (one - cos_p * cos_p) / (eta_y * eta_y);
    let cos_t = (one - sin2_t).fast_max(f32x16::ZERO).sqrt();
    let refracted = h_y * (cos_p / eta_y - cos_t) - p_y / eta_y;
    let across = straight_y.select(Vec3x::new(reflected.x, reflected.y, -reflected.z), refracted);
    let s_y = transmit.select(across, reflected);

    let bends = transmit.and_not(straight_x);
    let reflection_jacobian = {
        let s_y = straight_y.select(reflected, s_y);
        s_y.dot(h).abs() / s_for_h.dot(h).abs()
    };
    let sum_y = p_y + s_y * eta_y;
    let ratio = eta_x * eta_x / (eta_y * eta_y);
    let refraction_jacobian =
        ratio * sum_y.length_squared() / sum_x.length_squared() * (s_x.dot(h).abs() / s_y.dot(h).abs());
    let jacobian = bends.select(refraction_jacobian, reflection_jacobian);

    let no_total_reflection = !bends | sin2_t.lt(one);
    let sides_x = p_x.z * s_x.z;
    let sides_y = p_y.z * s_y.z;
    let same_kind = (sides_x * sides_y).gt(f32x16::ZERO)
        & !(straight_x.and_not(straight_y) | straight_y.and_not(straight_x));
    let valid = no_total_reflection & same_kind & cos_p.gt(f32x16::ZERO) & jacobian.gt(f32x16::ZERO);
    HalfVector {
        wi: y.bsdf.frame.to_world(s_y),
        jacobian,
        valid: valid & Mask(jacobian.is_finite()) & s_y.is_finite(),
    }
}
