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
