//! All settings of a picture except the scene, grouped by stage. Scene files and the command line use flat keys, without stages.

mod display;

use std::fmt::{self, Display, Formatter};
use std::ops::Range;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::Error;

pub use display::{Background, Exposure};

/// Declares each setting once, in the struct of its stage: `key | "old key" => field: type = default`. The key is its name in scene files, reports and
/// metadata. The macro makes the structs, their defaults, and the flat form of all settings.
macro_rules! settings {
    (
        Settings { $($(#[$common_doc:meta])* $common:ident: $common_type:ty = $common_default:expr,)* }
        $($(#[$stage_doc:meta])* $stage:ident: $Stage:ident {
            $($(#[$doc:meta])* $key:ident $(| $old:literal)? => $field:ident: $type:ty = $default:expr,)*
        })*
    ) => {
        $(
            $(#[$stage_doc])*
            #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
            #[serde(default)]
            pub struct $Stage {
                $($(#[$doc])* pub $field: $type,)*
            }

            impl Default for $Stage {
                fn default() -> Self {
                    Self { $($field: $default),* }
                }
            }
        )*

        /// Settings of a render or a bake. Every setting has a default, so a scene file names only the differences.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(from = "FlatSettings", into = "FlatSettings")]
        pub struct Settings {
            $($(#[$common_doc])* pub $common: $common_type,)*
            $($(#[$stage_doc])* pub $stage: $Stage,)*
        }

        impl Default for Settings {
            fn default() -> Self {
                Self { $($common: $common_default,)* $($stage: $Stage::default()),* }
            }
        }

        /// All settings by their keys.
        #[derive(Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields, expecting = "settings by their keys")]
        struct FlatSettings {
            /// Of earlier versions. See [`Settings::WITHOUT_EFFECT`].
            #[serde(rename = "shadow_size", skip_serializing)]
            _shadow_size: IgnoredAny,
            $($common: $common_type,)*
            $($($(#[serde(alias = $old)])? $key: $type,)*)*
        }

        impl Default for FlatSettings {
            fn default() -> Self {
                Settings::default().into()
            }
        }

        impl From<Settings> for FlatSettings {
            fn from(all: Settings) -> Self {
                Self { _shadow_size: IgnoredAny, $($common: all.$common,)* $($($key: all.$stage.$field,)*)* }
            }
        }

        impl From<FlatSettings> for Settings {
            fn from(flat: FlatSettings) -> Self {
                Self { $($common: flat.$common,)* $($stage: $Stage { $($field: flat.$key),* }),* }
            }
        }

        impl Settings {
            /// The current key of a setting, from its current or old key.
            pub(crate) fn key_of(name: &str) -> &str {
                match name {
                    $($($($old => stringify!($key),)?)*)*
                    key => key,
                }
            }
        }
    };
}

settings! {
    Settings {
        /// Seed of all random numbers.
        seed: u64 = 0,
    }

    /// The picture and its points.
    film: FilmSettings {
        /// Picture size in pixels, [width, height].
        size => size: [u32; 2] = [512, 512],
        points => points: PointSource = PointSource::Auto,
        /// Side in pixels of squares of neighbouring pixels that divide the directions among them. Each pixel gathers along its share. Then the pixels
        /// of one surface share their results. 1: every pixel gathers along every direction.
        interleave => interleave: Squares = Squares::Auto,
        /// Whether a plane under the scene catches its shadow, see [`Ground`](crate::points::Ground).
        ground => ground: bool = false,
    }

    /// The global directions, and the estimator for sums along them.
    directions: DirectionSettings {
        /// Number of global directions N. All points share them.
        directions => count: u32 = 1000,
        sequence => sequence: Sequence = Sequence::R2,
        estimator => estimator: Estimator = Estimator::SelfNormalised,
        /// A render stops early at this relative standard error of the mean reflected radiance: root mean square over the pixels, over the picture's
        /// mean, estimated from two halves. 0: never. The `auto` layer size then follows from the number of directions that the error needs.
        target_error | "until" => target_error: f64 = 0.0,
    }

    /// How gather rays find their hits.
    gather: GatherSettings {
        pipeline => pipeline: Pipeline = Pipeline::Auto,
        /// Side of the square depth layers. [`Self::layers`] gives it in texels.
        layer_size => layer_size: LayerSize = LayerSize::Auto,
        /// The poster's criterion: peeling of a direction ends at the first layer that fewer than this share of the points sample, or with 0 none.
        stop_fraction => stop_fraction: f32 = 0.001,
    }

    /// The photon map.
    photons: PhotonSettings {
        /// Number of photons that the lights emit, new ones for every 1024 directions.
        photons => count: u64 = 1_000_000,
        /// Maximum number of surfaces that store one photon.
        photon_depth | "bounces" => depth: u32 = 64,
        /// Where photons leave their light, for gather rays to see.
        photon_map => map: PhotonMapKind = PhotonMapKind::Surface,
        /// Number of photon grid cells along the longest side of the scene. Only for the grid.
        grid_cells => grid_cells: u32 = 32,
    }

    /// Direct light.
    direct: DirectSettings {
        /// Shadow rays of each point to the lights. Neighbouring pixels have different ones.
        light_samples => light_samples: u32 = 128,
    }

    /// Display of pictures. Sums do not depend on it.
    display: DisplaySettings {
        /// Exposure of 8-bit pictures. EXR is never scaled.
        exposure => exposure: Exposure = Exposure::default(),
        /// What 8-bit pictures show where there is no surface.
        background => background: Background = Background::default(),
    }
}

/// Number of directions that share a photon map. Few rays of a point hit the same grid cell, so new photons for each block would only make every map
/// noisier. Beyond about this number, the noise of one map would begin to show.
pub const DIRECTIONS_PER_PHOTON_MAP: u32 = 1024;

/// Source of a picture's points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PointSource {
    /// [`Self::Traced`] where the scene has mirrors, glass or narrow gloss, or the camera a lens; else [`Self::Camera`]. The choice is made when a job begins.
    #[default]
    Auto,
    /// Rasterisation through a pinhole. Every pixel shows the first surface; mirrors and glass look diffuse.
    Camera,
    /// CPU rays, through mirrors, glass, narrow gloss and the camera's lens, to the first diffuse surface.
    Traced,
}

/// Where photons leave their light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhotonMapKind {
    /// On the surfaces that they meet. Sides, rooms and hidden surfaces stay apart.
    #[default]
    Surface,
    /// In cells of space, as in the poster. Surfaces in one cell mix.
    Grid,
}

/// Declares a setting that is "auto" or a whole number.
macro_rules! auto_or_number {
    ($(#[$doc:meta])* $name:ident { $(#[$auto_doc:meta])* Auto, $number:ident } $what:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[serde(try_from = "Value", into = "Value")]
        pub enum $name {
            $(#[$auto_doc])*
            #[default]
            Auto,
            $number(u32),
        }

        impl TryFrom<Value> for $name {
            type Error = String;

            fn try_from(value: Value) -> Result<Self, String> {
                match value.as_u64().and_then(|number| number.try_into().ok()) {
                    Some(number) => Ok(Self::$number(number)),
                    None if value == "auto" => Ok(Self::Auto),
                    None => Err(format!(concat!("{} is no ", $what, ", or \"auto\""), value)),
                }
            }
        }

        impl From<$name> for Value {
            fn from(setting: $name) -> Self {
                match setting {
                    $name::Auto => "auto".into(),
                    $name::$number(number) => number.into(),
                }
            }
        }

        /// As settings spell it.
        impl Display for $name {
            fn fmt(&self, f: &mut Formatter) -> fmt::Result {
                self.serialize(f)
            }
        }
    };
}

auto_or_number! {
    /// Side of the square depth layers.
    LayerSize {
        /// The side grows with the number of directions, see [`GatherSettings::layers`].
        Auto,
        Texels
    }
    "layer size: give a number of texels"
}

auto_or_number! {
    /// Side of the squares of interleaved pixels.
    Squares {
        /// 1, except where [`Pipeline::Auto`] chooses exact rays: then neighbours look along different directions of a longer sequence.
        Auto,
        Pixels
    }
    "square: give 1, 2 or 4 pixels"
}

/// The method of the gather.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Pipeline {
    /// [`Self::Raycast`] with a software driver; on a GPU [`Self::Fused`] where its layers resolve what the points see, else [`Self::RaycastGl`]. The choice is
    /// made when a job begins.
    #[default]
    Auto,
    /// The method of 2004: peels layers from far to near, with one culling (KILL) pass over the points for each layer.
    Kill,
    /// The same, but culled points are not shaded again: the poster's "early KILL operation".
    EarlyKill,
    /// Samples all layers of several directions in one pass, for rays at both ends of each direction. So half the directions give the same number of
    /// samples. It peels to the last layer and ignores the stop fraction. It stores all layers, at least eight, in 12 bytes for each texel.
    Fused,
    /// Exact rays on the CPU, at both ends of each direction. The layers approximate these. Layer size and stop fraction have no effect.
    Raycast,
    /// As `raycast`, on the GL side: ray shooting on the same device.
    RaycastGl,
}

impl Pipeline {
    /// Whether hits come from layers, for which the layer size counts. `auto` may choose them.
    pub fn has_layers(self) -> bool {
        !matches!(self, Self::Raycast | Self::RaycastGl)
    }
}

/// The name in settings.
impl Display for Pipeline {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        self.serialize(f)
    }
}

/// Estimator of irradiance from radiance along N directions. Both converge to the same value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Estimator {
    /// E = π Σ L w / Σ w. Exact for constant radiance, so only its variation causes an error. The bias falls as 1/N and is far below the error. At
    /// smooth shading normals, directions under the surface count as missing.
    #[default]
    SelfNormalised,
    /// E = (4π/N) Σ L w, as in the poster; (2π/N) Σ L w if both ends of a direction count. It has no bias at any N. But constant radiance has a
    /// relative error of 1.29/√N with random directions.
    Plain,
}

/// Source of the global directions.
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

/// As many as in 16384 x 16384.
const MOST_PIXELS: u64 = 1 << 28;

/// Directions for which 128² are best: between 2500, as among hundreds of balls, and 19 000, as in the Cornell box.
const ENOUGH_FOR_128: f64 = 6144.0;

impl GatherSettings {
    /// Side of the square depth layers in texels.
    ///
    /// The error of a layer's texels changes with each direction. So more directions average it out as they do with their own noise, and finer layers
    /// would only take longer. What is left is a bias b, which falls as the side s grows, while the error e of the directions falls as N^(-3/4). The least
    /// error for the time has s in proportion to √(b/e) (docs/sampling.md). So the side of `auto` stays at 128 at first, and then it grows as
    /// N^(3/8). N is the number of directions, or that for the target error.
    pub fn layers(&self, directions: &DirectionSettings) -> u32 {
        match self.layer_size {
            LayerSize::Texels(side) => side,
            LayerSize::Auto => {
                // About 1024 low-discrepancy directions give an error of 1 %. The error falls with their number to the power of 3/4.
                let wanted = 1024.0 * (0.01 / directions.target_error).powf(4.0 / 3.0);
                let side = 128.0 * (wanted.min(directions.count.into()) / ENOUGH_FOR_128).powf(0.375);
                // Smaller layers would save little time.
                ((side / 64.0).round() as u32 * 64).clamp(128, 1024)
            }
        }
    }
}

impl Squares {
    /// Number of pixels that divide each direction of a block among them. With `auto`, a direction may stand for several.
    pub fn pixels(self) -> u32 {
        if let Self::Pixels(side) = self { side * side } else { 1 }
    }
}

impl PhotonSettings {
    /// Indices of the photons of a map. Maps use consecutive ranges.
    pub fn numbers(&self, map: u64) -> Range<u64> {
        map * self.count..(map + 1) * self.count
    }
}

impl Settings {
    /// Keys of earlier versions that are accepted and change nothing, each with the reason.
    pub(crate) const WITHOUT_EFFECT: [(&str, &str); 1] = [("shadow_size", "shadows are exact")];

    /// [`GatherSettings::layers`] for these directions.
    pub fn layers(&self) -> u32 {
        self.gather.layers(&self.directions)
    }

    /// Returns the settings after `change`.
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// The settings that affect sums: all but the display settings.
    pub fn of_sums(&self) -> Self {
        Self { display: DisplaySettings::default(), ..*self }
    }

    /// Checks every number that does not depend on the GL device.
    ///
    /// # Errors
    /// [`Error::Usage`]. Its problem starts with the option of the setting, or with its key if it has no option.
    pub fn validate(&self) -> crate::error::Result<()> {
        let Self { film, directions, gather, photons, direct, display, .. } = self;
        let check = |sound: bool, name: &str, value: &dyn Display, cure: &str| match sound {
            true => Ok(()),
            false => Err(Error::usage(format!("{name} is {value}"), cure)),
        };
        let at_least_one = |name, value: u64| check(value > 0, name, &value, &format!("give {name} of 1 or more"));
        let [width, height] = film.size.map(u64::from);
        at_least_one("size (width)", width)?;
        at_least_one("size (height)", height)?;
        let size = format!("{width} x {height}");
        check(width * height <= MOST_PIXELS, "size", &size, &format!("give at most {MOST_PIXELS} pixels"))?;
        at_least_one("directions", directions.count.into())?;
        let sound = !matches!(gather.layer_size, LayerSize::Texels(0..4));
        let cure = "give 4 texels or more, two of which are the layer's border, or auto";
        check(sound, "layer-size", &gather.layer_size, cure)?;
        at_least_one("photons", photons.count)?;
        at_least_one("photon-depth", photons.depth.into())?;
        at_least_one("light_samples", direct.light_samples.into())?;
        let sound = matches!(film.interleave, Squares::Auto | Squares::Pixels(1 | 2 | 4));
        check(sound, "interleave", &film.interleave, "give 1, 2 or 4 pixels, or auto")?;
        let (count, square) = (directions.count, film.interleave.pixels());
        if count < square {
            let problem = format!("{count} directions leave some of the {square} pixels of a square without");
            return Err(Error::usage(problem, "give more directions, or a smaller interleave"));
        }
        let cells = photons.grid_cells;
        check((1..=256).contains(&cells), "grid_cells", &cells, "give grid_cells from 1 to 256")?;
        let cure = "give a share of the points from 0 up to, not including, 1";
        check((0.0..1.0).contains(&gather.stop_fraction), "stop-fraction", &gather.stop_fraction, cure)?;
        let cure = "give the relative error to reach, above 0 and below 1, or 0 for all directions";
        check((0.0..1.0).contains(&directions.target_error), "target-error", &directions.target_error, cure)?;
        check(display.exposure.is_sound(), "exposure", &display.exposure, "give stops from -64 to 64, or auto")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_grow_with_what_is_wanted() {
        let by = |layer_size, count, target_error| {
            let directions = DirectionSettings { count, target_error, ..Default::default() };
            GatherSettings { layer_size, ..Default::default() }.layers(&directions)
        };
        let layers = |count, target_error| by(LayerSize::Auto, count, target_error);
        assert_eq!([1, 4096, 16384, 65536, 1 << 30].map(|directions| layers(directions, 0.0)), [128, 128, 192, 320, 1024]);
        // A thousand directions for 1 %, and 22 times as many for a tenth of that.
        assert_eq!([layers(1 << 30, 0.01), layers(1 << 30, 0.001), layers(100, 0.001)], [128, 192, 128]);
        assert_eq!(by(LayerSize::Texels(96), 1 << 20, 0.0), 96);
    }

    #[test]
    fn layer_sizes_are_written_as_they_are_read() {
        for (size, text) in [(LayerSize::Auto, "layer_size = \"auto\"\n"), (LayerSize::Texels(96), "layer_size = 96\n")] {
            let settings: Settings = toml::from_str(text).unwrap();
            assert_eq!(settings.gather.layer_size, size);
            assert!(toml::to_string(&settings).unwrap().contains(text), "{text}");
            assert_eq!(serde_json::from_value::<Settings>(serde_json::to_value(settings).unwrap()).unwrap(), settings);
        }
        for wrong in ["layer_size = \"big\"", "layer_size = -1", "layer_size = 5_000_000_000", "layer_size = 1.5"] {
            let error = toml::from_str::<Settings>(wrong).unwrap_err().to_string();
            assert!(error.contains("a number of texels, or \"auto\""), "{error}");
        }
    }
}
