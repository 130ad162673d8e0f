//! The emissive triangles as one light that can be sampled by power.

use std::f64::consts::PI;

use glam::Vec3;

use super::Scene;
use crate::random::Distribution;

/// All emissive triangles of a scene.
pub struct Lights {
    triangles: Vec<Light>,
    /// Of the triangles by power.
    by_power: Distribution,
    power: f64,
}

struct Light {
    /// Into [`super::Mesh::triangles`].
    triangle: usize,
    corners: [Vec3; 3],
    normal: Vec3,
    /// See [`LightPoint::radiance_area`].
    radiance_area: Vec3,
}

/// A point on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Into [`super::Mesh::triangles`].
    pub triangle: usize,
    pub position: Vec3,
    /// Unit normal of the emitting side.
    pub normal: Vec3,
    /// Emitted radiance over the density of such points per unit of area: the mean over many points of
    /// f(point) × `radiance_area` is the integral of f × radiance over the lights.
    pub radiance_area: Vec3,
}

impl Lights {
    pub fn new(scene: &Scene) -> Self {
        let power =
            |triangle: usize| f64::from(scene.material(triangle).emission.element_sum()) * f64::from(scene.mesh.area(triangle));
        let emissive = || (0..scene.mesh.triangles.len()).filter(|&triangle| power(triangle) > 0.0);
        let total: f64 = emissive().map(power).sum();
        let light = |triangle: usize| {
            let probability = (power(triangle) / total) as f32;
            Light {
                triangle,
                corners: scene.mesh.corners(triangle),
                normal: scene.mesh.geometric_normal(triangle),
                radiance_area: scene.material(triangle).emission * (scene.mesh.area(triangle) / probability),
            }
        };
        let by_power = Distribution::new(emissive().map(power).collect());
        Self { triangles: emissive().map(light).collect(), by_power, power: PI * total }
    }

    /// Number of emissive triangles.
    pub fn count(&self) -> usize {
        self.triangles.len()
    }

    /// What they emit, channels added up: of radiance L, πL per unit of area.
    pub fn power(&self) -> f64 {
        self.power
    }

    /// Maps a uniform number and a uniform point of the unit square to a point on the lights, with a density proportional to
    /// emitted power.
    ///
    /// # Panics
    /// When nothing emits.
    pub fn point(&self, pick: f32, [u, v]: [f32; 2]) -> LightPoint {
        let (slot, ..) = self.by_power.pick(pick);
        let &Light { triangle, corners: [a, b, c], normal, radiance_area, .. } = &self.triangles[slot];
        // The square folded along its diagonal, so that its neighbours stay neighbours in the triangle.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        LightPoint { triangle, position: a + u * (b - a) + v * (c - a), normal, radiance_area }
    }

    /// As [`Lights::point`], where `u` picks the triangle and what it has left places the point: points even over the unit square are
    /// even over the lights.
    pub fn point_of_square(&self, [u, v]: [f32; 2]) -> LightPoint {
        let (_, rest, _) = self.by_power.pick(u);
        self.point(u, [rest, v])
    }
}
