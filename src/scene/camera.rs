//! Cameras: a film position to a ray. The camera looks along its −z, y up; row 0 of the film is the top.
//!
//! Film coordinates are the base measure (algorithm: importance ÷ pdf = 1), so a shift by a pixel has Jacobian 1.

use crate::math::warp::square_to_disk;
use crate::math::{Vec3x, f32x16, splat};
use glam::{Affine3A, Vec3};

/// A camera of the scene.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name in the file.
    pub name: String,
    /// Camera to world, without scale.
    pub to_world: Affine3A,
    /// Perspective or orthographic.
    pub projection: Projection,
    /// Radius of the lens, m; 0 is a pinhole.
    pub lens_radius: f32,
    /// Distance of the plane in focus along −z, m.
    pub focus_distance: f32,
}

/// How a film position becomes a direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in radians; the horizontal extent follows from the film's shape.
    Perspective {
        /// Full vertical angle, rad.
        yfov: f32,
    },
    /// Parallel rays; half the height of the view, m.
    Orthographic {
        /// Half height, m.
        ymag: f32,
    },
}

/// Sixteen camera rays: origins and unit directions.
#[derive(Clone, Copy, Debug, Default)]
pub struct CameraRays {
    /// World-space origins.
    pub origin: Vec3x,
    /// World-space unit directions.
    pub direction: Vec3x,
}

impl Camera {
    /// Rays through the film positions (x, y) in pixels, of a film of `width`×`height`; (lens_u, lens_v) in [0, 1)
    /// choose the point on the lens.
    #[inline]
    pub fn rays(
        &self,
        x: f32x16,
        y: f32x16,
        width: u32,
        height: u32,
        lens_u: f32x16,
        lens_v: f32x16,
    ) -> CameraRays {
        let half_height = splat(0.5 * height as f32);
        // Both axes in units of half the film's height.
        let sx = (x - splat(0.5 * width as f32)) / half_height;
        let sy = -(y - half_height) / half_height;
        let zero = f32x16::ZERO;
        let (mut origin, mut direction) = match self.projection {
            Projection::Perspective { yfov } => {
                let tan = splat((0.5 * yfov).tan());
                (Vec3x::ZERO, Vec3x::new(sx * tan, sy * tan, splat(-1.0)))
            }
            Projection::Orthographic { ymag } => {
                let mag = splat(ymag);
                (Vec3x::new(sx * mag, sy * mag, zero), Vec3x::splat(Vec3::NEG_Z))
            }
        };
        if self.lens_radius > 0.0 {
            let focus = direction.mul_add(splat(self.focus_distance), origin);
            let (lens_x, lens_y) = square_to_disk(lens_u, lens_v);
            let r = splat(self.lens_radius);
            origin += Vec3x::new(lens_x * r, lens_y * r, zero);
            direction = focus - origin;
        }
        let m = self.to_world.matrix3;
        let (ax, ay, az) =
            (Vec3x::splat(m.x_axis.into()), Vec3x::splat(m.y_axis.into()), Vec3x::splat(m.z_axis.into()));
        let rotate = |v: Vec3x| ax * v.x + ay * v.y + az * v.z;
        CameraRays {
            origin: rotate(origin) + Vec3x::splat(self.to_world.translation.into()),
            direction: rotate(direction).normalize(),
        }
    }
}
