//! NumPy's `.npz`: arrays with names in one file, an uncompressed ZIP. Each quantity is an array, beside positions, normals, faces and sources; `about`
//! holds JSON that describes them.
//!
//! The arrays of a light map have the shape `[height, width, ...]`, the top row first. `mask` is 1 where a texel has a value of its own or of its
//! chart's edge, and `uv` are the coordinates of the vertices, v up.

use std::fs::File;
use std::io::{Cursor, Read, Seek, Write};
use std::path::Path;

use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::npy::{ABOUT, POSITIONS, checked_prt, describe_columns, describe_sources, digest, sources_array};
use super::{ExportMesh, PointValues, Positions};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS, read_file, write_file};
use crate::harmonics::MAX_ORDER;
use crate::image::{Channel, Image, WriteOptions};
use crate::npy;
use crate::quantity::ValueArray;

/// Name of the description among the arrays.
const DESCRIPTION: &str = "about.npy";

/// A light map, as arrays.
#[derive(Clone, Copy)]
pub struct MapValues<'a> {
    /// The mesh with its coordinates on the map.
    pub surface: ExportMesh<'a>,
    /// Columns, and the channel `A`.
    pub image: &'a Image,
}

/// Arrays by name.
type Arrays = Vec<(String, Vec<u8>)>;

pub fn write(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let points = values.positions.world.len();
    let columns: Vec<&Channel> = values.columns.iter().collect();
    let (mut arrays, mut about) = values_of(&columns, &[points], options);
    about[POSITIONS] = digest(values.positions).into();
    arrays.push(positions(values.positions));
    let normals = values.normals.iter().flat_map(|normal| normal.to_array());
    arrays.push(("normals".into(), npy::encode(&[points, 3], normals)));
    arrays.extend(values.surface.map(|surface| faces(&surface)));
    if let Some(sources) = &values.sources {
        let map = sources_array(sources);
        about["sources"] = describe_sources(sources, "sources", &map);
        arrays.push(("sources".into(), map));
    }
    write_arrays(path, arrays, &about)
}

impl MapValues<'_> {
    pub fn write(&self, path: &Path, options: &WriteOptions) -> Result<()> {
        let &Self { surface, image } = self;
        let size = [image.height, image.width];
        let columns: Vec<_> = image.channels.iter().filter(|channel| channel.name != "A").collect();
        let (mut arrays, about) = values_of(&columns, &size, options);
        if let Some(mask) = image.channel("A") {
            arrays.push(("mask".into(), npy::encode(&size, mask.iter().copied())));
        }
        let vertices = surface.mesh.normals.len();
        arrays.push(positions(surface.positions));
        let normals = surface.mesh.normals.iter().flat_map(|normal| normal.to_array());
        arrays.push(("normals".into(), npy::encode(&[vertices, 3], normals)));
        let uvs = surface.mesh.lightmap_uvs.iter().flat_map(|uv| uv.to_array());
        arrays.push(("uv".into(), npy::encode(&[vertices, 2], uvs)));
        arrays.push(faces(&surface));
        write_arrays(path, arrays, &about)
    }
}

/// The arrays of columns, whose samples have this shape, and their description.
fn values_of(columns: &[&Channel], of_points: &[usize], options: &WriteOptions) -> (Arrays, Value) {
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    let mut about = json!({});
    describe_columns(&names, options, &mut about);
    let points = of_points.iter().product();
    let of_quantity = |array: ValueArray| {
        let own = &columns[array.columns.clone()];
        let rows = (0..points).flat_map(|point| own.iter().map(move |column| column.samples[point]));
        (array.key(), npy::encode(&array.shape(of_points), rows))
    };
    (ValueArray::of(&names).into_iter().map(of_quantity).collect(), about)
}

/// In world space, in 64 bits.
fn positions(positions: Positions) -> (String, Vec<u8>) {
    let numbers = positions.world.iter().flat_map(|position| position.to_array());
    ("positions".into(), npy::encode_f64(&[positions.world.len(), 3], numbers))
}

fn faces(surface: &ExportMesh) -> (String, Vec<u8>) {
    let triangles = &surface.mesh.triangles;
    let indices = triangles.iter().flat_map(|triangle| triangle.vertices);
    ("faces".into(), npy::encode_u32(&[triangles.len(), 3], indices))
}

fn write_arrays(path: &Path, mut arrays: Arrays, about: &Value) -> Result<()> {
    let refused = |error: &dyn std::fmt::Display| {
        Error::output(path, format!("cannot be packed: {error}"), "write .npy, or bake fewer quantities at a time")
    };
    arrays.push(("about".into(), npy::encode_text(&about.to_string())));
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        // Without times, so that equal jobs give equal files.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
        let options = options.large_file(bytes.len() > u32::MAX as usize);
        zip.start_file(format!("{name}.npy"), options).map_err(|error| refused(&error))?;
        zip.write_all(&bytes).map_err(|error| refused(&error))?;
    }
    let packed = zip.finish().map_err(|error| refused(&error))?;
    write_file(path, &packed.into_inner())
}

/// The columns `PRT.00.R` and so on of a file's array `prt`.
pub fn read_prt(path: &Path) -> Result<Vec<Channel>> {
    let refused = |problem: String| {
        Error::input(path, None, problem, "give a file of `finalgather bake --what prt`, or one of numpy.savez")
    };
    let bytes = read_file(path, MOST_BYTES).map_err(|error| refused(format!("not readable: {error}")))?;
    let mut zip = ZipArchive::new(Cursor::new(bytes)).map_err(|error| refused(format!("no .npz: {error}")))?;
    let entry = zip.by_name("prt.npy").map_err(|error| refused(format!("its transfer, prt, is not there: {error}")))?;
    let mut bytes = Vec::new();
    entry.take(MOST_BYTES).read_to_end(&mut bytes).map_err(|error| refused(format!("not readable: {error}")))?;
    let array = npy::Array::parse(path, &bytes)?;
    let shape = match array.shape[..] {
        [points, coefficients, 3] if points > 0 && coefficients <= MAX_ORDER * MAX_ORDER => Some((points, coefficients)),
        _ => None,
    };
    let (points, coefficients) =
        shape.ok_or_else(|| refused(format!("prt has the shape {:?}, not [points, order², 3]", array.shape)))?;
    let column = |k: usize| Channel {
        name: format!("PRT.{:02}.{}", k / 3, ["R", "G", "B"][k % 3]),
        samples: (0..points).map(|point| array.at(&[point, k / 3, k % 3]) as f32).collect(),
    };
    checked_prt(path, path, (0..3 * coefficients).map(column).collect())
}

/// The metadata of a file, if it is whole.
pub fn metadata(path: &Path) -> Option<Value> {
    let mut zip = ZipArchive::new(Cursor::new(read_file(path, MOST_BYTES).ok()?)).ok()?;
    // Reading to the end compares checksums.
    for index in 0..zip.len() {
        std::io::copy(&mut zip.by_index(index).ok()?, &mut std::io::sink()).ok()?;
    }
    description(zip).map(|mut about| about[ABOUT].take())
}

/// What the file says about its arrays.
pub fn about(path: &Path) -> Option<Value> {
    description(ZipArchive::new(File::open(path).ok()?).ok()?)
}

fn description(mut zip: ZipArchive<impl Read + Seek>) -> Option<Value> {
    let mut text = Vec::new();
    zip.by_name(DESCRIPTION).ok()?.take(MOST_WORDS).read_to_end(&mut text).ok()?;
    serde_json::from_str(&npy::parse_text(&text)?).ok()
}
