//! Lights: all emitters of a scene. [`Lights`] is the entry point.
//!
//! Each kind of light is a variant of `Light` (instead of virtual functions, as in pbrt's `base/light.h`) with a file here. It has `power`, `emit` for
//! photons and `sample` for direct light.

use std::f32::consts::PI;

use glam::{Vec3, Vec4};

use super::{Path, RAY_OFFSET, Scene};

mod area;
mod daylight;
mod environment;
mod focus;
mod punctual;

use area::{AreaLight, LightPoint};
pub use daylight::{Daylight, Sky, Sun};
pub use environment::Environment;
pub use focus::Focus;
use punctual::{DistantLights, NearLights};
pub use punctual::{PunctualKind, PunctualLight};

/// Height above its surface at which a shadow ray towards a lamp ends, in unit space. A lamp that is flush with a ceiling has neighbours in its own
/// plane. A ray of length 2 has an error of some 1e-7 at its end, and so has its hit with a plane. A ray towards a lamp without a surface ends so far
/// before it.
const LIGHT_OFFSET: f32 = 2.0 * RAY_OFFSET;

/// The least share of the samples for a light. The sun has more power than all lamps of a room that it hardly reaches.
const LEAST_SHARE: f32 = 0.25;

/// A light of a scene in unit space.
enum Light {
    /// Radiance from outside the scene.
    Environment(Environment),
    /// All directional lights, as one light.
    Distant(DistantLights),
    /// All points and spots, as one light.
    Near(NearLights),
    /// All emissive triangles, as one light.
    Area(AreaLight),
}

/// A sample of direct light. Its mean over uniform points of the unit square is all direct light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// w 1: position on a surface, in unit space; w 2: position without a surface; w 0: unit vector towards a light outside the scene.
    pub place: Vec4,
    /// Unit normal of the emitting side, or the axis of a cone. Outside the scene: the vector towards the light, turned round.
    pub normal: Vec3,
    /// Over the density of the sample: radiance, per area or per solid angle; without a surface the intensity on the axis.
    pub weight: Vec3,
    /// Scale and offset. At an angle of cosine c from the axis there is clamp(scale c + offset, 0, 1)² of the intensity. Without a surface only. Other lights
    /// have [0, 0], or [0, 1] if rays do not meet them.
    pub cone: [f32; 2],
}

impl LightSample {
    /// On a surface, or outside the scene.
    fn of_side(place: Vec4, normal: Vec3, weight: Vec3) -> Self {
        Self { place, normal, weight, cone: [0.0; 2] }
    }

    /// The same of a light that no ray meets.
    fn unseen(self) -> Self {
        Self { cone: [0.0, 1.0], ..self }
    }

    /// For a receiver at `origin`: the unit vector towards the sample, the length of the shadow ray, and the irradiance on a surface that faces it. The
    /// twin of `glsl/direct.frag`.
    pub fn seen_from(&self, origin: Vec3) -> (Vec3, f32, Vec3) {
        let near = self.place.w > 0.0;
        let way = self.place.truncate() - if near { origin } else { Vec3::ZERO };
        let distance = way.length();
        let direction = way / distance;
        let cosine = -self.normal.dot(direction).min(0.0);
        let (emitted, gap) = if self.place.w > 1.0 {
            let [scale, offset] = self.cone;
            ((scale * self.normal.dot(-direction) + offset).clamp(0.0, 1.0).powi(2), LIGHT_OFFSET)
        } else {
            (cosine, 0.0)
        };
        let received = emitted / if near { distance * distance } else { 1.0 };
        (direction, if near { distance - gap } else { f32::INFINITY }, received * self.weight)
    }
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
            Self::Distant(distant) => distant.power,
            Self::Near(near) => near.power,
            Self::Area(area) => area.power,
        }
    }

    /// As [`Lights::emit_at`], for a light that is chosen with this probability.
    fn emit(&self, probability: f32, numbers: [f32; 5], focus: &Focus) -> (Path, Vec3) {
        match self {
            Self::Environment(environment) => environment.emit(probability, numbers, focus),
            Self::Distant(distant) => distant.emit(probability, numbers, focus),
            Self::Near(near) => near.emit(probability, numbers),
            Self::Area(area) => area.emit(probability, numbers),
        }
    }

    /// The part of [`Self::power`] that direct light samples. The gather has the rest: its rays that hit no surface bring it.
    fn sampled_power(&self) -> f64 {
        match self {
            Self::Environment(environment) => f64::from(PI) * environment.bright_power(),
            _ => self.power(),
        }
    }

    /// As [`Lights::sample`], for a light that is chosen with this probability.
    fn sample(&self, probability: f32, square: [f32; 2]) -> LightSample {
        match self {
            Self::Environment(environment) => {
                let (to_light, density) = environment.sample_bright(square).expect("only bright parts are sampled");
                let weight = environment.bright_radiance(to_light) / (density * probability);
                LightSample::of_side(to_light.extend(0.0), -to_light, weight)
            }
            Self::Distant(distant) => distant.sample(probability, square),
            Self::Near(near) => near.sample(probability, square),
            Self::Area(area) => {
                let LightPoint { position, normal, radiance_area, .. } = area.point_of_square(square);
                let place = (position + LIGHT_OFFSET * normal).extend(1.0);
                LightSample::of_side(place, normal, radiance_area / probability)
            }
        }
    }
}

impl Lights {
    /// `scene` must be in unit space.
    pub fn new(scene: &Scene) -> Self {
        let environment = scene.environment.clone().map(Light::Environment);
        let [distant, near] = [Light::Distant(DistantLights::new(&scene.lights)), Light::Near(NearLights::new(&scene.lights))];
        Self::of(environment.into_iter().chain([distant, near, Light::Area(AreaLight::new(scene))]))
    }

    /// These lights alone, in unit space.
    pub fn without_surface<'a>(lights: impl IntoIterator<Item = &'a PunctualLight>) -> Self {
        let lights: Vec<_> = lights.into_iter().cloned().collect();
        Self::of([Light::Distant(DistantLights::new(&lights)), Light::Near(NearLights::new(&lights))].into_iter())
    }

    fn of(lights: impl Iterator<Item = Light>) -> Self {
        let mut lights: Vec<_> = lights.filter(|light| light.power() > 0.0).map(|light| (light, 1.0)).collect();
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

    /// Start and flux (RGB) of a photon; the mean flux is that of all lights. The numbers are uniform in [0, 1). The first selects the light, by power.
    ///
    /// # Panics
    /// When there is no light.
    pub fn emit(&self, numbers: [f32; 5]) -> (Path, Vec3) {
        self.emit_by(|share| share, numbers, &Focus::NONE)
    }

    /// The same for places that are small beside the scene: photons of the environment go to `focus`, and no light gets so few that it has no part.
    pub fn emit_at(&self, numbers: [f32; 5], focus: &Focus) -> (Path, Vec3) {
        self.emit_by(|share| share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE), numbers, focus)
    }

    fn emit_by(&self, share_of: impl Fn(f32) -> f32, [mut pick, u, v, s, t]: [f32; 5], focus: &Focus) -> (Path, Vec3) {
        let ((last, _), others) = self.lights.split_last().expect("photons come from a light");
        let mut left = 1.0;
        for (light, share) in others {
            let share = share_of(*share);
            if pick < share {
                return light.emit(left * share, [pick / share, u, v, s, t], focus);
            }
            pick = (pick - share) / (1.0 - share);
            left *= 1.0 - share;
        }
        last.emit(left, [pick, u, v, s, t], focus)
    }

    /// Number of sides of triangles that emit, and of lights without a surface.
    pub fn count(&self) -> usize {
        let count = |(light, _): &(Light, f32)| match light {
            Light::Environment(_) => 0,
            Light::Distant(distant) => distant.count(),
            Light::Near(near) => near.count(),
            Light::Area(area) => area.sides.len(),
        };
        self.lights.iter().map(count).sum()
    }

    /// Whether there are points or spots, whose samples may have a [cone](LightSample::cone).
    pub fn have_cones(&self) -> bool {
        self.lights.iter().any(|(light, _)| matches!(light, Light::Near(_)))
    }

    /// Whether there is direct light.
    pub fn are_sampled(&self) -> bool {
        self.sampled().next().is_some()
    }

    /// Whether all direct light comes from one point, or along one direction, so that one sample is exact.
    pub fn are_one_point(&self) -> bool {
        let mut sampled = self.sampled();
        match (sampled.next(), sampled.next()) {
            (Some(Light::Near(near)), None) => near.is_one_point(),
            (Some(Light::Distant(distant)), None) => distant.is_one_direction(),
            _ => false,
        }
    }

    fn sampled(&self) -> impl Iterator<Item = &Light> {
        self.lights.iter().map(|(light, _)| light).filter(|light| light.sampled_power() > 0.0)
    }

    /// Maps a uniform point of the unit square to a sample of direct light. `u` selects the light, its remainder the point on it: an even
    /// distribution in the square is even on the lights.
    ///
    /// # Panics
    /// When there is no direct light.
    pub fn sample(&self, [u, v]: [f32; 2]) -> LightSample {
        let count = self.sampled().count();
        let all: f64 = self.sampled().map(Light::sampled_power).sum();
        let (mut u, mut left) = (u, 1.0);
        for (index, light) in (1..).zip(self.sampled()) {
            let share = LEAST_SHARE + (1.0 - LEAST_SHARE * count as f32) * (light.sampled_power() / all) as f32;
            if index == count {
                return light.sample(left, [u / left, v]);
            }
            if u < share {
                return light.sample(share, [u / share, v]);
            }
            (u, left) = (u - share, left - share);
        }
        unreachable!("direct light comes from a light")
    }
}
