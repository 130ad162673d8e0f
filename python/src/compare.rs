//! Differences of pictures.

use finalgather::Image;
use finalgather::image::compare::{Comparison as Numbers, ErrorMap, Selection, ViewingConditions, compare_as};
use numpy::PyUntypedArrayMethods;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::{Value, json};

use crate::arrays::{picture, singles, wrong_shape};
use crate::errors::{begin_work, raised};
use crate::film::Film;
use crate::scene::table;

/// How far a picture is from its reference.
#[pyclass(frozen, module = "finalgather")]
pub struct Comparison {
    numbers: Numbers,
    map: ErrorMap,
}

/// Compares a picture with a reference of the same size.
#[pyfunction]
#[pyo3(signature = (picture, reference, *, mask=None, trim=0.0, exposure=0.0))]
pub fn compare(
    py: Python,
    picture: &Bound<PyAny>,
    reference: &Bound<PyAny>,
    mask: Option<&Bound<PyAny>>,
    trim: f32,
    exposure: f32,
) -> PyResult<Comparison> {
    begin_work(py)?;
    let (a, b) = (image(picture, "picture")?, image(reference, "reference")?);
    let mask = mask.map(|mask| mask_of(mask, &a)).transpose()?;
    let selection = Selection { mask: mask.as_deref(), trim };
    let view = ViewingConditions { exposure, toned: [false; 2] };
    let compared = py.detach(|| compare_as(&a, &b, selection, view));
    let (numbers, map) = compared.map_err(|error| raised(py, &error))?;
    Ok(Comparison { numbers, map })
}

fn image(object: &Bound<PyAny>, name: &str) -> PyResult<Image> {
    match object.cast::<Film>() {
        Ok(film) => Ok(film.get().image().clone()),
        Err(_) => picture(object, name),
    }
}

/// The pixels that count: those above 0.5.
fn mask_of(object: &Bound<PyAny>, image: &Image) -> PyResult<Vec<bool>> {
    let mask = singles(object, "mask")?;
    if *mask.shape() != [image.height, image.width] {
        return Err(wrong_shape(object.py(), "mask", mask.shape(), &format!("[{}, {}]", image.height, image.width)));
    }
    Ok(mask.as_array().iter().map(|&value| value > 0.5).collect())
}

impl Comparison {
    /// The numbers by name. JSON has no infinity, and Python has.
    fn numbers(&self) -> Vec<(String, f64)> {
        let Value::Object(all) = json!(self.numbers) else { return Vec::new() };
        all.into_iter().map(|(name, value)| (name, value.as_f64().unwrap_or(f64::INFINITY))).collect()
    }
}

#[pymethods]
impl Comparison {
    fn as_dict(&self) -> std::collections::BTreeMap<String, f64> {
        self.numbers().into_iter().collect()
    }

    fn __getitem__(&self, name: &str) -> PyResult<f64> {
        let found = self.numbers().into_iter().find(|(known, _)| known == name);
        found.map(|(_, value)| value).ok_or_else(|| {
            let known: Vec<_> = self.numbers().into_iter().map(|(name, _)| name).collect();
            PyKeyError::new_err(format!("no {name:?}; there are {}", known.join(", ")))
        })
    }

    /// Differences as R, G, B, and FLIP.
    #[getter]
    fn map(&self) -> Film {
        Film::of_image(self.map.0.clone())
    }

    fn __repr__(&self) -> String {
        let numbers = self.numbers().into_iter().map(|(name, value)| format!("{name} {value:.6}"));
        format!("<finalgather.Comparison {}>", numbers.collect::<Vec<_>>().join(", "))
    }

    /// FLIP: black where there is no difference to see, pale yellow where there is most.
    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        begin_work(py)?;
        self.map.to_png().map(|bytes| PyBytes::new(py, &bytes)).map_err(|error| raised(py, &error))
    }

    fn _repr_html_(&self) -> String {
        table(&["", "difference"], self.numbers().into_iter().map(|(name, value)| vec![name, format!("{value:.6}")]))
    }
}
