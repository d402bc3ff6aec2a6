//! The scattering of sixteen surface points: glTF's metallic-roughness model with transmission.
//!
//! A lane is a mixture, by `metallic` m and `transmission` t, of
//! * a metal (weight m): GGX reflection, Schlick's Fresnel from the base colour to 1;
//! * a dielectric layer over Lambert (weight (1−m)(1−t)): GGX reflection from f0 = ((ior−1)/(ior+1))² × specular
//!   colour × specular to f90 = specular, and below it base/π · (1−F(cosθo)) (1−F(cosθi)) / (1−F̄), where F̄ is the
//!   hemispherical mean of F: reciprocal, and all light is accounted for (Kelemen and Szirmay-Kalos 2001, with
//!   Schlick's F; the product form of the glTF appendix, 1−F(h), creates energy at grazing angles);
//! * a transmissive dielectric (weight (1−m)t) with exact Fresnel: a solid refracts (Walter et al. 2007), a thin
//!   sheet passes light straight on or, where rough, spreads it like its reflection mirrored to the other side;
//!   both tint what they transmit by the base colour.
//!
//! One alpha (roughness²) serves all specular lobes of a lane; below [`Material::SMOOTH_ALPHA`] they are Diracs.
//! Single scattering, isotropic. Radiance is transported: what is transmitted is divided by eta².
//!
//! Directions are unit vectors away from the surface: `wo` to the previous vertex, `wi` sampled. `f` is the BSDF
//! times |cosθi|, `pdf` in sr⁻¹, for Diracs the coefficient and the probability. Both sides scatter alike, sides
//! being those of the shading normal; only a solid dielectric knows its inside.

use super::fresnel::{self, Dielectric, SCHLICK_MEAN, schlick, schlick_weight};
use super::microfacet::{distribution, sample_visible_normal, smith_g1};
use crate::math::warp::square_to_cosine_hemisphere;
use crate::math::{Compare, Frame, Mask, Rgb, Vec3x, f32x16, splat};
use crate::scene::Material;
use std::f32::consts::FRAC_1_PI;

/// Material parameters of sixteen points, textures applied.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parameters {
    /// Linear base colour.
    pub base: Rgb,
    /// 0 dielectric, 1 metal.
    pub metallic: f32x16,
    /// Perceptual roughness.
    pub roughness: f32x16,
    /// Strength of the dielectric layer.
    pub specular: f32x16,
    /// Tint of the dielectric layer at normal incidence.
    pub specular_color: Rgb,
    /// Index of refraction, inside over outside.
    pub ior: f32x16,
    /// Transmitted share of the dielectric.
    pub transmission: f32x16,
    /// Absorption inside, m⁻¹.
    pub absorption: Rgb,
    /// Bounds a solid; else thin.
    pub solid: Mask,
}

/// The scattering at sixteen points. The default scatters nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Bsdf {
    /// Shading frame: n is the (mapped) shading normal on the front side.
    pub frame: Frame,
    /// Weight × albedo of the Lambertian lobe, divided by 1 − F̄ of its layer.
    diffuse: Rgb,
    /// Reflectance of the layer over the Lambertian lobe at normal and at grazing incidence, largest channel.
    layer: [f32x16; 2],
    /// Schlick's reflectances of metal and layer together, weights applied.
    f0: Rgb,
    f90: f32x16,
    /// GGX alpha of the specular lobes; 0 where they are Diracs or there is none.
    alpha: f32x16,
    /// Weight of the transmissive dielectric.
    clear: f32x16,
    /// That weight × the tint of what it transmits.
    tint: Rgb,
    ior: f32x16,
    solid: Mask,
    absorption: Rgb,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug, Default)]
pub struct BsdfSample {
    /// World direction.
    pub wi: Vec3x,
    /// f·|cosθi| of all smooth lobes, or the coefficient of the Dirac lobe; not divided by `pdf`.
    pub f: Rgb,
    /// Density over all smooth lobes, sr⁻¹, or the probability of the Dirac lobe.
    pub pdf: f32x16,
    /// The event is a Dirac.
    pub dirac: Mask,
    /// The direction crosses the surface, judged by the shading normal.
    pub transmit: Mask,
    /// Relative index of this crossing, transmitted over incident; 1 for reflection and thin sheets.
    pub eta: f32x16,
    /// `pdf` > 0 and `f` is not black; nothing else is to be used elsewhere.
    pub valid: Mask,
}

/// A Dirac lobe evaluated.
#[derive(Clone, Copy, Debug, Default)]
pub struct DiracEval {
    /// World direction.
    pub wi: Vec3x,
    /// Coefficient: reflectance, or transmittance / eta².
    pub f: Rgb,
    /// Probability with which [`Bsdf::sample`] takes this lobe.
    pub pdf: f32x16,
    /// Relative index of the crossing; 1 for reflection and thin sheets.
    pub eta: f32x16,
    /// The lobe exists and gives light.
    pub valid: Mask,
}

/// `wo` seen from its own side: the local frame turned over where wo is behind.
struct Side {
    /// Local wo with z ≥ 0.
    wo: Vec3x,
    behind: Mask,
    /// Relative index for light that crosses, transmitted over incident.
    eta: f32x16,
    /// Probability of the Lambertian lobe.
    p_diffuse: f32x16,
}

/// Shares of the specular lobes about one microfacet normal.
struct Facet {
    reflect: Rgb,
    transmit: Rgb,
    /// Probability of reflection.
    p_reflect: f32x16,
    cos_t: f32x16,
}

/// `a / b`, or 0 where b is 0.
#[inline(always)]
fn ratio(a: f32x16, b: f32x16) -> f32x16 {
    b.differs(f32x16::ZERO).keep(a / b)
}

impl Bsdf {
    /// Scattering in a shading frame.
    pub fn new(frame: Frame, p: &Parameters) -> Self {
        let one = splat(1.0);
        let dielectric = one - p.metallic;
        let mut clear = dielectric * p.transmission;
        let opaque = dielectric - clear;
        let r = (p.ior - one) / (p.ior + one);
        let tinted = p.specular_color * (r * r);
        let clamp = |x: f32x16| x.fast_min(one) * p.specular;
        let layer = Rgb::new(clamp(tinted.x), clamp(tinted.y), clamp(tinted.z));
        let layer_f0 = layer.max_component();
        let mean = (p.specular - layer_f0).mul_add(splat(SCHLICK_MEAN), layer_f0);
        let mut f0 = p.base * p.metallic + layer * opaque;
        let mut f90 = opaque.mul_add(p.specular, p.metallic);
        // An index of 0 is KHR_materials_ior's way to say: reflects everything.
        let closed = p.ior.le(f32x16::ZERO);
        f0 = closed.select(f0 + Rgb::all(clear), f0);
        f90 = closed.select(f90 + clear, f90);
        clear = closed.select(f32x16::ZERO, clear);
        let alpha = p.roughness * p.roughness;
        // Where indices match, no microfacet deflects: the transmission is a Dirac at any roughness.
        let matched = p.solid & p.ior.same(one) & clear.gt(f32x16::ZERO);
        let smooth = alpha.lt(splat(Material::SMOOTH_ALPHA)) | matched;
        let mut bsdf = Self {
            frame,
            diffuse: p.base * ratio(opaque, one - mean),
            layer: [layer_f0, p.specular],
            f0,
            f90,
            alpha: f32x16::ZERO,
            clear,
            tint: p.base * clear,
            ior: closed.select(one, p.ior),
            solid: p.solid,
            absorption: p.solid.keep(p.absorption),
        };
        bsdf.alpha = bsdf.has_specular().and_not(smooth).keep(alpha);
        bsdf
    }

    /// A frame that scatters nothing.
    pub fn black(frame: Frame) -> Self {
        Self { frame, ..Self::default() }
    }

    /// Lanes with a specular lobe of any kind.
    #[inline(always)]
    fn has_specular(&self) -> Mask {
        let strength = self.f0.max_component().fast_max(self.f90).fast_max(self.clear);
        strength.gt(f32x16::ZERO)
    }

    /// Lanes with a Lambertian or rough lobe.
    #[inline(always)]
    pub fn has_smooth(&self) -> Mask {
        !self.diffuse.is_zero() | self.alpha.gt(f32x16::ZERO)
    }

    /// Lanes with a Dirac lobe.
    #[inline(always)]
    pub fn has_dirac(&self) -> Mask {
        self.has_specular() & self.alpha.same(f32x16::ZERO)
    }

    /// Lanes that let light cross the surface.
    #[inline(always)]
    pub fn transmits(&self) -> Mask {
        self.clear.gt(f32x16::ZERO)
    }

    /// Smallest GGX alpha over the smooth lobes: infinite where there is only Lambert, 0 where there is none.
    #[inline(always)]
    pub fn smooth_alpha(&self) -> f32x16 {
        let rough = self.alpha.gt(f32x16::ZERO);
        let lambert = (!self.diffuse.is_zero()).keep(splat(f32::INFINITY));
        rough.select(self.alpha, lambert)
    }

    /// Index, transmitted over incident, for light that crosses, seen from wo's side; 1 for thin and opaque lanes.
    #[inline(always)]
    pub fn relative_ior(&self, wo: Vec3x) -> f32x16 {
        self.eta(wo.dot(self.frame.n).lt(f32x16::ZERO))
    }

    #[inline(always)]
    fn eta(&self, behind: Mask) -> f32x16 {
        let one = splat(1.0);
        let refracts = self.solid & self.clear.gt(f32x16::ZERO);
        refracts.select(behind.select(one / self.ior, self.ior), one)
    }

    /// What a solid lets pass over `distance` metres along `wi`: exp(−absorption · distance) inside, 1 outside.
    #[inline(always)]
    pub fn transmittance(&self, wi: Vec3x, distance: f32x16) -> Rgb {
        let one = splat(1.0);
        let inside = self.solid & wi.dot(self.frame.n).lt(f32x16::ZERO);
        let absorbing = inside & self.absorption.max_component().gt(f32x16::ZERO);
        if absorbing.none() {
            return Rgb::grey(1.0);
        }
        let channel = |a: f32x16| {
            let absorbs = absorbing & a.gt(f32x16::ZERO);
            // exp underflows long before −200; infinite distances stay finite here.
            absorbs.select((-(a * distance)).fast_max(splat(-200.0)).exp(), one)
        };
        Rgb::new(channel(self.absorption.x), channel(self.absorption.y), channel(self.absorption.z))
    }

    /// Transmission of the dielectric layer for one of the two directions of the Lambertian lobe.
    #[inline(always)]
    fn below_layer(&self, cos: f32x16) -> f32x16 {
        let [f0, f90] = self.layer;
        let one = splat(1.0);
        (one - (f90 - f0).mul_add(schlick_weight(cos), f0)).fast_max(f32x16::ZERO)
    }

    #[inline(always)]
    fn side(&self, wo: Vec3x) -> Side {
        let local = self.frame.to_local(wo);
        let behind = local.z.lt(f32x16::ZERO);
        let wo = Vec3x::new(local.x, local.y, local.z.abs());
        let eta = self.eta(behind);
        let diffuse = self.diffuse.luminance() * self.below_layer(wo.z);
        // At least the mean weight, so that a lobe which is black at this angle alone keeps its chance.
        let weight = schlick_weight(wo.z).fast_max(splat(SCHLICK_MEAN));
        let specular = schlick(self.f0, self.f90, weight).luminance() + self.clear;
        Side { wo, behind, eta, p_diffuse: ratio(diffuse, diffuse + specular) }
    }

    /// Reflected and transmitted shares at a microfacet seen under the cosine `cos` ≥ 0.
    #[inline(always)]
    fn facet(&self, cos: f32x16, eta: f32x16) -> Facet {
        let face = fresnel::dielectric(cos, self.solid.select(eta, self.ior));
        self.facet_of(cos, face)
    }

    #[inline(always)]
    fn facet_of(&self, cos: f32x16, face: Dielectric) -> Facet {
        let opaque = schlick(self.f0, self.f90, schlick_weight(cos));
        let reflected = self.solid.select(face.reflectance, fresnel::thin(face.reflectance));
        let reflect = opaque + Rgb::all(self.clear * reflected);
        let transmit = self.tint * (splat(1.0) - reflected);
        let (r, t) = (reflect.luminance(), transmit.luminance());
        Facet { reflect, transmit, p_reflect: ratio(r, r + t), cos_t: face.cos_t }
    }

    /// World direction of a local one that was seen from `behind`.
    #[inline(always)]
    fn outward(&self, behind: Mask, w: Vec3x) -> Vec3x {
        self.frame.to_world(Vec3x::new(w.x, w.y, behind.select(-w.z, w.z)))
    }

    /// All smooth lobes: f·|cosθi|, and the density with which [`Bsdf::sample`] finds `wi` as a smooth event.
    /// The density is 0 exactly where f is black.
    #[inline]
    pub fn eval(&self, wo: Vec3x, wi: Vec3x) -> (Rgb, f32x16) {
        self.eval_side(&self.side(wo), wi)
    }

    #[inline(always)]
    fn eval_side(&self, side: &Side, wi: Vec3x) -> (Rgb, f32x16) {
        let zero = f32x16::ZERO;
        let wo = side.wo;
        let local = self.frame.to_local(wi);
        let wi = Vec3x::new(local.x, local.y, side.behind.select(-local.z, local.z));
        let cos_i = wi.z.abs();
        let (above, below) = (wi.z.gt(zero), wi.z.lt(zero));
        let usable = wo.z.gt(zero) & (above | below);

        let coupling = self.below_layer(wo.z) * self.below_layer(cos_i);
        let lambert = above.keep(cos_i * splat(FRAC_1_PI));
        let mut f = self.diffuse * (coupling * lambert);
        let mut pdf = side.p_diffuse * lambert;

        let rough = self.alpha.gt(zero) & usable;
        if rough.any() {
            let (f_rough, pdf_rough) = self.eval_rough(side, wi, cos_i, below);
            f += rough.keep(f_rough);
            pdf += rough.keep(pdf_rough);
        }
        let live = usable & pdf.gt(zero) & f.max_component().gt(zero);
        (live.keep(f), live.keep(pdf))
    }

    /// The rough specular lobes; meaningful where alpha > 0 and no cosine is 0.
    #[inline(always)]
    fn eval_rough(&self, side: &Side, wi: Vec3x, cos_i: f32x16, below: Mask) -> (Rgb, f32x16) {
        let zero = f32x16::ZERO;
        let wo = side.wo;
        let refracted = below & self.solid;
        // A thin sheet's transmission is its reflection mirrored at the surface.
        let mirrored = Vec3x::new(wi.x, wi.y, self.solid.select(wi.z, cos_i));
        let h = refracted.select(mirrored * side.eta + wo, mirrored + wo);
        let inverse = splat(1.0) / h.length();
        let h = h * h.z.lt(zero).select(-inverse, inverse);
        let (oh, ih) = (wo.dot(h), mirrored.dot(h));
        let facing = oh.gt(zero) & refracted.select(-ih, ih).gt(zero);

        let mut face = fresnel::dielectric(oh, self.solid.select(side.eta, self.ior));
        face.reflectance = refracted.select(fresnel::crossing(oh, ih.abs(), side.eta), face.reflectance);
        let facet = self.facet_of(oh, face);
        let (g_o, g_i) = (smith_g1(wo.z, self.alpha), smith_g1(cos_i, self.alpha));
        let visible = distribution(h, self.alpha) * g_o / wo.z;
        let denominator = side.eta.mul_add(ih, oh);
        let refraction = oh * ih.abs() / (denominator * denominator);
        let density = visible * refracted.select(refraction, splat(0.25));
        let share = below.select(facet.transmit, facet.reflect);
        let p = below.select(splat(1.0) - facet.p_reflect, facet.p_reflect);
        // dωh/dωi carries eta², the radiance does not: that is its compression.
        let eta2 = refracted.select(side.eta * side.eta, splat(1.0));
        let f = share * (density * g_i);
        let pdf = (splat(1.0) - side.p_diffuse) * density * p * eta2;
        let live = facing & !share.is_zero();
        (live.keep(f), live.keep(pdf))
    }

    /// The Dirac reflection, or where `transmit` the Dirac transmission, for `wo`.
    #[inline]
    pub fn eval_dirac(&self, wo: Vec3x, transmit: Mask) -> DiracEval {
        self.dirac_side(&self.side(wo), transmit)
    }

    #[inline(always)]
    fn dirac_side(&self, side: &Side, transmit: Mask) -> DiracEval {
        let one = splat(1.0);
        let wo = side.wo;
        let facet = self.facet(wo.z, side.eta);
        let refracts = transmit & self.solid;
        let eta = refracts.select(side.eta, one);
        let scale = refracts.select(one / side.eta, one);
        let z = transmit.select(-refracts.select(facet.cos_t, wo.z), wo.z);
        let wi = Vec3x::new(-wo.x * scale, -wo.y * scale, z);
        let f = transmit.select(facet.transmit * (one / (eta * eta)), facet.reflect);
        let p = transmit.select(one - facet.p_reflect, facet.p_reflect);
        let pdf = (one - side.p_diffuse) * p;
        let zero = f32x16::ZERO;
        let valid = self.has_dirac() & wo.z.gt(zero) & pdf.gt(zero) & f.max_component().gt(zero);
        DiracEval { wi: self.outward(side.behind, wi), f: valid.keep(f), pdf: valid.keep(pdf), eta, valid }
    }

    /// Samples a direction: `u_lobe` chooses the lobe, (u, v) the direction within it, all in [0, 1).
    #[inline]
    pub fn sample(&self, wo: Vec3x, u_lobe: f32x16, u: f32x16, v: f32x16, active: Mask) -> BsdfSample {
        let (zero, one) = (f32x16::ZERO, splat(1.0));
        let side = self.side(wo);
        let wo = side.wo;
        let diffuse = u_lobe.lt(side.p_diffuse);
        let dirac = self.has_dirac().and_not(diffuse);
        let rough = (active & self.alpha.gt(zero)).and_not(diffuse);
        let rest = (u_lobe - side.p_diffuse) / (one - side.p_diffuse);

        let mut wi = Vec3x::ZERO;
        if (active & diffuse).any() {
            wi = diffuse.keep(square_to_cosine_hemisphere(u, v));
        }
        let mut transmit = Mask::NONE;
        if rough.any() {
            let h = sample_visible_normal(wo, self.alpha, u, v);
            let oh = wo.dot(h);
            let facet = self.facet(oh, side.eta);
            transmit = rough & rest.ge(facet.p_reflect);
            let reflected = h.mul_add(splat(2.0) * oh, -wo);
            let mirrored = Vec3x::new(reflected.x, reflected.y, -reflected.z);
            let refracted = h * (oh / side.eta - facet.cos_t) + -wo * (one / side.eta);
            let crossing = self.solid.select(refracted, mirrored);
            wi = rough.select(transmit.select(crossing, reflected), wi);
        }
        // A microfacet may send light to the wrong side of the surface; single scattering loses it.
        let kept = transmit.select(wi.z.lt(zero), wi.z.gt(zero));
        let wi = self.outward(side.behind, wi);
        let (f, pdf) = self.eval_side(&side, wi);
        let valid = active & kept & pdf.gt(zero);
        let mut sample = BsdfSample {
            wi,
            f: valid.keep(f),
            pdf: valid.keep(pdf),
            dirac,
            transmit,
            eta: (transmit & self.solid).select(side.eta, one),
            valid,
        };
        if (active & dirac).any() {
            let crosses = rest.ge(self.facet(wo.z, side.eta).p_reflect);
            let lobe = self.dirac_side(&side, crosses);
            let valid = active & lobe.valid;
            let event = BsdfSample {
                wi: lobe.wi,
                f: valid.keep(lobe.f),
                pdf: valid.keep(lobe.pdf),
                dirac,
                transmit: crosses,
                eta: lobe.eta,
                valid,
            };
            sample = dirac.select(event, sample);
        }
        sample
    }
}

crate::lanewise!(BsdfSample { wi, f, pdf, dirac, transmit, eta, valid });

crate::lanewise!(Bsdf { frame, diffuse, layer, f0, f90, alpha, clear, tint, ior, solid, absorption });
