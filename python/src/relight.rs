//! Light from radiance transfer.

use finalgather::Environment;
use finalgather::harmonics::MAX_ORDER;
use finalgather::image::Channel;
use finalgather::quantity::Quantity;
use finalgather::relight::{RelitModel, irradiance};
use glam::Vec3;
use numpy::{PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{array, environment, singles, wrong_shape};
use crate::errors::usage;
use crate::film::Film;
use crate::request::View;
use crate::scene::{Scene, size_of};

/// Columns of transfer, and the shape of its points.
fn columns(object: &Bound<PyAny>) -> PyResult<(Vec<Channel>, Vec<usize>)> {
    let array = singles(object, "transfer")?;
    let wrong = || wrong_shape(object.py(), "transfer", array.shape(), "[points, order², 3]");
    let [of_points @ .., coefficients, 3] = array.shape() else { return Err(wrong()) };
    let order = coefficients.isqrt();
    if of_points.is_empty() || order.pow(2) != *coefficients || !(1..=MAX_ORDER).contains(&order) {
        return Err(wrong());
    }
    let (samples, names) = (array.as_slice()?, Quantity::Prt.columns(order));
    let width = names.len();
    let column = |(k, name)| Channel { name, samples: samples.iter().skip(k).step_by(width).copied().collect() };
    Ok((names.into_iter().enumerate().map(column).collect(), of_points.to_vec()))
}

/// Irradiance in W/m² under an environment. Points without transfer have none.
fn lit(py: Python, transfer: &[Channel], environment: &Environment) -> Vec<Vec3> {
    let mut light = py.detach(|| irradiance(transfer, environment));
    for (point, light) in light.iter_mut().enumerate() {
        // A point without transfer, as a vertex that no face uses.
        if transfer.iter().any(|column| column.samples[point].is_nan()) {
            *light = Vec3::NAN;
        }
    }
    light
}

/// Irradiance in W/m² under an environment, from transfer of the shape [points, order², 3].
#[pyfunction]
pub fn relight<'py>(transfer: &Bound<'py, PyAny>, env: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let (columns, mut shape) = columns(transfer)?;
    let light = lit(env.py(), &columns, &environment(env)?);
    shape.push(3);
    array(transfer.py(), &shape, light.iter().flat_map(|light| light.to_array()).collect())
}

/// The scene under an environment, from transfer at its vertices.
#[pyfunction]
#[pyo3(signature = (scene, transfer, env, *, size=None, eye=None, target=None, up=None, fov=None))]
#[allow(clippy::too_many_arguments)]
pub fn relight_picture(
    py: Python,
    scene: &Scene,
    transfer: &Bound<PyAny>,
    env: &Bound<PyAny>,
    size: Option<&Bound<PyAny>>,
    eye: Option<&Bound<PyAny>>,
    target: Option<&Bound<PyAny>>,
    up: Option<&Bound<PyAny>>,
    fov: Option<f32>,
) -> PyResult<Film> {
    let loaded = scene.loaded();
    let size = size.map(size_of).transpose()?.unwrap_or(loaded.settings.film.size);
    if size.contains(&0) || size.iter().any(|&side| side > 16384) {
        return Err(usage(py, format!("size is {size:?}"), "give 1 to 16384 pixels on a side"));
    }
    let camera = loaded.world.changed_camera(size, &View { eye, target, up, fov }.change()?);
    let camera = camera.check().map_err(|(problem, cure)| usage(py, problem, cure))?;
    let (columns, of_points) = columns(transfer)?;
    let environment = environment(env)?;
    let light = lit(py, &columns, &environment);
    let model = py.detach(|| RelitModel::new(&loaded.world));
    let (lists, sources) = (&model.scene.source_lists, &model.mesh.sources);
    // A row for each vertex of the input, or for each vertex of the bake.
    let light = match of_points[..] {
        [rows] if rows == lists.total() && !sources.is_empty() => {
            sources.iter().map(|&source| light[lists.place(source)]).collect()
        }
        [rows] if rows == model.mesh.positions.len() => light,
        _ => {
            let problem = format!("transfer: {of_points:?} points, and the scene has {} vertices", lists.total());
            return Err(usage(py, problem, "give the transfer that was baked at the vertices of this scene"));
        }
    };
    let picture = py.detach(|| model.picture(&light, &environment, camera, size));
    Ok(Film::of_image(picture))
}
