//! What a job is asked, from Python's arguments.

use std::path::PathBuf;
use std::time::Duration;

use finalgather::job::{DeviceRequest, Keeping, SceneRequest};
use finalgather::nearest::nearest;
use finalgather::scene::CameraChange;
use finalgather::{Backend, DeviceChoice, Settings};
use glam::DVec3;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict};
use serde_json::{Map, Value, json};

use crate::arrays::numbers;
use crate::errors::usage;
use crate::scene::{Scene, size_of};

/// Time between two writes of a checkpoint, as in the tool.
const EVERY: Duration = Duration::from_secs(30);

/// Arguments of the camera.
#[derive(Default)]
pub struct View<'a, 'py> {
    pub eye: Option<&'a Bound<'py, PyAny>>,
    pub target: Option<&'a Bound<'py, PyAny>>,
    pub up: Option<&'a Bound<'py, PyAny>>,
    pub fov: Option<f32>,
}

impl View<'_, '_> {
    pub fn change(&self) -> PyResult<CameraChange> {
        Ok(CameraChange {
            eye: self.eye.map(|eye| vector(eye, "eye")).transpose()?,
            target: self.target.map(|target| vector(target, "target")).transpose()?,
            up: self.up.map(|up| vector(up, "up")).transpose()?.map(|up| up.as_vec3()),
            fov_y_degrees: self.fov,
        })
    }
}

/// Three finite numbers.
fn vector(object: &Bound<PyAny>, name: &str) -> PyResult<DVec3> {
    let numbers = numbers(object).ok().and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let vector = numbers.map(DVec3::from_array).filter(|vector| vector.is_finite());
    vector.ok_or_else(|| usage(object.py(), format!("{name} is no vector"), "give three finite numbers, as (0, 1.5, -3)"))
}

/// The scene of a job, with its view and settings.
pub fn scene_request(scene: &Scene, view: &View, settings: Option<&Bound<PyDict>>, what: &str) -> PyResult<SceneRequest> {
    let settings = settings.map(|settings| to_settings(settings, what)).transpose()?.unwrap_or_default();
    Ok(SceneRequest { view: view.change()?, settings, ..scene.request() })
}

/// Settings by their keys.
fn to_settings(given: &Bound<PyDict>, what: &str) -> PyResult<Map<String, Value>> {
    let py = given.py();
    let Value::Object(known) = json!(Settings::default()) else { unreachable!("settings are an object") };
    let mut settings = Map::new();
    for (name, value) in given {
        let name: String = name.extract()?;
        if !known.contains_key(&name) {
            let meant = nearest(&name, known.keys().map(String::as_str));
            let meant = meant.map_or(String::new(), |meant| format!(". Did you mean {meant}?"));
            return Err(PyTypeError::new_err(format!("{what}() got an unexpected keyword argument '{name}'{meant}")));
        }
        let wrong = |_| {
            usage(
                py,
                format!("{name}: {}", value.repr().map_or_else(|_| "?".into(), |text| text.to_string())),
                "give a number or a name, as scene files have it",
            )
        };
        let setting = match name.as_str() {
            "size" => json!(size_of(&value)?),
            "background" if value.extract::<String>().is_err() => {
                json!(numbers(&value).map_err(wrong)?)
            }
            _ => plain(&value).map_err(wrong)?,
        };
        if let Err(error) = serde_json::from_value::<Settings>(json!({ name.as_str(): setting })) {
            return Err(usage(py, format!("{name}: {error}"), "give what scene files take, as docs/scene-format.md lists it"));
        }
        settings.insert(name, setting);
    }
    Ok(settings)
}

/// A plain value as JSON.
fn plain(value: &Bound<PyAny>) -> PyResult<Value> {
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(truth.is_true().into());
    }
    if let Ok(number) = value.extract::<i64>() {
        return Ok(number.into());
    }
    if let Ok(number) = value.extract::<u64>() {
        return Ok(number.into());
    }
    if let Ok(number) = value.extract::<f64>() {
        return Ok(number.into());
    }
    value.extract::<String>().map(Value::from)
}

/// How sums are kept.
pub fn keeping(py: Python, checkpoint: Option<PathBuf>, resume: bool) -> PyResult<Keeping> {
    if resume && checkpoint.is_none() {
        return Err(usage(py, "resume: there is nothing to go on from", "give checkpoint too, the file of an earlier run"));
    }
    Ok(Keeping { shard: None, file: checkpoint, every: EVERY, resume })
}

pub fn device(py: Python, backend: &str, device: Option<&Bound<PyAny>>) -> PyResult<DeviceRequest> {
    let device = device.map_or(Ok("auto".to_owned()), |device| device.str().map(|name| name.to_string()))?;
    let wrong = |name: &str, problem: String| usage(py, format!("{name}: {problem}"), "leave it out, or see `finalgather info`");
    Ok(DeviceRequest {
        backend: backend.parse::<Backend>().map_err(|problem| wrong("backend", problem.to_string()))?,
        device: device.parse::<DeviceChoice>().map_err(|problem| wrong("device", problem.to_string()))?,
    })
}
