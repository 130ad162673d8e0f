//! What a figure is: a type whose values are measured, written as JSON, and drawn.

use std::error::Error;
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub type Result<T, E = Box<dyn Error>> = std::result::Result<T, E>;

/// The measured data of one kind of figure.
pub trait Figure: Serialize + DeserializeOwned {
    const FORMAT: Format = Format::Svg;
    /// What a declaration sets.
    type Parameters: DeserializeOwned;

    fn measure(parameters: &Self::Parameters, task: &Task) -> Result<Self>;

    /// In [`Self::FORMAT`].
    fn draw(&self, parameters: &Self::Parameters) -> Result<String>;
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A document.
    Svg,
    /// A part of the page. It names pictures by their files.
    Html,
}

/// How much to measure, and where pictures go.
pub struct Task<'a> {
    pub scale: Scale,
    pub figure: &'a str,
    pub out: &'a Path,
}

impl Task<'_> {
    /// The name and the path of a picture's file.
    pub fn picture_file(&self, name: &str) -> (String, PathBuf) {
        let file = format!("{}-{name}.png", self.figure);
        let path = self.out.join(&file);
        (file, path)
    }
}

/// A type that implements [`Figure`], as an entry of a list.
pub struct Kind {
    /// As declarations name it.
    pub name: &'static str,
    pub format: Format,
    pub measure: fn(&Value, &Task) -> Result<Value>,
    /// From data and parameters.
    pub draw: fn(&Value, &Value) -> Result<String>,
}

impl Kind {
    pub const fn of<F: Figure>(name: &'static str) -> Self {
        Self {
            name,
            format: F::FORMAT,
            measure: |parameters, task| Ok(serde_json::to_value(F::measure(&F::Parameters::deserialize(parameters)?, task)?)?),
            draw: |data, parameters| F::deserialize(data)?.draw(&F::Parameters::deserialize(parameters)?),
        }
    }
}

/// Share of the full work that is done.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale(pub f64);

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
        let share = s.parse().ok().filter(|&share| share > 0.0 && share <= 1.0);
        share.map(Self).ok_or_else(|| "a number above 0, at most 1".into())
    }
}

/// The result of work on a file; an error names the file.
pub fn of_file<T>(path: &Path, result: Result<T, impl Display>) -> Result<T> {
    result.map_err(|error| format!("{}: {error}", path.display()).into())
}

/// The package's folder.
pub fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A panic of one figure is its error, so that the others and the page are made. Each figure has its own device.
pub fn caught<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
        Err(format!("it panicked: {}", text.unwrap_or("without a message")).into())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_with_its_message() {
        let error = caught::<()>(|| panic!("no {}", "light")).unwrap_err();
        assert_eq!(error.to_string(), "it panicked: no light");
        assert!(caught(|| Ok(())).is_ok());
    }
}
