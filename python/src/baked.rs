//! Values at points.

use std::path::PathBuf;

use finalgather::job::{JobReport, JobResults, Outcome, ReceiverValues};
use finalgather::quantity::ValueArray;
use glam::Vec3;
use numpy::PyArrayDyn;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList};

use crate::arrays::{array, interleaved};
use crate::errors::{begin_work, raised};
use crate::film::{to_dict, to_exposure};
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

    fn of_points(&self) -> &ReceiverValues {
        &self.results.values()[0]
    }

    fn columns(&self) -> Columns<'_> {
        let values = self.of_points();
        let (channels, of_points) = match &values.image {
            Some(image) => (&image.channels, vec![image.height, image.width]),
            None => (&values.columns, vec![values.positions.len()]),
        };
        // `A` tells which pixels have values.
        let channels = || channels.iter().filter(|channel| channel.name != "A");
        let names = channels().map(|channel| channel.name.as_str()).collect();
        Columns { names, samples: channels().map(|channel| channel.samples.as_slice()).collect(), of_points }
    }

    fn names(&self) -> Vec<String> {
        self.arrays().iter().map(ValueArray::key).collect()
    }

    fn arrays(&self) -> Vec<ValueArray> {
        ValueArray::of(&self.columns().names)
    }

    /// A new array of a quantity.
    pub fn array(&self, py: Python, name: &str) -> PyResult<Py<PyAny>> {
        let Columns { samples, of_points, .. } = self.columns();
        let wanted = name.replace('-', "_");
        let Some(found) = self.arrays().into_iter().find(|array| array.key() == wanted) else {
            return Err(PyKeyError::new_err(format!("{name:?} was not baked; there are {}", self.names().join(", "))));
        };
        Ok(interleaved(py, &samples[found.columns.clone()], &found.shape(&of_points))?.into_any().unbind())
    }

    fn vectors<'py>(&self, py: Python<'py>, vectors: &[Vec3]) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        array(py, &[vectors.len(), 3], vectors.iter().flat_map(|vector| vector.to_array()).collect())
    }
}

/// A view of a mapping, by the rules of Python's own.
fn view<'py>(baked: &Bound<'py, Baked>, kind: &str) -> PyResult<Bound<'py, PyAny>> {
    baked.py().import("collections.abc")?.call_method1(kind, (baked,))
}

#[pymethods]
impl Baked {
    fn __getitem__(&self, name: &Bound<PyAny>) -> PyResult<Py<PyAny>> {
        let key: String = name.extract().map_err(|_| PyKeyError::new_err(name.clone().unbind()))?;
        self.array(name.py(), &key)
    }

    fn __len__(&self) -> usize {
        self.arrays().len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.names())?.try_iter()
    }

    fn __contains__(&self, name: &Bound<PyAny>) -> bool {
        let wanted = name.extract::<String>().unwrap_or_default().replace('-', "_");
        self.names().contains(&wanted)
    }

    fn keys<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        view(&slf, "KeysView")
    }

    fn values<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        view(&slf, "ValuesView")
    }

    fn items<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        view(&slf, "ItemsView")
    }

    #[pyo3(signature = (name, default=None))]
    fn get(&self, name: &Bound<PyAny>, default: Option<Py<PyAny>>) -> PyResult<Option<Py<PyAny>>> {
        if self.__contains__(name) { self.__getitem__(name).map(Some) } else { Ok(default) }
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
        let positions = &self.of_points().positions;
        array(py, &[positions.len(), 3], positions.iter().flat_map(|position| position.to_array()).collect())
    }

    /// Unit vectors, one a position.
    #[getter]
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        self.vectors(py, &self.of_points().normals)
    }

    /// Triangles of the mesh that the positions are vertices of.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<u32>>>> {
        let faces = |mesh: &finalgather::scene::Mesh| {
            let indices = mesh.triangles.iter().flat_map(|triangle| triangle.vertices).collect();
            array(py, &[mesh.triangles.len(), 3], indices)
        };
        self.of_points().mesh.as_ref().map(faces).transpose()
    }

    /// The object, and the index of the vertex in its list, for each position.
    #[getter]
    fn sources<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<u32>>>> {
        let sources = self.of_points().mesh.as_ref().map(|mesh| &mesh.sources).filter(|sources| !sources.is_empty());
        let rows = |sources: &Vec<finalgather::scene::Source>| {
            let numbers = sources.iter().flat_map(|source| [source.instance, source.index]).collect();
            array(py, &[sources.len(), 2], numbers)
        };
        sources.map(rows).transpose()
    }

    /// Coordinates of the vertices on the light map, v up.
    #[getter]
    fn uv<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        let values = self.of_points();
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
        let Some(image) = &self.of_points().image else { return Ok(None) };
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
    #[pyo3(signature = (path, *, exposure=None))]
    fn write(&self, py: Python, path: PathBuf, exposure: Option<&Bound<PyAny>>) -> PyResult<()> {
        begin_work(py)?;
        let mut display = self.results.display();
        if let Some(exposure) = exposure {
            display.exposure = to_exposure(exposure)?;
        }
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
