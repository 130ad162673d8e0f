//! Queries: how many fragments survive, and how long the device takes.

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
        Ok(Self { query: Resource::own(gpu, |gl| unsafe { gl.create_query() })? })
    }

    /// Runs `draws` and returns how many fragments were neither discarded nor failed a test; none, once the context is lost. Waits for the device.
    pub fn count(&self, draws: impl FnOnce()) -> u32 {
        let gl = self.query.gl();
        unsafe { gl.begin_query(glow::SAMPLES_PASSED, self.query.name()) };
        draws();
        unsafe { gl.end_query(glow::SAMPLES_PASSED) };
        let context = self.query.context();
        let count = context.wait(|| unsafe { gl.get_query_parameter_u32(self.query.name(), glow::QUERY_RESULT) });
        // A lost one may tell any number, and who peels until none are left would go on for ever.
        if context.is_lost() { 0 } else { count }
    }
}

/// The time that the device takes from [`TimerQuery::begin`] to [`TimerQuery::end`]. Only one can be running in a context.
pub(super) struct TimerQuery {
    query: Resource<glow::NativeQuery>,
}

impl TimerQuery {
    /// # Errors
    /// [`crate::Error::Gl`] when the device makes no query.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self { query: Resource::own(gpu, |gl| unsafe { gl.create_query() })? })
    }

    pub fn begin(&self) {
        unsafe { self.query.gl().begin_query(glow::TIME_ELAPSED, self.query.name()) }
    }

    pub fn end(&self) {
        unsafe { self.query.gl().end_query(glow::TIME_ELAPSED) }
    }

    /// Whether [`TimerQuery::seconds`] would not have to wait.
    pub fn is_available(&self) -> bool {
        unsafe { self.query.gl().get_query_parameter_u32(self.query.name(), glow::QUERY_RESULT_AVAILABLE) != 0 }
    }

    /// Waits for the device, unless the result is available. `None` beyond what 32 bits of nanoseconds hold, 4.29 s: glow asks for 64 by a call
    /// that not every OpenGL 3.3 has.
    pub fn seconds(&self) -> Option<f64> {
        let nanoseconds = unsafe { self.query.gl().get_query_parameter_u32(self.query.name(), glow::QUERY_RESULT) };
        (nanoseconds < u32::MAX).then_some(1e-9 * f64::from(nanoseconds))
    }
}
