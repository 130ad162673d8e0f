//! Binary PLY: a colour for display, one property for each column, and the place of each vertex in the model's file.
//!
//! The crate that reads points is not used to write, because it asks for every property of every vertex by name.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use serde_json::Value;

use super::{PointValues, snake_case};
use crate::blocks::sha256;
use crate::error::Result;
use crate::file::write_by;
use crate::image::{WriteOptions, encode_srgb};
use crate::scene::Triangle;

/// The metadata's line begins with this.
const ABOUT: &str = "comment finalgather ";

/// The line of the checksum of all data after the header begins with this.
const DATA: &str = "comment sha256 ";

/// Reads the metadata from the header, if the checksum is that of the data.
pub fn metadata(bytes: &[u8]) -> Option<Value> {
    const END: &str = "end_header\n";
    let end = bytes.windows(END.len()).position(|window| window == END.as_bytes())?;
    let mut lines = str::from_utf8(&bytes[..end]).ok()?.lines().skip(2);
    let about = lines.next()?.strip_prefix(ABOUT)?;
    let is_whole = lines.next()?.strip_prefix(DATA)? == sha256(&bytes[end + END.len()..]);
    is_whole.then(|| serde_json::from_str(about).ok())?
}

pub fn write(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let triangles = values.surface.map_or(&[][..], |surface| &surface.mesh.triangles);
    let data = data(values, triangles, options.exposure);
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    // A comment is one line, so line breaks become spaces.
    if let Some(metadata) = options.metadata {
        let _ = writeln!(header, "{ABOUT}{}", metadata.replace(['\r', '\n'], " "));
        let _ = writeln!(header, "{DATA}{}", sha256(&data));
    }
    if let Some(sources) = values.sources {
        let file = sources.file.replace(char::is_control, " ");
        let _ = writeln!(header, "comment file {file}");
        for (object, name) in sources.names().enumerate() {
            let _ = writeln!(header, "comment object {object} {name}");
        }
    }
    let _ = writeln!(header, "element vertex {}", values.positions.world.len());
    let kind = if values.positions.are_far() { "double" } else { "float" };
    for name in ["x", "y", "z"] {
        let _ = writeln!(header, "property {kind} {name}");
    }
    for name in ["nx", "ny", "nz"] {
        let _ = writeln!(header, "property float {name}");
    }
    for name in ["red", "green", "blue"] {
        let _ = writeln!(header, "property uchar {name}");
    }
    for column in values.columns {
        let _ = writeln!(header, "property float {}", snake_case(&column.name));
    }
    if values.sources.is_some() {
        let _ = writeln!(header, "property uint source_object\nproperty uint source_index");
    }
    if !triangles.is_empty() {
        let _ = writeln!(header, "element face {}\nproperty list uchar int vertex_indices", triangles.len());
    }
    header.push_str("end_header\n");

    write_by(path, |mut file| {
        file.write_all(header.as_bytes())?;
        file.write_all(&data)
    })
}

/// The data after the header.
fn data(values: &PointValues, triangles: &[Triangle], exposure: f32) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(values.positions.world.len() * (39 + 4 * values.columns.len()) + 13 * triangles.len());
    for (i, colour) in values.shown(exposure).into_iter().enumerate() {
        for number in values.positions.world[i].to_array() {
            if values.positions.are_far() {
                bytes.extend(number.to_le_bytes());
            } else {
                bytes.extend((number as f32).to_le_bytes());
            }
        }
        bytes.extend(values.normals[i].to_array().into_iter().flat_map(f32::to_le_bytes));
        bytes.extend(colour.to_array().map(|value| (encode_srgb(value) * 255.0).round() as u8));
        for column in values.columns {
            bytes.extend(column.samples[i].to_le_bytes());
        }
        if let Some(sources) = values.sources {
            bytes.extend(sources.points[i].instance.to_le_bytes());
            bytes.extend(sources.points[i].index.to_le_bytes());
        }
    }
    for triangle in triangles {
        bytes.push(3);
        bytes.extend(triangle.vertices.into_iter().flat_map(u32::to_le_bytes));
    }
    bytes
}
