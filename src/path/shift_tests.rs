//! The shift's mathematics against an oracle in f64: the oracle's Jacobians against central finite differences, the
//! wide code against the oracle, round trips, the identity, and the sum of the weights of a pair.

use super::shift::{PairWeights, half_vector, reconnect};
use crate::math::sampler::hash;
use crate::math::{Frame, Mask, Vec3x, splat};
use crate::shade::{Bsdf, Parameters, Surface};
use glam::{DVec3, Vec3};

/// Random numbers from a hashed counter.
struct Random(u32, u32);

impl Random {
    fn unit(&mut self) -> f64 {
        self.1 += 1;
        f64::from(hash(self.0, self.1) >> 8) / f64::from(1 << 24)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A direction whose |z| is at least `least`, on the side `up`.
    fn direction(&mut self, least: f64, up: bool) -> DVec3 {
        let z = self.between(least, 1.0);
        let (sin, cos) = self.between(0.0, std::f64::consts::TAU).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * cos, r * sin, if up { z } else { -z })
    }
}

/// One end of a pair in its shading frame: the direction back and the index of the inside.
#[derive(Clone, Copy, Debug)]
struct End {
    p: DVec3,
    ior: f64,
}

impl End {
    /// Transmitted over incident index.
    fn eta(&self) -> f64 {
        if self.p.z > 0.0 { self.ior } else { 1.0 / self.ior }
    }

    fn wide(&self) -> Surface {
        let mut surface = Surface::default();
        let n = Vec3::Z;
        let frame = Frame { s: Vec3x::splat(Vec3::X), t: Vec3x::splat(Vec3::Y), n: Vec3x::splat(n) };
        let parameters = Parameters {
            base: Vec3x::grey(1.0),
            roughness: splat(0.5),
            specular: splat(1.0),
            specular_color: Vec3x::grey(1.0),
            ior: splat(self.ior as f32),
            transmission: splat(1.0),
            solid: Mask::ALL,
            ..Parameters::default()
        };
        surface.bsdf = Bsdf::new(frame, &parameters);
        surface.ng = Vec3x::splat(n);
        surface.wo = wide(self.p);
        surface
    }
}

fn wide(v: DVec3) -> Vec3x {
    Vec3x::splat(v.as_vec3())
}

fn narrow(v: &Vec3x) -> DVec3 {
    v.lane(0).as_dvec3()
}

/// Refracts the direction back `p` about `h` (p·h > 0); `None` on total internal reflection.
fn refract(p: DVec3, h: DVec3, eta: f64) -> Option<DVec3> {
    let cos = p.dot(h);
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    (sin2 < 1.0).then(|| h * (cos / eta - (1.0 - sin2).sqrt()) - p / eta)
}

/// Outgoing direction for a half-vector in the upper hemisphere.
fn scatter(end: &End, h: DVec3, transmit: bool) -> Option<DVec3> {
    let h = if end.p.z < 0.0 { -h } else { h };
    let cos = end.p.dot(h);
    if cos <= 0.0 {
        return None;
    }
    let s = if transmit { refract(end.p, h, end.eta())? } else { h * (2.0 * cos) - end.p };
    (transmit == (s.z * end.p.z < 0.0)).then_some(s)
}

/// The half-vector of an event, in the upper hemisphere.
fn half(end: &End, s: DVec3, transmit: bool) -> DVec3 {
    let h = (end.p + s * if transmit { end.eta() } else { 1.0 }).normalize();
    if h.z < 0.0 { -h } else { h }
}

/// The oracle: direction and Jacobian of the copy.
fn copy(x: &End, s: DVec3, y: &End, transmit: bool) -> Option<(DVec3, f64)> {
    let h = half(x, s, transmit);
    let t = scatter(y, h, transmit)?;
    let jacobian = if transmit {
        let (a, b) = (x.p + s * x.eta(), y.p + t * y.eta());
        (x.eta() / y.eta()).powi(2) * b.length_squared() / a.length_squared() * (s.dot(h) / t.dot(h)).abs()
    } else {
        (t.dot(h) / s.dot(h)).abs()
    };
    Some((t, jacobian))
}

/// Area of the image of a small square around `s`, over its own.
fn finite_difference(s: DVec3, f: impl Fn(DVec3) -> Option<DVec3>) -> Option<f64> {
    const STEP: f64 = 1e-5;
    let (a, b) = s.any_orthonormal_pair();
    let along =
        |t: DVec3| Some((f((s + t * STEP).normalize())? - f((s - t * STEP).normalize())?) / (2.0 * STEP));
    Some(along(a)?.cross(along(b)?).length())
}

/// A pair of ends, an event of x and whether it crosses: all enter and exit combinations, indices above, below and
/// equal to one another.
fn events(count: u32, mut visit: impl FnMut(&End, DVec3, &End, bool)) {
    let mut random = Random(0x5eed, 0);
    let indices = [1.5, 1.33, 0.75, 2.0, 1.0 / 1.5];
    for i in 0..count {
        let transmit = i % 2 == 0;
        let end = |random: &mut Random, up: bool, ior: f64| End { p: random.direction(0.05, up), ior };
        let ior = indices[(i / 8) as usize % 5];
        let x = end(&mut random, i & 2 == 0, ior);
        let y = end(&mut random, i & 4 == 0, if i % 3 == 0 { ior } else { indices[(i / 40) as usize % 5] });
        let h = (random.direction(0.0, true) * random.between(0.0, 1.0) + DVec3::Z).normalize();
        if let Some(s) = scatter(&x, h, transmit) {
            visit(&x, s, &y, transmit);
        }
    }
}

/// Median and 99th percentile.
fn quantiles(mut errors: Vec<f64>) -> (f64, f64) {
    errors.sort_by(f64::total_cmp);
    (errors[errors.len() / 2], errors[errors.len() * 99 / 100])
}

#[test]
fn oracle_agrees_with_finite_differences() {
    for kind in [false, true] {
        let mut errors = Vec::new();
        events(100_000, |x, s, y, transmit| {
            let Some((_, jacobian)) = copy(x, s, y, transmit).filter(|_| transmit == kind) else { return };
            let image = finite_difference(s, |s| Some(copy(x, s, y, transmit)?.0));
            errors.extend(image.map(|j| (j / jacobian - 1.0).abs()));
        });
        assert!(errors.len() > 10_000);
        let (median, high) = quantiles(errors);
        println!("transmit {kind}: median {median:.1e}, 99th percentile {high:.1e}");
        assert!(median < 1e-6 && high < 1e-4, "transmit {kind}: {median:.1e}, {high:.1e}");
    }
}

#[test]
fn copied_half_vectors_agree_with_the_oracle_and_come_back() {
    let (mut jacobians, mut round_trips, mut products) = (Vec::new(), Vec::new(), Vec::new());
    let (mut disagree, mut lost, mut count) = (0, 0, 0);
    events(100_000, |x, s, y, transmit| {
        let (wide_x, wide_y, crosses) = (x.wide(), y.wide(), Mask::from_fn(|_| transmit));
        let there = half_vector(&wide_x, wide(s), &wide_y, crosses);
        let expected = copy(x, s, y, transmit);
        count += 1;
        // At the edge of the domain rounding decides; elsewhere both must agree that the copy exists.
        disagree += u32::from(there.valid.get(0) != expected.is_some());
        let (true, Some((_, jacobian))) = (there.valid.get(0), expected) else { return };
        let found = f64::from(there.jacobian.as_array()[0]);
        jacobians.push((found / jacobian - 1.0).abs());
        let back = half_vector(&wide_y, there.wi, &wide_x, crosses);
        if !back.valid.get(0) {
            lost += 1;
            return;
        }
        round_trips.push((narrow(&back.wi) - s).length());
        products.push((found * f64::from(back.jacobian.as_array()[0]) - 1.0).abs());
    });
    let (jacobian, round_trip, product) = (quantiles(jacobians), quantiles(round_trips), quantiles(products));
    println!(
        "{count} events: J {jacobian:?}, round trip {round_trip:?}, J J⁻¹ {product:?}; {disagree} at the \
         edge of the domain, {lost} without a way back"
    );
    // f32 carries 6e-8; the copies divide by cosines down to 0.05.
    assert!(jacobian.0 < 1e-6 && jacobian.1 < 1e-5);
    assert!(round_trip.0 < 1e-6 && round_trip.1 < 1e-5);
    assert!(product.0 < 1e-6 && product.1 < 1e-5);
    assert!(disagree * 10_000 <= count && lost * 10_000 <= count, "{disagree} and {lost} of {count}");
}

#[test]
fn shift_to_itself_is_the_identity() {
    events(20_000, |x, s, _, transmit| {
        let surface = x.wide();
        let same = half_vector(&surface, wide(s), &surface, Mask::from_fn(|_| transmit));
        let jacobian = same.jacobian.as_array()[0];
        // Where the direction grazes the microfacet, its cosine carries few digits.
        if s.dot(half(x, s, transmit)).abs() > 0.1 && s.z.abs() > 0.01 {
            assert!(same.valid.get(0), "{x:?} {s}");
            assert!((jacobian - 1.0).abs() < 1e-4, "{x:?} {s}: J = {jacobian}");
            assert!((narrow(&same.wi) - s).length() < 1e-4, "{x:?} {s}: {}", narrow(&same.wi));
        }
    });
}

#[test]
fn reconnection_agrees_with_finite_differences() {
    let mut random = Random(77, 0);
    let (mut oracle, mut wide_errors, mut products) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..20_000 {
        let mut point = |size: f64| DVec3::from_array(std::array::from_fn(|_| random.between(-size, size)));
        let (x, y, z, n) = (point(1.0), point(1.0), point(1.0), point(1.0).normalize());
        let seen = |from: DVec3| n.dot((z - from).normalize()).abs() / (z - from).length_squared();
        if seen(x) < 0.05 || seen(y) < 0.05 || (z - x).length() < 0.1 || (z - y).length() < 0.1 {
            continue;
        }
        let jacobian = seen(y) / seen(x);
        // The direction from x moves z in its plane, and that the direction from y.
        let direction = (z - x).normalize();
        let image = finite_difference(direction, |d| {
            let target = x + d * (n.dot(z - x) / n.dot(d));
            Some((target - y).normalize())
        });
        oracle.extend(image.map(|j| (j / jacobian - 1.0).abs()));
        let at = |p: DVec3| {
            let mut surface = Surface::default();
            surface.p = wide(p);
            surface.ng = wide(n);
            surface
        };
        let there = reconnect(&at(x), &at(y), &at(z));
        let back = reconnect(&at(y), &at(x), &at(z));
        let (j, j_back) = (f64::from(there.jacobian.as_array()[0]), f64::from(back.jacobian.as_array()[0]));
        wide_errors.push((j / jacobian - 1.0).abs());
        products.push((j * j_back - 1.0).abs());
        let same = reconnect(&at(x), &at(x), &at(z));
        assert!(same.jacobian.as_array()[0] == 1.0, "to itself: {}", same.jacobian.as_array()[0]);
    }
    let (oracle, wide_errors, products) = (quantiles(oracle), quantiles(wide_errors), quantiles(products));
    println!("oracle {oracle:?}, wide {wide_errors:?}, J J⁻¹ {products:?}");
    assert!(oracle.0 < 1e-6 && oracle.1 < 1e-5);
    assert!(wide_errors.0 < 1e-6 && wide_errors.1 < 1e-5);
    assert!(products.0 < 1e-6 && products.1 < 1e-5);
}

/// What is known of one end of a pair: its solid-angle pdfs, before J.
#[derive(Clone, Copy, Debug)]
struct Techniques {
    /// Product of the pdfs so far.
    product: f64,
    nee: f64,
    bsdf: f64,
    /// Whether the light is visible: the BSDF sampler finds nothing through an occluder.
    visible: bool,
}

/// The weights of the two events drawn at `own`, and of its path in them, by the formulas of the head: squared pdfs
/// over that of the technique drawn. `jacobian` is that of the shift from `own` to `other`.
fn weights(
    pairs: &PairWeights,
    own: &Techniques,
    other: &Techniques,
    jacobian: f64,
    with_nee: bool,
) -> [f64; 2] {
    let weight = |base: f64, offset: f64| {
        f64::from(pairs.weight(splat(base as f32), splat(offset as f32)).as_array()[0])
    };
    let r2 = (other.product / own.product).powi(2);
    let b = if own.visible { own.bsdf } else { 0.0 };
    let b_other = if other.visible { other.bsdf * jacobian } else { 0.0 };
    if !with_nee {
        // Half-vector copies: the shift fails where the other end does not arrive.
        return [0.0, weight(1.0, r2 * (b_other / own.bsdf).powi(2))];
    }
    // J ℓ_y = ℓ_x: both ends see the same point.
    let nee = weight(1.0 + (b / own.nee).powi(2), r2 * (1.0 + (b_other / own.nee).powi(2)));
    let light2 = (own.nee / own.bsdf).powi(2);
    let bsdf = weight(1.0 + light2, r2 * (light2 + (b_other / own.bsdf).powi(2)));
    [nee, if own.visible { bsdf } else { 0.0 }]
}

#[test]
fn weights_of_all_techniques_sum_to_one() {
    let mut random = Random(0xabc, 0);
    for i in 0..20_000 {
        let jacobian = random.between(0.2, 5.0);
        let nee = random.between(0.05, 20.0);
        let mut end = |nee: f64, product: f64, visible: bool| Techniques {
            product,
            nee,
            bsdf: random.between(0.01, 10.0),
            visible,
        };
        let with_nee = i % 4 < 3;
        // Base visible; the other visible, occluded, or (half-vector) failed.
        let x = end(nee, 1.0, true);
        let y = end(nee / jacobian, 1.0 + f64::from(i % 7) * 0.3, i % 4 != 1);
        for mis in [true, false] {
            let pairs = PairWeights { mis };
            let from_x = weights(&pairs, &x, &y, jacobian, with_nee);
            let from_y = weights(&pairs, &y, &x, 1.0 / jacobian, with_nee);
            let sum: f64 = from_x.iter().chain(&from_y).sum();
            assert!((sum - 1.0).abs() < 2e-6, "{x:?} {y:?} J {jacobian}, mis {mis}: {from_x:?} + {from_y:?}");
        }
    }
    // Mixed classes and dead offsets: base-only weights, whatever the pairs.
    for mis in [true, false] {
        let alone =
            |ratio: f32| PairWeights { mis }.weight(splat(1.0 + ratio * ratio), splat(0.0)).as_array()[0];
        assert!((alone(0.3) + alone(1.0 / 0.3) - 1.0).abs() < 1e-6);
        assert_eq!(alone(0.0), 1.0);
    }
}
