//! The ground: a plane under a scene that catches its shadow. Pixels that see no surface have their points on it.
//!
//! It is in no picture itself, and no ray of the gather meets it. So it hides none of the environment's light, which comes from below in its place.
//! Light on it, over what it would be without the scene, is how much of the background shows.

use glam::{Vec3, Vec4};

use super::list::octahedral_encode;
use crate::direction::Direction;
use crate::math::dominant_axis;
use crate::random::sobol;
use crate::scene::{Environment, Mesh};

/// The ground ends this far from the middle of the scene, in unit space, where a scene takes a thousandth of the light. From the first number on, its
/// shadow fades.
const FADES: [f32; 2] = [5.0, 8.0];

/// Samples of the bright parts of the environment. They follow its power, so their sum converges fast.
const BRIGHT_SAMPLES: u32 = 4096;

/// A horizontal plane at the lowest point of a scene, in unit space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    up: Vec3,
    height: f32,
}

impl Ground {
    /// The ground under `mesh`. Up is the axis nearest to the camera's `up`, which may be tilted.
    pub fn under(mesh: &Mesh, up: Vec3) -> Self {
        let axis = dominant_axis(up);
        let up = Vec3::AXES[axis] * up[axis].signum();
        let height = mesh.positions.iter().map(|position| position.dot(up)).fold(f32::INFINITY, f32::min);
        Self { up, height }
    }

    /// Where a ray meets it from above.
    pub fn met(&self, origin: Vec3, direction: Vec3) -> Option<Vec3> {
        let down = -direction.dot(self.up);
        let distance = (origin.dot(self.up) - self.height) / down;
        let place = origin + distance * direction;
        (down > 0.0 && distance > 0.0 && place.reject_from_normalized(self.up).length() < FADES[1]).then_some(place)
    }

    /// The texels of a point of it, as [`super::Points`] says.
    pub fn point(&self, place: Vec3) -> [Vec4; 2] {
        let code = octahedral_encode(self.up);
        [place.extend(code.x), self.up.extend(code.y)]
    }

    /// How much of a shadow shows at a place.
    pub fn fade(&self, place: Vec3) -> f32 {
        let far = ((FADES[1] - place.reject_from_normalized(self.up).length()) / (FADES[1] - FADES[0])).clamp(0.0, 1.0);
        far * far * (3.0 - 2.0 * far)
    }

    /// What the gather sums at a point of it without the scene: radiance times weight, and weight, of the environment along these directions.
    pub fn open(&self, environment: &Environment, directions: impl Iterator<Item = Direction>, both_ends: bool) -> Vec4 {
        let along = |direction: Vec3| {
            let weight = direction.dot(self.up).max(0.0);
            (weight * environment.gathered_radiance(direction)).extend(weight)
        };
        let ends = |direction: Direction| along(direction.vector) + if both_ends { along(-direction.vector) } else { Vec4::ZERO };
        directions.map(ends).sum()
    }

    /// Irradiance from the bright parts of the environment without the scene.
    pub fn bright(&self, environment: &Environment) -> Vec3 {
        let sample = |index: u32| {
            let (direction, density) = environment.sample_bright(sobol(index, 0))?;
            let weight = if density > 0.0 { direction.dot(self.up).max(0.0) / density } else { 0.0 };
            Some(weight * environment.bright_radiance(direction))
        };
        (0..BRIGHT_SAMPLES).filter_map(sample).sum::<Vec3>() / BRIGHT_SAMPLES as f32
    }
}
