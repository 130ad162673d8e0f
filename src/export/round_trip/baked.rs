//! Which triangles of a glTF file have results.

use std::collections::{BTreeMap, HashMap, HashSet};

use serde_json::Value;

use super::super::ExportSource;
use super::split::file_triangles;
use crate::error::Result;
use crate::scene::gltf::Buffers;
use crate::scene::{Mesh, Source};

/// Node and primitive.
pub type PrimitivePlace = (usize, usize);

/// The triangles with results of each primitive.
pub type Parts = BTreeMap<PrimitivePlace, Vec<BakedTriangle>>;

pub struct BakedTriangle {
    /// Its vertices in the file.
    pub of_file: [u32; 3],
    /// Their rows in the bake.
    pub rows: [u32; 3],
}

/// The bits of a position in unit space.
type Spot = [u32; 3];

/// The triangles of a bake, also those that it left out as doubles of others: they have the results of these.
pub fn baked_parts(buffers: &Buffers, mesh: &Mesh, source: &ExportSource) -> Result<Parts> {
    let spots: HashMap<Source, Spot> =
        source.mesh.sources.iter().zip(&source.mesh.positions).map(|(&of, at)| (of, at.to_array().map(f32::to_bits))).collect();
    let (mut parts, mut kept) = (Parts::new(), HashMap::new());
    for triangle in &mesh.triangles {
        let rows = triangle.vertices;
        let of = rows.map(|row| mesh.sources.get(row as usize).copied().unwrap_or_default());
        let part = source.instances.get(of[0].instance as usize).and_then(|instance| instance.part);
        let Some(part) = part else { continue };
        let of_file = of.map(|of| of.index);
        parts.entry((part.node, part.primitive)).or_default().push(BakedTriangle { of_file, rows });
        if let [Some(a), Some(b), Some(c)] = of.map(|of| spots.get(&of).copied()) {
            kept.entry(sorted([a, b, c])).or_insert([(a, rows[0]), (b, rows[1]), (c, rows[2])]);
        }
    }
    for (instance, part) in (0..).zip(source.instances.iter().map(|instance| instance.part)) {
        let Some(part) = part else { continue };
        let place = (part.node, part.primitive);
        let known: HashSet<_> = parts.get(&place).into_iter().flatten().map(|triangle| sorted(triangle.of_file)).collect();
        let double = |of_file: [u32; 3]| {
            let [a, b, c] = of_file.map(|index| spots.get(&Source { instance, index }).copied());
            let corners = [a?, b?, c?];
            let twin: &[(Spot, u32); 3] = kept.get(&sorted(corners))?;
            let rows = corners.map(|corner| twin.iter().find(|(spot, _)| *spot == corner).map_or(twin[0].1, |&(_, row)| row));
            Some(BakedTriangle { of_file, rows })
        };
        let left_out = file_triangles(buffers, place)?.into_iter().filter(|&of_file| !known.contains(&sorted(of_file)));
        let doubles: Vec<_> = left_out.filter_map(double).collect();
        if !doubles.is_empty() {
            parts.entry(place).or_default().extend(doubles);
        }
    }
    Ok(parts)
}

/// The same for all orders of the corners.
pub fn sorted<T: Ord>(mut corners: [T; 3]) -> [T; 3] {
    corners.sort_unstable();
    corners
}

/// Gives each node of the bake a mesh of its own. A mesh stays as it is where all that use it are one node.
pub fn separate_meshes(root: &mut Value, baked: &Parts) {
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
