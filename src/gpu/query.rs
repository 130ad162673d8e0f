//! Occlusion queries.

use glow::HasContext;

use super::context::Gpu;
use super::resource::Resource;
use crate::error::Result;

/// Counts the fragments that survive the draws made within [`SampleQuery::count`].
pub struct SampleQuery {
    query: Resource<glow::NativeQuery>,
}

impl SampleQuery {
    /// # Errors
    /// [`crate::Error::Gl`] when the device makes no query.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { query: Resource::own(gpu, unsafe { gpu.gl().create_query() })? })
    }

    /// Runs `draws` and returns how many fragments were neither discarded nor failed a test. Waits for the device.
    pub fn count(&self, draws: impl FnOnce()) -> u32 {
        let gl = self.query.gl();
        unsafe { gl.begin_query(glow::SAMPLES_PASSED, self.query.name()) };
        draws();
        unsafe {
            gl.end_query(glow::SAMPLES_PASSED);
            gl.get_query_parameter_u32(self.query.name(), glow::QUERY_RESULT)
        }
    }
}
