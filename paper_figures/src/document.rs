//! The files of a figure: its declaration, `figures/NAME.toml`, and what was measured, `NAME.json`.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};

use crate::figure::{Figure, Format, Kind, Result, Scale, Task, folder, of_file};
use crate::figures::KINDS;
use crate::lab::{Machine, today};

/// A file `figures/NAME.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Declaration {
    #[serde(skip)]
    pub name: String,
    kind: String,
    /// Title and caption are HTML, as it may stand in a paragraph. `{name}` stands for a measured value, or for a parameter before that.
    title: String,
    caption: String,
    #[serde(default = "no_parameters")]
    parameters: Value,
}

fn no_parameters() -> Value {
    Value::Object(serde_json::Map::new())
}

fn kind(name: &str) -> Result<&'static Kind> {
    let known = || KINDS.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
    KINDS.iter().find(|kind| kind.name == name).ok_or_else(|| format!("no kind {name}, only {}", known()).into())
}

impl Declaration {
    pub fn load(name: &str) -> Result<Self> {
        let path = folder().join(format!("figures/{name}.toml"));
        let text = of_file(&path, fs::read_to_string(&path))?;
        let declaration: Self = of_file(&path, toml::from_str(&text))?;
        of_file(&path, kind(&declaration.kind))?;
        Ok(Self { name: name.into(), ..declaration })
    }

    /// Title and caption, with the numbers of what was measured.
    pub fn texts(&self, document: Option<&Document>) -> [String; 2] {
        let value = |name: &str| document.and_then(|document| document.data.get(name)).or_else(|| self.parameters.get(name));
        [&self.title, &self.caption].map(|text| filled(text, value))
    }

    /// The measurement's file.
    pub fn json(&self, out: &Path) -> PathBuf {
        out.join(format!("{}.json", self.name))
    }

    /// Where the page finds why the figure failed. A later page of other figures shows it too.
    pub fn failure(&self, out: &Path) -> PathBuf {
        out.join(format!("{}.error", self.name))
    }

    pub fn measure(&self, scale: Scale, out: &Path) -> Result<Document> {
        eprintln!("{}", self.name);
        // A measurement that fails leaves nothing of an older one.
        let old = pictures_of(&self.name, out)?.into_iter().chain([self.json(out), out.join(format!("{}.svg", self.name))]);
        for file in old.filter(|file| file.exists()) {
            of_file(&file, fs::remove_file(&file))?;
        }
        let start = Instant::now();
        let data = rounded((kind(&self.kind)?.measure)(&self.parameters, &Task { scale, figure: &self.name, out })?);
        Ok(Document {
            figure: self.name.clone(),
            kind: self.kind.clone(),
            date: today(),
            machine: Machine::here()?,
            scale,
            seconds: start.elapsed().as_secs_f64().round(),
            parameters: self.parameters.clone(),
            data,
        })
    }
}

/// A figure's JSON file.
#[derive(Serialize, Deserialize)]
pub struct Document {
    pub figure: String,
    #[serde(default)]
    kind: String,
    /// The day on which the measurement ended, ISO 8601.
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
        of_file(path, serde_json::from_str(&of_file(path, fs::read_to_string(path))?))
    }

    pub fn to_json(&self) -> Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }

    pub fn format(&self) -> Result<Format> {
        Ok(kind(&self.kind)?.format)
    }

    pub fn draw(&self) -> Result<String> {
        (kind(&self.kind)?.draw)(&self.data, &self.parameters)
    }

    /// `None` where the data is not of this type.
    pub fn data<F: Figure>(&self) -> Option<F> {
        F::deserialize(&self.data).ok()
    }

    /// Files of its pictures in `out`.
    pub fn pictures(&self, out: &Path) -> Result<Vec<PathBuf>> {
        pictures_of(&self.figure, out)
    }
}

/// As [`Task::picture_file`] names them.
fn pictures_of(figure: &str, out: &Path) -> Result<Vec<PathBuf>> {
    let mut files = fs::read_dir(out)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<_>>>()?;
    files.retain(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(&format!("{figure}-")) && name.ends_with(".png")
    });
    files.sort();
    Ok(files)
}

/// With a value for each name in braces.
fn filled<'a>(text: &str, value: impl Fn(&str) -> Option<&'a Value>) -> String {
    let mut parts = text.split('{');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |filled, part| match part.split_once('}') {
        Some((name, rest)) => {
            let value = value(name).map_or_else(|| format!("{{{name}}}"), ToString::to_string);
            filled + &value + rest
        }
        None => filled + "{" + part,
    })
}

/// Keeps five digits of every fraction. Measurements are less precise, and the files stay readable.
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
