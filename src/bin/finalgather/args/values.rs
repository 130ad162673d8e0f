//! Parsers for the values of options.

use std::fmt::Display;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use finalgather::error::Result;
use finalgather::scene::{Sky, Sun, World};
use finalgather::settings::Settings;
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use serde::{Deserialize, Serialize};

/// Help text for an option that overrides a setting, with the library's default.
pub fn setting<T: Display>(text: &str, default: impl Fn(Settings) -> T) -> String {
    format!("{text} [default: {}]", default(Settings::default()))
}

/// The name of this value in scene files.
pub fn name(value: impl Serialize) -> String {
    serde_json::to_value(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Parses one of these names, in the same way as a scene file.
pub fn named<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: for<'de> Deserialize<'de> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| -> Result<T, ValueError> { T::deserialize(name.into_deserializer()) })
}

/// Parses a whole number: digits with optional `_` between them, or a float such as `1e6`.
pub fn count<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    /// 2^53, the first float without a neighbour at distance 1. Larger floats may differ from the number in the text.
    const INEXACT: f64 = 9_007_199_254_740_992.0;
    // `_` may only stand between digits.
    let digits = if text.starts_with('_') || text.ends_with('_') { String::new() } else { text.replace('_', "") };
    let number = digits.parse::<u64>().ok().or_else(|| {
        let float = digits.parse::<f64>().ok()?;
        ((0.0..INEXACT).contains(&float) && float.fract() == 0.0).then_some(float as u64)
    });
    let number = number.ok_or_else(|| match digits.parse::<f64>() {
        Ok(float) if float < 0.0 => "negative",
        Ok(float) if float >= INEXACT => "too large",
        _ => "not a whole number such as 1000, 1_000 or 1e3",
    })?;
    T::try_from(number).map_err(|_| "too large".into())
}

/// Parses a time: a number of seconds, or a number with s, m or h. In seconds.
pub fn duration(text: &str) -> Result<f64, String> {
    let units = [("s", 1.0), ("m", 60.0), ("h", 3600.0)];
    let unit = units.into_iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let (number, seconds) = unit.unwrap_or((text, 1.0));
    let right = |number: &f64| number.is_finite() && *number > 0.0;
    checked::<f64>(number, right, "not a time such as 10, 90s, 5m or 1h").map(|number| number * seconds)
}

/// Parses a share: a number, or a percentage.
pub fn percentage(text: &str) -> Result<f64, String> {
    let (number, of) = text.strip_suffix('%').map_or((text, 1.0), |number| (number, 100.0));
    number
        .trim_end()
        .parse::<f64>()
        .map(|number| number / of)
        .map_err(|_| "not a number such as 0.01, or a percentage such as 1%".into())
}

/// Parses a value that satisfies `right`. The error is `wrong`.
pub fn checked<T: std::str::FromStr>(text: &str, right: impl Fn(&T) -> bool, wrong: &str) -> Result<T, String> {
    text.parse().ok().filter(right).ok_or_else(|| wrong.to_owned())
}

/// The value of an option that may be `auto`: then the scene decides.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(transparent)]
pub struct OrAuto<T>(pub Option<T>);

/// Parses "auto" or what `parse` takes.
pub fn or_auto<T, E: Display>(text: &str, parse: impl Fn(&str) -> Result<T, E>) -> Result<OrAuto<T>, String> {
    if text == "auto" {
        return Ok(OrAuto(None));
    }
    parse(text).map(|value| OrAuto(Some(value))).map_err(|error| format!("{error}; or auto"))
}

/// Parses "on" or "off".
pub fn switch(text: &str) -> Result<bool, &'static str> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("not on or off"),
    }
}

pub fn stops(text: &str) -> Result<f32, String> {
    checked(text, |stops: &f32| stops.is_finite(), "not a number of stops such as -1.5")
}

/// Parses an angle of [`World::smooth`].
pub fn smooth_angle(text: &str) -> Result<f32, String> {
    checked(text, |degrees| World::SMOOTH_ANGLES.contains(degrees), World::SMOOTH_ANGLE_CURE)
}

/// Parses three finite numbers with commas between them.
pub fn vector(text: &str) -> Result<[f64; 3], String> {
    let numbers: Vec<f64> =
        text.split(',').filter_map(|number| number.trim().parse().ok()).filter(|number: &f64| number.is_finite()).collect();
    let whole = text.split(',').count() == numbers.len();
    <[f64; 3]>::try_from(numbers)
        .ok()
        .filter(|_| whole)
        .ok_or_else(|| "not three numbers with commas between them, such as 0,1.5,-3".into())
}

/// Parses `AZIMUTH,HEIGHT` or `AZIMUTH,HEIGHT,LUX`.
pub fn sun(text: &str) -> Result<Sun, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    numbers
        .as_deref()
        .and_then(Sun::of_numbers)
        .ok_or_else(|| "not an azimuth and a height from -90 to 90 degrees, as 120,35, and perhaps lux, as 120,35,1e5".into())
}

/// Parses a turbidity.
pub fn sky(text: &str) -> Result<Sky, String> {
    let turbidity = number::<f32>(text)?;
    Sky { turbidity, ..Sky::default() }.check().map_err(|(problem, cure)| format!("{problem}: {cure}"))
}

pub fn number<T: std::str::FromStr>(text: &str) -> Result<T, String> {
    checked(text, |_| true, "not a number such as 0.5")
}

/// Parses "auto" or a whole number.
pub fn auto_or<T: Default>(text: &str, number: fn(u32) -> T) -> Result<T, String> {
    if text == "auto" { Ok(T::default()) } else { count(text).map(number).map_err(|error| format!("{error}, nor auto")) }
}

/// Parses `WxH`, or `N` for a square.
pub fn size(text: &str) -> Result<[u32; 2], String> {
    let (width, height) = text.split_once(['x', 'X']).unwrap_or((text, text));
    let side = |side: &str| count(side).map_err(|_| "not a size such as 640x480, or 512 for a square".to_owned());
    Ok([side(width)?, side(height)?])
}

/// Parses the side of a square, `N` or `NxN`.
pub fn side(text: &str) -> Result<u32, String> {
    match size(text) {
        Ok([width, height]) if width == height => Ok(width),
        Ok([width, height]) => Err(format!("not a square; give {}", width.max(height))),
        Err(_) => Err("not a whole number such as 512".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn counts() {
        for (text, number) in [("0", 0), ("1e6", 1_000_000), ("1_000_000", 1_000_000), ("2.5E2", 250)] {
            assert_eq!(count::<u64>(text), Ok(number), "{text}");
        }
        assert_eq!(count::<u64>("18446744073709551615"), Ok(u64::MAX));
        for text in ["", "_", "-1", "1.5", "1e40", "nan", "inf", "ten"] {
            assert!(count::<u64>(text).is_err(), "{text}");
        }
        assert_eq!(count::<u32>("5e9"), Err("too large".into()));
    }

    #[test]
    fn vectors() {
        assert_eq!(vector("1,-2.5, 1e3"), Ok([1.0, -2.5, 1000.0]));
        for text in ["", "1,2", "1,2,3,4", "1,,3,4", "1,2,nan", "1,2,inf", "1 2 3"] {
            assert!(vector(text).is_err(), "{text}");
        }
    }

    #[test]
    fn suns_and_skies() {
        let found = sun("90,0").unwrap();
        assert!(found.direction.distance(Vec3::X) < 1e-6 && found.illuminance.is_none(), "{found:?}");
        let found = sun("-0, 30, 1e5").unwrap();
        assert!(found.direction.distance(Vec3::new(0.0, 0.5, -0.75f32.sqrt())) < 1e-6, "{found:?}");
        assert_eq!(found.illuminance, Some(Vec3::splat(1e5)));
        for text in ["", "1", "1,2,3,4", "1,91", "nan,2", "1,2,-1", "1,2,inf"] {
            assert!(sun(text).is_err(), "{text}");
        }
        assert!(sky("4.5").is_ok_and(|sky| sky.turbidity == 4.5) && sky("1").is_err() && sky("clear").is_err());
    }

    #[test]
    fn sizes() {
        assert_eq!(size("64"), Ok([64, 64]));
        assert_eq!(size("640x480"), Ok([640, 480]));
        for text in ["", "x", "640x", "640x480x3", "-1x5"] {
            assert!(size(text).is_err(), "{text}");
        }
    }
}
