//! Whether a context is lost: what it held is gone, and whatever it is told comes to nothing.

use std::ffi::c_void;

use glow::HasContext;

/// `glGetGraphicsResetStatus`, where there is one: OpenGL 3.3 knows it as an extension.
pub(super) struct ResetStatus(Option<extern "system" fn() -> u32>);

impl ResetStatus {
    /// Of the current context, whose functions are at `address`.
    pub fn new(functions: &glow::Context, address: impl Fn(&str) -> *const c_void) -> Self {
        // GLX and GLVND have an address for any name; only the extension says whether there is a function.
        let robust = [("GL_KHR_robustness", "glGetGraphicsResetStatus"), ("GL_ARB_robustness", "glGetGraphicsResetStatusARB")];
        let known = robust.into_iter().filter(|(extension, _)| functions.supported_extensions().contains(*extension));
        let found = known.map(|(_, name)| address(name)).find(|address| !address.is_null());
        Self(found.map(|address| unsafe { std::mem::transmute::<*const c_void, extern "system" fn() -> u32>(address) }))
    }

    /// Whose fault it was, once the context is lost.
    pub fn cause(&self) -> Option<&'static str> {
        match self.0.map_or(glow::NO_ERROR, |status| status()) {
            glow::NO_ERROR => None,
            glow::GUILTY_CONTEXT_RESET => Some("for what this process did"),
            glow::INNOCENT_CONTEXT_RESET => Some("for what another process did"),
            _ => Some("without a reason"),
        }
    }
}
