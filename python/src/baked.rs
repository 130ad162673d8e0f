//! Values at points.

use std::path::PathBuf;

use finalgather::job::{JobReport, JobResults, Outcome, ReceiverValues};
use finalgather::quantity::ValueArray;
use finalgather::settings::Exposure;
use glam::Vec3;
use numpy::PyArrayDyn;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList};

use crate::arrays::{array, interleaved};
use crate::errors::{begin_work, raised};
use crate::film::to_dict;
use crate::scene::table;

/// Values at points: an array of each quantity by its name.
#[pyclass(frozen, mapping, module = "finalgather")]
pub struct Baked {
    results: JobResults,
    report: JobReport,
}

/// Columns by name, and the shape of their points or pixels.
struct Columns<'a> {
    names: Vec<&'a str>,
    samples: Vec<&'a [f32]>,
    of_points: Vec<usize>,
}

impl Baked {
    pub fn of_job(Outcome { results, report, .. }: Outcome) -> Option<Self> {
        Some(Self { results: results.filter(|results| !results.values().is_empty())?, report })
    }

    fn values(&self) -> &ReceiverValues {
        &self.results.values()[0]
    }

    fn columns(&self) -> Columns<'_> {
        let values = self.values();
        let (channels, of_points) = match &values.image {
            Some(image) => (&image.channels, vec![image.height, image.width]),
            None => (&values.columns, vec![values.positions.len()]),
        };
        // `A` tells which pixels have values.
        let channels = || channels.iter().filter(|channel| channel.name != "A");
        let names = channels().map(|channel| channel.name.as_str()).collect();
        Columns { names, samples: channels().map(|channel| channel.samples.as_slice()).collect(), of_points }
    }

    fn arrays(&self) -> Vec<ValueArray> {
        ValueArray::of(&self.columns().names)
    }

    /// A new array of a quantity.
    pub fn array(&self, py: Python, name: &str) -> PyResult<Py<PyAny>> {
        let Columns { samples, of_points, .. } = self.columns();
        let wanted = name.replace('-', "_");
        let Some(found) = self.arrays().into_iter().find(|array| array.key() == wanted) else {
            return Err(PyKeyError::new_err(format!("{name:?} was not baked; there are {}", self.keys().join(", "))));
        };
        Ok(interleaved(py, &samples[found.columns.clone()], &found.shape(&of_points))?.into_any().unbind())
    }

    fn vectors<'py>(&self, py: Python<'py>, vectors: &[Vec3]) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, &[vectors.len(), 3], vectors.iter().flat_map(|vector| vector.to_array()).collect())
    }
}

#[pymethods]
impl Baked {
    fn __getitem__(&self, py: Python, name: &str) -> PyResult<Py<PyAny>> {
        self.array(py, name)
    }

    fn __len__(&self) -> usize {
        self.arrays().len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.keys())?.try_iter()
    }

    fn __contains__(&self, name: &str) -> bool {
        let wanted = name.replace('-', "_");
        self.arrays().iter().any(|array| array.key() == wanted)
    }

    fn keys(&self) -> Vec<String> {
        self.arrays().iter().map(ValueArray::key).collect()
    }

    #[pyo3(name = "values")]
    fn all_values(&self, py: Python) -> PyResult<Vec<Py<PyAny>>> {
        self.keys().iter().map(|key| self.array(py, key)).collect()
    }

    fn items(&self, py: Python) -> PyResult<Vec<(String, Py<PyAny>)>> {
        self.keys().into_iter().map(|key| Ok((key.clone(), self.array(py, &key)?))).collect()
    }

    #[pyo3(signature = (name, default=None))]
    fn get(&self, py: Python, name: &str, default: Option<Py<PyAny>>) -> PyResult<Option<Py<PyAny>>> {
        if self.__contains__(name) { self.array(py, name).map(Some) } else { Ok(default) }
    }

    /// Meaning and unit of each quantity.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let units = PyDict::new(py);
        self.arrays().iter().try_for_each(|array| units.set_item(array.key(), array.meaning()))?;
        Ok(units)
    }

    /// Of the points, or of the vertices of the mesh with the light map, in world space.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let positions = &self.values().positions;
        array(py, &[positions.len(), 3], positions.iter().flat_map(|position| position.to_array()).collect())
    }

    /// Unit vectors, one a position.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let values = self.values();
        match &values.mesh {
            // The normals of a light map's points are those of its samples.
            Some(mesh) if values.image.is_some() => self.vectors(py, &mesh.normals),
            _ => self.vectors(py, &values.normals),
        }
    }

    /// Triangles of the mesh that the positions are vertices of.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<u32>>>> {
        let faces = |mesh: &finalgather::scene::Mesh| {
            let indices = mesh.triangles.iter().flat_map(|triangle| triangle.vertices).collect();
            array(py, &[mesh.triangles.len(), 3], indices)
        };
        self.values().mesh.as_ref().map(faces).transpose()
    }

    /// The object, and the index of the vertex in its list, for each position.
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<u32>>>> {
        let sources = self.values().mesh.as_ref().map(|mesh| &mesh.sources).filter(|sources| !sources.is_empty());
        let rows = |sources: &Vec<finalgather::scene::Source>| {
            let numbers = sources.iter().flat_map(|source| [source.instance, source.index]).collect();
            array(py, &[sources.len(), 2], numbers)
        };
        sources.map(rows).transpose()
    }

    /// Coordinates of the vertices on the light map, v up.
    #[getter]
    fn uv<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let values = self.values();
        let mesh = values.mesh.as_ref().filter(|_| values.image.is_some());
        let rows = |mesh: &finalgather::scene::Mesh| {
            let numbers = mesh.lightmap_uvs.iter().flat_map(|uv| uv.to_array()).collect();
            array(py, &[mesh.lightmap_uvs.len(), 2], numbers)
        };
        mesh.map(rows).transpose()
    }

    /// Which texels or pixels have values.
    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<bool>>>> {
        let Some(image) = &self.values().image else { return Ok(None) };
        let mask = image.channel("A").unwrap_or_default().iter().map(|&cover| cover > 0.0).collect();
        array(py, &[image.height, image.width], mask).map(Some)
    }

    /// What the job did, as `--json` of the tool.
    #[getter]
    fn report(&self, py: Python) -> PyResult<Py<PyAny>> {
        to_dict(py, Some(&self.report))
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.report.head.warnings.clone()
    }

    /// Writes a file of the kind of its ending, as the tool does.
    #[pyo3(signature = (path, *, exposure=0.0))]
    fn write(&self, py: Python, path: PathBuf, exposure: f32) -> PyResult<()> {
        begin_work(py)?;
        let display = finalgather::settings::DisplaySettings { exposure: Exposure::Stops(exposure), ..self.results.display() };
        py.detach(|| self.results.write(0, &path, &display)).map_err(|error| raised(py, &error))
    }

    fn __repr__(&self) -> String {
        let of_points = self.columns().of_points;
        let arrays = self.arrays().into_iter().map(|array| format!("{} {:?}", array.key(), array.shape(&of_points)));
        format!("<finalgather.Baked {}>", arrays.collect::<Vec<_>>().join(", "))
    }

    fn _repr_html_(&self) -> String {
        let Columns { samples, of_points, .. } = self.columns();
        let rows = self.arrays().into_iter().map(|array| {
            let own =
                || samples[array.columns.clone()].iter().flat_map(|column| column.iter()).filter(|sample| sample.is_finite());
            let count = own().count().max(1) as f64;
            let mean = own().map(|&sample| f64::from(sample)).sum::<f64>() / count;
            let (min, max) = own().fold((f32::INFINITY, f32::NEG_INFINITY), |(min, max), &x| (min.min(x), max.max(x)));
            let [min, mean, max] = [f64::from(min), mean, f64::from(max)].map(|number| format!("{number:.4}"));
            vec![array.key(), format!("{:?}", array.shape(&of_points)), min, mean, max, array.meaning().to_owned()]
        });
        table(&["quantity", "shape", "least", "mean", "most", "meaning and unit"], rows)
    }
}
