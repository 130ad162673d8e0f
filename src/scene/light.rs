//! The emissive triangles as one light that can be sampled by power.

use glam::Vec3;

use super::Scene;

/// All emissive triangles of a scene.
pub struct Lights {
    triangles: Vec<usize>,
    /// Power up to and with each triangle, as a share of the total.
    cumulative: Vec<f32>,
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
        let mut sum = 0.0;
        let (mut triangles, mut powers) = (Vec::new(), Vec::new());
        for triangle in 0..scene.mesh.triangles.len() {
            let power = scene.material(triangle).emission.element_sum() * scene.mesh.area(triangle);
            if power > 0.0 {
                sum += f64::from(power);
                triangles.push(triangle);
                powers.push(sum);
            }
        }
        Self { triangles, cumulative: powers.iter().map(|part| (part / sum) as f32).collect() }
    }

    /// Number of emissive triangles.
    pub fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Whether nothing emits.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    /// Maps a uniform number and a uniform point of the unit square to a point on the lights, with a density proportional to
    /// emitted power.
    ///
    /// # Panics
    /// When nothing emits.
    pub fn point(&self, scene: &Scene, pick: f32, [u, v]: [f32; 2]) -> LightPoint {
        let slot = self.cumulative.partition_point(|&part| part <= pick).min(self.triangles.len() - 1);
        let triangle = self.triangles[slot];
        let probability = self.cumulative[slot] - if slot == 0 { 0.0 } else { self.cumulative[slot - 1] };
        let [a, b, c] = scene.mesh.corners(triangle);
        // The square folded along its diagonal, so that its neighbours stay neighbours in the triangle.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        LightPoint {
            triangle,
            position: a + u * (b - a) + v * (c - a),
            normal: scene.mesh.geometric_normal(triangle),
            radiance_area: scene.material(triangle).emission * (scene.mesh.area(triangle) / probability),
        }
    }
}
