//! Arrays in and out. What comes in may be anything that numpy makes an array of.

use std::path::PathBuf;

use finalgather::Environment;
use finalgather::image::{Channel, Image, decode_srgb};
use glam::Vec3;
use numpy::ndarray::ArrayViewD;
use numpy::{Element, IxDyn, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::errors::{begin_work, raised, usage};

/// The array of an object, in this type of numbers and in row order. Only what differs is copied.
fn converted<'py, T: Element>(object: &Bound<'py, PyAny>, name: &str, dtype: &str) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = object.py();
    if kind_of(object).is_ok_and(|(kind, _)| kind == "c") {
        return Err(usage(py, format!("{name}: complex numbers"), "give real ones, as array.real"));
    }
    let wrong = |error: PyErr| usage(py, format!("{name}: {error}"), "give an array of numbers");
    let array = py.import("numpy")?.call_method1("require", (object, dtype, ["C", "A", "E"])).map_err(wrong)?;
    array.cast::<PyArrayDyn<T>>().map(|array| array.readonly()).map_err(|error| wrong(error.into()))
}

/// An array of 64-bit floats.
pub fn floats<'py>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    converted(object, name, "float64")
}

/// The numbers of a list, a tuple or an array; of a number that one.
pub fn numbers(object: &Bound<PyAny>) -> PyResult<Vec<f64>> {
    Ok(floats(object, "numbers")?.as_slice()?.to_vec())
}

/// An array of 32-bit floats.
pub fn singles<'py>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f32>> {
    converted(object, name, "float32")
}

/// The type of an object's numbers: `u` of bytes and other whole numbers from 0 on, `i`, `f`.
fn kind_of(object: &Bound<PyAny>) -> PyResult<(String, usize)> {
    let dtype = object.py().import("numpy")?.call_method1("asarray", (object,))?.getattr("dtype")?;
    Ok((dtype.getattr("kind")?.extract()?, dtype.getattr("itemsize")?.extract()?))
}

/// Bytes, of an array that has them.
pub fn bytes<'py>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<Option<PyReadonlyArrayDyn<'py, u8>>> {
    if kind_of(object)? == ("u".to_owned(), 1) { converted(object, name, "uint8").map(Some) } else { Ok(None) }
}

/// Whole numbers. Those below 0 or too large become `u32::MAX`, which is no vertex.
pub fn indices(object: &Bound<PyAny>, name: &str) -> PyResult<(Vec<usize>, Vec<u32>)> {
    let (kind, _) = kind_of(object)?;
    if !["i", "u"].contains(&kind.as_str()) {
        return Err(usage(object.py(), format!("{name}: no whole numbers"), "give indices of vertices, as int32 or int64"));
    }
    let array: PyReadonlyArrayDyn<i64> = converted(object, name, "int64")?;
    Ok((array.shape().to_vec(), array.as_array().iter().map(|&index| u32::try_from(index).unwrap_or(u32::MAX)).collect()))
}

/// Rows of three.
pub fn rows_of_3<'py>(object: &Bound<'py, PyAny>, name: &str) -> PyResult<Vec<[f64; 3]>> {
    let array = floats(object, name)?;
    match *array.shape() {
        [_, 3] => Ok(array.as_slice()?.as_chunks().0.to_vec()),
        ref shape => Err(wrong_shape(object.py(), name, shape, "[n, 3]")),
    }
}

pub fn wrong_shape(py: Python, name: &str, shape: &[usize], wanted: &str) -> PyErr {
    usage(py, format!("{name}: an array of the shape {shape:?}"), &format!("give one of the shape {wanted}"))
}

/// A grey or a colour, if it is one. Bytes are in sRGB.
pub fn color(object: &Bound<PyAny>, name: &str) -> PyResult<Option<Vec3>> {
    if let Some(array) = bytes(object, name)? {
        return Ok(match array.as_slice()? {
            &[r, g, b] if array.ndim() == 1 => Some(Vec3::from([r, g, b].map(linear))),
            _ => None,
        });
    }
    let array = singles(object, name)?;
    Ok(match (array.shape(), array.as_slice()?) {
        ([], &[grey]) => Some(Vec3::splat(grey)),
        ([3], &[r, g, b]) => Some(Vec3::new(r, g, b)),
        _ => None,
    })
}

/// An environment: a file, a colour, or texels.
pub fn environment(object: &Bound<PyAny>) -> PyResult<Environment> {
    let py = object.py();
    // Its sums are made by several threads.
    begin_work(py)?;
    let refused = |error: finalgather::Error| match error {
        finalgather::Error::Usage { problem, cure } => usage(py, format!("env: {problem}"), &cure),
        other => raised(py, &other),
    };
    if let Ok(path) = object.extract::<PathBuf>() {
        return Environment::load(&path).map_err(refused);
    }
    if let Some(radiance) = color(object, "env")? {
        return Environment::constant(radiance).map_err(refused);
    }
    let texels = singles(object, "env")?;
    match *texels.shape() {
        [height, width, 3] if width > 0 && height > 0 => {
            let texels = texels.as_slice()?.as_chunks().0.iter().map(|&texel| Vec3::from_array(texel)).collect();
            Environment::from_texels([width, height], texels).map_err(refused)
        }
        ref shape => Err(wrong_shape(py, "env", shape, "[height, width, 3], or give a colour or a file")),
    }
}

fn linear(byte: u8) -> f32 {
    decode_srgb(f32::from(byte) / 255.0)
}

/// Linear colours of vertices: bytes are in sRGB, other numbers are linear.
pub fn colors(object: &Bound<PyAny>, name: &str) -> PyResult<Vec<Vec3>> {
    fn rows<T: Copy>(array: ArrayViewD<T>, linear: impl Fn(T) -> f32) -> Option<Vec<Vec3>> {
        let [_, 3 | 4] = *array.shape() else { return None };
        Some(array.outer_iter().map(|row| Vec3::from_array([0, 1, 2].map(|k| linear(row[k])))).collect())
    }
    let (found, shape) = match bytes(object, name)? {
        Some(array) => (rows(array.as_array(), linear), array.shape().to_vec()),
        None => {
            let array = singles(object, name)?;
            (rows(array.as_array(), |linear| linear), array.shape().to_vec())
        }
    };
    found.ok_or_else(|| wrong_shape(object.py(), name, &shape, "[vertices, 3] or [faces, 3], or a grey, or a colour"))
}

/// A new array of this shape.
pub fn array<'py, T: Element>(py: Python<'py>, shape: &[usize], numbers: Vec<T>) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    PyArray1::from_vec(py, numbers).reshape(IxDyn(shape))
}

/// Neighbouring columns as the last axis of an array.
pub fn interleaved<'py>(py: Python<'py>, columns: &[&[f32]], shape: &[usize]) -> PyResult<Bound<'py, PyArrayDyn<f32>>> {
    let numbers = match columns {
        [one] => one.to_vec(),
        _ => (0..columns.first().map_or(0, |column| column.len()))
            .flat_map(|i| columns.iter().map(move |column| column[i]))
            .collect(),
    };
    array(py, shape, numbers)
}

/// A picture from an array of the shape [height, width, 3].
pub fn picture(object: &Bound<PyAny>, name: &str) -> PyResult<Image> {
    if bytes(object, name)?.is_some() {
        let cure = "give linear radiance, as film.rgb, or a Film";
        return Err(usage(object.py(), format!("{name}: bytes, which are to look at"), cure));
    }
    let array = singles(object, name)?;
    let [height, width, 3 | 4] = *array.shape() else {
        return Err(wrong_shape(object.py(), name, array.shape(), "[height, width, 3], linear"));
    };
    let array = array.as_array();
    let channel = |(k, name): (usize, &str)| Channel {
        name: name.to_owned(),
        samples: array.outer_iter().flat_map(|row| row.outer_iter().map(|pixel| pixel[k]).collect::<Vec<_>>()).collect(),
    };
    Ok(Image { width, height, channels: ["R", "G", "B"].into_iter().enumerate().map(channel).collect() })
}
