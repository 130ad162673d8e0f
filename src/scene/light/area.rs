//! The emissive triangles of a scene, as one light.

use std::f32::consts;
use std::f64::consts::PI;

use glam::Vec3;

use super::super::{Path, RAY_OFFSET, Scene};
use crate::math::cosine_direction;
use crate::random::Distribution;

/// All emissive triangles of a scene.
pub struct AreaLight {
    /// The sides that emit: a two-sided triangle has two.
    pub sides: Vec<Emitter>,
    /// Chooses a side by power.
    by_power: Distribution,
    /// Flux of all triangles, sum of the channels. A surface of radiance L emits πL per unit of area.
    pub power: f64,
}

pub struct Emitter {
    /// Index into [`super::super::Mesh::triangles`].
    triangle: usize,
    corners: [Vec3; 3],
    normal: Vec3,
    /// See [`LightPoint::radiance_area`].
    radiance_area: Vec3,
}

/// A point on a light.
#[derive(Clone, Copy, Debug)]
pub struct LightPoint {
    /// Index into [`super::super::Mesh::triangles`].
    pub triangle: usize,
    pub position: Vec3,
    /// Unit normal on the emitting side.
    pub normal: Vec3,
    /// Emitted radiance over point density per area. The mean of f(point) × `radiance_area` is the integral of f × radiance over the lights.
    pub radiance_area: Vec3,
}

impl AreaLight {
    pub fn new(scene: &Scene) -> Self {
        let power =
            |triangle: usize| f64::from(scene.material(triangle).emission.element_sum()) * f64::from(scene.mesh.area(triangle));
        let sides = |triangle: usize| [1.0, -1.0].into_iter().take(1 + usize::from(scene.material(triangle).two_sided));
        let emissive = || {
            let triangles = (0..scene.mesh.triangles.len()).filter(|&triangle| power(triangle) > 0.0);
            triangles.flat_map(|triangle| sides(triangle).map(move |side| (triangle, side)))
        };
        let total: f64 = emissive().map(|(triangle, _)| power(triangle)).sum();
        let emitter = |(triangle, side): (usize, f32)| {
            let probability = (power(triangle) / total) as f32;
            Emitter {
                triangle,
                corners: scene.mesh.corners(triangle),
                normal: side * scene.mesh.geometric_normal(triangle),
                radiance_area: scene.material(triangle).emission * (scene.mesh.area(triangle) / probability),
            }
        };
        let by_power = Distribution::new(emissive().map(|(triangle, _)| power(triangle)).collect());
        Self { sides: emissive().map(emitter).collect(), by_power, power: PI * total }
    }

    /// A point by a uniform number, which selects the triangle, and a uniform point of the unit square. The density is proportional to emitted power.
    fn point(&self, pick: f32, [u, v]: [f32; 2]) -> LightPoint {
        let (slot, ..) = self.by_power.pick(pick);
        let &Emitter { triangle, corners: [a, b, c], normal, radiance_area } = &self.sides[slot];
        // Shrinks one side of the square to a corner. Neighbours in the square stay neighbours in the triangle, and no two parts of it overlap there: so
        // 512 even points have a twentieth of the error that they have in a square folded along its diagonal.
        let along = u.sqrt();
        LightPoint { triangle, position: a + (1.0 - along) * (b - a) + v * along * (c - a), normal, radiance_area }
    }

    /// As [`Self::point`]. `u` selects the triangle, its remainder the point: an even distribution in the square is even on the lights.
    pub fn point_of_square(&self, [u, v]: [f32; 2]) -> LightPoint {
        let (_, rest, _) = self.by_power.pick(u);
        self.point(u, [rest, v])
    }

    /// A photon from a point of the light, with a cosine distribution about the normal of the emitting side; see [`super::Lights::emit`].
    pub fn emit(&self, probability: f32, [pick, u, v, s, t]: [f32; 5]) -> (Path, Vec3) {
        let LightPoint { triangle, position, normal, radiance_area } = self.point(pick, [u, v]);
        let direction = cosine_direction(normal, s, t);
        let path = Path { origin: position + RAY_OFFSET * normal, direction, triangle: Some(triangle) };
        // A diffuse emitter of radiance L emits πL per unit of area.
        (path, radiance_area * (consts::PI / probability))
    }
}
