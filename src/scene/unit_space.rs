//! Unit space: the world, moved and scaled so that its bounding box is centred on the origin and the corners of the box lie on the unit sphere.
//!
//! All stages work in unit space, so a box of one millimetre and one of ten kilometres have equal coordinates, and one set of tolerances, derived from
//! float precision at 1, serves all. Radiance and irradiance do not change with scale.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{Camera, Lens, WorldCamera};

/// A world is far if its centre lies this many of its radii from the origin. Coordinates there round to 2.4e-7 of the radius.
const FAR: f64 = 8.0;

/// The transform between world space and unit space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitSpace {
    /// World position of the origin.
    center: DVec3,
    /// World length of one unit of unit space.
    scale: f64,
}

impl UnitSpace {
    /// The unit space of a bounding box, given by two opposite corners in world space.
    pub fn around([min, max]: [DVec3; 2]) -> Self {
        Self { center: 0.5 * (min + max), scale: 0.5 * (max - min).length() }
    }

    /// Converts a camera from world space to unit space.
    pub fn enter_camera(self, WorldCamera { eye, target, up, fov_y_degrees, lens }: WorldCamera) -> Camera {
        // The direction is kept instead of the target, because rounding could move the target onto the eye.
        let forward = (target - eye).normalize().as_vec3();
        let eye = self.enter_point(eye);
        let lens = lens.map(|Lens { radius, focus_distance }| Lens {
            radius: self.length_to_unit(radius),
            focus_distance: self.length_to_unit(focus_distance),
        });
        Camera { eye, target: eye + forward, up, fov_y_degrees, lens }
    }

    /// Converts a world position to unit space.
    pub fn enter_point(self, position: impl Into<DVec3>) -> Vec3 {
        ((position.into() - self.center) / self.scale).as_vec3()
    }

    /// Converts a position in unit space to world space.
    pub fn to_world(self, position: Vec3) -> DVec3 {
        position.as_dvec3() * self.scale + self.center
    }

    /// The origin relative to which 32 bits hold world positions: zero, unless the world lies so far from there that they would round by more than a
    /// few ten-millionths of its size. Then it is a point near the middle of the world, in few digits.
    pub fn local_origin(self) -> DVec3 {
        if self.center.length() > FAR * self.scale && self.scale > 0.0 {
            let step = self.scale.log2().ceil().exp2();
            (self.center / step).round() * step
        } else {
            DVec3::ZERO
        }
    }

    /// Converts a world length to unit space.
    pub fn length_to_unit(self, length: f32) -> f32 {
        (f64::from(length) / self.scale) as f32
    }

    /// Converts a luminous intensity, which over a squared length is an illuminance, from world space to unit space.
    pub fn intensity_to_unit(self, intensity: Vec3) -> Vec3 {
        (intensity.as_dvec3() / (self.scale * self.scale)).as_vec3()
    }

    /// Converts a length in unit space to world space.
    pub fn length_to_world(self, length: f32) -> f32 {
        (f64::from(length) * self.scale) as f32
    }
}
