//! Pictures.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use finalgather::Image;
use finalgather::image::WriteOptions;
use finalgather::job::{JobReport, JobResults, Outcome, TaskReport};
use finalgather::settings::{Background, DisplaySettings, Exposure};
use numpy::PyArrayDyn;
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{array, interleaved, numbers};
use crate::errors::{begin_work, raised, usage};
use crate::scene::table;

/// A picture: named channels of 32 bits, linear.
#[pyclass(frozen, module = "finalgather")]
pub struct Film {
    picture: Arc<Picture>,
    report: Option<Arc<JobReport>>,
}

/// Where a film is from.
enum Picture {
    Job(Box<JobResults>),
    Image(Image),
}

impl Film {
    pub fn of_job(Outcome { results, report, .. }: Outcome) -> Option<Self> {
        let results = results.filter(|results| results.picture().is_some())?;
        Some(Self { picture: Arc::new(Picture::Job(Box::new(results))), report: Some(Arc::new(report)) })
    }

    pub fn of_image(image: Image) -> Self {
        Self { picture: Arc::new(Picture::Image(image)), report: None }
    }

    pub fn image(&self) -> &Image {
        match &*self.picture {
            Picture::Job(results) => results.picture().expect("a film's job made a picture"),
            Picture::Image(image) => image,
        }
    }

    /// How it is shown: as asked, else as the job says.
    fn display(&self, exposure: Option<&Bound<PyAny>>, background: Option<&Bound<PyAny>>) -> PyResult<DisplaySettings> {
        let mut display = match &*self.picture {
            Picture::Job(results) => results.display(),
            Picture::Image(_) => DisplaySettings::default(),
        };
        if let Some(exposure) = exposure {
            display.exposure = to_exposure(exposure)?;
        }
        if let Some(background) = background {
            display.background = to_background(background)?;
        }
        Ok(display)
    }

    fn shape(&self) -> [usize; 2] {
        [self.image().height, self.image().width]
    }

    fn triple<'py>(&self, py: Python<'py>, names: [String; 3]) -> Option<PyResult<Bound<'py, PyArrayDyn<f32>>>> {
        let [r, g, b] = names.map(|name| self.image().channel(&name));
        let [height, width] = self.shape();
        Some(interleaved(py, &[r?, g?, b?], &[height, width, 3]))
    }
}

pub fn to_exposure(exposure: &Bound<PyAny>) -> PyResult<Exposure> {
    let text = exposure.extract::<f64>().map(|stops| stops.to_string()).or_else(|_| exposure.extract::<String>())?;
    let wrong = || usage(exposure.py(), format!("exposure is {text}"), "give stops from -64 to 64, or \"auto\"");
    match text.parse().map_err(|_| wrong())? {
        Exposure::Stops(stops) if stops.abs() > Exposure::MOST => Err(wrong()),
        other => Ok(other),
    }
}

fn to_background(background: &Bound<PyAny>) -> PyResult<Background> {
    let text = match background.extract::<String>() {
        Ok(text) => text,
        Err(_) => numbers(background)?.iter().map(f64::to_string).collect::<Vec<_>>().join(","),
    };
    text.parse().map_err(|problem: &str| {
        let cure = "give \"environment\", \"transparent\", \"#rrggbb\" or linear (r, g, b)";
        usage(background.py(), format!("background is {problem}"), cure)
    })
}

#[pymethods]
impl Film {
    /// Reads an .exr or a .png.
    #[staticmethod]
    fn read(py: Python, path: PathBuf) -> PyResult<Self> {
        begin_work(py)?;
        py.detach(|| Image::read(&path)).map(Self::of_image).map_err(|error| raised(py, &error))
    }

    /// Radiance, [height, width, 3].
    #[getter]
    fn rgb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        let channels = self.image().rgb().map_err(|error| raised(py, &error))?;
        let [height, width] = self.shape();
        interleaved(py, &channels, &[height, width, 3])
    }

    /// What numpy takes a film for: rgb.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<&Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        // It is always a copy.
        let (array, _) = (self.rgb(py)?.into_any(), copy);
        dtype.map_or(Ok(array.clone()), |dtype| array.call_method1("astype", (dtype,)))
    }

    /// Share of each pixel that surfaces cover, [height, width].
    #[getter]
    fn alpha<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArrayDyn<f32>>>> {
        self.image().channel("A").map(|samples| array(py, &self.shape(), samples.to_vec())).transpose()
    }

    /// Width and height.
    #[getter]
    fn size(&self) -> (usize, usize) {
        (self.image().width, self.image().height)
    }

    #[getter]
    fn channels(&self) -> Vec<String> {
        self.image().channels.iter().map(|channel| channel.name.clone()).collect()
    }

    /// The parts of channels' names before the dot.
    #[getter]
    fn layers(&self) -> Vec<String> {
        let mut layers = Vec::new();
        for (layer, _) in self.image().channels.iter().filter_map(|channel| channel.name.split_once('.')) {
            if !layers.iter().any(|known| known == layer) {
                layers.push(layer.to_owned());
            }
        }
        layers
    }

    /// A channel by its name, [height, width], or a layer, [height, width, 3].
    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
        if let Some(samples) = self.image().channel(name) {
            return array(py, &self.shape(), samples.to_vec());
        }
        let of_layer = |parts: [&str; 3]| self.triple(py, parts.map(|part| format!("{name}.{part}")));
        of_layer(["R", "G", "B"]).or_else(|| of_layer(["X", "Y", "Z"])).unwrap_or_else(|| {
            Err(PyKeyError::new_err(format!("no channel or layer {name:?}; there are {}", self.channels().join(", "))))
        })
    }

    fn __contains__(&self, name: &Bound<PyAny>) -> bool {
        let name: String = name.extract().unwrap_or_default();
        self.channels().contains(&name) || self.layers().contains(&name)
    }

    /// Relative standard error of the picture, once it can be told.
    #[getter]
    fn error(&self) -> Option<f64> {
        match &self.report.as_ref()?.task {
            TaskReport::Render { error, .. } => *error,
            TaskReport::Bake { .. } => None,
        }
    }

    /// What the job did, as `--json` of the tool.
    #[getter]
    fn report(&self, py: Python) -> PyResult<Py<PyAny>> {
        to_dict(py, self.report.as_deref())
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.report.as_ref().map_or(Vec::new(), |report| report.head.warnings.clone())
    }

    /// Bytes of sRGB and alpha, [height, width, 4].
    #[pyo3(signature = (*, exposure=None, background=None))]
    fn to_srgb<'py>(
        &self,
        py: Python<'py>,
        exposure: Option<&Bound<PyAny>>,
        background: Option<&Bound<PyAny>>,
    ) -> PyResult<Bound<'py, PyArrayDyn<u8>>> {
        begin_work(py)?;
        let display = self.display(exposure, background)?;
        let (image, [height, width]) = (self.image(), self.shape());
        let bytes = py.detach(|| image.to_srgba8(image.stops(display.exposure), display.background));
        array(py, &[height, width, 4], bytes.map_err(|error| raised(py, &error))?)
    }

    /// Writes an .exr with all channels, or a .png.
    #[pyo3(signature = (path, *, exposure=None, background=None))]
    fn write(
        &self,
        py: Python,
        path: PathBuf,
        exposure: Option<&Bound<PyAny>>,
        background: Option<&Bound<PyAny>>,
    ) -> PyResult<()> {
        begin_work(py)?;
        let display = self.display(exposure, background)?;
        let written = py.detach(|| match &*self.picture {
            Picture::Job(results) => results.write(0, &path, &display),
            Picture::Image(image) => write_image(image, &path, &display),
        });
        written.map_err(|error| raised(py, &error))
    }

    fn __repr__(&self) -> String {
        let [height, width] = self.shape();
        let error = self.error().map_or(String::new(), |error| format!(", error {:.2} %", 100.0 * error));
        format!("<finalgather.Film {width}x{height}, {} channels{error}>", self.channels().len())
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        begin_work(py)?;
        let (display, image) = (self.display(None, None)?, self.image());
        let bytes = py.detach(|| image.to_png(image.stops(display.exposure), display.background));
        bytes.map(|bytes| PyBytes::new(py, &bytes)).map_err(|error| raised(py, &error))
    }

    fn _repr_html_(&self, py: Python) -> PyResult<String> {
        let png = py.import("base64")?.call_method1("b64encode", (self._repr_png_(py)?,))?.call_method0("decode")?;
        let mut rows = vec![("channels", self.channels().join(", "))];
        if let Some(report) = &self.report {
            rows.push(("directions", report.settings.directions.count.to_string()));
            rows.push(("seconds", format!("{:.2}", report.seconds.total)));
        }
        rows.extend(self.error().map(|error| ("error", format!("{:.2} %", 100.0 * error))));
        let rows = rows.into_iter().map(|(name, value)| vec![name.to_owned(), value]);
        Ok(format!("<img src=\"data:image/png;base64,{png}\">{}", table(&["", "film"], rows)))
    }
}

fn write_image(image: &Image, path: &Path, display: &DisplaySettings) -> finalgather::Result<()> {
    let options = WriteOptions { exposure: image.stops(display.exposure), background: display.background, metadata: None };
    image.write(path, &options)
}

/// A report as a dictionary.
pub fn to_dict(py: Python, report: Option<&JobReport>) -> PyResult<Py<PyAny>> {
    let text = report.map_or_else(|| "{}".to_owned(), |report| serde_json::to_string(report).unwrap_or_default());
    Ok(py.import("json")?.call_method1("loads", (text,))?.unbind())
}
