//! Primitives packed by draco: `KHR_draco_mesh_compression`.

use std::collections::HashMap;

use draco_core::{DecodeLimits, DecoderBuffer, MeshDecoder};
use gltf::json::mesh::Primitive;
use serde::Deserialize;

use super::accessors::{AccessorValues, divisor};
use super::buffers::Buffers;
use crate::error::Result;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Extension {
    buffer_view: usize,
    /// From names such as `POSITION` to ids in the packed mesh.
    attributes: HashMap<String, u32>,
}

/// An unpacked primitive. Its vertices are in the order of the packed mesh.
pub struct Unpacked {
    mesh: draco_core::Mesh,
    attributes: HashMap<String, u32>,
}

impl Unpacked {
    /// Unpacks a primitive, if it is packed. `place` is its place in the JSON.
    pub fn of(buffers: &Buffers, primitive: &Primitive, place: &str) -> Result<Option<Self>> {
        let extension = primitive.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_draco_mesh_compression"));
        let Some(extension) = extension else { return Ok(None) };
        let fault = |problem: String| buffers.document.fault(place, format_args!("its draco compression {problem}"));
        let Extension { buffer_view, attributes } =
            Extension::deserialize(extension).map_err(|error| fault(format!("is malformed: {error}")))?;
        let (bytes, _) = buffers.view(buffer_view)?;
        let most = buffers.left() as u64;
        // As much for a vertex as elsewhere.
        let limits =
            DecodeLimits::default().with_max_points(most).with_max_faces(most).with_max_decoded_bytes(most.saturating_mul(16));
        let mut mesh = draco_core::Mesh::new();
        let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
        decoded.map_err(|error| fault(format!("cannot be unpacked: {error}")))?;
        buffers.take(mesh.num_points().saturating_add(mesh.num_faces()))?;
        Ok(Some(Self { mesh, attributes }))
    }

    pub fn vertices(&self) -> usize {
        self.mesh.num_points()
    }

    pub fn count_triangles(&self) -> usize {
        self.mesh.num_faces()
    }

    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.mesh.faces().iter().map(|face| face.map(|point| point.0)).collect()
    }

    /// The values of an attribute, if it is packed. Its accessor has no bytes but says how they are meant.
    pub fn values(&self, buffers: &Buffers, name: &str, accessor: usize) -> Result<Option<AccessorValues<'static>>> {
        let Some(&id) = self.attributes.get(name) else { return Ok(None) };
        let Some(attribute) = self.mesh.attribute_by_unique_id(id) else { return Ok(None) };
        let accessor = buffers.document.entry(&buffers.document.root.accessors, "accessors", accessor)?;
        let width = usize::from(attribute.num_components()).max(1);
        buffers.take(self.vertices().saturating_mul(width) / 16)?;
        let mut floats = attribute.read_f32s(self.vertices(), width);
        let divisor = divisor(accessor);
        if divisor != 1.0 {
            floats.iter_mut().for_each(|number| *number = (*number / divisor).max(-1.0));
        }
        Ok(Some(AccessorValues::from_floats(floats, width)))
    }
}
