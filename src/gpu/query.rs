//! Queries that count fragments and measure device time.

use glow::HasContext;

use super::context::Gpu;
use super::resource::Resource;
use crate::error::Result;

/// Counts the fragments of draws.
pub struct SampleQuery(Resource<glow::NativeQuery>);

impl SampleQuery {
    /// # Errors
    /// [`crate::Error::Gl`] if the device makes no query.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Resource::own(gpu, |gl| unsafe { gl.create_query() }).map(Self)
    }

    /// Runs `draws` and returns how many fragments were neither discarded nor failed a test; 0 if the context is lost. Waits for the device.
    pub fn count(&self, draws: impl FnOnce()) -> u32 {
        let (gl, context) = (self.0.gl(), self.0.context());
        unsafe { gl.begin_query(glow::SAMPLES_PASSED, self.0.name()) };
        draws();
        unsafe { gl.end_query(glow::SAMPLES_PASSED) };
        let count = context.wait(|| unsafe { gl.get_query_parameter_u32(self.0.name(), glow::QUERY_RESULT) });
        // A lost context may return any number, and peeling until no fragment is left would never end.
        if context.is_lost() { 0 } else { count }
    }
}

/// Measures the device time from [`TimerQuery::begin`] to [`TimerQuery::end`]. A context can run only one at a time.
pub(super) struct TimerQuery(Resource<glow::NativeQuery>);

impl TimerQuery {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Resource::own(gpu, |gl| unsafe { gl.create_query() }).map(Self)
    }

    pub fn begin(&self) {
        unsafe { self.0.gl().begin_query(glow::TIME_ELAPSED, self.0.name()) }
    }

    pub fn end(&self) {
        unsafe { self.0.gl().end_query(glow::TIME_ELAPSED) }
    }

    /// Whether [`TimerQuery::seconds`] returns without a wait.
    pub fn is_available(&self) -> bool {
        unsafe { self.0.gl().get_query_parameter_u32(self.0.name(), glow::QUERY_RESULT_AVAILABLE) != 0 }
    }

    /// Waits for the time. `None` from 4.29 s on: 32 bits of nanoseconds hold no more, and for 64, glow uses a call that OpenGL 3.3 may lack.
    pub fn seconds(&self) -> Option<f64> {
        let nanoseconds = unsafe { self.0.gl().get_query_parameter_u32(self.0.name(), glow::QUERY_RESULT) };
        (nanoseconds < u32::MAX).then_some(1e-9 * f64::from(nanoseconds))
    }
}
