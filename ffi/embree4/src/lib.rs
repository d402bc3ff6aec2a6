//! A safe API over the part of Embree 4 that a renderer needs, and the only place with unsafe code.
//!
//! A [`Device`] is configured with types and read back; a [`SceneBuilder`] takes triangle meshes and instances,
//! whose buffers are shared with Embree and owned by the [`Scene`] that [`SceneBuilder::commit`] returns; packets
//! of 16 (also 8 and 1) rays go through [`Scene::intersect16`] and [`Scene::occluded16`].
//!
//! Limits: triangles only, one level of instances, no motion blur, no callbacks but the memory monitor.

pub mod cpu;
mod device;
mod error;
mod packet;
mod query;
mod scene;

pub use cpu::flush_denormals;
pub use device::{Device, DeviceConfig, Isa};
pub use error::{Error, Result};
pub use packet::{INVALID_ID, Ray1, Ray8, Ray16, RayHit1, RayHit8, RayHit16, Valid8, Valid16};
pub use query::Coherence;
pub use scene::{BuildQuality, Scene, SceneBuilder, SceneOptions};

/// Version of the Embree headers this crate was compiled against: major, minor, patch.
pub const HEADERS_VERSION: [u32; 3] =
    [embree4_sys::RTC_VERSION_MAJOR, embree4_sys::RTC_VERSION_MINOR, embree4_sys::RTC_VERSION_PATCH];
