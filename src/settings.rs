//! What shapes a picture beside the scene: one flat value, read from the scene file and overridden by the command line.

use std::fmt::{self, Display, Formatter};

use serde::de::{self, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::Error;

/// Settings of a render. Every field has a default, so that a scene file names only what differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Picture size in pixels, [width, height].
    pub size: [u32; 2],
    /// Number of global directions N, each shared by all points.
    pub directions: u32,
    /// Side of the square depth layers; [`Self::layers`] has it in texels.
    pub layer_size: LayerSize,
    pub points: PointSource,
    pub pipeline: Pipeline,
    pub estimator: Estimator,
    pub sequence: Sequence,
    /// Side of the squares of neighbouring pixels in which each direction is gathered by one pixel only; what the pixels of one surface
    /// found is then shared among them. 1: every pixel gathers along every direction.
    pub interleave: u32,
    pub seed: u64,
    /// The poster's criterion: peeling a direction ends with the layer that fewer than this share of the points sample.
    /// 0 peels until no point samples.
    pub stop_fraction: f32,
    /// Photons emitted from the lights, afresh for every 1024 directions.
    pub photons: u64,
    /// The most surfaces that one photon is stored at.
    pub bounces: u32,
    /// Photon grid cells along the scene's longest side.
    pub grid_cells: u32,
    /// Samples on the area lights for direct light, over the whole picture.
    pub light_samples: u32,
    /// Side of a shadow map's faces in texels.
    pub shadow_size: u32,
    /// A render ends before all directions are done once the standard error of the mean of reflected radiance (root mean square over
    /// the pixels, as a share of the picture's mean, estimated from two halves) is at most this. 0: never. Layers
    /// of `auto` are no larger than what as many directions as that takes are worth.
    pub until: f64,
    /// Exposure of 8-bit pictures in stops; EXR is never scaled.
    pub exposure: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            size: [512, 512],
            directions: 1000,
            layer_size: LayerSize::Auto,
            points: PointSource::Camera,
            pipeline: Pipeline::Fused,
            estimator: Estimator::SelfNormalised,
            sequence: Sequence::R2,
            interleave: 1,
            seed: 0,
            stop_fraction: 0.001,
            photons: 1_000_000,
            bounces: 64,
            grid_cells: 32,
            light_samples: 512,
            shadow_size: 256,
            until: 0.0,
            exposure: 0.0,
        }
    }
}

/// Directions that see the same photons. So few rays of a point meet in one grid cell that fresh photons for each block would only make
/// every map noisier; after about this many, the noise of one map would begin to show.
pub const DIRECTIONS_PER_PHOTON_MAP: u32 = 1024;

/// Where a picture's points come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PointSource {
    /// Rasterised: every pixel shows the first surface, mirrors and glass as diffuse ones, through a pinhole.
    #[default]
    Camera,
    /// Rays on the CPU, through mirrors, glass and the camera's lens to the first diffuse surface.
    Traced,
}

/// Side of the square depth layers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LayerSize {
    /// What the directions are worth: see [`Settings::layers`].
    #[default]
    Auto,
    Texels(u32),
}

impl Display for LayerSize {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Self::Auto => f.pad("auto"),
            Self::Texels(side) => Display::fmt(side, f),
        }
    }
}

impl Serialize for LayerSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match *self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Texels(side) => serializer.serialize_u32(side),
        }
    }
}

impl<'de> Deserialize<'de> for LayerSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Size;

        impl Visitor<'_> for Size {
            type Value = LayerSize;

            fn expecting(&self, f: &mut Formatter) -> fmt::Result {
                f.write_str("a number of texels, or \"auto\"")
            }

            fn visit_i64<E: de::Error>(self, side: i64) -> Result<LayerSize, E> {
                let texels = u32::try_from(side).map(LayerSize::Texels);
                texels.map_err(|_| E::invalid_value(Unexpected::Signed(side), &self))
            }

            fn visit_u64<E: de::Error>(self, side: u64) -> Result<LayerSize, E> {
                self.visit_i64(side.try_into().unwrap_or(i64::MAX))
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<LayerSize, E> {
                match text {
                    "auto" => Ok(LayerSize::Auto),
                    _ => Err(E::invalid_value(Unexpected::Str(text), &self)),
                }
            }
        }

        deserializer.deserialize_any(Size)
    }
}

/// How the gather is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pipeline {
    /// The 2004 method: layers peeled far to near, one culling (KILL) pass over the points for each layer.
    Kill,
    /// The same, but points that a layer culls are not shaded again: the poster's "early KILL operation".
    EarlyKill,
    /// All layers of several directions sampled in one pass, for rays at both ends of each: as many samples from half the directions, and to
    /// the last layer, whatever the stop fraction. Keeps all layers, at least eight, in 12 bytes a texel each.
    #[default]
    Fused,
    /// Exact rays on the CPU along the same directions: what the layers approximate. Layer size and stop fraction mean nothing to it.
    Raycast,
    /// Exact rays on the GL side, for both ends of each direction as `fused`: ray shooting, by the same device. Layer size and stop fraction mean
    /// nothing to it.
    RaycastGl,
}

impl Pipeline {
    /// As settings spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kill => "kill",
            Self::EarlyKill => "early-kill",
            Self::Fused => "fused",
            Self::Raycast => "raycast",
            Self::RaycastGl => "raycast-gl",
        }
    }
}

/// How radiance along N directions makes an irradiance. Both tend to the same value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// E = π Σ L w / Σ w. Exact where radiance is constant, so that only its variation makes an error; in return a point has a bias that
    /// falls as 1/N, far below its error, and at smooth shading normals the directions under the surface count as if not there.
    #[default]
    SelfNormalised,
    /// E = (4π/N) Σ L w, the poster's; (2π/N) Σ L w where both ends of a direction count. Without bias at any N, but a constant radiance has a relative error of 1.29/√N with random directions.
    Plain,
}

/// Where global directions come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sequence {
    /// Independent, uniformly distributed.
    Random,
    /// The additive recurrence with the plastic number.
    #[default]
    R2,
    /// The first two Sobol dimensions, Owen-scrambled.
    Sobol,
}

/// As many as 16384 x 16384.
const MOST_PIXELS: u64 = 1 << 28;

impl Settings {
    /// Side of the square depth layers in texels.
    ///
    /// What a texel is off by differs from one direction to the next, so that more directions even it out as they do their own noise, though less
    /// well. The side grows with their root, or with that of as many as the wanted error takes, and adds a twentieth to a quarter to the error of so
    /// many (ARCHITECTURE has the measurements): in the end both vanish.
    pub fn layers(&self) -> u32 {
        match self.layer_size {
            LayerSize::Texels(side) => side,
            LayerSize::Auto => {
                // About 1024 of low discrepancy to a percent, falling as their number to the power of 3/4.
                let wanted = 1024.0 * (0.01 / self.until).powf(4.0 / 3.0);
                let side = 128.0 * (wanted.min(self.directions.into()) / 1024.0).sqrt();
                // Fewer texels would save little.
                ((side / 64.0).round() as u32 * 64).clamp(128, 1024)
            }
        }
    }

    /// Checks every number that does not depend on the GL device.
    pub fn validate(&self) -> crate::error::Result<()> {
        let at_least_one = |name: &str, value: u64| match value {
            0 => Err(Error::usage(format!("{name} is 0"), format!("give {name} of 1 or more"))),
            _ => Ok(()),
        };
        at_least_one("size (width)", self.size[0].into())?;
        at_least_one("size (height)", self.size[1].into())?;
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        if pixels > MOST_PIXELS {
            let problem = format!("size is {} x {}", self.size[0], self.size[1]);
            return Err(Error::usage(problem, format!("give at most {MOST_PIXELS} pixels")));
        }
        at_least_one("directions", self.directions.into())?;
        if matches!(self.layer_size, LayerSize::Texels(0..4)) {
            return Err(Error::usage(
                format!("layer-size is {}", self.layer_size),
                "give 4 texels or more, two of which are the layer's border, or auto",
            ));
        }
        at_least_one("photons", self.photons)?;
        at_least_one("bounces", self.bounces.into())?;
        at_least_one("light_samples", self.light_samples.into())?;
        at_least_one("shadow_size", self.shadow_size.into())?;
        if !matches!(self.interleave, 1 | 2 | 4) {
            return Err(Error::usage(format!("interleave is {}", self.interleave), "give 1, 2 or 4 pixels"));
        }
        if self.directions < self.interleave * self.interleave {
            return Err(Error::usage(
                format!(
                    "{} directions leave some of the {} pixels of a square without",
                    self.directions,
                    self.interleave * self.interleave
                ),
                "give more directions, or a smaller interleave",
            ));
        }
        if !(1..=256).contains(&self.grid_cells) {
            return Err(Error::usage(format!("grid_cells is {}", self.grid_cells), "give grid_cells from 1 to 256"));
        }
        if !(0.0..1.0).contains(&self.stop_fraction) {
            return Err(Error::usage(
                format!("stop-fraction is {}", self.stop_fraction),
                "give a share of the points from 0 up to, not including, 1",
            ));
        }
        if !(0.0..1.0).contains(&self.until) {
            return Err(Error::usage(
                format!("until is {}", self.until),
                "give the relative error to reach, above 0 and below 1, or 0 for all directions",
            ));
        }
        if !(-64.0..=64.0).contains(&self.exposure) {
            return Err(Error::usage(format!("exposure is {}", self.exposure), "give stops from -64 to 64"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_grow_with_what_is_wanted() {
        let layers = |directions, until| Settings { directions, until, ..Settings::default() }.layers();
        assert_eq!([1, 1000, 4096, 16384, 1 << 30].map(|directions| layers(directions, 0.0)), [128, 128, 256, 512, 1024]);
        // A thousand directions to a percent, and eight times as many to a fifth of it.
        assert_eq!([layers(1 << 30, 0.01), layers(1 << 30, 0.002), layers(100, 0.002)], [128, 384, 128]);
        assert_eq!(Settings { layer_size: LayerSize::Texels(96), directions: 1 << 20, ..Settings::default() }.layers(), 96);
    }

    #[test]
    fn layer_sizes_are_written_as_they_are_read() {
        for (size, text) in [(LayerSize::Auto, "layer_size = \"auto\"\n"), (LayerSize::Texels(96), "layer_size = 96\n")] {
            let settings: Settings = toml::from_str(text).unwrap();
            assert_eq!(settings.layer_size, size);
            assert!(toml::to_string(&settings).unwrap().contains(text), "{text}");
            assert_eq!(serde_json::from_value::<Settings>(serde_json::to_value(&settings).unwrap()).unwrap(), settings);
        }
        for wrong in ["layer_size = \"big\"", "layer_size = -1", "layer_size = 5_000_000_000", "layer_size = 1.5"] {
            let error = toml::from_str::<Settings>(wrong).unwrap_err().to_string();
            assert!(error.contains("a number of texels, or \"auto\""), "{error}");
        }
    }
}
