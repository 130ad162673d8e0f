//! Vertex buffers.

use glow::HasContext;

use super::context::Gpu;
use super::resource::Resource;
use crate::error::Result;

/// Triangles, three vertices each. Each float attribute is tightly packed in a buffer of its own.
pub struct VertexArray {
    pub(super) array: Resource<glow::NativeVertexArray>,
    _buffers: Vec<Resource<glow::NativeBuffer>>,
}

impl VertexArray {
    /// Attribute `i` has location `i`. It is `(components, data)` with components × 4 bytes for each vertex.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] if the device has too little memory.
    pub fn new(gpu: &Gpu, attributes: &[(i32, &[u8])]) -> Result<Self> {
        let gl = gpu.gl();
        let array = Resource::own(gpu, |gl| unsafe { gl.create_vertex_array() })?;
        unsafe { gl.bind_vertex_array(Some(array.name())) };
        let mut buffers = Vec::new();
        for (location, &(components, data)) in (0..).zip(attributes) {
            let buffer = Resource::own(gpu, |gl| unsafe { gl.create_buffer() })?;
            unsafe {
                gl.bind_buffer(glow::ARRAY_BUFFER, Some(buffer.name()));
                gl.buffer_data_u8_slice(glow::ARRAY_BUFFER, data, glow::STATIC_DRAW);
                gl.enable_vertex_attrib_array(location);
                gl.vertex_attrib_pointer_f32(location, components, glow::FLOAT, false, 0, 0);
            }
            buffers.push(buffer);
        }
        gpu.check("uploading vertices")?;
        Ok(Self { array, _buffers: buffers })
    }
}
