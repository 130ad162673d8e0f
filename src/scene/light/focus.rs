//! Where the light of an environment matters: spheres about a place, one within the other, through which its photons are sent in equal numbers.

use std::f32::consts::TAU;

use glam::{Vec3, vec3};

use super::super::Path;
use crate::math::frame;

/// Ratio of the radii of a sphere and the next smaller one.
const STEP: f32 = 3.0;

/// The unit sphere, which holds the scene, and smaller spheres about one place.
#[derive(Clone, Debug, PartialEq)]
pub struct Focus {
    center: Vec3,
    /// Of the smaller spheres, from large to small, in unit space.
    radii: Vec<f32>,
}

impl Focus {
    /// The whole scene alone.
    pub const NONE: Self = Self { center: Vec3::ZERO, radii: Vec::new() };

    /// Spheres down to `radius` about `center`. A place that is not small beside the scene has none of its own.
    pub fn around(center: Vec3, radius: f32) -> Self {
        let radii = std::iter::successors(Some(1.0 / STEP), |radius| Some(radius / STEP));
        Self { center, radii: radii.take_while(|&other| other > radius && other > 1e-5).collect() }
    }

    /// The path of a photon from the unit vector `to_light`, through a random point of the perpendicular disc that covers one of the spheres, and the
    /// [density](Self::density) of such paths. The first number selects the sphere.
    pub(super) fn ray(&self, to_light: Vec3, [pick, s, t]: [f32; 3]) -> (Path, f32) {
        let (sin, cos) = (TAU * s).sin_cos();
        let (center, radius) = self.sphere(pick);
        let through = center + frame(to_light) * (radius * t.sqrt() * vec3(cos, sin, 0.0));
        // The scene lies in the unit sphere. The photon starts before it.
        let origin = through.reject_from_normalized(to_light) + 1.1 * to_light;
        (Path { origin, direction: -to_light, triangle: None }, self.density(through, to_light))
    }

    /// Selects a sphere by a uniform number: its centre and its radius.
    pub fn sphere(&self, pick: f32) -> (Vec3, f32) {
        let level = (pick * (self.radii.len() + 1) as f32) as usize;
        if level == 0 { (Vec3::ZERO, 1.0) } else { (self.center, self.radii[(level - 1).min(self.radii.len() - 1)]) }
    }

    /// Density of rays along the unit vector `direction` through `position`, per area across it, of all spheres together, times π.
    pub fn density(&self, position: Vec3, direction: Vec3) -> f32 {
        let across = (position - self.center).reject_from_normalized(direction).length_squared();
        let own = self.radii.iter().filter(|&&radius| across <= radius * radius).map(|radius| 1.0 / (radius * radius));
        (1.0 + own.sum::<f32>()) / (self.radii.len() + 1) as f32
    }
}
