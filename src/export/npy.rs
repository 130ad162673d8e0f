//! NumPy's `.npy`, with a `.json` of the same name that describes the numbers: columns, shape, units, basis. A second array, `.sources.npy`, maps
//! vertices to those of the model's file.
//!
//! One quantity has the shape that research code expects: `[points, coefficients, 3]` for coefficients, else `[points, 3]` or `[points]`.
//! Several quantities have the shape `[points, columns]`.

use std::path::Path;

use serde_json::{Map, Value, json};

use super::{PointValues, Positions, SourceMap, npz};
use crate::blocks::sha256;
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS, read_file, write_file};
use crate::image::{Channel, WriteOptions};
use crate::npy::{self, Array};
use crate::quantity::ValueArray;

/// Key of the metadata in the JSON.
pub(super) const ABOUT: &str = "finalgather";
/// Key of the array file's checksum.
const ARRAY: &str = "npy_sha256";
/// Key of the positions' checksum.
pub(super) const POSITIONS: &str = "positions_sha256";
/// Ending of the array of sources, and key of its description.
pub const SOURCES: &str = "sources.npy";
const MAP: &str = "sources";
const BASIS: &str =
    "real orthonormal spherical harmonics without the Condon-Shortley phase, at index l (l + 1) + m; z is the polar axis";

pub fn write(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let columns = values.columns;
    let points = columns.first().map_or(0, |column| column.samples.len());
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let shape = match &ValueArray::of(&names)[..] {
        [one] => one.shape(&[points]),
        _ => vec![points, columns.len()],
    };
    let mut about = json!({ "shape": shape });
    describe_columns(&names, options, &mut about);
    about[POSITIONS] = digest(values.positions).into();
    let rows = (0..points).flat_map(|i| columns.iter().map(move |column| column.samples[i]));
    let array = npy::encode(&shape, rows);
    // The checksum shows whether both files are from one bake: an error may leave one of them unwritten.
    about[ARRAY] = sha256(&array).into();
    if let Some(sources) = &values.sources {
        let map = sources_array(sources);
        let name = path.with_extension(SOURCES);
        about[MAP] = describe_sources(sources, &name.file_name().unwrap_or_default().to_string_lossy(), &map);
        write_file(&path.with_extension(SOURCES), &map)?;
    }
    write_file(&path.with_extension("json"), format!("{about:#}\n").as_bytes())?;
    write_file(path, &array)
}

/// Describes columns, for whoever reads a file of them, and adds the metadata.
pub(super) fn describe_columns(names: &[&str], options: &WriteOptions, about: &mut Value) {
    about["columns"] = json!(names);
    let arrays = ValueArray::of(names);
    let meanings: Map<_, _> = arrays.iter().map(|array| (array.name.clone(), array.meaning().into())).collect();
    about["quantities"] = meanings.into();
    if arrays.iter().any(|array| ["SH", "PRT", "PRTUnshadowed"].contains(&array.name.as_str())) {
        about["basis"] = BASIS.into();
    }
    if let Some(metadata) = options.metadata {
        about[ABOUT] = serde_json::from_str(metadata).unwrap_or_else(|_| metadata.into());
    }
}

/// Whole numbers of the shape `[points, 2]`: the object, and the index in its list of vertices.
pub(super) fn sources_array(sources: &SourceMap) -> Vec<u8> {
    npy::encode_u32(&[sources.points.len(), 2], sources.points.iter().flat_map(|source| [source.instance, source.index]))
}

/// Describes the bytes of [`sources_array`], of this name.
pub(super) fn describe_sources(sources: &SourceMap, name: &str, array: &[u8]) -> Value {
    json!({
        "array": name,
        "columns": ["object", "index"],
        "meaning": "for each point, its object in the list here and the index of its vertex in the file, from 0",
        "file": sources.file,
        "objects": sources.names().collect::<Vec<_>>(),
        ARRAY: sha256(array),
    })
}

/// The description beside the array at `path`.
fn description(path: &Path) -> Option<Value> {
    serde_json::from_slice(&read_file(&path.with_extension("json"), MOST_WORDS).ok()?).ok()
}

/// Reads the metadata from the description, if its checksum is that of the array.
pub fn metadata(path: &Path) -> Option<Value> {
    let mut about = description(path)?;
    (about[ARRAY] == sha256(&read_file(path, MOST_BYTES).ok()?)).then(|| about[ABOUT].take())
}

/// Fails if the description would replace a file that is no description of an array: the user does not name that file.
pub fn check_ours(path: &Path) -> Result<()> {
    let beside = path.with_extension("json");
    if beside.exists() && !description(path).is_some_and(|about| about["shape"].is_array() && about["columns"].is_array()) {
        let problem = format!("{}: is there already, and describes no array", beside.display());
        return Err(Error::usage(problem, "give the array another name, for its description goes beside it (.json)"));
    }
    let sources = path.with_extension(SOURCES);
    if sources.exists() && !read_file(&sources, MOST_BYTES).is_ok_and(|bytes| npy::is_u32(&bytes)) {
        let problem = format!("{}: is there already, and maps no points to vertices", sources.display());
        return Err(Error::usage(problem, "give the array another name, for this map goes beside it (.sources.npy)"));
    }
    Ok(())
}

/// The checksum of positions in world space, in their order, as a PLY holds them.
pub(super) fn digest(positions: Positions) -> String {
    if positions.are_far() {
        sha256(bytemuck::cast_slice(positions.world))
    } else {
        sha256(bytemuck::cast_slice(&positions.local()))
    }
}

fn is_npz(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz"))
}

/// Whether a file of [`PointValues::write`] is of these points; `None` if its description does not tell.
pub fn is_of(path: &Path, positions: Positions) -> Option<bool> {
    let about = if is_npz(path) { npz::about(path) } else { description(path) };
    Some(about?[POSITIONS].as_str()? == digest(positions))
}

const CURE: &str = "give a .npz file of `finalgather bake --what prt`, or a .npy with its .json beside it";

/// Reads the columns `PRT.00.R` and so on from a file of [`PointValues::write`], `.npy` or `.npz`. All coefficients of an order must be there.
pub fn read_prt(path: &Path) -> Result<Vec<Channel>> {
    if is_npz(path) {
        return npz::read_prt(path);
    }
    let read = |path: &Path, most: u64| {
        read_file(path, most).map_err(|error| Error::input(path, None, format!("not readable: {error}"), CURE))
    };
    parse_prt(path, &read(path, MOST_BYTES)?, &read(&path.with_extension("json"), MOST_WORDS)?)
}

/// As [`read_prt`], from the `bytes` of the array at `path` and of `about`, its JSON.
pub fn parse_prt(path: &Path, bytes: &[u8], about: &[u8]) -> Result<Vec<Channel>> {
    let json_path = path.with_extension("json");
    let about: Value = serde_json::from_slice(about)
        .map_err(|error| Error::input(&json_path, Some(error.line()), format!("not JSON: {error}"), CURE))?;
    let names: Vec<&str> = about["columns"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let array = Array::parse(path, bytes)?;
    let columns: usize = array.shape.iter().skip(1).product();
    if !(1..=3).contains(&array.shape.len()) || columns != names.len() || array.shape[0] == 0 {
        let problem = format!("{} columns are named for an array of the shape {:?}", names.len(), array.shape);
        return Err(Error::input(&json_path, None, problem, CURE));
    }
    let of_prt = names.into_iter().enumerate().filter(|(_, name)| name.starts_with("PRT."));
    let at = |row: usize, column: usize| match *array.shape {
        [_, _, width] => array.at(&[row, column / width, column % width]),
        _ => array.at(&[row, column]),
    };
    let prt: Vec<_> = of_prt
        .map(|(column, name)| Channel {
            name: name.into(),
            samples: (0..array.shape[0]).map(|row| at(row, column) as f32).collect(),
        })
        .collect();
    checked_prt(path, &json_path, prt)
}

/// Returns these columns of the array at `path` if they are all coefficients of radiance transfer, as `names` says, and finite.
pub(super) fn checked_prt(path: &Path, names: &Path, prt: Vec<Channel>) -> Result<Vec<Channel>> {
    let all: Vec<&str> = prt.iter().map(|column| column.name.as_str()).collect();
    if !matches!(&ValueArray::of(&all)[..], [one] if one.is_of_coefficients()) {
        return Err(Error::input(names, None, "the columns are not the coefficients of radiance transfer", CURE));
    }
    match prt.iter().find_map(|column| column.samples.iter().position(|sample| !sample.is_finite()).map(|point| (point, column)))
    {
        None => Ok(prt),
        Some((point, Channel { name, samples })) => {
            Err(Error::input(path, None, format!("{name} of point {} is {}", point + 1, samples[point]), CURE))
        }
    }
}
