//! The seam on Embree 4: the one module that speaks to `embree4`.
//!
//! A mesh that is placed by the identity is geometry of the top-level scene, with the index of its instance as id;
//! every other placement is an Embree instance of a scene that holds one mesh and that all placements of it share.
//! A transform without an inverse, which Embree cannot instance, is applied to the vertices instead.
//!
//! Rays that are not finite are masked off and counted: Embree would take fifty times as long for each.
//!
//! Limits: single precision throughout; hits are equal to the last bit for any thread count and build quality on one
//! instruction set, not across instruction sets.

use super::{Accel, Coherence, Hits, Rays, Visible};
use crate::error::{Error, Result};
use crate::math::{Compare, LANES, Mask, f32x16, splat};
use crate::scene::{Instance, Mesh, Scene};
use embree4::{BuildQuality, Device, DeviceConfig, INVALID_ID, Ray16, RayHit16, SceneOptions, Valid16};
use glam::Vec3A;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

pub use embree4::flush_denormals;

/// Mask bit of geometry that alpha cannot open.
const OPAQUE: u32 = 1;
/// Mask bit of geometry that alpha can open.
const COVERAGE: u32 = 2;

/// Embree's acceleration structure of a scene.
#[derive(Debug)]
pub struct EmbreeAccel {
    top: embree4::Scene,
    /// The mask bits that occur in the scene.
    present: u32,
    robust: bool,
    /// Active lanes that were masked off because their ray was not finite.
    rejected: AtomicU64,
}

impl EmbreeAccel {
    /// Builds it with `threads` threads (0: one a CPU). `robust` closes the hairline gaps between triangles;
    /// `max_memory` bounds the bytes Embree holds. Not to be called from inside parallel work.
    pub fn new(scene: &Scene, threads: usize, robust: bool, max_memory: Option<u64>) -> Result<Self> {
        let device = Device::new(DeviceConfig { threads, max_memory, ..Default::default() })?;
        let quality = if robust { BuildQuality::Medium } else { BuildQuality::High };
        let options = SceneOptions { quality, robust };
        let mut top = embree4::SceneBuilder::new(&device, options)?;
        let mut shared: Vec<Option<embree4::Scene>> = vec![None; scene.meshes.len()];
        let mut present = 0;
        for (id, instance) in (0..INVALID_ID).zip(&scene.instances) {
            let mesh = &scene.meshes[instance.mesh as usize];
            let mask = mask_of(scene, mesh);
            present |= mask;
            if instance.is_identity {
                top.triangles(id, mesh.positions.clone(), mesh.triangles.clone(), mask)?;
            } else if instance.to_world.inverse().is_finite() {
                let slot = &mut shared[instance.mesh as usize];
                let child = match slot {
                    Some(child) => child,
                    None => slot.insert(scene_of(&device, options, mesh, mask)?),
                };
                top.instance(id, child, instance.to_world, mask)?;
            } else {
                top.triangles(id, in_world(mesh, instance), mesh.triangles.clone(), mask)?;
            }
        }
        Ok(Self { top: top.commit()?, present, robust, rejected: AtomicU64::new(0) })
    }

    /// Version of the library, instruction width and memory, for the log: "Embree 4.4.0, 16 wide, 12.3 MB".
    pub fn describe(&self) -> String {
        let device = self.top.device();
        let [major, minor, patch] = device.version();
        let megabytes = device.memory_used() as f64 * 1e-6;
        format!("Embree {major}.{minor}.{patch}, {} wide, {megabytes:.1} MB", device.native_width())
    }

    /// Bytes Embree holds.
    pub fn memory_used(&self) -> u64 {
        self.top.device().memory_used()
    }

    /// Active rays so far that were not finite and therefore hit nothing.
    pub fn rejected_rays(&self) -> u64 {
        self.rejected.load(Relaxed)
    }

    /// The rays in Embree's layout.
    #[inline(always)]
    fn ray16(&self, rays: &Rays, visible: Visible) -> Ray16 {
        let (o, d) = (rays.origin, rays.direction);
        // Embree's robust triangle test takes hits at `tnear` itself, which the seam leaves out.
        let tnear = if self.robust { next_up(rays.tnear) } else { rays.tnear };
        Ray16::new(
            [o.x.to_array(), o.y.to_array(), o.z.to_array()],
            [d.x.to_array(), d.y.to_array(), d.z.to_array()],
            tnear.to_array(),
            rays.tfar.to_array(),
            mask_for(visible),
        )
    }

    /// The active lanes that may be traced: those with finite rays, and none where nothing is to be seen.
    #[inline(always)]
    fn traceable(&self, rays: &Rays, active: Mask, visible: Visible) -> Mask {
        if mask_for(visible) & self.present == 0 {
            return Mask::NONE;
        }
        // A sum of products with zero is zero where all factors are finite and NaN elsewhere.
        let zero = f32x16::ZERO;
        let (o, d) = (rays.origin, rays.direction);
        let sum = o.x.mul_add(zero, o.y.mul_add(zero, o.z * zero));
        let sum = d.x.mul_add(zero, d.y.mul_add(zero, d.z.mul_add(zero, sum)));
        let finite = sum.same(zero) & rays.tnear.lt(splat(f32::INFINITY)) & rays.tfar.same(rays.tfar);
        let bad = active.and_not(finite);
        if bad.any() {
            self.rejected.fetch_add(u64::from(bad.count()), Relaxed);
        }
        active & finite & rays.tnear.le(rays.tfar)
    }
}

impl Accel for EmbreeAccel {
    #[inline]
    fn intersect16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Hits {
        let active = self.traceable(rays, active, visible);
        let mut packet = RayHit16::new(self.ray16(rays, visible));
        if active.any() {
            self.top.intersect16(&valid16(active), &mut packet, hint(coherence));
        }
        let (geometry, instance) = (packet.geometry(), packet.instance());
        let hit = |i: usize| if geometry[i] == INVALID_ID { 0 } else { u32::MAX };
        Hits {
            valid: Mask(bytemuck::cast(std::array::from_fn::<u32, LANES, _>(hit))),
            t: f32x16::new(*packet.t()),
            u: f32x16::new(*packet.u()),
            v: f32x16::new(*packet.v()),
            // A mesh of the top-level scene carries the index itself.
            instance: std::array::from_fn(
                |i| if instance[i] == INVALID_ID { geometry[i] } else { instance[i] },
            ),
            primitive: *packet.primitive(),
        }
    }

    #[inline]
    fn occluded16(&self, rays: &Rays, active: Mask, visible: Visible, coherence: Coherence) -> Mask {
        let active = self.traceable(rays, active, visible);
        if active.none() {
            return Mask::NONE;
        }
        let mut packet = self.ray16(rays, visible);
        self.top.occluded16(&valid16(active), &mut packet, hint(coherence));
        // `tfar` of a traced lane was not below `tnear`, so only Embree can have made it −∞.
        active & f32x16::new(*packet.tfar()).same(splat(f32::NEG_INFINITY))
    }
}

/// Fails with the reason if this CPU lacks instructions that were compiled in. Call it before any wide code runs.
pub fn check_cpu() -> Result<()> {
    let missing = embree4::cpu::missing_features();
    if missing.is_empty() {
        return Ok(());
    }
    Err(Error::Backend(format!(
        "this program was compiled for a CPU with {}, which this one lacks; build it here, or for all machines with \
         RUSTFLAGS=\"-C target-cpu=x86-64-v3\"",
        missing.join(", ")
    )))
}

impl From<embree4::Error> for Error {
    fn from(error: embree4::Error) -> Self {
        match error {
            embree4::Error::OutOfMemory(what) => Self::OutOfMemory(format!("Embree: {what}")),
            other => Self::Backend(other.to_string()),
        }
    }
}

#[inline(always)]
fn hint(coherence: Coherence) -> embree4::Coherence {
    match coherence {
        Coherence::Coherent => embree4::Coherence::Coherent,
        Coherence::Incoherent => embree4::Coherence::Incoherent,
    }
}

#[inline(always)]
fn mask_for(visible: Visible) -> u32 {
    match visible {
        Visible::All => OPAQUE | COVERAGE,
        Visible::Opaque => OPAQUE,
        Visible::Coverage => COVERAGE,
    }
}

#[inline(always)]
fn valid16(mask: Mask) -> Valid16 {
    Valid16::new(bytemuck::cast(mask.0))
}

/// The next larger float; for x ≥ 0, and never subnormal, which would count as zero.
#[inline(always)]
fn next_up(x: f32x16) -> f32x16 {
    let bits: [u32; LANES] = bytemuck::cast(x);
    let next: f32x16 = bytemuck::cast(bits.map(|bits| bits.wrapping_add(1)));
    next.fast_max(splat(f32::MIN_POSITIVE))
}

fn mask_of(scene: &Scene, mesh: &Mesh) -> u32 {
    if scene.materials[mesh.material as usize].has_coverage() { COVERAGE } else { OPAQUE }
}

/// A scene of one mesh.
fn scene_of(device: &Device, options: SceneOptions, mesh: &Mesh, mask: u32) -> Result<embree4::Scene> {
    let mut builder = embree4::SceneBuilder::new(device, options)?;
    builder.triangles(0, mesh.positions.clone(), mesh.triangles.clone(), mask)?;
    Ok(builder.commit()?)
}

/// The vertices of a mesh where an instance puts them.
fn in_world(mesh: &Mesh, instance: &Instance) -> Arc<[Vec3A]> {
    mesh.positions.iter().map(|&p| instance.to_world.transform_point3a(p)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::BruteAccel;
    use crate::math::{Vec3x, lanes};
    use crate::scene::Material;
    use glam::{Affine3A, Vec3};

    /// A bumpy sheet of `2 n²` triangles over the unit square, placed by each of `transforms`.
    fn sheets(n: u32, transforms: &[Affine3A]) -> Scene {
        let vertex = |i: u32| {
            let (x, y) = ((i % (n + 1)) as f32 / n as f32, (i / (n + 1)) as f32 / n as f32);
            Vec3A::new(x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos())
        };
        let quad = |i: u32| {
            let a = i / n * (n + 1) + i % n;
            [[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]
        };
        let mesh = Mesh {
            name: "sheet".into(),
            positions: (0..(n + 1) * (n + 1)).map(vertex).collect(),
            triangles: (0..n * n).flat_map(quad).collect(),
            normals: None,
            tangents: None,
            uvs: [None, None],
            colors: None,
            material: 0,
        };
        let instance = |&to_world: &Affine3A| Instance {
            mesh: 0,
            to_world,
            is_identity: to_world == Affine3A::IDENTITY,
        };
        Scene {
            meshes: vec![mesh],
            instances: transforms.iter().map(instance).collect(),
            materials: vec![Material::default()],
            ..Scene::default()
        }
    }

    /// Slanted rays from z = 2 that all meet a sheet over the unit square.
    fn slanted() -> Rays {
        let origin =
            Vec3x::lanes(|i| Vec3::new(i as f32 / 17.0 + 0.031, (i * 7 % 16) as f32 / 17.0 + 0.043, 2.0));
        Rays::new(origin, Vec3x::splat(Vec3::new(0.01, 0.005, -1.0)))
    }

    fn intersect(accel: &EmbreeAccel, rays: &Rays) -> Hits {
        accel.intersect16(rays, Mask::ALL, Visible::All, Coherence::Incoherent)
    }

    #[test]
    fn rays_that_are_not_finite_hit_nothing_and_are_counted() {
        let accel =
            EmbreeAccel::new(&sheets(4, &[Affine3A::IDENTITY]), 1, false, None).expect("a valid scene");
        let good = slanted();
        assert!(intersect(&accel, &good).valid.all());
        assert_eq!(accel.rejected_rays(), 0);
        type Spoil = fn(&mut Rays, f32x16);
        let spoil: [(Spoil, f32); 8] = [
            (|rays, x| rays.origin.x = x, f32::NAN),
            (|rays, x| rays.origin.y = x, f32::INFINITY),
            (|rays, x| rays.origin.z = x, f32::NEG_INFINITY),
            (|rays, x| rays.direction.x = x, f32::NAN),
            (|rays, x| rays.direction.y = x, f32::NEG_INFINITY),
            (|rays, x| rays.direction.z = x, f32::INFINITY),
            (|rays, x| rays.tnear = x, f32::NAN),
            (|rays, x| rays.tfar = x, f32::NAN),
        ];
        let odd = Mask::from_bits(0xaaaa);
        for (round, (spoil, value)) in (0u64..).zip(spoil) {
            let mut bad = good;
            spoil(&mut bad, splat(value));
            let rays = Rays {
                origin: odd.select(bad.origin, good.origin),
                direction: odd.select(bad.direction, good.direction),
                tnear: odd.select(bad.tnear, good.tnear),
                tfar: odd.select(bad.tfar, good.tfar),
            };
            assert_eq!(intersect(&accel, &rays).valid.bits(), 0x5555, "round {round}");
            let occluded = accel.occluded16(&rays, Mask::ALL, Visible::All, Coherence::Coherent);
            assert_eq!(occluded.bits(), 0x5555, "round {round}");
            assert_eq!(accel.rejected_rays(), 16 * (round + 1));
            // In lanes that are not active they are nobody's business.
            accel.intersect16(&rays, !odd, Visible::All, Coherence::Coherent);
            assert_eq!(accel.rejected_rays(), 16 * (round + 1));
        }
    }

    #[test]
    fn flattening_transforms_are_hit_like_any_other() {
        let flat = Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0));
        let point = Affine3A::from_scale(Vec3::ZERO);
        let scene = sheets(5, &[point, flat]);
        let (accel, brute) = (EmbreeAccel::new(&scene, 1, false, None), BruteAccel::new(&scene));
        let (accel, brute) = (accel.expect("a valid scene"), brute.expect("a valid scene"));
        let rays = slanted();
        let (ours, oracle) = (
            intersect(&accel, &rays),
            brute.intersect16(&rays, Mask::ALL, Visible::All, Coherence::Coherent),
        );
        assert!(ours.valid.all() && ours.instance == [1; LANES]);
        assert_eq!(ours.primitive, oracle.primitive);
        assert!((ours.t - oracle.t).abs().lt(splat(1e-6)).all());
    }

    #[test]
    fn thread_count_and_build_leave_no_trace_in_the_hits() {
        let turned = Affine3A::from_rotation_y(0.2);
        let scene = sheets(50, &[Affine3A::IDENTITY, turned, Affine3A::from_translation(Vec3::Z)]);
        let hits = [1, 2, 3].map(|threads| {
            let accel = EmbreeAccel::new(&scene, threads, false, None).expect("a valid scene");
            let mut all = Vec::new();
            for k in 0..200 {
                let mut rays = slanted();
                rays.origin.x += lanes(|i| ((i * 31 + k * 17) % 101) as f32 * 1e-3);
                let hits = intersect(&accel, &rays);
                all.push((hits.t.to_array(), hits.u.to_array(), hits.instance, hits.primitive));
            }
            all
        });
        assert!(hits[0] == hits[1] && hits[0] == hits[2]);
    }

    #[test]
    fn too_little_memory_is_its_own_error() {
        let scene = sheets(100, &[Affine3A::IDENTITY, Affine3A::from_rotation_x(1.0)]);
        let error = EmbreeAccel::new(&scene, 2, false, Some(100_000)).expect_err("20,000 triangles");
        assert!(matches!(error, Error::OutOfMemory(_)), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
        let accel = EmbreeAccel::new(&scene, 2, false, Some(1 << 30)).expect("1 GiB is enough");
        assert!(accel.memory_used() > 100_000);
        assert!(accel.describe().starts_with("Embree 4."), "{}", accel.describe());
    }

    #[test]
    fn this_machine_has_what_was_compiled_in() {
        check_cpu().expect("the tests are built where they run");
    }
}
