//! The vertices of a file's primitives, split where they have several results.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::Vec2;
use gltf::json::mesh::Semantic;
use gltf::json::validation::Checked;
use serde_json::Value;

use super::super::ExportSource;
use crate::error::{Error, Result};
use crate::scene::gltf::{Buffers, triangles_of};
use crate::scene::{GltfPart, Mesh};

/// Node and primitive.
pub type Place = (usize, usize);

/// How the vertices of a primitive become those with results.
pub struct Split {
    /// For each vertex of the result, that of the file. It starts with all vertices of the file.
    pub order: Vec<usize>,
    /// For each vertex of the result, its row in the bake. `None`: no triangle in the bake uses it.
    pub rows: Vec<Option<u32>>,
    /// The corners of all triangles; `None` if no vertex was split.
    pub corners: Option<Vec<u32>>,
}

/// The baked triangles of each primitive, as indices of the mesh's triangles.
pub fn baked_parts(path: &Path, mesh: &Mesh, source: &ExportSource) -> Result<BTreeMap<Place, Vec<usize>>> {
    let mut parts: BTreeMap<Place, Vec<usize>> = BTreeMap::new();
    for (index, triangle) in mesh.triangles.iter().enumerate() {
        let of = mesh.sources.get(triangle.vertices[0] as usize);
        let part = of.and_then(|of| source.instances.get(of.instance as usize)?.part);
        let Some(GltfPart { node, primitive, copy }) = part else { continue };
        if copy > 0 {
            let name = &source.instances[of.map_or(0, |of| of.instance as usize)].name;
            let problem = format!(
                "{}: {name} is placed several times by EXT_mesh_gpu_instancing, and its copies share what is stored",
                path.display()
            );
            return Err(Error::usage(problem, "write another format, or make nodes of the copies: `gltf-transform uninstance`"));
        }
        parts.entry((node, primitive)).or_default().push(index);
    }
    Ok(parts)
}

/// Gives each node of the bake a mesh of its own. A mesh stays as it is where all that use it are one node.
pub fn separate_meshes(root: &mut Value, baked: &BTreeMap<Place, Vec<usize>>) {
    let mut users: HashMap<u64, Vec<usize>> = HashMap::new();
    for (node, json) in root["nodes"].as_array().into_iter().flatten().enumerate() {
        if let Some(mesh) = json["mesh"].as_u64() {
            users.entry(mesh).or_default().push(node);
        }
    }
    let is_baked = |node: &usize| baked.range((*node, 0)..(node + 1, 0)).next().is_some();
    let mut shared: Vec<_> = users.into_iter().filter(|(_, nodes)| nodes.len() > 1).collect();
    shared.sort_unstable();
    for (mesh, nodes) in shared {
        // If all of them are baked, the first keeps the mesh.
        let kept = usize::from(nodes.iter().all(is_baked));
        for node in nodes.into_iter().filter(is_baked).skip(kept) {
            let copy = root["meshes"][mesh as usize].clone();
            let Some(meshes) = root["meshes"].as_array_mut() else { return };
            meshes.push(copy);
            root["nodes"][node]["mesh"] = (meshes.len() - 1).into();
        }
    }
}

/// The primitive at a place of a file that was read again.
fn primitive<'a>(buffers: &'a Buffers, (node, index): Place) -> Result<&'a gltf::json::mesh::Primitive> {
    let root = &buffers.document.root;
    let mesh = root.nodes.get(node).and_then(|node| node.mesh).and_then(|mesh| root.meshes.get(mesh.value()));
    mesh.and_then(|mesh| mesh.primitives.get(index)).ok_or_else(|| changed(buffers))
}

fn changed(buffers: &Buffers) -> Error {
    Error::input(buffers.document.path, None, "this model has changed since it was loaded", "bake again")
}

/// Finds out which vertices have several rows. `triangles` are those of the bake in this primitive.
pub fn split(buffers: &Buffers, place: Place, mesh: &Mesh, triangles: &[usize]) -> Result<Split> {
    let json = primitive(buffers, place)?;
    let positions = json.attributes.get(&Checked::Valid(Semantic::Positions)).ok_or_else(|| changed(buffers))?;
    let count = buffers.values(positions.value(), &[3])?.count;
    let mut split = Split { order: (0..count).collect(), rows: vec![None; count], corners: None };
    let mut vertices: HashMap<u32, u32> = HashMap::new();
    // Baked triangles by their vertices in the file, in any winding.
    let mut baked: HashMap<[u32; 3], Vec<[u32; 3]>> = HashMap::new();
    for &triangle in triangles {
        let rows = mesh.triangles[triangle].vertices;
        let of_file = rows.map(|row| mesh.sources[row as usize].index);
        for (row, of_file) in rows.into_iter().zip(of_file) {
            let known = split.rows.get_mut(of_file as usize).ok_or_else(|| changed(buffers))?;
            vertices.entry(row).or_insert_with(|| match known {
                None => {
                    *known = Some(row);
                    of_file
                }
                Some(_) => {
                    split.order.push(of_file as usize);
                    split.order.len() as u32 - 1
                }
            });
        }
        let mut key = of_file;
        key.sort_unstable();
        baked.entry(key).or_default().push(rows);
    }
    let mut of_extra: Vec<_> = vertices.iter().filter(|&(_, &vertex)| vertex as usize >= count).collect();
    of_extra.sort_unstable_by_key(|&(_, vertex)| vertex);
    split.rows.extend(of_extra.into_iter().map(|(&row, _)| Some(row)));
    if split.order.len() > count {
        let indices = json.indices.map(|indices| buffers.values(indices.value(), &[1])).transpose()?;
        let Checked::Valid(mode) = json.mode else { return Err(changed(buffers)) };
        let corners = indices.as_ref().map_or(count, |indices| indices.count);
        let all = triangles_of(mode, indices.as_ref(), corners);
        let renumber = |corners: [u32; 3]| {
            let mut key = corners;
            key.sort_unstable();
            // A triangle with the same corners shares the rows of its twin. One that was left out keeps its vertices.
            let Some(twins) = baked.get_mut(&key) else { return corners };
            let rows = if twins.len() > 1 { twins.remove(0) } else { twins[0] };
            corners.map(|corner| {
                let row = rows.iter().find(|&&row| mesh.sources[row as usize].index == corner);
                row.map_or(corner, |row| vertices[row])
            })
        };
        split.corners = Some(all.into_iter().flat_map(renumber).collect());
    }
    Ok(split)
}

/// The texture coordinates of a primitive, by set, v up.
pub fn coordinates(buffers: &Buffers, place: Place) -> Result<Vec<Vec<Vec2>>> {
    let json = primitive(buffers, place)?;
    let accessor = |set| json.attributes.get(&Checked::Valid(Semantic::TexCoords(set)));
    let mut sets = Vec::new();
    while let Some(accessor) = accessor(sets.len() as u32) {
        let values = buffers.values(accessor.value(), &[2])?;
        sets.push((0..values.count).map(|vertex| values.get(vertex)).map(|[u, v]| Vec2::new(u, 1.0 - v)).collect());
    }
    Ok(sets)
}

/// An accessor with the values of split vertices, and where its index belongs in the primitive.
pub struct Renewed {
    pub pointer: String,
    pub bytes: Vec<u8>,
    pub stride: usize,
    pub json: Value,
}

/// All attributes of a primitive at its split vertices.
pub fn renew(buffers: &Buffers, place: Place, split: &Split) -> Result<Vec<Renewed>> {
    let json = serde_json::to_value(primitive(buffers, place)?).map_err(|_| changed(buffers))?;
    let lists = json["targets"].as_array().map_or(0, Vec::len);
    let lists = (0..lists).map(|target| format!("/targets/{target}")).chain(["/attributes".to_owned()]);
    let mut renewed = Vec::new();
    for list in lists {
        for (name, accessor) in json.pointer(&list).and_then(Value::as_object).into_iter().flatten() {
            let Some(index) = accessor.as_u64() else { continue };
            let accessor = buffers.document.root.accessors.get(index as usize).ok_or_else(|| changed(buffers))?;
            let values = buffers.values(index as usize, &[1, 2, 3, 4, 9, 16])?;
            if split.order.iter().any(|&vertex| vertex >= values.count) {
                return Err(changed(buffers));
            }
            let mut json = serde_json::to_value(accessor).map_err(|_| changed(buffers))?;
            let component = json["componentType"].as_u64().unwrap_or_default();
            let (bytes, stride) = values.encode(split.order.iter().copied(), component, accessor.normalized, 4);
            json["count"] = split.order.len().into();
            if let Some(json) = json.as_object_mut() {
                ["bufferView", "byteOffset", "sparse"].iter().for_each(|key| drop(json.remove(*key)));
            }
            // A `/` in a name is written `~1` in a pointer.
            let pointer = format!("{list}/{}", name.replace('~', "~0").replace('/', "~1"));
            renewed.push(Renewed { pointer, bytes, stride, json });
        }
    }
    Ok(renewed)
}
