//! The vertices of a file's primitives, split where they have several results.

use std::collections::HashMap;

use glam::Vec2;
use gltf::json::accessor::Accessor;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;
use serde_json::{Value, json};

use super::baked::{BakedTriangle, PrimitivePlace, sorted};
use crate::error::{Error, Result};
use crate::scene::gltf::{Buffers, triangles_of};

/// How the vertices of a primitive become those with results.
pub struct VertexSplit {
    /// For each vertex of the result, that of the file. It starts with all vertices of the file.
    pub order: Vec<usize>,
    /// For each vertex of the result, its row in the bake. `None`: no triangle in the bake uses it.
    pub rows: Vec<Option<u32>>,
    /// The corners of all triangles; `None` if no vertex was split.
    pub corners: Option<Vec<u32>>,
}

impl VertexSplit {
    /// The vertex of the result with this row, which is a new one if the file's vertex has a row already.
    fn vertex(&mut self, row: u32, of_file: u32) -> u32 {
        let known = &mut self.rows[of_file as usize];
        if known.is_none() {
            *known = Some(row);
            return of_file;
        }
        self.order.push(of_file as usize);
        self.rows.push(Some(row));
        self.order.len() as u32 - 1
    }
}

/// The primitive at a place of a file that was read again.
fn primitive<'a>(buffers: &'a Buffers, (node, index): PrimitivePlace) -> Result<&'a Primitive> {
    let root = &buffers.document.root;
    let mesh = root.nodes.get(node).and_then(|node| node.mesh).and_then(|mesh| root.meshes.get(mesh.value()));
    mesh.and_then(|mesh| mesh.primitives.get(index)).ok_or_else(|| changed(buffers))
}

fn changed(buffers: &Buffers) -> Error {
    Error::input(buffers.document.path, None, "this model has changed since it was loaded", "bake again")
}

/// The number of vertices of a primitive.
fn count(buffers: &Buffers, place: PrimitivePlace) -> Result<usize> {
    let positions = primitive(buffers, place)?.attributes.get(&Checked::Valid(Semantic::Positions));
    Ok(buffers.values(positions.ok_or_else(|| changed(buffers))?.value(), &[3])?.count)
}

/// The corners of all triangles of a primitive.
pub fn file_triangles(buffers: &Buffers, place: PrimitivePlace) -> Result<Vec<[u32; 3]>> {
    let json = primitive(buffers, place)?;
    let indices = json.indices.map(|indices| buffers.values(indices.value(), &[1])).transpose()?;
    let Checked::Valid(mode) = json.mode else { return Err(changed(buffers)) };
    let corners = indices.as_ref().map_or_else(|| count(buffers, place), |indices| Ok(indices.count))?;
    Ok(triangles_of(mode, indices.as_ref(), corners))
}

/// Finds out which vertices have several rows. `triangles` are those of the bake in this primitive.
pub fn split(buffers: &Buffers, place: PrimitivePlace, triangles: &[BakedTriangle]) -> Result<VertexSplit> {
    let count = count(buffers, place)?;
    // Many primitives may share an accessor of which each uses a part.
    buffers.take(count)?;
    let mut split = VertexSplit { order: (0..count).collect(), rows: vec![None; count], corners: None };
    // By row and vertex of the file, because doubles of a triangle share its rows.
    let mut vertices: HashMap<(u32, u32), u32> = HashMap::new();
    // Baked triangles by their vertices in the file, in any winding.
    let mut baked: HashMap<[u32; 3], Vec<&BakedTriangle>> = HashMap::new();
    for triangle in triangles {
        for (row, of_file) in triangle.rows.into_iter().zip(triangle.of_file) {
            if of_file as usize >= count {
                return Err(changed(buffers));
            }
            vertices.entry((row, of_file)).or_insert_with(|| split.vertex(row, of_file));
        }
        baked.entry(sorted(triangle.of_file)).or_default().push(triangle);
    }
    if split.order.len() > count {
        let renumber = |corners: [u32; 3]| {
            // A triangle with the same corners shares the rows of its twin. One that was left out keeps its vertices.
            let Some(twins) = baked.get_mut(&sorted(corners)) else { return corners };
            let twin = if twins.len() > 1 { twins.remove(0) } else { twins[0] };
            corners.map(|corner| {
                let at = twin.of_file.iter().position(|&of_file| of_file == corner);
                at.map_or(corner, |at| vertices[&(twin.rows[at], corner)])
            })
        };
        split.corners = Some(file_triangles(buffers, place)?.into_iter().flat_map(renumber).collect());
    }
    Ok(split)
}

/// The coordinates of a primitive that loaders take for those on a light map, v up. `None`: there are none that can be read.
pub fn own_coordinates(buffers: &Buffers, place: PrimitivePlace) -> Result<Option<Vec<Vec2>>> {
    let Some(accessor) = primitive(buffers, place)?.attributes.get(&Checked::Valid(Semantic::TexCoords(1))) else {
        return Ok(None);
    };
    // The loader has left out what it cannot read.
    let Ok(values) = buffers.values(accessor.value(), &[2]) else { return Ok(None) };
    buffers.take(values.count)?;
    Ok(Some((0..values.count).map(|vertex| values.get(vertex)).map(|[u, v]| Vec2::new(u, 1.0 - v)).collect()))
}

/// What takes the place of an accessor of a primitive.
pub struct Renewed {
    /// The list in the primitive that refers to it, and its name there.
    pub list: String,
    pub name: String,
    /// `None`: it cannot be read, or is too short.
    pub accessor: Option<NewAccessor>,
}

/// An accessor with the values of split vertices.
pub struct NewAccessor {
    pub bytes: Vec<u8>,
    pub stride: usize,
    pub json: Value,
}

/// All attributes of a primitive at its split vertices. `root` is the JSON of the file, which knows more names than the types of the crate.
pub fn renew(buffers: &Buffers, root: &Value, (node, index): PrimitivePlace, split: &VertexSplit) -> Vec<Renewed> {
    let mesh = root["nodes"][node]["mesh"].as_u64().unwrap_or_default() as usize;
    let json = &root["meshes"][mesh]["primitives"][index];
    let targets = json["targets"].as_array().map_or(0, Vec::len);
    let lists = (0..targets).map(|target| format!("/targets/{target}")).chain(["/attributes".to_owned()]);
    let mut renewed = Vec::new();
    for list in lists {
        for (name, accessor) in json.pointer(&list).and_then(Value::as_object).into_iter().flatten() {
            let accessor = accessor.as_u64().and_then(|accessor| renewed_accessor(buffers, root, accessor as usize, split));
            renewed.push(Renewed { list: list.clone(), name: name.clone(), accessor });
        }
    }
    renewed
}

fn renewed_accessor(buffers: &Buffers, root: &Value, index: usize, split: &VertexSplit) -> Option<NewAccessor> {
    let Accessor { component_type: Checked::Valid(component), normalized, .. } = buffers.document.root.accessors.get(index)?
    else {
        return None;
    };
    let values = buffers.values(index, &[1, 2, 3, 4, 9, 16]).ok()?;
    if split.order.iter().any(|&vertex| vertex >= values.count) {
        return None;
    }
    let (bytes, stride) = values.encode(split.order.iter().copied(), u64::from(component.0.as_gl_enum()), *normalized, 4);
    let mut json = root["accessors"][index].clone();
    json["count"] = json!(split.order.len());
    let entries = json.as_object_mut()?;
    ["bufferView", "byteOffset", "sparse"].iter().for_each(|key| drop(entries.remove(*key)));
    Some(NewAccessor { bytes, stride, json })
}
