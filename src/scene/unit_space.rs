//! Unit space: the world moved and scaled so that its bounding box is centred on the origin and the box's corners lie on the unit sphere.
//!
//! All stages work there. A box one millimetre wide and one ten kilometres wide are then the same numbers, and one set of
//! tolerances, derived from float precision at 1, serves every scene. Radiance and irradiance do not change with scale.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{Camera, Lens};

/// The way between world space and unit space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnitSpace {
    /// World position of the origin.
    center: DVec3,
    /// World length of one unit.
    scale: f64,
}

impl UnitSpace {
    /// The unit space of the box between these corners, in world space.
    pub fn around([min, max]: [DVec3; 2]) -> Self {
        Self { center: 0.5 * (min + max), scale: 0.5 * (max - min).length() }
    }

    /// A camera in world space as unit space has it.
    pub fn enter_camera(self, camera: Camera) -> Camera {
        // The direction is kept, and not the target, which may fall together with the eye.
        let forward = (camera.target.as_dvec3() - camera.eye.as_dvec3()).normalize().as_vec3();
        let eye = self.enter_point(camera.eye);
        let lens = camera.lens.map(|Lens { radius, focus_distance }| Lens {
            radius: self.length_to_unit(radius),
            focus_distance: self.length_to_unit(focus_distance),
        });
        Camera { eye, target: eye + forward, lens, ..camera }
    }

    /// Position in unit space of a world position.
    pub fn enter_point(self, position: impl Into<DVec3>) -> Vec3 {
        ((position.into() - self.center) / self.scale).as_vec3()
    }

    /// World position of a position in unit space.
    pub fn to_world(self, position: Vec3) -> Vec3 {
        (position.as_dvec3() * self.scale + self.center).as_vec3()
    }

    /// Length in unit space of a world length.
    pub fn length_to_unit(self, length: f32) -> f32 {
        (f64::from(length) / self.scale) as f32
    }

    /// World length of a length in unit space.
    pub fn length_to_world(self, length: f32) -> f32 {
        (f64::from(length) * self.scale) as f32
    }
}
