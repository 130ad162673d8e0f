//! Cameras. [`WorldCamera::check`] refuses an unusable camera. [`WorldCamera::framing`] makes a camera for a scene without one.

use std::f32::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3, Mat3, Vec2, Vec3};
use serde::{Deserialize, Serialize};

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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WorldCamera {
    pub eye: DVec3,
    pub target: DVec3,
    pub up: Vec3,
    /// Full vertical angle of view.
    pub fov_y_degrees: f32,
    pub lens: Option<Lens>,
}

/// The parts of a camera that replace those of another, in world space.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraChange {
    pub eye: Option<DVec3>,
    pub target: Option<DVec3>,
    pub up: Option<Vec3>,
    pub fov_y_degrees: Option<f32>,
}

/// A thin lens, centred on the eye and perpendicular to the direction of view.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lens {
    pub radius: f32,
    /// Distance from the eye to the plane in focus, along the direction of view.
    pub focus_distance: f32,
}

/// The margin around a framed model on each side, as a fraction of the picture's side.
const MARGIN: f64 = 0.05;

impl Camera {
    /// Default angle of view, in degrees.
    pub const DEFAULT_FOV_Y: f32 = 40.0;

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
    /// The nearest camera that sees all `positions` with a margin, in a picture of `size`. It stands before their front (+z), a little above and to the
    /// right. With another `up` than +y in `change`, the view is turned with it: a model with z up is seen from -y. Of `change` it takes the angle of view
    /// too.
    ///
    /// The four planes of the view then touch the model, or two of them do and the others are equally far from it.
    pub fn framing(positions: impl Iterator<Item = DVec3>, size: [u32; 2], change: &CameraChange) -> Self {
        let up = change.up.unwrap_or(Vec3::Y);
        // An unusable angle is refused later.
        let usable = change.fov_y_degrees.filter(|degrees| *degrees > 0.0 && *degrees < 180.0);
        let fov_y_degrees = usable.unwrap_or(Camera::DEFAULT_FOV_Y);
        let upright = DQuat::from_rotation_arc(DVec3::Y, up.as_dvec3().try_normalize().unwrap_or(DVec3::Y));
        let back = upright * DVec3::new(0.35, 0.25, 1.0).normalize();
        let right = (upright * DVec3::Y).cross(back).normalize();
        let axes = DMat3::from_cols(right, back.cross(right), back);
        let half_height = (1.0 - 2.0 * MARGIN) * (0.5 * f64::from(fov_y_degrees).to_radians()).tan();
        let slopes = DVec2::new(half_height * f64::from(size[0]) / f64::from(size[1]), half_height);

        // How far each plane through the origin must move outwards to let all positions in, and how far they reach.
        let [mut above, mut below] = [DVec2::NEG_INFINITY; 2];
        let [mut near, mut far] = [f64::NEG_INFINITY, f64::INFINITY];
        for position in positions {
            let place = axes.transpose() * position;
            above = above.max(place.truncate() + slopes * place.z);
            below = below.max(slopes * place.z - place.truncate());
            (near, far) = (near.max(place.z), far.min(place.z));
        }
        let distance = (0.5 * (above + below) / slopes).max_element();
        let across = 0.5 * (above - below);
        let eye = axes * across.extend(distance);
        let target = axes * across.extend(0.5 * (near + far));
        Self { eye, target, up, fov_y_degrees, lens: None }
    }

    /// The camera with the parts of `change`.
    /// A lens that is sharp at the target stays so.
    #[must_use]
    pub fn changed(self, change: &CameraChange) -> Self {
        let (eye, target) = (change.eye.unwrap_or(self.eye), change.target.unwrap_or(self.target));
        let lens = self.lens.map(|lens| match lens.focus_distance == self.eye.distance(self.target) as f32 {
            true => Lens { focus_distance: eye.distance(target) as f32, ..lens },
            false => lens,
        });
        Self {
            eye,
            target,
            lens,
            up: change.up.unwrap_or(self.up),
            fov_y_degrees: change.fov_y_degrees.unwrap_or(self.fov_y_degrees),
        }
    }

    /// The same camera where world space is unit space.
    pub(super) fn in_own_space(self) -> Camera {
        let Self { eye, target, up, fov_y_degrees, lens } = self;
        Camera { eye: eye.as_vec3(), target: target.as_vec3(), up, fov_y_degrees, lens }
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
            return Err((
                problem,
                "give an up direction that is not along the view: 0, 1, 0 for a level view, 0, 0, 1 for one straight down along y",
            ));
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
