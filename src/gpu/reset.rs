//! Tells whether a context is lost. A lost context has no objects any more, and calls have no effect.

use std::ffi::c_void;

use glow::HasContext;

/// `glGetGraphicsResetStatus`, if the driver has it. In OpenGL 3.3 it is an extension.
pub(super) struct ResetStatus(Option<extern "system" fn() -> u32>);

impl ResetStatus {
    /// Finds the function of the current context; `address` returns the address of a GL function.
    pub fn new(functions: &glow::Context, address: impl Fn(&str) -> *const c_void) -> Self {
        // GLX and GLVND return an address for any name. Only the extension tells whether the function exists.
        let robust = [("GL_KHR_robustness", "glGetGraphicsResetStatus"), ("GL_ARB_robustness", "glGetGraphicsResetStatusARB")];
        let known = robust.into_iter().filter(|(extension, _)| functions.supported_extensions().contains(*extension));
        let found = known.map(|(_, name)| address(name)).find(|address| !address.is_null());
        Self(found.map(|address| unsafe { std::mem::transmute::<*const c_void, extern "system" fn() -> u32>(address) }))
    }

    /// The cause in words, if the context is lost.
    pub fn cause(&self) -> Option<&'static str> {
        match self.0.map_or(glow::NO_ERROR, |status| status()) {
            glow::NO_ERROR => None,
            glow::GUILTY_CONTEXT_RESET => Some("for what this process did"),
            glow::INNOCENT_CONTEXT_RESET => Some("for what another process did"),
            _ => Some("without a reason"),
        }
    }
}
