//! Lights without a surface: points, spots and directional lights. No ray meets them, and no camera sees them.
//!
//! A point of I candela brings I/d² lux to a surface that faces it at the distance d. A directional light brings its illuminance everywhere.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3, vec3};

use super::super::{Path, UnitSpace};
use super::focus::Focus;
use super::{LIGHT_OFFSET, LightSample};
use crate::math::frame;
use crate::random::Distribution;

/// The narrowest edge of a spot's cone, in the cosine, as in the glTF extension; and as a share of the whole cone, if that is narrow itself.
const EDGE: f64 = 1e-3;
const EDGE_SHARE: f64 = 0.05;
/// The least outer angle of a spot, in radians: f32 holds the edge of such a cone.
const NARROWEST: f32 = 1.7e-4;
/// Maximum coordinate and radius, as of vertices.
const FARTHEST: f64 = 1e9;
/// In unit space: from farther away light is parallel, and equal all over the scene, to one part in ten thousand. f32 no longer holds its directions.
const FAR: f64 = 1e4;
/// Maximum intensity or illuminance. Its flux, also in unit space, is finite in f32.
const BRIGHTEST: f32 = 1e15;

/// A light without a surface. In a [`World`](super::super::World) it is in world space, in a [`Scene`](super::super::Scene) in unit space.
#[derive(Clone, Debug, PartialEq)]
pub struct PunctualLight {
    pub name: String,
    pub kind: PunctualKind,
    /// Of points and spots.
    pub position: DVec3,
    /// Unit vector along which spots and directional lights shine.
    pub direction: Vec3,
    /// Luminous intensity of a point, or of a spot on its axis, in cd; illuminance of a directional light, in lux, on a surface that faces it. RGB.
    pub strength: Vec3,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualKind {
    /// The same intensity in all directions, from a diffuse sphere of this radius. 0: from a point, so that shadows are sharp.
    Point { radius: f64 },
    /// A cone, from a disc of this radius across its axis. The angles are from the axis, in radians: within `inner` it has its whole intensity, and
    /// beyond `outer` none.
    Spot { radius: f64, inner: f32, outer: f32 },
    /// Parallel light, or that of a disc in the sky of this diameter, in radians.
    Directional { angle: f32 },
}

impl PunctualLight {
    /// Returns itself with a direction of length 1, or the problem and its cure.
    pub fn check(self) -> Result<Self, (String, &'static str)> {
        let Self { strength, position, .. } = self;
        let (radius, what) = match self.kind {
            PunctualKind::Point { radius } | PunctualKind::Spot { radius, .. } => (radius, "intensity"),
            PunctualKind::Directional { .. } => (0.0, "illuminance"),
        };
        if !strength.to_array().iter().all(|channel| (0.0..=BRIGHTEST).contains(channel)) {
            let cure = "give a number from 0 to 1e15, or one for each of red, green and blue";
            return Err((format!("{what} is {strength}"), cure));
        }
        if !(0.0..=FARTHEST).contains(&position.abs().max_element()) {
            return Err((format!("position is {position}"), "give three numbers from -1e9 to 1e9"));
        }
        if !(0.0..=FARTHEST).contains(&radius) {
            return Err((format!("radius is {radius}"), "give a length from 0 to 1e9"));
        }
        match self.kind {
            PunctualKind::Spot { inner, outer, .. }
                if !((0.0..=outer).contains(&inner) && (NARROWEST..=0.5 * PI + 1e-6).contains(&outer)) =>
            {
                let [inner, outer] = [inner, outer].map(f32::to_degrees);
                let cure = "give angles from the axis: 0 <= inner <= outer <= 90 degrees, and an outer angle of 0.01 at least";
                return Err((format!("the cone reaches from {inner} to {outer} degrees"), cure));
            }
            PunctualKind::Directional { angle } if !(0.0..=PI).contains(&angle) => {
                return Err((format!("its angle is {} degrees", angle.to_degrees()), "give a diameter from 0 to 180 degrees"));
            }
            _ => {}
        }
        let direction = self.direction.as_dvec3().normalize_or_zero().as_vec3();
        if direction == Vec3::ZERO {
            let cure = "give the direction in which it shines, three numbers that are not all 0";
            return Err((format!("direction is {}", self.direction), cure));
        }
        Ok(Self { direction, ..self })
    }

    /// Whether it gives light.
    pub fn shines(&self) -> bool {
        self.strength != Vec3::ZERO
    }

    /// Whether it has no extent, so that one sample is exact.
    pub fn is_sharp(&self) -> bool {
        match self.kind {
            PunctualKind::Point { radius } | PunctualKind::Spot { radius, .. } => radius == 0.0,
            PunctualKind::Directional { angle } => angle == 0.0,
        }
    }

    pub fn is_directional(&self) -> bool {
        matches!(self.kind, PunctualKind::Directional { .. })
    }

    /// The same light in unit space, with the same illuminance on the same surfaces.
    pub fn in_space(&self, space: UnitSpace) -> Self {
        let length = |radius: f64| f64::from(space.length_to_unit(radius as f32));
        let (kind, strength) = match self.kind {
            PunctualKind::Directional { .. } => return self.clone(),
            PunctualKind::Point { radius } => (PunctualKind::Point { radius: length(radius) }, self.strength),
            PunctualKind::Spot { radius, inner, outer } => {
                (PunctualKind::Spot { radius: length(radius), inner, outer }, self.strength)
            }
        };
        let position = space.enter_point(self.position).as_dvec3();
        let distance = position.length();
        if distance > FAR {
            let direction = (-position / distance).as_vec3();
            let (radius, share) = match kind {
                PunctualKind::Spot { radius, inner, outer } => {
                    (radius, Cone::new(inner, outer).share(self.direction.dot(direction)))
                }
                PunctualKind::Point { radius } => (radius, 1.0),
                PunctualKind::Directional { .. } => (0.0, 1.0),
            };
            let kind = PunctualKind::Directional { angle: 2.0 * (radius / distance).min(1.0).asin() as f32 };
            let illuminance = space.intensity_to_unit(strength).as_dvec3() * f64::from(share) / (distance * distance);
            return Self { kind, direction, strength: illuminance.as_vec3(), ..self.clone() };
        }
        Self { kind, position, strength: space.intensity_to_unit(strength), ..self.clone() }
    }

    /// Flux of a point or spot in lm, or illuminance of a directional light in lux.
    pub fn output(&self) -> Vec3 {
        let solid_angle = match self.kind {
            PunctualKind::Point { .. } => 2.0 * TAU,
            PunctualKind::Spot { inner, outer, .. } => Cone::new(inner, outer).solid_angle,
            PunctualKind::Directional { .. } => 1.0,
        };
        solid_angle * self.strength
    }
}

/// What a spot sends into a direction: clamp(scale cos + offset, 0, 1)² of its intensity, as the glTF extension suggests.
#[derive(Clone, Copy)]
struct Cone {
    scale: f32,
    offset: f32,
    /// Of a cone with the whole intensity and this one's flux.
    solid_angle: f32,
    /// 1 - cos of the outer angle.
    height: f32,
}

impl Cone {
    /// All directions.
    const SPHERE: Self = Self { scale: 0.0, offset: 1.0, solid_angle: 2.0 * TAU, height: 2.0 };

    fn new(inner: f32, outer: f32) -> Self {
        let height = |angle: f32| 2.0 * (0.5 * f64::from(angle)).sin().powi(2);
        let (inner, outer) = (height(inner), height(outer));
        let edge = (outer - inner).max(EDGE.min(EDGE_SHARE * outer));
        // The square of a ramp from 0 to 1 has the mean 1/3.
        let solid_angle = std::f64::consts::TAU * (outer - edge * 2.0 / 3.0);
        Self {
            scale: (1.0 / edge) as f32,
            offset: ((outer - 1.0) / edge) as f32,
            solid_angle: solid_angle as f32,
            height: outer as f32,
        }
    }

    fn share(self, cosine: f32) -> f32 {
        (self.scale * cosine + self.offset).clamp(0.0, 1.0).powi(2)
    }
}

/// Points and spots, as one light.
pub struct NearLights {
    lights: Vec<NearLight>,
    by_power: Distribution,
    /// Flux into the scene, sum of the channels.
    pub power: f64,
}

/// A point or spot in unit space.
struct NearLight {
    position: Vec3,
    /// Unit vector along a spot's axis.
    axis: Vec3,
    intensity: Vec3,
    radius: f32,
    is_spot: bool,
    cone: Cone,
    /// A cone of all directions that may bring photons into the scene: its axis, and 1 - cos of its angle.
    window: (Vec3, f32),
}

impl NearLights {
    /// Those of the lights that are points or spots.
    pub fn new<'a>(lights: impl Iterator<Item = &'a PunctualLight>) -> Self {
        let lights: Vec<_> = lights.filter(|light| light.shines()).filter_map(NearLight::new).collect();
        let powers: Vec<f64> = lights.iter().map(NearLight::power).collect();
        Self { power: powers.iter().sum(), by_power: Distribution::new(powers), lights }
    }

    pub fn count(&self) -> usize {
        self.lights.len()
    }

    /// A sample of each light, which is exact for those without extent.
    pub fn each(&self) -> impl Iterator<Item = LightSample> {
        self.lights.iter().map(|light| light.sample(light.intensity, [0.5; 2]))
    }

    /// A photon from a light, evenly over its cone; see [`super::Lights::emit`].
    pub fn emit(&self, probability: f32, [pick, u, v, s, t]: [f32; 5]) -> (Path, Vec3) {
        let (slot, _, of_light) = self.by_power.pick(pick);
        let light = &self.lights[slot];
        let (axis, height) = light.window;
        let direction = within(axis, height, [u, v]);
        let on_disc = light.radius * disc([s, t]);
        let start = if light.is_spot {
            frame(light.axis) * on_disc
        } else {
            // Seen from afar a diffuse sphere is a disc of even radiance.
            frame(direction) * on_disc.with_z((light.radius.powi(2) - on_disc.length_squared()).max(0.0).sqrt())
        };
        // A lamp on a ceiling is not behind it: see [`LIGHT_OFFSET`].
        let path = Path { origin: light.position + start + LIGHT_OFFSET * direction, direction, triangle: None };
        let share = light.cone.share(light.axis.dot(direction));
        (path, light.intensity * (share * TAU * height / (of_light * probability)))
    }

    /// As [`super::Lights::sample`].
    pub fn sample(&self, probability: f32, [u, v]: [f32; 2]) -> LightSample {
        let (slot, rest, of_light) = self.by_power.pick(u);
        let light = &self.lights[slot];
        light.sample(light.intensity / (of_light * probability), [rest, v])
    }
}

impl NearLight {
    fn new(light: &PunctualLight) -> Option<Self> {
        let (radius, cone, is_spot) = match light.kind {
            PunctualKind::Point { radius } => (radius, Cone::SPHERE, false),
            PunctualKind::Spot { radius, inner, outer } => (radius, Cone::new(inner, outer), true),
            PunctualKind::Directional { .. } => return None,
        };
        let (position, axis, radius) = (light.position.as_vec3(), light.direction, radius as f32);
        // The scene lies in the unit sphere. Of a lamp beyond it, few directions of all lead there.
        let (distance, reach) = (position.length(), 1.0 + radius);
        let of_scene = if distance > reach {
            let sine = (reach / distance).powi(2);
            (-position / distance, sine / (1.0 + (1.0 - sine).sqrt()))
        } else {
            (axis, 2.0)
        };
        let window = if of_scene.1 < cone.height { of_scene } else { (axis, cone.height) };
        Some(Self { position, axis, intensity: light.strength, radius, is_spot, cone, window })
    }

    /// A sample of this weight.
    fn sample(&self, weight: Vec3, square: [f32; 2]) -> LightSample {
        let &Self { position, axis, radius, is_spot, cone, .. } = self;
        if !is_spot && radius > 0.0 {
            let normal = disc(square).with_z(radius);
            return LightSample { place: position.extend(3.0), normal, weight, cone: [0.0, 1.0] };
        }
        let place = position + frame(axis) * (radius * disc(square));
        LightSample { place: place.extend(2.0), normal: axis, weight, cone: [cone.scale, cone.offset] }
    }

    fn power(&self) -> f64 {
        self.intensity.as_dvec3().element_sum() * f64::from(self.cone.solid_angle.min(TAU * self.window.1))
    }
}

/// Directional lights, as one light.
pub struct DistantLights {
    lights: Vec<DistantLight>,
    by_power: Distribution,
    /// Flux through the unit sphere, sum of the channels.
    pub power: f64,
}

struct DistantLight {
    to_light: Vec3,
    /// 1 - cos of half its angle.
    height: f32,
    /// Radiance times solid angle.
    weight: Vec3,
}

impl DistantLights {
    /// Those of the lights that are directional.
    pub fn new<'a>(lights: impl Iterator<Item = &'a PunctualLight>) -> Self {
        let lights: Vec<_> = lights.filter(|light| light.shines()).filter_map(DistantLight::new).collect();
        // The cross-section of the unit sphere is π.
        let powers: Vec<f64> = lights.iter().map(|light| f64::from(PI) * light.weight.as_dvec3().element_sum()).collect();
        Self { power: powers.iter().sum(), by_power: Distribution::new(powers), lights }
    }

    pub fn count(&self) -> usize {
        self.lights.len()
    }

    /// A sample of each light, which is exact for those without extent.
    pub fn each(&self) -> impl Iterator<Item = LightSample> {
        self.lights.iter().map(|light| LightSample::of_side(light.to_light.extend(0.0), -light.to_light, light.weight).unseen())
    }

    /// A photon through the disc that covers a sphere of `focus`, as those of an environment.
    pub fn emit(&self, probability: f32, [pick, u, v, s, t]: [f32; 5], focus: &Focus) -> (Path, Vec3) {
        let (to_light, weight) = self.direction([u, v]);
        let (path, density) = focus.ray(to_light, [pick, s, t]);
        (path, weight * (PI / (probability * density)))
    }

    /// As [`super::Lights::sample`].
    pub fn sample(&self, probability: f32, square: [f32; 2]) -> LightSample {
        let (to_light, weight) = self.direction(square);
        LightSample::of_side(to_light.extend(0.0), -to_light, weight / probability).unseen()
    }

    /// A direction to a light, and radiance over density.
    fn direction(&self, [u, v]: [f32; 2]) -> (Vec3, Vec3) {
        let (slot, rest, of_light) = self.by_power.pick(u);
        let DistantLight { to_light, height, weight } = self.lights[slot];
        (within(to_light, height, [rest, v]), weight / of_light)
    }
}

impl DistantLight {
    fn new(light: &PunctualLight) -> Option<Self> {
        let PunctualKind::Directional { angle } = light.kind else { return None };
        let height = 2.0 * (0.25 * angle).sin().powi(2);
        // A disc of half angle α and radiance L has the illuminance π L sin²α and the solid angle 2π (1 - cos α).
        Some(Self { to_light: -light.direction, height, weight: light.strength * (2.0 / (2.0 - height)) })
    }
}

/// A direction even in solid angle within a cone, of which `height` is 1 - cos of the angle. 2 is the whole sphere.
fn within(axis: Vec3, height: f32, [u, v]: [f32; 2]) -> Vec3 {
    // By 1 - cos and not by the cosine, which has few digits in a narrow cone.
    let down = u * height;
    let radius = (down * (2.0 - down)).sqrt();
    let (sin, cos) = (TAU * v).sin_cos();
    frame(axis) * vec3(radius * cos, radius * sin, 1.0 - down)
}

/// An even point of the unit disc in the plane z = 0.
fn disc([u, v]: [f32; 2]) -> Vec3 {
    let (sin, cos) = (TAU * v).sin_cos();
    u.sqrt() * vec3(cos, sin, 0.0)
}
