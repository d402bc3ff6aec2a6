//! Rays and hits in Embree's layout, lane masks in the form it reads. All are aligned as it asks for (64 bytes for
//! packets of 16).

use embree4_sys as sys;

/// The id where nothing was hit, and the instance id of a hit outside of any instance.
pub const INVALID_ID: u32 = sys::INVALID_ID;

/// Packet types of one width.
macro_rules! packet {
    ($lanes:literal, $align:literal, $ray:ident($raw_ray:ident), $rayhit:ident($raw_rayhit:ident),
     $valid:ident, $bits:ty) => {
        #[doc = concat!("Which of ", $lanes, " lanes are active.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(C, align($align))]
        pub struct $valid(pub(crate) [i32; $lanes]);

        impl $valid {
            /// From one integer a lane: −1 active, 0 not.
            #[inline(always)]
            pub fn new(lanes: [i32; $lanes]) -> Self {
                Self(lanes)
            }

            /// Lane i is active where bit i is set.
            #[inline(always)]
            pub fn from_bits(bits: $bits) -> Self {
                Self(std::array::from_fn(|i| -i32::from(bits >> i & 1 != 0)))
            }
        }

        #[doc = concat!($lanes, " rays.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $ray(pub(crate) sys::$raw_ray);

        impl $ray {
            /// From origins, directions (any length), ends of the segments in units of those lengths, and the
            /// mask of the geometry to see. Needs 0 ≤ `tnear` ≤ `tfar`, else the ray meets nothing.
            #[inline(always)]
            pub fn new(
                origin: [[f32; $lanes]; 3],
                direction: [[f32; $lanes]; 3],
                tnear: [f32; $lanes],
                tfar: [f32; $lanes],
                mask: u32,
            ) -> Self {
                let [org_x, org_y, org_z] = origin;
                let [dir_x, dir_y, dir_z] = direction;
                Self(sys::$raw_ray {
                    org_x,
                    org_y,
                    org_z,
                    tnear,
                    dir_x,
                    dir_y,
                    dir_z,
                    time: [0.0; $lanes],
                    tfar,
                    mask: [mask; $lanes],
                    id: [0; $lanes],
                    flags: [0; $lanes],
                })
            }

            /// Ends of the segments; −∞ where [`crate::Scene`] found the ray occluded.
            #[inline(always)]
            pub fn tfar(&self) -> &[f32; $lanes] {
                &self.0.tfar
            }
        }

        #[doc = concat!($lanes, " rays with their closest hits.")]
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $rayhit(pub(crate) sys::$raw_rayhit);

        impl $rayhit {
            /// Rays that have not hit anything yet.
            #[inline(always)]
            pub fn new(ray: $ray) -> Self {
                let mut raw = sys::$raw_rayhit { ray: ray.0, ..Default::default() };
                raw.hit.geomID = [INVALID_ID; $lanes];
                raw.hit.instID[0] = [INVALID_ID; $lanes];
                Self(raw)
            }

            /// Distance of the hit in units of the direction's length; the given `tfar` without one.
            #[inline(always)]
            pub fn t(&self) -> &[f32; $lanes] {
                &self.0.ray.tfar
            }

            /// Barycentric weight of the triangle's second vertex; 0 without a hit.
            #[inline(always)]
            pub fn u(&self) -> &[f32; $lanes] {
                &self.0.hit.u
            }

            /// Barycentric weight of the triangle's third vertex; 0 without a hit.
            #[inline(always)]
            pub fn v(&self) -> &[f32; $lanes] {
                &self.0.hit.v
            }

            /// Index of the triangle in its mesh; 0 without a hit.
            #[inline(always)]
            pub fn primitive(&self) -> &[u32; $lanes] {
                &self.0.hit.primID
            }

            /// Id of the mesh in its scene, [`INVALID_ID`] without a hit.
            #[inline(always)]
            pub fn geometry(&self) -> &[u32; $lanes] {
                &self.0.hit.geomID
            }

            /// Id of the instance, [`INVALID_ID`] for a mesh of the scene itself.
            #[inline(always)]
            pub fn instance(&self) -> &[u32; $lanes] {
                &self.0.hit.instID[0]
            }
        }
    };
}

packet!(16, 64, Ray16(RTCRay16), RayHit16(RTCRayHit16), Valid16, u16);
packet!(8, 32, Ray8(RTCRay8), RayHit8(RTCRayHit8), Valid8, u8);

/// One ray.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Ray1(pub(crate) sys::RTCRay);

impl Ray1 {
    /// From origin, direction, ends of the segment and geometry mask; as [`Ray16::new`].
    #[inline(always)]
    pub fn new(origin: [f32; 3], direction: [f32; 3], tnear: f32, tfar: f32, mask: u32) -> Self {
        let [org_x, org_y, org_z] = origin;
        let [dir_x, dir_y, dir_z] = direction;
        let (time, id, flags) = (0.0, 0, 0);
        Self(sys::RTCRay { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags })
    }

    /// End of the segment; −∞ where [`crate::Scene`] found the ray occluded.
    #[inline(always)]
    pub fn tfar(&self) -> f32 {
        self.0.tfar
    }
}

/// One ray with its closest hit.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct RayHit1(pub(crate) sys::RTCRayHit);

impl RayHit1 {
    /// A ray that has not hit anything yet.
    #[inline(always)]
    pub fn new(ray: Ray1) -> Self {
        let mut raw = sys::RTCRayHit { ray: ray.0, ..Default::default() };
        raw.hit.geomID = INVALID_ID;
        raw.hit.instID[0] = INVALID_ID;
        Self(raw)
    }

    /// Distance of the hit in units of the direction's length; the given `tfar` without one.
    #[inline(always)]
    pub fn t(&self) -> f32 {
        self.0.ray.tfar
    }

    /// Barycentric weights of the triangle's second and third vertex; 0 without a hit.
    #[inline(always)]
    pub fn uv(&self) -> [f32; 2] {
        [self.0.hit.u, self.0.hit.v]
    }

    /// Index of the triangle in its mesh; 0 without a hit.
    #[inline(always)]
    pub fn primitive(&self) -> u32 {
        self.0.hit.primID
    }

    /// Id of the mesh in its scene, [`INVALID_ID`] without a hit.
    #[inline(always)]
    pub fn geometry(&self) -> u32 {
        self.0.hit.geomID
    }

    /// Id of the instance, [`INVALID_ID`] for a mesh of the scene itself.
    #[inline(always)]
    pub fn instance(&self) -> u32 {
        self.0.hit.instID[0]
    }
}
