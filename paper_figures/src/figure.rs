//! What a figure is, how much of it to measure, and the JSON document between measuring and drawing.

use std::error::Error;
use std::str::FromStr;
use std::time::Instant;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};

use crate::machine::{self, Machine};

pub type Result<T, E = Box<dyn Error>> = std::result::Result<T, E>;

/// A figure: the type of its data, which can be measured and drawn.
pub trait Figure: Serialize + DeserializeOwned {
    const NAME: &'static str;
    /// What it shows, in a line for `--help`.
    const ABOUT: &'static str;

    fn measure(scale: Scale) -> Result<Self>;

    /// An SVG document.
    fn draw(&self) -> Result<String>;
}

/// A [`Figure`] among others in a list.
pub struct Entry {
    pub name: &'static str,
    pub about: &'static str,
    measure: fn(Scale) -> Result<Value>,
    draw: fn(&Value) -> Result<String>,
}

impl Entry {
    pub const fn of<F: Figure>() -> Self {
        Self {
            name: F::NAME,
            about: F::ABOUT,
            measure: |scale| Ok(serde_json::to_value(F::measure(scale)?)?),
            draw: |data| F::deserialize(data)?.draw(),
        }
    }

    pub fn measure(&self, scale: Scale) -> Result<Document> {
        eprintln!("{}", self.name);
        let start = Instant::now();
        let data = rounded((self.measure)(scale)?);
        let seconds = start.elapsed().as_secs_f64().round();
        Ok(Document { figure: self.name.into(), date: machine::today(), machine: Machine::here()?, scale, seconds, data })
    }

    pub fn draw(&self, document: &Document) -> Result<String> {
        (self.draw)(&document.data)
    }
}

/// A figure's JSON file.
#[derive(Serialize, Deserialize)]
pub struct Document {
    figure: String,
    /// ISO 8601, of the end of the measurement.
    pub date: String,
    pub machine: Machine,
    pub scale: Scale,
    /// That the measurement took.
    seconds: f64,
    data: Value,
}

impl Document {
    pub fn to_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// Share of the whole work that is done.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale(f64);

impl Scale {
    /// `whole` at scale 1, in proportion at less, but not below `least`.
    pub fn of(self, whole: u32, least: u32) -> u32 {
        ((f64::from(whole) * self.0).round() as u32).max(least)
    }

    pub fn is_whole(self) -> bool {
        self.0 == 1.0
    }
}

impl FromStr for Scale {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        match s.parse() {
            Ok(share) if share > 0.0 && share <= 1.0 => Ok(Self(share)),
            _ => Err("a number above 0, at most 1".into()),
        }
    }
}

/// Five digits of every fraction: more than measurements are good for, and files that can be read.
fn rounded(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => {
            let digits = number.as_f64().and_then(|number| format!("{number:.4e}").parse().ok());
            digits.and_then(Number::from_f64).map_or(Value::Null, Value::Number)
        }
        Value::Array(values) => values.into_iter().map(rounded).collect(),
        Value::Object(fields) => fields.into_iter().map(|(name, value)| (name, rounded(value))).collect(),
        other => other,
    }
}
