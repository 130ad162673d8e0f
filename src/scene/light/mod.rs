//! Lights: all that emits in a scene. [`Lights`] is the entry point.
//!
//! A kind of light is a variant of `Light` and a file here. It answers `Light::power`, `Light::emit` for photons and `Light::points` for direct
//! light; the tag takes the place of virtual functions, as in pbrt's `base/light.h`. A point, spot or directional light comes from a list in
//! [`World`](super::World), see there, that [`Lights::new`] reads. Its [`LightPoint`] has no side, so that [`Direct`](crate::direct::Direct) has to draw
//! a shadow map all around it.

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
    /// Radiance from beyond all surfaces.
    Environment(Environment),
    /// All emissive triangles, as one light.
    Area(AreaLight),
}

/// All lights of a scene, chosen by power.
pub struct Lights {
    /// Those that send anything, each with its share of the power of itself and all after it.
    lights: Vec<(Light, f32)>,
}

impl Light {
    /// Flux that it sends into the scene, channels added up.
    fn power(&self) -> f64 {
        match self {
            // Radiance L from a solid angle Ω brings LΩ to each unit of area across it, and the unit sphere has an area of π across.
            Self::Environment(environment) => f64::from(PI) * environment.power(),
            Self::Area(area) => area.power,
        }
    }

    /// As [`Lights::emit`], of a light that is chosen with this probability.
    fn emit(&self, probability: f32, numbers: [f32; 5]) -> (Path, Vec3) {
        match self {
            Self::Environment(environment) => environment.emit(probability, numbers),
            Self::Area(area) => area.emit(probability, numbers),
        }
    }

    /// The points that send its direct light. An environment has none: gather rays that meet no surface bring its light.
    fn points(&self) -> Option<&AreaLight> {
        match self {
            Self::Environment(_) => None,
            Self::Area(area) => Some(area),
        }
    }
}

impl Lights {
    /// `scene` is in unit space.
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

    /// Whether there is no light at all.
    pub fn is_dark(&self) -> bool {
        self.lights.is_empty()
    }

    /// Where a photon starts, and its flux (RGB): the mean over many photons is the flux of all lights. The numbers are uniform in [0, 1); the first
    /// of them picks the light.
    ///
    /// # Panics
    /// When it is dark.
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

    /// The points that direct light comes from.
    fn points(&self) -> Option<&AreaLight> {
        self.lights.iter().find_map(|(light, _)| light.points())
    }

    /// Number of emissive triangles. Without one there are no points.
    pub fn count(&self) -> usize {
        self.points().map_or(0, |area| area.triangles.len())
    }

    /// Maps a uniform number and a uniform point of the unit square to a point on the lights, with a density proportional to
    /// emitted power.
    ///
    /// # Panics
    /// When [`Self::count`] is 0.
    pub fn point(&self, pick: f32, square: [f32; 2]) -> LightPoint {
        self.points().expect("some light has points").point(pick, square)
    }

    /// As [`Self::point`], where `u` picks the triangle and what it has left places the point: points even over the unit square are
    /// even over the lights.
    pub fn point_of_square(&self, square: [f32; 2]) -> LightPoint {
        self.points().expect("some light has points").point_of_square(square)
    }
}
