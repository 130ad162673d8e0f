//! Vertex and index buffers.

use bytemuck::Pod;
use glow::HasContext;

use super::context::Gpu;
use super::resource::Resource;
use crate::error::Result;

/// Indexed triangles with float attributes, each tightly packed in a buffer of its own.
pub struct VertexArray {
    array: Resource<glow::NativeVertexArray>,
    _buffers: Vec<Resource<glow::NativeBuffer>>,
}

impl VertexArray {
    /// Attribute `i` has location `i`: `(components, data)`, components × 4 bytes a vertex.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device has no memory for it.
    pub fn new(gpu: &Gpu, attributes: &[(i32, &[u8])], indices: &[u32]) -> Result<Self> {
        let gl = gpu.gl();
        let array = Resource::own(gpu, unsafe { gl.create_vertex_array() })?;
        unsafe { gl.bind_vertex_array(Some(array.name())) };
        let mut buffers = Vec::new();
        for (location, &(components, data)) in (0..).zip(attributes) {
            buffers.push(buffer(gpu, glow::ARRAY_BUFFER, data)?);
            unsafe {
                gl.enable_vertex_attrib_array(location);
                gl.vertex_attrib_pointer_f32(location, components, glow::FLOAT, false, 0, 0);
            }
        }
        buffers.push(buffer(gpu, glow::ELEMENT_ARRAY_BUFFER, indices)?);
        gpu.check("uploading vertices")?;
        Ok(Self { array, _buffers: buffers })
    }

    pub(super) fn name(&self) -> glow::NativeVertexArray {
        self.array.name()
    }
}

fn buffer<T: Pod>(gpu: &Gpu, kind: u32, data: &[T]) -> Result<Resource<glow::NativeBuffer>> {
    let gl = gpu.gl();
    let buffer = Resource::own(gpu, unsafe { gl.create_buffer() })?;
    unsafe {
        gl.bind_buffer(kind, Some(buffer.name()));
        gl.buffer_data_u8_slice(kind, bytemuck::cast_slice(data), glow::STATIC_DRAW);
    }
    Ok(buffer)
}
