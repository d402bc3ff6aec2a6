//! S2, identities: an independent scalar model, reciprocity, Diracs there and back, Snell, exact zeros.

use crate::Random;
use crate::bsdf::{CASES, Case, outgoing};
use gdpt::math::{Compare, Frame, LANES, Mask, Rgb, Vec3x, f32x16, lanes, splat};
use gdpt::shade::{Bsdf, Parameters};
use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Exact Fresnel reflectance by angles (sine and tangent laws).
fn fresnel(cos_i: f64, eta: f64) -> f64 {
    let theta_i = cos_i.min(1.0).acos();
    let sin_t = theta_i.sin() / eta;
    if sin_t >= 1.0 {
        return 1.0;
    }
    let theta_t = sin_t.asin();
    if theta_i < 1e-6 {
        return ((1.0 - eta) / (1.0 + eta)).powi(2);
    }
    let s = (theta_i - theta_t).sin() / (theta_i + theta_t).sin();
    let p = (theta_i - theta_t).tan() / (theta_i + theta_t).tan();
    0.5 * (s * s + p * p)
}

/// f·|cosθi| of the rough and Lambertian lobes, from the formulas of the papers, in f64 and local coordinates.
fn model(case: &Case, mut o: DVec3, mut i: DVec3) -> DVec3 {
    let behind = o.z < 0.0;
    if behind {
        (o.z, i.z) = (-o.z, -i.z);
    }
    let (m, t, s, ior) = (
        f64::from(case.metallic),
        f64::from(case.transmission),
        f64::from(case.specular),
        f64::from(case.ior),
    );
    let base = DVec3::from(Vec3::from(case.base));
    let alpha = f64::from(case.roughness).powi(2);
    let solid = case.solid;
    let eta = if behind { 1.0 / ior } else { ior };
    let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * s;
    let schlick = |f0: f64, f90: f64, c: f64| f0 + (f90 - f0) * (1.0 - c).powi(5);
    let tan2 = |c: f64| (1.0 - c * c).max(0.0) / (c * c);
    let d = |h: DVec3| alpha.powi(2) / (PI * h.z.powi(4) * (alpha * alpha + tan2(h.z)).powi(2));
    let g1 = |c: f64| 2.0 / (1.0 + (1.0 + alpha * alpha * tan2(c)).sqrt());
    let slab = |c: f64, eta: f64| {
        let r = fresnel(c, if solid { eta } else { ior });
        if solid { r } else { 2.0 * r / (1.0 + r) }
    };
    let clear = (1.0 - m) * t;
    let opaque = (1.0 - m) * (1.0 - t);
    let reflection = |i: DVec3| {
        let h = (o + i).normalize();
        let c = o.dot(h);
        (h, c, d(h) * g1(o.z) * g1(i.z) / (4.0 * o.z))
    };
    if i.z > 0.0 {
        let mean = schlick(f0, s, 1.0) + (s - f0) / 21.0;
        let under = |c: f64| 1.0 - schlick(f0, s, c);
        let lambert = base * opaque * under(o.z) * under(i.z) / (1.0 - mean) * i.z / PI;
        if alpha < 1e-4 {
            return lambert;
        }
        let (_, c, dg) = reflection(i);
        let metal = base + (DVec3::ONE - base) * (1.0 - c).powi(5);
        let f = metal * m + DVec3::splat(opaque * schlick(f0, s, c) + clear * slab(c, eta));
        return lambert + f * dg;
    }
    if alpha < 1e-4 || clear == 0.0 {
        return DVec3::ZERO;
    }
    if !solid {
        let (_, c, dg) = reflection(DVec3::new(i.x, i.y, -i.z));
        return base * clear * (1.0 - slab(c, eta)) * dg;
    }
    let mut h = (o + i * eta).normalize();
    if h.z < 0.0 {
        h = -h;
    }
    let (oh, ih) = (o.dot(h), i.dot(h));
    if oh <= 0.0 || ih >= 0.0 {
        return DVec3::ZERO;
    }
    // Walter et al. 2007, equation 21, with ηo = 1 and ηi = eta.
    let jacobian = 1.0 / (eta * ih + oh).powi(2);
    base * clear * (1.0 - slab(oh, eta)) * d(h) * g1(o.z) * g1(-i.z) * oh * ih.abs() / o.z * jacobian
}

#[test]
fn eval_is_the_model_of_the_papers() {
    for case in &CASES {
        let bsdf = case.bsdf();
        let mut random = Random::new(7);
        let (mut compared, mut worst) = (0, 0.0_f64);
        for _ in 0..4000 {
            let (wo, wi) = (random.directions(), random.directions());
            let (f, _) = bsdf.eval(wo, wi);
            let (o, i) = (bsdf.frame.to_local(wo), bsdf.frame.to_local(wi));
            for lane in 0..LANES {
                let (o, i) = (DVec3::from(o.lane(lane)).normalize(), DVec3::from(i.lane(lane)).normalize());
                let exact = model(case, o, i);
                let f = DVec3::from(f.lane(lane));
                // Grazing directions amplify the rounding of the inputs.
                if o.z.abs() > 0.02 && i.z.abs() > 0.02 && exact.max_element() > 1e-6 {
                    let error = (f - exact).abs().max_element() / exact.max_element();
                    worst = worst.max(error);
                    assert!(error < 2e-3, "{}: {f} for {exact}, wo {o}, wi {i}", case.name);
                    compared += 1;
                }
            }
        }
        assert!(compared > 1000, "{}: {compared} compared", case.name);
    }
}

#[test]
fn smooth_lobes_are_reciprocal() {
    for case in &CASES {
        let bsdf = case.bsdf();
        let mut random = Random::new(11);
        for _ in 0..4000 {
            let (wo, wi) = (random.directions(), random.directions());
            let (n, zero) = (bsdf.frame.n, f32x16::ZERO);
            let crosses = (wo.dot(n) * wi.dot(n)).lt(zero);
            let eta = crosses.select(bsdf.relative_ior(wo), splat(1.0));
            let there = bsdf.eval(wo, wi).0 * (eta * eta / wi.dot(n).abs());
            let back = bsdf.eval(wi, wo).0 * (splat(1.0) / wo.dot(n).abs());
            for lane in 0..LANES {
                let (a, b) = (there.lane(lane), back.lane(lane));
                let steep = wo.dot(n).abs().min(wi.dot(n).abs()).as_array()[lane] > 0.02;
                let scale = a.max_element().max(b.max_element());
                // Single precision: wo·h and wi·h differ by rounding, which Fresnel's slope near the critical angle
                // turns into some 1e-4.
                if steep && scale > 1e-6 {
                    assert!((a - b).abs().max_element() <= 1e-3 * scale, "{}: {a} and {b}", case.name);
                }
            }
        }
    }
}

/// Smooth glass and a smooth sheet, tinted.
fn smooth(solid: bool, ior: f32) -> Bsdf {
    Case { roughness: 0.0, transmission: 1.0, base: [0.9, 0.5, 0.2], ior, solid, ..CASES[0] }.bsdf()
}

#[test]
fn dirac_reflection_returns() {
    for bsdf in CASES.iter().map(Case::bsdf).chain([smooth(true, 1.5), smooth(false, 1.5)]) {
        let wo = outgoing(&bsdf);
        let there = bsdf.eval_dirac(wo, Mask::NONE);
        let back = bsdf.eval_dirac(there.wi, Mask::NONE);
        assert_eq!(there.valid.bits(), bsdf.has_dirac().bits());
        for lane in there.valid.iter() {
            assert!((back.wi.lane(lane) - wo.lane(lane)).length() < 1e-5);
            assert!((back.f.lane(lane) - there.f.lane(lane)).length() < 1e-5);
            assert_eq!(there.eta.as_array()[lane], 1.0);
        }
    }
}

#[test]
fn dirac_transmission_obeys_snell_and_returns() {
    for ior in [1.5, 0.75, 1.0, 2.4] {
        let bsdf = smooth(true, ior);
        let wo = outgoing(&bsdf);
        let there = bsdf.eval_dirac(wo, Mask::ALL);
        let back = bsdf.eval_dirac(there.wi, Mask::ALL);
        let n = bsdf.frame.n.lane(0);
        let mut refracted = 0;
        for lane in 0..LANES {
            let (o, i) = (wo.lane(lane), there.wi.lane(lane));
            let eta = if o.dot(n) > 0.0 { ior } else { 1.0 / ior };
            let sin_t = o.cross(n).length() / eta;
            assert_eq!(there.valid.get(lane), sin_t < 1.0, "ior {ior}, direction {lane}");
            if !there.valid.get(lane) {
                continue;
            }
            refracted += 1;
            assert!((there.eta.as_array()[lane] - eta).abs() < 1e-6);
            assert!((i.cross(n).length() - sin_t).abs() < 1e-5 && i.dot(n) * o.dot(n) < 0.0);
            // In the plane of incidence, on the far side of the normal.
            assert!(o.cross(n).dot(i).abs() < 1e-6 && i.cross(n).dot(o.cross(n)) <= 1e-7);
            assert!((i.length() - 1.0).abs() < 1e-5);
            let f = there.f.lane(lane);
            let r = fresnel(f64::from(o.dot(n).abs()), f64::from(eta)) as f32;
            let expected = Vec3::new(0.9, 0.5, 0.2) * (1.0 - r) / (eta * eta);
            assert!((f - expected).length() < 2e-4 * expected.length(), "{f} for {expected}");
            assert!(back.valid.get(lane));
            assert!((back.wi.lane(lane) - o).length() < 1e-4);
            assert!((back.eta.as_array()[lane] * eta - 1.0).abs() < 1e-6);
            let scaled = back.f.lane(lane) / (eta * eta * eta * eta);
            // Towards the critical angle Fresnel's slope grows without bound, and rounding with it.
            let steep = i.dot(n).abs().min(o.dot(n).abs()) > 0.05;
            assert!(!steep || (scaled - f).length() < 2e-3 * f.length(), "{scaled} back for {f}");
        }
        assert!(refracted >= 8);
    }
}

#[test]
fn thin_sheets_pass_straight_on() {
    let bsdf = smooth(false, 1.5);
    let wo = outgoing(&bsdf);
    let through = bsdf.eval_dirac(wo, Mask::ALL);
    let mirror = bsdf.eval_dirac(wo, Mask::NONE);
    assert!(through.valid.all() && mirror.valid.all() && bsdf.has_smooth().none());
    for lane in 0..LANES {
        assert!((through.wi.lane(lane) + wo.lane(lane)).length() < 1e-6);
        assert_eq!(through.eta.as_array()[lane], 1.0);
        let r = fresnel(f64::from(wo.dot(bsdf.frame.n).as_array()[lane].abs()), 1.5) as f32;
        assert!((mirror.f.lane(lane).x - 2.0 * r / (1.0 + r)).abs() < 1e-5);
        let t = Vec3::new(0.9, 0.5, 0.2) * (1.0 - mirror.f.lane(lane).x);
        assert!((through.f.lane(lane) - t).length() < 1e-5);
    }
}

/// Refracted directions against Fermat: the optical path over a plane is stationary where Snell holds.
#[test]
fn refraction_makes_the_optical_path_stationary() {
    let bsdf = smooth(true, 1.5);
    let wo = outgoing(&bsdf);
    let wi = bsdf.eval_dirac(wo, Mask::ALL).wi;
    let (o, i) = (bsdf.frame.to_local(wo), bsdf.frame.to_local(wi));
    for lane in 0..4 {
        let (a, b) = (DVec3::from(o.lane(lane)), DVec3::from(i.lane(lane)));
        let path = |x: f64, y: f64| {
            let p = DVec3::new(x, y, 0.0);
            (a - p).length() + 1.5 * (b - p).length()
        };
        let h = 1e-4;
        assert!(((path(h, 0.0) - path(-h, 0.0)) / (2.0 * h)).abs() < 1e-5);
        assert!(((path(0.0, h) - path(0.0, -h)) / (2.0 * h)).abs() < 1e-5);
    }
}

/// Parameters with exact zeros and ones among them.
fn random_parameters(random: &mut Random) -> Parameters {
    let mut value = |scale: f32| {
        let u = random.wide();
        let choice = random.wide();
        lanes(|i| match choice.as_array()[i] {
            c if c < 0.2 => 0.0,
            c if c < 0.4 => scale,
            _ => u.as_array()[i] * scale,
        })
    };
    Parameters {
        base: Rgb::new(value(1.0), value(1.0), value(1.0)),
        metallic: value(1.0),
        roughness: value(1.0),
        specular: value(1.0),
        specular_color: Rgb::new(value(1.0), value(1.0), value(2.0)),
        ior: value(3.0),
        transmission: value(1.0),
        absorption: Rgb::ZERO,
        solid: value(1.0).gt(splat(0.5)),
    }
}

#[test]
fn pdf_is_zero_exactly_where_f_is_and_sample_agrees_with_eval() {
    let mut random = Random::new(23);
    let frame = Frame::from_normal(Vec3x::splat(Vec3::new(-0.2, 0.3, 0.9).normalize()));
    for round in 0..20_000 {
        let parameters = random_parameters(&mut random);
        let bsdf = Bsdf::new(frame, &parameters);
        let mut wo = random.directions();
        if round % 8 == 0 {
            wo = if round % 16 == 0 { frame.n } else { frame.s };
        }
        let wi = if round % 5 == 0 { -wo } else { random.directions() };
        let (f, pdf) = bsdf.eval(wo, wi);
        assert!(f.is_finite().all() && pdf.is_finite().all(), "{parameters:?}");
        assert_eq!(pdf.gt(f32x16::ZERO).bits(), f.max_component().gt(f32x16::ZERO).bits());
        assert!(pdf.ge(f32x16::ZERO).all());

        let s = bsdf.sample(wo, random.wide(), random.wide(), random.wide(), Mask::ALL);
        let (f, pdf) = bsdf.eval(wo, s.wi);
        let dirac = bsdf.eval_dirac(wo, s.transmit);
        assert_eq!((s.valid & s.dirac).and_not(bsdf.has_dirac()).bits(), 0);
        assert_eq!(s.valid.and_not(s.dirac | bsdf.has_smooth()).bits(), 0);
        for lane in 0..LANES {
            let (sf, sp) = (s.f.lane(lane), s.pdf.as_array()[lane]);
            assert_eq!(s.valid.get(lane), sp > 0.0);
            if !s.valid.get(lane) {
                assert_eq!(sf, Vec3::ZERO);
                continue;
            }
            let (ef, ep) = if s.dirac.get(lane) {
                assert_eq!(dirac.wi.lane(lane), s.wi.lane(lane));
                (dirac.f.lane(lane), dirac.pdf.as_array()[lane])
            } else {
                (f.lane(lane), pdf.as_array()[lane])
            };
            // The same bits: a shift that changes nothing must give a gradient of exactly zero.
            assert_eq!((sf, sp), (ef, ep));
            assert!(sf.is_finite() && sp.is_finite() && (s.wi.lane(lane).length() - 1.0).abs() < 1e-4);
            let product = wo.lane(lane).dot(frame.n.lane(lane)) * s.wi.lane(lane).dot(frame.n.lane(lane));
            assert!(product.abs() < 1e-6 || s.transmit.get(lane) == (product < 0.0));
            let eta = if s.transmit.get(lane) { bsdf.relative_ior(wo).as_array()[lane] } else { 1.0 };
            assert_eq!(s.eta.as_array()[lane], eta);
        }
    }
}

#[test]
fn roughness_is_reported_for_the_smooth_lobes_alone() {
    let alpha = |case: Case| case.bsdf().smooth_alpha().as_array()[0];
    let metal = Case { metallic: 1.0, ..CASES[0] };
    assert_eq!(alpha(CASES[0]), f32::INFINITY);
    assert_eq!(alpha(Case { roughness: 0.5, ..metal }), 0.25);
    assert_eq!(alpha(Case { roughness: 0.0, ..metal }), 0.0);
    assert_eq!(alpha(Case { roughness: 0.0, specular: 1.0, ..CASES[0] }), f32::INFINITY);
    assert_eq!(alpha(Case { roughness: 0.5, specular: 1.0, ..CASES[0] }), 0.25);
    assert_eq!(Bsdf::default().smooth_alpha().as_array()[0], 0.0);
    assert!((Bsdf::default().has_smooth() | Bsdf::default().has_dirac()).none());
}

#[test]
fn absorption_acts_inside_solids_only() {
    let frame = Frame::from_normal(Vec3x::splat(Vec3::Z));
    let parameters = Parameters {
        base: Rgb::grey(1.0),
        ior: splat(1.5),
        transmission: splat(1.0),
        absorption: Rgb::splat(Vec3::new(0.0, 0.5, 3.0)),
        solid: Mask::ALL,
        ..Parameters::default()
    };
    let bsdf = Bsdf::new(frame, &parameters);
    let inside = Vec3x::splat(Vec3::NEG_Z);
    let t = bsdf.transmittance(inside, splat(2.0)).lane(3);
    assert!((t - Vec3::new(1.0, (-1.0_f32).exp(), (-6.0_f32).exp())).length() < 1e-6);
    assert_eq!(bsdf.transmittance(-inside, splat(2.0)).lane(3), Vec3::ONE);
    let far = bsdf.transmittance(inside, splat(f32::INFINITY)).lane(0);
    assert!(far.x == 1.0 && far.y < 1e-30 && far.is_finite());
    let thin = Bsdf::new(frame, &Parameters { solid: Mask::NONE, ..parameters });
    assert_eq!(thin.transmittance(inside, splat(2.0)).lane(0), Vec3::ONE);
}
