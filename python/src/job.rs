//! Pictures and bakes.

use std::path::PathBuf;
use std::sync::Arc;

use finalgather::bake::{Plan, RadianceCache};
use finalgather::job::{BakeRequest, Job, JobRequest, Outcome, Per, ReceiverKind, SceneRequest, Work};
use finalgather::points::{LightMapOptions, Resolution, UvSource, file};
use finalgather::quantity::Quantity;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use pyo3::{PyClass, PyClassInitializer};
use serde_json::Value;

use crate::arrays::rows_of_3;
use crate::baked::Baked;
use crate::errors::{begin_work, raised, usage};
use crate::film::Film;
use crate::request::{View, device as device_request, keeping, scene_request};
use crate::scene::Scene;
use crate::turn::Turn;
use crate::watch::{PythonWatch, warn};

/// Settings that do nothing in a bake, but for those of pictures with the camera.
const OF_PICTURES: [&str; 7] = ["size", "background", "points", "interleave", "estimator", "target_error", "ground"];

/// Renders a picture: radiance in W/(m² sr), as a Film.
///
/// eye, target, up: vectors in the scene's units that replace those of its camera. fov: full vertical angle of view in degrees. time: seconds; as many
/// directions as fit, in place of the setting. The size in pixels is a setting: size=512 or size=(640, 480).
///
/// memory: MiB that the job may take. checkpoint: a file that keeps the sums, for the same call with resume=True. progress: True, or what to call with
/// directions done, their total, and seconds left or None. backend: "auto", "egl" or "osmesa". device: "auto", "sw" or an index.
///
/// Other arguments are settings by their keys in scene files. They replace those of the scene: directions=1000, seed=0, photons=1_000_000,
/// pipeline="auto" and so on.
#[pyfunction]
#[pyo3(signature = (scene, *, eye=None, target=None, up=None, fov=None, time=None, memory=None, checkpoint=None, resume=false, progress=None, backend="auto", device=None, **settings))]
#[allow(clippy::too_many_arguments)]
pub fn render(
    py: Python,
    scene: &Scene,
    eye: Option<&Bound<PyAny>>,
    target: Option<&Bound<PyAny>>,
    up: Option<&Bound<PyAny>>,
    fov: Option<f32>,
    time: Option<f64>,
    memory: Option<i64>,
    checkpoint: Option<PathBuf>,
    resume: bool,
    progress: Option<&Bound<PyAny>>,
    backend: &str,
    device: Option<&Bound<PyAny>>,
    settings: Option<&Bound<PyDict>>,
) -> PyResult<Film> {
    if time.is_some() && settings.is_some_and(|settings| settings.contains("directions").unwrap_or(false)) {
        return Err(usage(py, "time chooses the directions, and directions are given too", "give one of them"));
    }
    if time.is_some_and(|seconds| !(seconds.is_finite() && seconds > 0.0)) {
        return Err(usage(py, "time is no number of seconds", "give a finite number above 0"));
    }
    let scene = scene_request(scene, &View { eye, target, up, fov }, settings, "render")?;
    Means { time, memory, checkpoint, resume, progress, backend, device }.run(py, scene, Work::Render, Film::of_job)
}

/// Computes values at points, as a Baked: a mapping of names to arrays.
///
/// Where: vertices=True (also where nothing is said): the vertices of the scene, in the order of the input. points=(positions, unit normals), both [n, 3].
/// lightmap=256: a map of so many texels on a side; texels_per_unit in place of that; uvs, padding, samples_per_texel. camera=True: one point in each
/// pixel, with eye, target, up, fov and size.
///
/// what: one name or several. irradiance (W/m², [n, 3], also irradiance_direct and irradiance_indirect), ao, bent_normal, sky, sh (W/(m² sr),
/// [n, order², 3]), prt and prt_unshadowed ([n, order², 3]). order: bands of spherical harmonics, 1 to 5. gather_bounces: surfaces that may reflect light
/// in prt, and with radiance_cache="gathered". ao_distance: surfaces farther away do not count. per="row": a row for each normal of a vertex, in place
/// of the mean.
///
/// memory: MiB that the job may take. checkpoint: a file that keeps the sums, for the same call with resume=True. progress: True, or what to call with
/// directions done, their total, and seconds left or None. backend: "auto", "egl" or "osmesa". device: "auto", "sw" or an index.
///
/// Other arguments are settings by their keys in scene files. They replace those of the scene: directions=1000, seed=0, photons=1_000_000,
/// pipeline="auto" and so on.
#[pyfunction]
#[pyo3(signature = (scene, *, vertices=false, points=None, lightmap=None, camera=false, what=None, order=3, gather_bounces=2, ao_distance=None, radiance_cache="photons", per="source", texels_per_unit=None, uvs="auto", padding=2, samples_per_texel=4, eye=None, target=None, up=None, fov=None, memory=None, checkpoint=None, resume=false, progress=None, backend="auto", device=None, **settings))]
#[allow(clippy::too_many_arguments)]
pub fn bake(
    py: Python,
    scene: &Scene,
    vertices: bool,
    points: Option<&Bound<PyAny>>,
    lightmap: Option<i64>,
    camera: bool,
    what: Option<&Bound<PyAny>>,
    order: i64,
    gather_bounces: i64,
    ao_distance: Option<f32>,
    radiance_cache: &str,
    per: &str,
    texels_per_unit: Option<f32>,
    uvs: &str,
    padding: i64,
    samples_per_texel: i64,
    eye: Option<&Bound<PyAny>>,
    target: Option<&Bound<PyAny>>,
    up: Option<&Bound<PyAny>>,
    fov: Option<f32>,
    memory: Option<i64>,
    checkpoint: Option<PathBuf>,
    resume: bool,
    progress: Option<&Bound<PyAny>>,
    backend: &str,
    device: Option<&Bound<PyAny>>,
    settings: Option<&Bound<PyDict>>,
) -> PyResult<Baked> {
    let is_map = lightmap.is_some() || texels_per_unit.is_some();
    let receiver = match (vertices, &points, is_map, camera) {
        (_, None, false, false) => ReceiverKind::Vertices,
        (false, Some(points), false, false) => ReceiverKind::PointList(point_list(points)?),
        (false, None, true, false) => ReceiverKind::LightMap,
        (false, None, false, true) => ReceiverKind::Camera,
        _ => return Err(usage(py, "a bake is of one kind of points", "give one of vertices, points, lightmap and camera")),
    };
    if lightmap.is_some() && texels_per_unit.is_some() {
        return Err(usage(py, "the light map has two sizes", "give lightmap, its side, or texels_per_unit"));
    }
    let side = lightmap.map(|side| count(py, side, "lightmap")).transpose()?.unwrap_or_default();
    let resolution = texels_per_unit.map_or(Resolution::Pixels(side), Resolution::TexelsPerUnit);
    let (padding, samples_per_texel) = (count(py, padding, "padding")?, count(py, samples_per_texel, "samples_per_texel")?);
    let light_map = LightMapOptions { resolution, uvs: named::<UvSource>(py, uvs, "uvs")?, padding, samples_per_texel };
    if is_map {
        check_map(py, &light_map)?;
    }
    let plan = Plan {
        what: quantities(what, py)?,
        order: count(py, order, "order")? as usize,
        gather_bounces: count(py, gather_bounces, "gather_bounces")?,
        ao_distance,
        radiance_cache: match radiance_cache {
            "photons" => RadianceCache::Photons,
            "gathered" => RadianceCache::Vertices,
            other => return Err(usage(py, format!("radiance_cache is {other:?}"), "give \"photons\" or \"gathered\"")),
        },
        memory: Plan::MEMORY,
    };
    let is_camera = receiver == ReceiverKind::Camera;
    for name in settings.into_iter().flat_map(|settings| settings.keys()) {
        let name: String = name.extract()?;
        if OF_PICTURES.contains(&name.as_str()) && !(is_camera && ["size", "background"].contains(&name.as_str())) {
            warn(py, &format!("{name} has no effect on these points"))?;
        }
    }
    let scene = scene_request(scene, &View { eye, target, up, fov }, settings, "bake")?;
    let work = Work::Bake(BakeRequest { receivers: vec![receiver], plan, light_map, per: named::<Per>(py, per, "per")? });
    Means { time: None, memory, checkpoint, resume, progress, backend, device }.run(py, scene, work, Baked::of_job)
}

/// Radiance transfer at the vertices, [n, order², 3], in the order of the input: from incident radiance to irradiance over π.
///
/// It is bake(scene, what="prt")["prt"]. order: bands of spherical harmonics, 1 to 5. gather_bounces: surfaces that may reflect light on its way, 0 for
/// shadows alone. unshadowed=True: without other surfaces.
///
/// memory: MiB that the job may take. checkpoint: a file that keeps the sums, for the same call with resume=True. progress: True, or what to call with
/// directions done, their total, and seconds left or None. backend: "auto", "egl" or "osmesa". device: "auto", "sw" or an index.
///
/// Other arguments are settings by their keys in scene files. They replace those of the scene: directions=1000, seed=0, photons=1_000_000,
/// pipeline="auto" and so on.
#[pyfunction]
#[pyo3(signature = (scene, *, order=3, gather_bounces=2, unshadowed=false, memory=None, checkpoint=None, resume=false, progress=None, backend="auto", device=None, **settings))]
#[allow(clippy::too_many_arguments)]
pub fn prt(
    py: Python,
    scene: &Scene,
    order: i64,
    gather_bounces: i64,
    unshadowed: bool,
    memory: Option<i64>,
    checkpoint: Option<PathBuf>,
    resume: bool,
    progress: Option<&Bound<PyAny>>,
    backend: &str,
    device: Option<&Bound<PyAny>>,
    settings: Option<&Bound<PyDict>>,
) -> PyResult<Py<PyAny>> {
    let quantity = if unshadowed { Quantity::PrtUnshadowed } else { Quantity::Prt };
    let plan = Plan {
        what: vec![quantity],
        order: count(py, order, "order")? as usize,
        gather_bounces: count(py, gather_bounces, "gather_bounces")?,
        ao_distance: None,
        radiance_cache: RadianceCache::Photons,
        memory: Plan::MEMORY,
    };
    let (receivers, light_map) = (vec![ReceiverKind::Vertices], LightMapOptions::default());
    let scene = scene_request(scene, &View::default(), settings, "prt")?;
    let work = Work::Bake(BakeRequest { receivers, plan, light_map, per: Per::Source });
    let means = Means { time: None, memory, checkpoint, resume, progress, backend, device };
    let baked = means.run(py, scene, work, Baked::of_job)?;
    baked.array(py, if unshadowed { "prt_unshadowed" } else { "prt" })
}

/// Arguments of how a job runs, which all jobs have.
struct Means<'a, 'py> {
    time: Option<f64>,
    memory: Option<i64>,
    checkpoint: Option<PathBuf>,
    resume: bool,
    progress: Option<&'a Bound<'py, PyAny>>,
    backend: &'a str,
    device: Option<&'a Bound<'py, PyAny>>,
}

impl Means<'_, '_> {
    /// Runs a job without the interpreter's lock, and makes its result by `wrap`.
    fn run<T: PyClass + Into<PyClassInitializer<T>>>(
        self,
        py: Python,
        scene: SceneRequest,
        work: Work,
        wrap: impl FnOnce(Outcome) -> Option<T>,
    ) -> PyResult<T> {
        let memory = self.memory.map(|mib| count(py, mib, "memory")).transpose()?.map(|mib| mib as usize);
        let device = device_request(py, self.backend, self.device)?;
        let request = JobRequest { scene, work, outputs: vec![Vec::new()], memory, time: self.time, device };
        let keeping = keeping(py, self.checkpoint, self.resume)?;
        begin_work(py)?;
        let bar = self.progress.map(bar).transpose()?.flatten();
        let mut watch = PythonWatch::new(bar.as_ref().map(|(call, _)| call.clone().unbind()));
        let turn = Turn::take(py)?;
        let outcome = py.detach(|| {
            // Others need not wait until this thread has the interpreter again.
            let _turn = turn;
            Job::in_memory(request, &keeping).and_then(|job| job.run(&mut watch))
        });
        if let Some((call, true)) = bar {
            call.call_method0("close")?;
        }
        let outcome = outcome.map_err(|error| raised(py, &error));
        let is_interrupted = watch.is_interrupted(py);
        if let Some(error) = watch.ended_by.take_if(|_| !is_interrupted) {
            return Err(error);
        }
        if !is_interrupted {
            return wrap(outcome?).ok_or_else(|| PyValueError::new_err("the job has no result"));
        }
        let (result, cause) = match outcome {
            Ok(outcome) => (wrap(outcome).map(|result| Py::new(py, result)).transpose()?, None),
            Err(error) => (None, Some(error)),
        };
        let kind = py.import("finalgather.errors")?.getattr("Interrupted")?;
        let interrupted = PyErr::from_value(kind.call1((result,))?);
        interrupted.set_cause(py, cause);
        Err(interrupted)
    }
}

/// What to call with progress, and whether to close it at the end.
fn bar<'py>(progress: &Bound<'py, PyAny>) -> PyResult<Option<(Bound<'py, PyAny>, bool)>> {
    if let Ok(wanted) = progress.extract::<bool>() {
        let bar = || Ok((progress.py().import("finalgather._progress")?.call_method0("Bar")?, true));
        return wanted.then(bar).transpose();
    }
    match progress.is_callable() {
        true => Ok(Some((progress.clone(), false))),
        false => {
            Err(PyTypeError::new_err("progress: give True, or what to call with directions done, their total, and seconds left"))
        }
    }
}

/// Points in memory.
fn point_list(points: &Bound<PyAny>) -> PyResult<Arc<[file::OrientedPoint]>> {
    let py = points.py();
    if points.len().ok() != Some(2) {
        return Err(usage(py, "points are no pair", "give (positions, normals), both [n, 3]"));
    }
    let (positions, normals) = (rows_of_3(&points.get_item(0)?, "positions")?, rows_of_3(&points.get_item(1)?, "normals")?);
    if positions.len() != normals.len() {
        let problem = format!("points: {} positions and {} normals", positions.len(), normals.len());
        return Err(usage(py, problem, "give one normal a position"));
    }
    let rows = positions.iter().zip(&normals).map(|([x, y, z], [nx, ny, nz])| [*x, *y, *z, *nx, *ny, *nz]);
    file::of_rows("points".as_ref(), rows).map(Arc::from).map_err(|error| raised(py, &error))
}

/// The quantities that are asked for, each once.
fn quantities(what: Option<&Bound<PyAny>>, py: Python) -> PyResult<Vec<Quantity>> {
    let Some(what) = what else { return Ok(vec![Quantity::Irradiance]) };
    let names = match what.extract::<String>() {
        Ok(one) => vec![one],
        Err(_) => what
            .extract::<Vec<String>>()
            .map_err(|_| usage(py, "what is no name of a quantity", "give names, as [\"ao\", \"prt\"]"))?,
    };
    let mut quantities = Vec::new();
    for name in names {
        let quantity = named::<Quantity>(py, &name, "what")?;
        if !quantities.contains(&quantity) {
            quantities.push(quantity);
        }
    }
    Ok(quantities)
}

/// A whole number of 0 or more.
fn count(py: Python, number: i64, name: &str) -> PyResult<u32> {
    u32::try_from(number).map_err(|_| usage(py, format!("{name} is {number}"), "give a whole number of 0 or more"))
}

/// A value by its name, with underscores or hyphens.
fn named<T: serde::de::DeserializeOwned>(py: Python, name: &str, argument: &str) -> PyResult<T> {
    serde_json::from_value(Value::from(name.replace('_', "-"))).map_err(|error| {
        let text = error.to_string().replace('-', "_");
        let known = text.split_once("expected ").map_or("one of those in the documentation", |(_, known)| known);
        usage(py, format!("{argument} is {name:?}"), &format!("give {known}"))
    })
}

fn check_map(py: Python, map: &LightMapOptions) -> PyResult<()> {
    let samples = map.samples_per_texel;
    if samples == 0 || samples.isqrt().pow(2) != samples {
        return Err(usage(py, format!("samples_per_texel is {samples}"), "give a square number, as 1, 4 or 9"));
    }
    match map.resolution {
        Resolution::Pixels(side) if !(1..=16384).contains(&side) => {
            Err(usage(py, format!("lightmap is {side}"), "give its side in texels, from 1 to 16384"))
        }
        Resolution::TexelsPerUnit(texels) if !(texels > 0.0 && texels.is_finite()) => {
            Err(usage(py, format!("texels_per_unit is {texels}"), "give a number above 0"))
        }
        _ => Ok(()),
    }
}
