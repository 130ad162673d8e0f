//! Lights: all that emits in a scene, one [`Light`] for each thing that is sampled as a whole. [`Lights`] is the entry point.
//!
//! A kind of light is a variant of [`Light`] and a file here. It says how much power it sends into the scene ([`Light::power`]), how a photon leaves
//! it (`Light::emit`) and, if shadow maps can be drawn from it, which points it has for direct light ([`Lights::point`]). The tag does the work of
//! virtual functions, as in pbrt's `base/light.h`.
//!
//! A point, spot or directional light has a list in [`World`](super::World) and [`Scene`], which [`Lights::new`] reads. Where its kind matters to
//! others: `Direct` draws shadow maps over the half space before a [`LightPoint`], and a light without a side needs them all around.

use std::f32::consts::PI;

use super::{Path, Scene};

mod area;
mod environment;

pub use area::{AreaLight, LightPoint};
pub use environment::Environment;

/// A light of a scene in unit space.
pub enum Light {
    /// Radiance from beyond all surfaces. Rays that miss bring its direct light, so it has no points.
    Environment(Environment),
    /// All emissive triangles.
    Area(AreaLight),
}

/// All lights of a scene, chosen by power.
pub struct Lights {
    /// Each sends something. With each its share of the power that it has together with those after it; the last one has all of that.
    lights: Vec<(Light, f32)>,
}

impl Light {
    /// Flux that it sends into the scene, channels added up.
    pub fn power(&self) -> f64 {
        match self {
            // Radiance L from a solid angle Ω brings LΩ to each unit of area across it; the scene's sphere has an area of π across.
            Self::Environment(environment) => f64::from(PI) * environment.power(),
            Self::Area(area) => area.power(),
        }
    }

    /// As [`Lights::emit`], of a light that is chosen with this probability.
    fn emit(&self, probability: f32, numbers: [f32; 5]) -> (Path, glam::Vec3) {
        match self {
            Self::Environment(environment) => environment.emit(probability, numbers),
            Self::Area(area) => area.emit(probability, numbers),
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
            let power = light.power();
            rest += power;
            *share = (power / rest) as f32;
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
    pub fn emit(&self, [mut pick, u, v, s, t]: [f32; 5]) -> (Path, glam::Vec3) {
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

    /// The lights that have points, for direct light by shadow maps.
    fn area(&self) -> Option<&AreaLight> {
        self.lights.iter().find_map(|(light, _)| match light {
            Light::Environment(_) => None,
            Light::Area(area) => Some(area),
        })
    }

    /// Number of emissive triangles; without one there are no points.
    pub fn count(&self) -> usize {
        self.area().map_or(0, AreaLight::count)
    }

    /// Maps a uniform number and a uniform point of the unit square to a point on the lights, with a density proportional to
    /// emitted power.
    ///
    /// # Panics
    /// When [`Self::count`] is 0.
    pub fn point(&self, pick: f32, square: [f32; 2]) -> LightPoint {
        self.area().expect("a light with points").point(pick, square)
    }

    /// As [`Self::point`], where `u` picks the triangle and what it has left places the point: points even over the unit square are
    /// even over the lights.
    pub fn point_of_square(&self, square: [f32; 2]) -> LightPoint {
        self.area().expect("a light with points").point_of_square(square)
    }
}
