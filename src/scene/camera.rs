//! Cameras. [`WorldCamera::check`] refuses an unusable camera. [`Camera::framing`] makes a camera for a scene without one.

use std::f32::consts::TAU;

use glam::{DVec3, Mat3, Vec2, Vec3};

use crate::math::Aabb;

/// A pinhole camera, or a camera with a thin lens, in unit space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub eye: Vec3,
    pub target: Vec3,
    pub up: Vec3,
    /// Full vertical angle of view.
    pub fov_y_degrees: f32,
    pub lens: Option<Lens>,
}

/// A camera in world space, as files and users give it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldCamera {
    pub eye: DVec3,
    pub target: DVec3,
    pub up: Vec3,
    /// Full vertical angle of view.
    pub fov_y_degrees: f32,
    pub lens: Option<Lens>,
}

/// A thin lens, centred on the eye and perpendicular to the direction of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    pub radius: f32,
    /// Distance from the eye to the plane in focus, along the direction of view.
    pub focus_distance: f32,
}

impl Camera {
    /// Default angle of view, in degrees.
    pub const DEFAULT_FOV_Y: f32 = 40.0;

    /// Sees all of `bounds` from the front (+z), a little above and to the right.
    pub fn framing(bounds: Aabb, size: [u32; 2]) -> Self {
        let half_height = (Self::DEFAULT_FOV_Y / 2.0).to_radians();
        let half_width = (half_height.tan() * size[0] as f32 / size[1] as f32).atan();
        let distance = bounds.diagonal() / 2.0 / half_height.min(half_width).sin();
        let target = bounds.center();
        let eye = target + Vec3::new(0.35, 0.25, 1.0).normalize() * distance;
        Self { eye, target, up: Vec3::Y, fov_y_degrees: Self::DEFAULT_FOV_Y, lens: None }
    }

    /// The camera's axes as columns: right, up, and opposite to the direction of view.
    pub fn axes(self) -> Mat3 {
        let back = (self.eye - self.target).normalize();
        let right = self.up.cross(back).normalize();
        Mat3::from_cols(right, back.cross(right), back)
    }

    /// Unit direction through a position in the picture, in [0, 1]² from the upper left corner. `aspect` is width over height.
    pub fn ray(self, place: Vec2, aspect: f32) -> Vec3 {
        let up = (0.5 * self.fov_y_degrees.to_radians()).tan();
        let across = (2.0 * place - 1.0) * Vec2::new(up * aspect, -up);
        (self.axes() * across.extend(-1.0)).normalize()
    }

    /// Origin and unit direction of a ray to this position through the lens. The uniform point [u, v] of the unit square chooses the point on the lens.
    pub fn ray_by_lens(self, place: Vec2, aspect: f32, [u, v]: [f32; 2]) -> (Vec3, Vec3) {
        let direction = self.ray(place, aspect);
        let Some(Lens { radius, focus_distance }) = self.lens else { return (self.eye, direction) };
        let axes = self.axes();
        let sharp = self.eye - direction * (focus_distance / direction.dot(axes.z_axis));
        let (sin, cos) = (TAU * v).sin_cos();
        let origin = self.eye + radius * u.sqrt() * (cos * axes.x_axis + sin * axes.y_axis);
        (origin, (sharp - origin).normalize())
    }
}

impl WorldCamera {
    /// As [`Camera::framing`], of the box between two corners.
    pub fn framing([min, max]: [DVec3; 2], size: [u32; 2]) -> Self {
        let center = 0.5 * (min + max);
        let bounds = Aabb { min: (min - center).as_vec3(), max: (max - center).as_vec3() };
        let Camera { eye, target, up, fov_y_degrees, lens } = Camera::framing(bounds, size);
        Self { eye: center + eye.as_dvec3(), target: center + target.as_dvec3(), up, fov_y_degrees, lens }
    }

    /// As [`Camera::axes`].
    pub fn axes(self) -> Mat3 {
        let Self { eye, target, up, fov_y_degrees, lens } = self;
        Camera { eye: Vec3::ZERO, target: (target - eye).normalize().as_vec3(), up, fov_y_degrees, lens }.axes()
    }

    /// Returns the camera with `up` of unit length, or the problem and its cure.
    pub fn check(self) -> Result<Self, (String, &'static str)> {
        for (name, value) in [("eye", self.eye), ("target", self.target), ("up", self.up.as_dvec3())] {
            if !value.is_finite() || value.abs().max_element() > 1e9 {
                return Err((format!("camera {name} is {value}"), "give three finite numbers, none beyond 1e9"));
            }
        }
        let Some(forward) = (self.target - self.eye).try_normalize() else {
            return Err((format!("camera eye and target are both {}", self.eye), "move target to where the camera looks"));
        };
        let Some(up) = self.up.as_dvec3().try_normalize() else {
            return Err(("camera up is zero".into(), "give a direction, such as [0, 1, 0]"));
        };
        if forward.cross(up).length() < 1e-4 {
            let problem = format!("camera up {} is parallel to the direction of view", self.up);
            return Err((problem, "give an up direction across the view, such as [0, 0, 1] for a view straight down"));
        }
        if !(self.fov_y_degrees > 0.0 && self.fov_y_degrees < 180.0) {
            let problem = format!("camera fov_y_degrees is {}", self.fov_y_degrees);
            return Err((problem, "give an angle between 0 and 180 degrees"));
        }
        if let Some(Lens { radius, focus_distance }) = self.lens {
            if !(radius > 0.0 && radius <= 1e9) {
                return Err((format!("camera aperture is {radius}"), "give the radius of the lens, or 0 for a pinhole"));
            }
            if !(focus_distance > 0.0 && focus_distance <= 1e9) {
                let problem = format!("camera focus_distance is {focus_distance}");
                return Err((problem, "give the distance from the eye, above 0, at which things are sharp"));
            }
        }
        Ok(Self { up: up.as_vec3(), ..self })
    }
}
