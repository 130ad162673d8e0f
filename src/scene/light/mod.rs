//! Lights: all emitters of a scene. [`Lights`] is the entry point.
//!
//! Each kind of light is a variant of `Light` (instead of virtual functions, as in pbrt's `base/light.h`) with a file here. It has `power`, `emit` for
//! photons and `points` for direct light. Point, spot and directional lights will come from a list in [`World`](super::World) that [`Lights::new`]
//! reads. Their points have no side, so [`Direct`](crate::direct::Direct) must then draw shadow maps in all directions.

use std::f32::consts::PI;

use glam::Vec3;

use super::{Path, Scene};

mod area;
mod environment;

use area::AreaLight;
pub use area::LightPoint;
pub use environment::Environment;

/// A light of a scene in unit space.
enum Light {
    /// Radiance from outside the scene.
    Environment(Environment),
    /// All emissive triangles, as one light.
    Area(AreaLight),
}

/// All lights of a scene, chosen by power.
pub struct Lights {
    /// Each light with power, and its share of the summed power of itself and all later lights.
    lights: Vec<(Light, f32)>,
}

impl Light {
    /// Flux that it sends into the scene, sum of the channels.
    fn power(&self) -> f64 {
        match self {
            // Radiance L from solid angle Ω brings LΩ to each unit of area perpendicular to it. The cross-section of the unit sphere is π.
            Self::Environment(environment) => f64::from(PI) * environment.power(),
            Self::Area(area) => area.power,
        }
    }

    /// As [`Lights::emit`], for a light that is chosen with this probability.
    fn emit(&self, probability: f32, numbers: [f32; 5]) -> (Path, Vec3) {
        match self {
            Self::Environment(environment) => environment.emit(probability, numbers),
            Self::Area(area) => area.emit(probability, numbers),
        }
    }

    /// The emissive points of its direct light. An environment has none: its light comes along gather rays that hit no surface.
    fn points(&self) -> Option<&AreaLight> {
        match self {
            Self::Environment(_) => None,
            Self::Area(area) => Some(area),
        }
    }
}

impl Lights {
    /// `scene` must be in unit space.
    pub fn new(scene: &Scene) -> Self {
        let environment = scene.environment.clone().map(Light::Environment);
        let all = environment.into_iter().chain([Light::Area(AreaLight::new(scene))]);
        let mut lights: Vec<_> = all.filter(|light| light.power() > 0.0).map(|light| (light, 1.0)).collect();
        let mut rest = 0.0;
        for (light, share) in lights.iter_mut().rev() {
            rest += light.power();
            *share = (light.power() / rest) as f32;
        }
        Self { lights }
    }

    /// Whether the scene has no light.
    pub fn is_dark(&self) -> bool {
        self.lights.is_empty()
    }

    /// Start and flux (RGB) of a photon; the mean flux is that of all lights. The numbers are uniform in [0, 1). The first selects the light.
    ///
    /// # Panics
    /// When there is no light.
    pub fn emit(&self, [mut pick, u, v, s, t]: [f32; 5]) -> (Path, Vec3) {
        let ((last, _), others) = self.lights.split_last().expect("photons come from a light");
        let mut left = 1.0;
        for (light, share) in others {
            if pick < *share {
                return light.emit(left * share, [pick / share, u, v, s, t]);
            }
            pick = (pick - share) / (1.0 - share);
            left *= 1.0 - share;
        }
        last.emit(left, [pick, u, v, s, t])
    }

    /// The emissive points of direct light.
    fn points(&self) -> Option<&AreaLight> {
        self.lights.iter().find_map(|(light, _)| light.points())
    }

    /// Number of sides of triangles that emit. If it is 0, there are no points.
    pub fn count(&self) -> usize {
        self.points().map_or(0, |area| area.sides.len())
    }

    /// Maps a uniform number and a uniform point of the unit square to a point on the lights. The density is proportional to emitted power.
    ///
    /// # Panics
    /// When [`Self::count`] is 0.
    pub fn point(&self, pick: f32, square: [f32; 2]) -> LightPoint {
        self.points().expect("some light has points").point(pick, square)
    }

    /// As [`Self::point`]. `u` selects the triangle, its remainder the point: an even distribution in the square is even on the lights.
    pub fn point_of_square(&self, square: [f32; 2]) -> LightPoint {
        self.points().expect("some light has points").point_of_square(square)
    }
}
