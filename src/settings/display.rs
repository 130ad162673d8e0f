//! Settings of the display: exposure and background, with their spelling in scene files.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

use crate::math::{decode_srgb, encode_srgb};

/// Exposure of 8-bit pictures.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "Value")]
pub enum Exposure {
    /// Chosen from the finished picture, see [`Image::automatic_exposure`](crate::image::Image::automatic_exposure). Bakes have 0.
    Auto,
    Stops(f32),
}

/// What pixels show where they see no surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "Value")]
pub enum Background {
    /// The scene's environment; black without one.
    #[default]
    Environment,
    /// Nothing: the picture has an alpha channel.
    Transparent,
    /// Linear, of display values: neither exposure nor tone curve changes it.
    Color([f32; 3]),
}

impl Exposure {
    /// Most stops up or down.
    pub const MOST: f32 = 64.0;

    /// The stops that it names; 0 for the automatic one.
    pub fn given(self) -> f32 {
        if let Self::Stops(stops) = self { stops } else { 0.0 }
    }

    /// Whether it can be used.
    pub fn is_sound(self) -> bool {
        match self {
            Self::Auto => true,
            Self::Stops(stops) => (-Self::MOST..=Self::MOST).contains(&stops),
        }
    }
}

impl Default for Exposure {
    fn default() -> Self {
        Self::Stops(0.0)
    }
}

impl FromStr for Exposure {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match (text, text.parse::<f32>()) {
            ("auto", _) => Ok(Self::Auto),
            (_, Ok(stops)) if stops.is_finite() => Ok(Self::Stops(stops)),
            _ => Err("not a number of stops such as -1.5, nor auto"),
        }
    }
}

impl TryFrom<Value> for Exposure {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        match value.as_f64() {
            Some(stops) => Ok(Self::Stops(stops as f32)),
            None if value == "auto" => Ok(Self::Auto),
            None => Err(format!("{value} is no exposure: give a number of stops, or \"auto\"")),
        }
    }
}

impl Serialize for Exposure {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Stops(stops) => serializer.serialize_f32(*stops),
        }
    }
}

/// As settings spell it.
impl Display for Exposure {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Stops(stops) => write!(f, "{stops}"),
        }
    }
}

impl Background {
    /// An opaque colour from `#rrggbb` or `#rgb`.
    fn of_hex(text: &str) -> Option<Self> {
        let digits: Vec<u32> = text.strip_prefix('#')?.chars().map(|digit| digit.to_digit(16)).collect::<Option<_>>()?;
        let bytes = match digits[..] {
            [r, g, b] => [r, g, b].map(|digit| 17 * digit as u8),
            [r, r2, g, g2, b, b2] => [[r, r2], [g, g2], [b, b2]].map(|[high, low]| (16 * high + low) as u8),
            _ => return None,
        };
        Some(Self::Color(bytes.map(|byte| decode_srgb(f32::from(byte) / 255.0))))
    }
}

impl FromStr for Background {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let linear = || {
            let numbers: Vec<f32> = text.split(',').map(|number| number.trim().parse().ok()).collect::<Option<_>>()?;
            let color = <[f32; 3]>::try_from(numbers).ok()?;
            color.iter().all(|value| (0.0..=1.0).contains(value)).then_some(Self::Color(color))
        };
        match text {
            "environment" => Ok(Self::Environment),
            "transparent" => Ok(Self::Transparent),
            _ => Self::of_hex(text).or_else(linear).ok_or("not environment, transparent, #rrggbb, or linear r,g,b from 0 to 1"),
        }
    }
}

impl TryFrom<Value> for Background {
    type Error = String;

    fn try_from(value: Value) -> Result<Self, String> {
        let text = match &value {
            Value::Array(numbers) => numbers.iter().map(Value::to_string).collect::<Vec<_>>().join(","),
            value => value.as_str().unwrap_or_default().to_owned(),
        };
        let cure = "give \"environment\", \"transparent\", \"#rrggbb\", or [r, g, b], linear from 0 to 1";
        text.parse().map_err(|_| format!("{value} is no background: {cure}"))
    }
}

/// A colour as its nearest `#rrggbb` only if that is exact.
impl Serialize for Background {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Environment => serializer.serialize_str("environment"),
            Self::Transparent => serializer.serialize_str("transparent"),
            Self::Color(color) => {
                let bytes = color.map(|value| (255.0 * encode_srgb(value)).round() as u8);
                let hex = format!("#{:02x}{:02x}{:02x}", bytes[0], bytes[1], bytes[2]);
                if Self::of_hex(&hex) == Some(*self) { serializer.serialize_str(&hex) } else { color.serialize(serializer) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn they_are_written_as_they_are_read() {
        for exposure in [Exposure::Auto, Exposure::Stops(-1.1)] {
            assert_eq!(exposure.to_string().parse(), Ok(exposure));
            assert_eq!(serde_json::from_value::<Exposure>(serde_json::to_value(exposure).unwrap()).unwrap(), exposure);
        }
        for text in ["environment", "transparent", "#12aBfe", "0.1,0.25, 1"] {
            let background: Background = text.parse().unwrap();
            assert_eq!(serde_json::from_value::<Background>(serde_json::to_value(background).unwrap()).unwrap(), background);
        }
        assert_eq!("#ff0080".parse(), Ok(Background::Color([1.0, 0.0, decode_srgb(128.0 / 255.0)])));
        assert_eq!("#f08".parse::<Background>(), "#ff0088".parse());
        for wrong in ["", "blue", "#12345", "#12345g", "1,2,3", "0,0", "0,0,nan"] {
            assert!(wrong.parse::<Background>().is_err(), "{wrong}");
        }
    }
}
