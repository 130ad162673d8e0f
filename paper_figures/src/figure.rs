//! What a figure is: declared in a TOML file, measured and drawn by its kind, with a JSON document in between.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};

use crate::figures::KINDS;
use crate::machine::{self, Machine};

pub type Result<T, E = Box<dyn Error>> = std::result::Result<T, E>;

/// A kind of figure: the type of its data, which can be measured and drawn.
pub trait Figure: Serialize + DeserializeOwned {
    /// As declarations name it.
    const KIND: &'static str;
    const FORMAT: Format = Format::Svg;
    /// What a declaration sets.
    type Parameters: DeserializeOwned;

    fn measure(parameters: &Self::Parameters, task: &Task) -> Result<Self>;

    /// In [`Self::FORMAT`].
    fn draw(&self, parameters: &Self::Parameters) -> Result<String>;
}

/// What a drawing is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// A document.
    Svg,
    /// A part of the page; pictures are named by their files.
    Html,
}

/// How much to measure, and where pictures go.
pub struct Task<'a> {
    pub scale: Scale,
    figure: &'a str,
    out: &'a Path,
}

impl Task<'_> {
    /// The name and the path of a picture's file.
    pub fn picture_file(&self, name: &str) -> (String, PathBuf) {
        let file = format!("{}-{name}.png", self.figure);
        let path = self.out.join(&file);
        (file, path)
    }
}

/// A [`Figure`] among others in a list.
pub struct Kind {
    pub name: &'static str,
    pub format: Format,
    measure: fn(&Value, &Task) -> Result<Value>,
    draw: fn(&Value, &Value) -> Result<String>,
}

impl Kind {
    pub const fn of<F: Figure>() -> Self {
        Self {
            name: F::KIND,
            format: F::FORMAT,
            measure: |parameters, task| Ok(serde_json::to_value(F::measure(&F::Parameters::deserialize(parameters)?, task)?)?),
            draw: |data, parameters| F::deserialize(data)?.draw(&F::Parameters::deserialize(parameters)?),
        }
    }

    fn named(name: &str) -> Result<&'static Self> {
        let known = || KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
        KINDS.iter().find(|kind| kind.name == name).ok_or_else(|| format!("no kind {name}, only {}", known()).into())
    }
}

/// A file `figures/<name>.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    #[serde(skip)]
    pub name: String,
    kind: String,
    pub title: String,
    /// HTML, as it may stand in a paragraph.
    pub caption: String,
    #[serde(default = "no_parameters")]
    parameters: Value,
}

fn no_parameters() -> Value {
    Value::Object(serde_json::Map::new())
}

impl Declaration {
    pub fn load(name: &str) -> Result<Self> {
        let path = folder().join(format!("figures/{name}.toml"));
        let of_file = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let text = fs::read_to_string(&path).map_err(|error| of_file(&error))?;
        let declaration: Self = toml::from_str(&text).map_err(|error| of_file(&error))?;
        Kind::named(&declaration.kind).map_err(|error| of_file(&error))?;
        Ok(Self { name: name.into(), ..declaration })
    }

    pub fn measure(&self, scale: Scale, out: &Path) -> Result<Document> {
        eprintln!("{}", self.name);
        for old in pictures_of(&self.name, out)? {
            fs::remove_file(old)?;
        }
        let start = Instant::now();
        let task = Task { scale, figure: &self.name, out };
        let data = rounded((Kind::named(&self.kind)?.measure)(&self.parameters, &task)?);
        Ok(Document {
            figure: self.name.clone(),
            kind: self.kind.clone(),
            date: machine::today(),
            machine: Machine::here()?,
            scale,
            seconds: start.elapsed().as_secs_f64().round(),
            parameters: self.parameters.clone(),
            data,
        })
    }
}

/// A figure's JSON file.
#[derive(Clone, Serialize, Deserialize)]
pub struct Document {
    figure: String,
    #[serde(default)]
    kind: String,
    /// ISO 8601, of the end of the measurement.
    pub date: String,
    pub machine: Machine,
    pub scale: Scale,
    /// That the measurement took.
    pub seconds: f64,
    #[serde(default = "no_parameters")]
    parameters: Value,
    data: Value,
}

impl Document {
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()).into())
    }

    pub fn to_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    pub fn format(&self) -> Result<Format> {
        Ok(Kind::named(&self.kind)?.format)
    }

    pub fn draw(&self) -> Result<String> {
        (Kind::named(&self.kind)?.draw)(&self.data, &self.parameters)
    }

    /// What was measured, if it is of this kind.
    pub fn data<F: Figure>(&self) -> Option<F> {
        if self.kind == F::KIND { F::deserialize(&self.data).ok() } else { None }
    }

    /// Files of its pictures in `out`.
    pub fn pictures(&self, out: &Path) -> Result<Vec<PathBuf>> {
        pictures_of(&self.figure, out)
    }
}

/// As [`Task::picture_file`] names them.
fn pictures_of(figure: &str, out: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(out)? {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with(&format!("{figure}-")) && name.ends_with(".png") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// The package's folder.
pub fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
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

impl std::fmt::Display for Scale {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        self.0.fmt(f)
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
