//! The tables `[sun]`, `[sky]` and `[[lights]]` of scene files.

use glam::{DVec3, Vec3};
use serde::Deserialize;

use crate::scene::{PunctualKind, PunctualLight, Sky, Sun};

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SunTable {
    direction: Option<[f32; 3]>,
    azimuth_degrees: Option<f32>,
    height_degrees: Option<f32>,
    illuminance: Option<[f32; 3]>,
    angle_degrees: Option<f32>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkyTable {
    turbidity: Option<f32>,
    scale: Option<f32>,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightTable {
    kind: KindName,
    name: Option<String>,
    position: Option<[f64; 3]>,
    direction: Option<[f32; 3]>,
    intensity: Option<[f32; 3]>,
    illuminance: Option<[f32; 3]>,
    radius: Option<f64>,
    inner_degrees: Option<f32>,
    outer_degrees: Option<f32>,
    angle_degrees: Option<f32>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum KindName {
    Point,
    Spot,
    Directional,
}

impl SunTable {
    pub fn sun(self) -> Result<Sun, (String, &'static str)> {
        let sun = match (self.direction, self.azimuth_degrees, self.height_degrees) {
            (Some(direction), None, None) => {
                let direction = Vec3::from(direction);
                let Some(unit) = direction.as_dvec3().try_normalize() else {
                    let cure = "give the direction towards the sun, three numbers that are not all 0";
                    return Err((format!("direction is {direction}"), cure));
                };
                Sun { direction: unit.as_vec3(), ..Sun::at(0.0, 0.0) }
            }
            (None, Some(azimuth), Some(height)) if azimuth.is_finite() && (-90.0..=90.0).contains(&height) => {
                Sun::at(azimuth, height)
            }
            (None, Some(azimuth), Some(height)) => {
                let problem = format!("the sun is at azimuth {azimuth} and height {height}");
                return Err((problem, "give degrees: any azimuth, and a height from -90 to 90"));
            }
            _ => {
                let cure = "give direction, or azimuth_degrees and height_degrees, and no more";
                return Err(("a sun has a direction, or an azimuth and a height".into(), cure));
            }
        };
        let angle_degrees = self.angle_degrees.unwrap_or(sun.angle_degrees);
        Ok(Sun { illuminance: self.illuminance.map(Vec3::from), angle_degrees, ..sun })
    }
}

impl SkyTable {
    pub fn sky(self) -> Result<Sky, (String, &'static str)> {
        let default = Sky::default();
        let sky = Sky { turbidity: self.turbidity.unwrap_or(default.turbidity), scale: self.scale.unwrap_or(default.scale) };
        sky.check()
    }
}

impl LightTable {
    /// The light, by default with this name.
    pub fn light(self, name: impl FnOnce() -> String) -> Result<PunctualLight, (String, &'static str)> {
        use KindName::{Directional, Point, Spot};
        let (what, wanted, all) = match self.kind {
            Point => ("point", "give it position and intensity", "take it out: a point has position, intensity and radius"),
            Spot => (
                "spot",
                "give it position, direction and intensity",
                "take it out: a spot has position, direction, intensity, radius, inner_degrees and outer_degrees",
            ),
            Directional => (
                "directional light",
                "give it direction and illuminance",
                "take it out: a directional light has direction, illuminance and angle_degrees",
            ),
        };
        let (is_spot, is_distant) = (matches!(self.kind, Spot), matches!(self.kind, Directional));
        let foreign = [
            (self.position.is_some() && is_distant, "position"),
            (self.direction.is_some() && matches!(self.kind, Point), "direction"),
            (self.intensity.is_some() && is_distant, "intensity"),
            (self.illuminance.is_some() && !is_distant, "illuminance"),
            (self.radius.is_some() && is_distant, "radius"),
            (self.inner_degrees.is_some() && !is_spot, "inner_degrees"),
            (self.outer_degrees.is_some() && !is_spot, "outer_degrees"),
            (self.angle_degrees.is_some() && !is_distant, "angle_degrees"),
        ];
        if let Some((_, key)) = foreign.iter().find(|(given, _)| *given) {
            return Err((format!("a {what} has no {key}"), all));
        }
        let strength = self.intensity.or(self.illuminance);
        let (position, direction) = match self.kind {
            Point => (self.position, Some([0.0, -1.0, 0.0])),
            Spot => (self.position, self.direction),
            Directional => (Some([0.0; 3]), self.direction),
        };
        let (Some(position), Some(direction), Some(strength)) = (position, direction, strength) else {
            return Err((format!("this {what} is not complete"), wanted));
        };
        let radius = self.radius.unwrap_or(0.0);
        let kind = match self.kind {
            Point => PunctualKind::Point { radius },
            Spot => {
                let outer = self.outer_degrees.unwrap_or(45.0);
                let inner = self.inner_degrees.unwrap_or(0.0);
                PunctualKind::Spot { radius, inner: inner.to_radians(), outer: outer.to_radians() }
            }
            Directional => PunctualKind::Directional { angle: self.angle_degrees.unwrap_or(0.0).to_radians() },
        };
        let (position, direction, strength) = (DVec3::from(position), Vec3::from(direction), Vec3::from(strength));
        PunctualLight { name: self.name.unwrap_or_else(name), kind, position, direction, strength }.check()
    }
}
