//! S2, statistics: sampling follows the pdf, the pdf integrates to what sampling finds, energy is bounded.

use crate::Random;
use crate::chi_square::assert_follows;
use gdpt::math::{Frame, LANES, Mask, Rgb, Vec3x, f32x16, splat};
use gdpt::shade::{Bsdf, Parameters};
use glam::Vec3;
use std::f32::consts::{PI, TAU};

/// Rows of equal θ, so that cells are small at the poles, where lobes are narrow; an even number, so that the horizon,
/// where the pdf jumps, is an edge.
const ROWS: usize = 102;
const COLUMNS: usize = 202;
const CELLS: usize = ROWS * COLUMNS;
const SAMPLES: usize = 1_000_000;

/// Parameters by scalars.
#[derive(Clone, Copy)]
pub struct Case {
    pub name: &'static str,
    pub base: [f32; 3],
    pub metallic: f32,
    pub roughness: f32,
    pub specular: f32,
    pub ior: f32,
    pub transmission: f32,
    pub solid: bool,
}

const PLAIN: Case = Case {
    name: "Lambert",
    base: [1.0, 1.0, 1.0],
    metallic: 0.0,
    roughness: 1.0,
    specular: 0.0,
    ior: 1.5,
    transmission: 0.0,
    solid: false,
};

const COLOURED: [f32; 3] = [0.9, 0.5, 0.1];

/// Every lobe alone and in mixtures.
pub const CASES: [Case; 14] = [
    PLAIN,
    Case { name: "layer", roughness: 0.5, specular: 1.0, ..PLAIN },
    Case { name: "dense layer", base: COLOURED, roughness: 0.9, specular: 0.7, ior: 2.4, ..PLAIN },
    Case { name: "smooth layer", roughness: 0.0, specular: 1.0, ..PLAIN },
    Case { name: "white metal", metallic: 1.0, roughness: 0.4, ..PLAIN },
    Case { name: "coloured metal", base: COLOURED, metallic: 1.0, roughness: 0.25, ..PLAIN },
    Case { name: "roughest metal", metallic: 1.0, roughness: 1.0, ..PLAIN },
    Case { name: "rough glass", roughness: 0.4, transmission: 1.0, solid: true, ..PLAIN },
    Case { name: "roughest glass", roughness: 0.9, transmission: 1.0, solid: true, ..PLAIN },
    Case { name: "rough bubble", roughness: 0.5, transmission: 1.0, solid: true, ior: 0.75, ..PLAIN },
    Case { name: "rough sheet", base: COLOURED, roughness: 0.5, transmission: 1.0, ..PLAIN },
    Case {
        name: "solid mixture",
        base: COLOURED,
        metallic: 0.3,
        roughness: 0.6,
        specular: 0.5,
        transmission: 0.5,
        solid: true,
        ..PLAIN
    },
    Case { name: "thin mixture", metallic: 0.2, roughness: 0.7, specular: 1.0, transmission: 0.6, ..PLAIN },
    Case {
        name: "smooth mixture",
        base: COLOURED,
        metallic: 0.5,
        roughness: 0.0,
        specular: 1.0,
        transmission: 0.5,
        solid: true,
        ..PLAIN
    },
];

impl Case {
    pub fn bsdf(&self) -> Bsdf {
        let frame = Frame::from_normal(Vec3x::splat(Vec3::new(0.3, -0.8, 0.52).normalize()));
        let parameters = Parameters {
            base: Vec3x::splat(Vec3::from(self.base)),
            metallic: splat(self.metallic),
            roughness: splat(self.roughness),
            specular: splat(self.specular),
            specular_color: Rgb::grey(1.0),
            ior: splat(self.ior),
            transmission: splat(self.transmission),
            absorption: Rgb::ZERO,
            solid: Mask::from_fn(|_| self.solid),
        };
        Bsdf::new(frame, &parameters)
    }
}

/// Sixteen outgoing directions, one a lane: eight angles, from the normal to grazing, on both sides.
pub fn outgoing(bsdf: &Bsdf) -> Vec3x {
    const COSINES: [f32; 8] = [1.0, 0.99, 0.9, 0.7, 0.5, 0.3, 0.1, 0.01];
    let local = Vec3x::lanes(|i| {
        let z = COSINES[i % 8];
        let (sin, cos) = (0.7 * i as f32).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, if i < 8 { z } else { -z })
    });
    bsdf.frame.to_world(local)
}

/// Integrals over one cell.
#[derive(Clone, Copy, Default)]
struct Cell {
    pdf: f32x16,
    f: Rgb,
}

/// Calls `visit` with each cell, whether it is above the surface, and its integrals.
///
/// Points are jittered within strata: the density jumps where a microfacet turns edge-on, on lines that a fixed grid
/// would miss by the same amount in every cell of a row. Cells that hold a narrow lobe get more points.
fn integrate(bsdf: &Bsdf, wo: Vec3x, mut visit: impl FnMut(usize, bool, &Cell)) {
    const NARROW: f32 = 2000.0 / SAMPLES as f32;
    let mut random = Random::new(3);
    for index in 0..CELLS {
        let mut cell = integrate_cell(bsdf, wo, index, 14, &mut random);
        if cell.pdf.simd_gt(splat(NARROW)).any() {
            cell = integrate_cell(bsdf, wo, index, 64, &mut random);
        }
        visit(index, index / COLUMNS < ROWS / 2, &cell);
    }
}

/// Integrals over a cell with `n`² points.
fn integrate_cell(bsdf: &Bsdf, wo: Vec3x, index: usize, n: usize, random: &mut Random) -> Cell {
    let (row, column) = (index / COLUMNS, index % COLUMNS);
    let area = PI / ROWS as f32 * TAU / COLUMNS as f32 / (n * n) as f32;
    let mut cell = Cell::default();
    for i in 0..n * n {
        let y = ((i / n) as f32 + random.float()) / n as f32;
        let x = ((i % n) as f32 + random.float()) / n as f32;
        let (r, z) = (PI * (row as f32 + y) / ROWS as f32).sin_cos();
        let (sin, cos) = (TAU * (column as f32 + x) / COLUMNS as f32).sin_cos();
        let (f, pdf) = bsdf.eval(wo, bsdf.frame.to_world(Vec3x::splat(Vec3::new(r * cos, r * sin, z))));
        cell.pdf += pdf * splat(area * r);
        cell.f += f * splat(area * r);
    }
    cell
}

/// The cell of a local direction.
fn cell(w: Vec3) -> usize {
    let theta = w.x.hypot(w.y).atan2(w.z);
    let row = (theta / PI * ROWS as f32) as usize;
    let turn = (w.y.atan2(w.x) / TAU).rem_euclid(1.0);
    let column = (turn * COLUMNS as f32) as usize;
    row.min(ROWS - 1) * COLUMNS + column.min(COLUMNS - 1)
}

/// Albedo of one side of a lane's surface, Dirac lobe included; × eta² where light crosses into a solid.
#[derive(Clone, Copy, Default)]
struct Albedo {
    above: Rgb,
    below: Rgb,
}

fn check_case(case: &Case) {
    let bsdf = case.bsdf();
    let wo = outgoing(&bsdf);
    let n = SAMPLES as f64;
    // The last cell holds Dirac events and samples that found nothing.
    let mut observed = vec![[0.0_f64; CELLS + 1]; LANES];
    let mut found = [0.0_f64; LANES];
    let mut random = Random::new(case.name.len() as u32);
    for _ in 0..SAMPLES {
        let s = bsdf.sample(wo, random.wide(), random.wide(), random.wide(), Mask::ALL);
        let local = bsdf.frame.to_local(s.wi);
        for (lane, counts) in observed.iter_mut().enumerate() {
            let smooth = s.valid.get(lane) && !s.dirac.get(lane);
            counts[if smooth { cell(local.lane(lane)) } else { CELLS }] += 1.0;
            found[lane] += f64::from(u8::from(smooth));
        }
    }
    let mut expected = vec![[0.0_f64; CELLS + 1]; LANES];
    let mut mass = [0.0_f64; LANES];
    let mut albedo = Albedo::default();
    integrate(&bsdf, wo, |index, above, cell| {
        for (lane, expected) in expected.iter_mut().enumerate() {
            let p = f64::from(cell.pdf.as_array()[lane]);
            expected[index] = p * n;
            mass[lane] += p;
        }
        let side = if above { &mut albedo.above } else { &mut albedo.below };
        *side += cell.f;
    });
    for lane in 0..LANES {
        let what = format!("{} from direction {lane}", case.name);
        assert!(
            (found[lane] / n - mass[lane]).abs() < 2e-3,
            "{what}: the pdf integrates to {}, sampling finds {}",
            mass[lane],
            found[lane] / n
        );
        expected[lane][CELLS] = (n - mass[lane] * n).max(0.0);
        if mass[lane] > 0.0 {
            assert_follows(&what, &observed[lane], &expected[lane], CASES.len() * LANES);
        }
    }
    check_energy(case, &bsdf, wo, &albedo);
}

/// White furnace: no direction returns more than it gets; smooth dielectrics and layers over white return all.
fn check_energy(case: &Case, bsdf: &Bsdf, wo: Vec3x, smooth: &Albedo) {
    let zero = f32x16::ZERO;
    let eta = bsdf.relative_ior(wo);
    let behind = Mask(wo.dot(bsdf.frame.n).simd_lt(zero));
    let (reflected, crossed) =
        (behind.select(smooth.below, smooth.above), behind.select(smooth.above, smooth.below));
    let mirror = bsdf.eval_dirac(wo, Mask::NONE);
    let through = bsdf.eval_dirac(wo, Mask::ALL);
    let total = reflected + mirror.f + (crossed + through.f) * (eta * eta);
    for lane in 0..LANES {
        let total = total.lane(lane);
        let what = format!("{} from direction {lane}: {total}", case.name);
        assert!(total.max_element() <= 1.001, "creates energy: {what}");
        let lossless = case.base == [1.0; 3] && (case.roughness == 0.0 || case.name == "Lambert");
        assert!(!lossless || (total.min_element() - 1.0).abs() < 0.005, "loses energy: {what}");
    }
}

macro_rules! distribution_tests {
    ($($name:ident: $index:expr),* $(,)?) => {$(
        #[test]
        fn $name() {
            check_case(&CASES[$index]);
        }
    )*};
}

distribution_tests! {
    lambert: 0, layer: 1, dense_layer: 2, smooth_layer: 3, white_metal: 4, coloured_metal: 5, roughest_metal: 6,
    rough_glass: 7, roughest_glass: 8, rough_bubble: 9, rough_sheet: 10, solid_mixture: 11, thin_mixture: 12,
    smooth_mixture: 13,
}
