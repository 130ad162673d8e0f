//! Lights: all emitters of a scene. [`Lights`] is the entry point.
//!
//! Each kind of light is a variant of `Light` (instead of virtual functions, as in pbrt's `base/light.h`) with a file here. It has `power`, `emit` for
//! photons and `sample` for direct light.

use std::f32::consts::PI;

use glam::{Vec3, Vec4, vec3};

use super::{Path, RAY_OFFSET, Scene};
use crate::math::frame;

mod area;
mod daylight;
mod environment;
mod focus;
mod pieces;
mod punctual;
mod tree;

pub use area::Lamp;
use area::{AreaLight, LightPoint};
pub use daylight::{Daylight, Sky, Sun};
pub use environment::Environment;
pub use focus::Focus;
use punctual::{DistantLights, NearLights};
pub use punctual::{PunctualKind, PunctualLight};
pub use tree::LightTree;

/// Height above its surface at which a shadow ray towards a lamp ends, in unit space. A lamp that is flush with a ceiling has neighbours in its own
/// plane. A ray of length 2 has an error of some 1e-7 at its end, and so has its hit with a plane. A ray towards a lamp without a surface ends so far
/// before it.
const LIGHT_OFFSET: f32 = 2.0 * RAY_OFFSET;

/// The least share of the samples for a light. The sun has more power than all lamps of a room that it hardly reaches.
const LEAST_SHARE: f32 = 0.25;

/// The most lights without extent of which each point takes an exact sample each. More are sampled by power.
const MOST_EXACT: usize = 16;

/// The most emitting sides of triangles of which each sample is one by power. Of more, points choose by a tree.
const FEW: usize = 2048;

/// A light of a scene in unit space.
enum Light {
    /// Radiance from outside the scene.
    Environment(Environment),
    /// Directional lights, as one light, and whether direct light has an exact sample of each.
    Distant(DistantLights, bool),
    /// Points and spots, as one light, and the same of them.
    Near(NearLights, bool),
    /// All emissive triangles, as one light.
    Area(AreaLight),
}

/// A sample of direct light. Its mean over uniform points of the unit square is all direct light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// w 0: unit vector towards a light outside the scene; 1: position on a surface, in unit space; 2: position without a surface; 3: centre of a
    /// diffuse sphere.
    pub place: Vec4,
    /// Unit normal of the emitting side, or the axis of a cone. Outside the scene: the vector towards the light, turned round. Of a sphere: a point of
    /// the unit disc, as which the receiver sees the sphere from afar, and the radius.
    pub normal: Vec3,
    /// Over the density of the sample: radiance, per area or per solid angle; without a surface the intensity, of a cone on its axis.
    pub weight: Vec3,
    /// Scale and offset. At an angle of cosine c from the axis there is clamp(scale c + offset, 0, 1)² of the intensity. Of w 2 only. Other lights
    /// have [0, 0], or [0, 1] if rays do not meet them.
    pub cone: [f32; 2],
}

impl LightSample {
    /// On a surface, or outside the scene.
    fn of_side(place: Vec4, normal: Vec3, weight: Vec3) -> Self {
        Self { place, normal, weight, cone: [0.0; 2] }
    }

    /// At a point of a lamp that is sampled with this probability.
    fn on_lamp(LightPoint { position, normal, radiance_area, .. }: LightPoint, probability: f32) -> Self {
        Self::of_side((position + LIGHT_OFFSET * normal).extend(1.0), normal, radiance_area / probability)
    }

    /// The same of a light that no ray meets.
    fn unseen(self) -> Self {
        Self { cone: [0.0, 1.0], ..self }
    }

    /// For a receiver at `origin`: the unit vector towards the sample, the length of the shadow ray, and the irradiance on a surface that faces it. The
    /// twin of `glsl/direct.frag`.
    pub fn seen_from(&self, origin: Vec3) -> (Vec3, f32, Vec3) {
        let near = self.place.w > 0.0;
        let (mut place, mut of_sphere) = (self.place.truncate(), None);
        if self.place.w > 2.0 {
            // A sample lies on the side that the receiver sees.
            let axis = (origin - place).normalize_or(Vec3::Y);
            let [x, y, radius] = self.normal.to_array();
            let normal = frame(axis) * vec3(x, y, (1.0 - x * x - y * y).max(0.0).sqrt());
            place += radius * normal;
            of_sphere = Some((normal, normal.dot(axis).max(1e-6)));
        }
        let way = place - if near { origin } else { Vec3::ZERO };
        let distance = way.length();
        let direction = way / distance;
        let [scale, offset] = self.cone;
        let emitted = match of_sphere {
            Some((normal, density)) => -normal.dot(direction).min(0.0) / density,
            None if self.place.w > 1.0 => (scale * self.normal.dot(-direction) + offset).clamp(0.0, 1.0).powi(2),
            None => -self.normal.dot(direction).min(0.0),
        };
        let gap = if self.place.w > 1.0 { LIGHT_OFFSET } else { 0.0 };
        let received = emitted / if near { distance * distance } else { 1.0 };
        (direction, if near { distance - gap } else { f32::INFINITY }, received * self.weight)
    }
}

/// How a sample of direct light is made.
pub enum LightChoice {
    Sample(LightSample),
    /// Each point chooses a lamp by [`Lights::tree`].
    Tree {
        /// Uniform: for the descent and, with what remains of the first, the point on the lamp.
        numbers: [f32; 2],
        /// The share of such samples among all.
        share: f32,
    },
}

/// All lights of a scene, chosen by power.
pub struct Lights {
    /// Each light with power, and its share of the summed power of itself and all later lights.
    lights: Vec<(Light, f32)>,
    /// Over the lamps with surfaces, if they are many.
    tree: Option<LightTree>,
}

impl Light {
    /// Flux that it sends into the scene, sum of the channels.
    fn power(&self) -> f64 {
        match self {
            // Radiance L from solid angle Ω brings LΩ to each unit of area perpendicular to it. The cross-section of the unit sphere is π.
            Self::Environment(environment) => f64::from(PI) * environment.power(),
            Self::Distant(distant, _) => distant.power,
            Self::Near(near, _) => near.power,
            Self::Area(area) => area.power,
        }
    }

    /// As [`Lights::emit_at`], for a light that is chosen with this probability.
    fn emit(&self, probability: f32, numbers: [f32; 5], focus: &Focus) -> (Path, Vec3) {
        match self {
            Self::Environment(environment) => environment.emit(probability, numbers, focus),
            Self::Distant(distant, _) => distant.emit(probability, numbers, focus),
            Self::Near(near, _) => near.emit(probability, numbers),
            Self::Area(area) => area.emit(probability, numbers),
        }
    }

    /// Whether direct light has an exact sample of each of its lights.
    fn is_exact(&self) -> bool {
        matches!(self, Self::Distant(_, true) | Self::Near(_, true))
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
            Self::Distant(distant, _) => distant.sample(probability, square),
            Self::Near(near, _) => near.sample(probability, square),
            Self::Area(area) => LightSample::on_lamp(area.point_of_square(square), probability),
        }
    }
}

impl Lights {
    /// `scene` must be in unit space.
    pub fn new(scene: &Scene) -> Self {
        let environment = scene.environment.clone().map(Light::Environment);
        let sharp = scene.lights.iter().filter(|light| light.shines() && light.is_sharp()).count();
        // One group is sampled, another has an exact sample of each.
        let kinds: &[Option<bool>] = if sharp <= MOST_EXACT { &[Some(true), Some(false)] } else { &[None] };
        let groups = kinds.iter().flat_map(|&kind| {
            let lights = || scene.lights.iter().filter(move |light| kind.is_none_or(|sharp| light.is_sharp() == sharp));
            let is_exact = kind == Some(true);
            [Light::Distant(DistantLights::new(lights()), is_exact), Light::Near(NearLights::new(lights()), is_exact)]
        });
        Self::of(environment.into_iter().chain(groups).chain([Light::Area(AreaLight::new(scene))]))
    }

    /// This light alone, in unit space.
    pub fn without_surface(light: &PunctualLight) -> Self {
        let lights = || std::iter::once(light);
        Self::of([Light::Distant(DistantLights::new(lights()), false), Light::Near(NearLights::new(lights()), false)].into_iter())
    }

    fn of(lights: impl Iterator<Item = Light>) -> Self {
        let mut lights: Vec<_> = lights.filter(|light| light.power() > 0.0).map(|light| (light, 1.0)).collect();
        let mut rest = 0.0;
        for (light, share) in lights.iter_mut().rev() {
            rest += light.power();
            *share = (light.power() / rest) as f32;
        }
        let mut all = Self { lights, tree: None };
        all.tree = all.area().filter(|area| area.triangle_sides() > FEW).map(|area| LightTree::new(&area.branches()));
        all
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
        self.counted(AreaLight::triangle_sides)
    }

    /// The same without the [exact](Self::exact) ones. Each piece of a triangle with a picture of emission counts.
    pub fn pieces(&self) -> usize {
        self.counted(|area| area.sides.len()) - self.exact().len()
    }

    fn area(&self) -> Option<&AreaLight> {
        self.lights.iter().find_map(|(light, _)| if let Light::Area(area) = light { Some(area) } else { None })
    }

    fn counted(&self, sides: impl Fn(&AreaLight) -> usize) -> usize {
        let count = |(light, _): &(Light, f32)| match light {
            Light::Environment(_) => 0,
            Light::Distant(distant, _) => distant.count(),
            Light::Near(near, _) => near.count(),
            Light::Area(area) => sides(area),
        };
        self.lights.iter().map(count).sum()
    }

    /// Whether there are points or spots, whose samples lie on no surface.
    pub fn have_points(&self) -> bool {
        self.lights.iter().any(|(light, _)| matches!(light, Light::Near(..)))
    }

    /// Whether there is direct light.
    pub fn are_sampled(&self) -> bool {
        self.sampled().next().is_some()
    }

    /// Samples that are exact: one of each light without extent, if these are few. [`Self::choose`] makes samples of all others.
    pub fn exact(&self) -> Vec<LightSample> {
        let mut samples = Vec::new();
        for (light, _) in &self.lights {
            match light {
                Light::Distant(distant, true) => samples.extend(distant.each()),
                Light::Near(near, true) => samples.extend(near.each()),
                _ => {}
            }
        }
        samples
    }

    /// Whether there are lights to choose from, beside the exact ones.
    pub fn are_chosen(&self) -> bool {
        self.sampled().any(|light| !light.is_exact())
    }

    fn sampled(&self) -> impl Iterator<Item = &Light> {
        self.lights.iter().map(|(light, _)| light).filter(|light| light.sampled_power() > 0.0)
    }

    /// The tree by which points choose lamps, if these are many.
    pub fn tree(&self) -> Option<&LightTree> {
        self.tree.as_ref()
    }

    /// The lamps of the tree, in its order.
    pub fn lamps(&self) -> impl Iterator<Item = Lamp> {
        self.area().into_iter().flat_map(AreaLight::lamps)
    }

    /// Maps a uniform point of the unit square to a sample of direct light. `u` selects the light, its remainder the point on it: an even
    /// distribution in the square is even on the lights.
    ///
    /// # Panics
    /// When there is no direct light.
    pub fn sample(&self, square: [f32; 2]) -> LightSample {
        let (light, share, square) = self.light_of(square, |_| true);
        light.sample(share, square)
    }

    /// The same without the [exact](Self::exact) ones. Points choose lamps by the tree if there is one.
    ///
    /// # Panics
    /// When there is no such light.
    pub fn choose(&self, square: [f32; 2]) -> LightChoice {
        match self.light_of(square, |light| !light.is_exact()) {
            (Light::Area(_), share, numbers) if self.tree.is_some() => LightChoice::Tree { numbers, share },
            (light, share, square) => LightChoice::Sample(light.sample(share, square)),
        }
    }

    /// A sample of the tree for a receiver at `position` with the unit normal `normal`, as [`LightChoice::Tree`]. `None`: it brings nothing. The twin of
    /// `lamp_light` in `glsl/include/light_tree.glsl`.
    pub fn sample_tree(&self, position: Vec3, normal: Vec3, [u, v]: [f32; 2]) -> Option<LightSample> {
        let (area, tree) = self.area().zip(self.tree.as_ref())?;
        let (lamp, probability, rest) = tree.descend(position, normal, u)?;
        Some(LightSample::on_lamp(area.point_on(lamp, area.sides[lamp].flux, [rest, v]), probability))
    }

    /// Selects one of these lights by `u`. Returns it, its share of the samples, and the square with the remainder of `u`.
    fn light_of(&self, [u, v]: [f32; 2], is: impl Fn(&Light) -> bool) -> (&Light, f32, [f32; 2]) {
        let lights = || self.sampled().filter(|light| is(light));
        let count = lights().count();
        let least = LEAST_SHARE.min(1.0 / count as f32);
        let all: f64 = lights().map(Light::sampled_power).sum();
        let (mut u, mut left) = (u, 1.0);
        for (index, light) in (1..).zip(lights()) {
            let share = least + (1.0 - least * count as f32) * (light.sampled_power() / all) as f32;
            if index == count {
                return (light, left, [u / left, v]);
            }
            if u < share {
                return (light, share, [u / share, v]);
            }
            (u, left) = (u - share, left - share);
        }
        unreachable!("direct light comes from a light")
    }
}
