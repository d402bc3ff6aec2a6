//! Scenes: meshes and instances go into a builder; a commit turns it into a scene that can be traced and that owns
//! every buffer Embree reads.

use crate::device::Device;
use crate::error::{Error, Result};
use embree4_sys as sys;
use glam::{Affine3A, Vec3A};
use std::mem::size_of;
use std::sync::Arc;

// Embree reads 16 bytes at every vertex, the last one included.
const _: () = assert!(size_of::<Vec3A>() == 16 && align_of::<Vec3A>() == 16);

/// How much time a commit takes for how fast a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuildQuality {
    /// Fastest to build.
    Low,
    /// Embree's default.
    Medium,
    /// Fastest to trace: spatial splits, where the scene is not robust.
    High,
}

/// Properties of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneOptions {
    /// Quality of the acceleration structure.
    pub quality: BuildQuality,
    /// No ray slips through a shared edge; 13–25 % slower.
    pub robust: bool,
}

/// A reference to an Embree scene.
#[derive(Debug)]
struct Handle(sys::RTCScene);

impl Drop for Handle {
    fn drop(&mut self) {
        // SAFETY: the one reference `rtcNewScene` gave.
        unsafe { sys::rtcReleaseScene(self.0) }
    }
}

/// A reference to an Embree geometry.
struct Geometry(sys::RTCGeometry);

impl Drop for Geometry {
    fn drop(&mut self) {
        // SAFETY: the one reference `rtcNewGeometry` gave; an attached geometry is held by its scene as well.
        unsafe { sys::rtcReleaseGeometry(self.0) }
    }
}

/// The vertices and indices of a mesh, kept alive for Embree.
type Buffers = (Arc<[Vec3A]>, Arc<[[u32; 3]]>);

/// Fields drop in order: the handle before what Embree reads through it, the device last.
#[derive(Debug)]
struct Inner {
    handle: Handle,
    buffers: Vec<Buffers>,
    children: Vec<Scene>,
    device: Device,
}

// SAFETY: a committed scene is only read, which Embree allows from any number of threads, and released once, which
// it allows from any thread.
unsafe impl Send for Inner {}
// SAFETY: as above.
unsafe impl Sync for Inner {}

/// A committed scene. Clones share it.
#[derive(Clone, Debug)]
pub struct Scene(Arc<Inner>);

impl Scene {
    pub(crate) fn handle(&self) -> sys::RTCScene {
        self.0.handle.0
    }

    /// The device it was built on.
    pub fn device(&self) -> &Device {
        &self.0.device
    }
}

/// A scene that is being put together.
#[derive(Debug)]
pub struct SceneBuilder(Inner);

impl SceneBuilder {
    /// An empty scene.
    pub fn new(device: &Device, options: SceneOptions) -> Result<Self> {
        // SAFETY: the device is alive, and is kept alive by `Inner`.
        let handle = unsafe { sys::rtcNewScene(device.handle()) };
        device.check()?;
        if handle.is_null() {
            return Err(Error::Embree("no scene, and no reason given".into()));
        }
        let handle = Handle(handle);
        let quality = match options.quality {
            BuildQuality::Low => sys::RTC_BUILD_QUALITY_LOW,
            BuildQuality::Medium => sys::RTC_BUILD_QUALITY_MEDIUM,
            BuildQuality::High => sys::RTC_BUILD_QUALITY_HIGH,
        };
        let flags = if options.robust { sys::RTC_SCENE_FLAG_ROBUST } else { sys::RTC_SCENE_FLAG_NONE };
        // SAFETY: the scene is alive and not committed.
        unsafe {
            sys::rtcSetSceneBuildQuality(handle.0, quality);
            sys::rtcSetSceneFlags(handle.0, flags);
        }
        device.check()?;
        Ok(Self(Inner { handle, buffers: Vec::new(), children: Vec::new(), device: device.clone() }))
    }

    /// Adds a mesh as geometry `id`, seen by rays whose mask has a bit in common with `mask`. Triangles with a
    /// vertex that is not finite are there and never hit.
    pub fn triangles(
        &mut self,
        id: u32,
        positions: Arc<[Vec3A]>,
        indices: Arc<[[u32; 3]]>,
        mask: u32,
    ) -> Result<()> {
        if let Some(index) = indices.iter().flatten().find(|&&index| index as usize >= positions.len()) {
            let count = positions.len();
            return Err(Error::Invalid(format!(
                "vertex index {index} of geometry {id}, with {count} vertices"
            )));
        }
        let device = &self.0.device;
        let geometry = new_geometry(device, sys::RTC_GEOMETRY_TYPE_TRIANGLE)?;
        // SAFETY: both slices have the formats, strides and counts given here, cannot change (they are shared and
        // have no interior mutability) and are kept by `Inner` until the scene is released. Indices are in range.
        unsafe {
            sys::rtcSetSharedGeometryBuffer(
                geometry.0,
                sys::RTC_BUFFER_TYPE_VERTEX,
                0,
                sys::RTC_FORMAT_FLOAT3,
                positions.as_ptr().cast(),
                0,
                size_of::<Vec3A>(),
                positions.len(),
            );
            sys::rtcSetSharedGeometryBuffer(
                geometry.0,
                sys::RTC_BUFFER_TYPE_INDEX,
                0,
                sys::RTC_FORMAT_UINT3,
                indices.as_ptr().cast(),
                0,
                size_of::<[u32; 3]>(),
                indices.len(),
            );
        }
        device.check()?;
        // Kept first: whether a failing attachment leaves Embree a reference is not for us to know.
        self.0.buffers.push((positions, indices));
        self.attach(&geometry, id, mask)
    }

    /// Adds `scene`, which has no instances itself, as instance `id`, placed by an invertible transform.
    pub fn instance(&mut self, id: u32, scene: &Scene, to_world: Affine3A, mask: u32) -> Result<()> {
        let device = &self.0.device;
        if !scene.0.children.is_empty() {
            return Err(Error::Invalid(format!("instance {id} is of a scene that has instances")));
        }
        if scene.device().handle() != device.handle() {
            return Err(Error::Invalid(format!("instance {id} is of a scene of another device")));
        }
        if !to_world.is_finite() || !to_world.inverse().is_finite() {
            return Err(Error::Invalid(format!("the transform of instance {id} has no inverse")));
        }
        let geometry = new_geometry(device, sys::RTC_GEOMETRY_TYPE_INSTANCE)?;
        let columns = to_world.to_cols_array();
        // SAFETY: geometry and scene are alive (the parent keeps the child); the twelve floats are copied.
        unsafe {
            sys::rtcSetGeometryInstancedScene(geometry.0, scene.handle());
            let format = sys::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
            sys::rtcSetGeometryTransform(geometry.0, 0, format, columns.as_ptr().cast());
        }
        device.check()?;
        self.0.children.push(scene.clone());
        self.attach(&geometry, id, mask)
    }

    fn attach(&self, geometry: &Geometry, id: u32, mask: u32) -> Result<()> {
        if id == sys::INVALID_ID {
            return Err(Error::Invalid(format!("{id} is the id of no geometry")));
        }
        // SAFETY: geometry and scene are alive; an id in use is an error that Embree detects.
        unsafe {
            sys::rtcSetGeometryMask(geometry.0, mask);
            sys::rtcCommitGeometry(geometry.0);
            sys::rtcAttachGeometryByID(self.0.handle.0, geometry.0, id);
        }
        self.0.device.check()
    }

    /// Builds the acceleration structure with the device's threads. Call it outside of other parallel work.
    pub fn commit(self) -> Result<Scene> {
        // SAFETY: the scene is alive, and this is the only reference to it.
        unsafe { sys::rtcCommitScene(self.0.handle.0) }
        self.0.device.check()?;
        Ok(Scene(Arc::new(self.0)))
    }
}

fn new_geometry(device: &Device, kind: sys::RTCGeometryType) -> Result<Geometry> {
    // SAFETY: the device is alive.
    let geometry = unsafe { sys::rtcNewGeometry(device.handle(), kind) };
    device.check()?;
    if geometry.is_null() {
        return Err(Error::Embree("no geometry, and no reason given".into()));
    }
    Ok(Geometry(geometry))
}
