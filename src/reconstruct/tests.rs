//! Oracles and properties of the solvers.

use super::*;

pub(super) struct Noise(u64);
impl Noise {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }
}

#[test]
fn tune() {
    let size: usize = std::env::var("SZ").map_or(512, |s| s.parse().unwrap());
    let (w, h) = if size == 1080 { (1920, 1080) } else { (size, size) };
    let outl: f64 = std::env::var("OUT").map_or(0.01, |s| s.parse().unwrap());
    let mut n = Noise(7);
    let img = Plane::from_fn(w, h, |x, y| {
        let b = if (x / 40 + y / 33) % 2 == 0 { 0.9 } else { 0.2 };
        let s = (x as f32 * 0.05).sin() * 0.1 + (y as f32 / h as f32) * 0.3;
        [b + s, b * 0.5 + s, b * 0.25 + s]
    });
    let mut noisy = |p: &Plane, s: f64| {
        Plane { data: p.data.iter().map(|v| { let o = if n.uniform() < outl { -n.uniform().ln() * 20.0 } else { 1.0 };
            v.map(|v| v + (s * o * n.normal()) as f32) }).collect(), ..p.clone() }
    };
    let d = |dx: usize, dy: usize| Plane::from_fn(w, h, |x, y| if x + dx < w && y + dy < h { let (a, b) = (img.at(x, y), img.at(x + dx, y + dy)); std::array::from_fn(|c| b[c] - a[c]) } else { [0.0; 3] });
    let (primal, dx, dy) = (noisy(&img, 0.3), noisy(&d(1, 0), 0.05), noisy(&d(0, 1), 0.05));
    let input = Input { primal: &primal, dx: &dx, dy: &dy };
    let mse = |p: &Plane| p.data.iter().zip(&img.data).map(|(a, b)| (0..3).map(|c| ((a[c] - b[c]) as f64).powi(2)).sum::<f64>()).sum::<f64>() / (3 * w * h) as f64;
    for _ in 0..3 {
        let t = std::time::Instant::now();
        let s = reconstruct(&input, Method::L2, 0.2);
        eprintln!("L2 {:?} residual {:e} mse {:e} primal {:e}", t.elapsed(), s.residual, mse(&s.image), mse(&primal));
    }
    let p = rows::Problem::new(&input);
    if size <= 512 {
        let s = l1::solve_with(&p, 0.2, l1::Schedule { outer: 64, steps: 30, reg: 1.0, decay: 0.7, tolerance: -1.0 });
        eprintln!("L1Q mse {:e} resid {:e}", mse(&s.image), s.residual);
    }
    for (outer, steps, reg, decay) in [(10, 3, 0.3, 0.5), (10, 2, 0.3, 0.5), (10, 2, 0.5, 0.6), (16, 1, 0.5, 0.7), (10, 3, 0.1, 0.5), (10, 2, 0.1, 0.7), (16, 1, 0.1, 0.8)] {
        eprintln!("outer {outer} steps {steps} {reg} {decay}");
        let t = std::time::Instant::now();
        let s = l1::solve_with(&p, 0.2, l1::Schedule { outer, steps, reg, decay, tolerance: -1.0 });
        eprintln!("  {:?} mse {:e}", t.elapsed(), mse(&s.image));
        if size == 1080 { return; }
    }
}
