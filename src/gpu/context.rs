//! A GL context with its limits. It becomes current when it is used.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use glow::HasContext;
use serde::Serialize;
use serde_json::{Value, json};

use super::clock::Stages;
use super::headless::{self, Backend, DeviceChoice, Platform};
use super::reset::ResetStatus;
use crate::error::{Error, Result};

/// An OpenGL 3.3 core context. Clones share it. It lives until its last clone and its last object are dropped.
#[derive(Clone)]
pub struct Gpu {
    context: Rc<Context>,
}

/// The context and its function pointers. GL objects keep it alive, because deleting them needs it.
pub(super) struct Context {
    functions: glow::Context,
    platform: Platform,
    info: GpuInfo,
    reset: ResetStatus,
    /// Why the context is lost, if it is. Stored, because some drivers report the loss only once.
    lost: Cell<Option<&'static str>>,
    /// The first GL error that [`Gpu::check`] has not reported yet.
    error: Cell<u32>,
    /// Estimated seconds of work that are queued and not yet flushed to the device.
    pub(super) queued: Cell<f64>,
    /// Core profiles need a bound vertex array for every draw, even for a triangle that reads no attribute.
    pub(super) no_vertices: glow::NativeVertexArray,
    /// Tells contexts apart that one thread uses in turn.
    identity: u64,
    /// The state of the [`super::StageClock`], if there is one.
    pub(super) stages: RefCell<Option<Stages>>,
}

/// The driver's description of itself.
#[derive(Clone, Debug, Serialize)]
pub struct GpuInfo {
    pub renderer: String,
    pub vendor: String,
    pub version: String,
    pub glsl: String,
    /// `egl` or `osmesa`.
    pub backend: String,
    /// Index and name of the EGL device.
    pub device: String,
    pub limits: Limits,
}

/// Device limits that settings can exceed.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Limits {
    pub max_texture_size: u32,
    pub max_array_layers: u32,
    pub max_3d_texture_size: u32,
    pub max_renderbuffer_size: u32,
    pub max_draw_buffers: u32,
    pub max_texture_units: u32,
}

thread_local! {
    static CURRENT: Cell<u64> = const { Cell::new(0) };
    static NEXT: Cell<u64> = const { Cell::new(1) };
}

impl Gpu {
    /// Makes a context without a window: through EGL on the chosen device, or through OSMesa if EGL fails and OSMesa is installed.
    ///
    /// With llvmpipe of Mesa 22, the contexts of one process must not work on several threads at once: each reads the unfinished draws
    /// of all contexts without a lock (`lp_setup_is_resource_referenced`), and the process crashes. Newer versions take a lock there.
    /// Contexts on one thread, or in several processes, are safe.
    ///
    /// # Errors
    /// [`Error::Gl`] if no library, no device or no OpenGL 3.3 core context is available.
    pub fn headless(backend: Backend, device: DeviceChoice) -> Result<Self> {
        // Even a failure leaves another context current, or none.
        CURRENT.set(0);
        let (platform, functions, reset) = headless::create(backend, device)?;
        let info = unsafe { info(&functions, &platform) };
        let no_vertices = unsafe { functions.create_vertex_array() }
            .map_err(|problem| Error::gl(format!("a GL object cannot be made: {problem}"), "try another device or driver"))?;
        let identity = NEXT.replace(NEXT.get() + 1);
        CURRENT.set(identity);
        let stages = RefCell::default();
        let (lost, error, queued) = Default::default();
        let context = Context { functions, platform, info, reset, lost, error, queued, no_vertices, identity, stages };
        let gpu = Self { context: Rc::new(context) };
        // Every draw relies on this state, and none changes it.
        let gl = gpu.gl();
        unsafe {
            gl.disable(glow::DITHER);
            gl.disable(glow::MULTISAMPLE);
            gl.pixel_store_i32(glow::PACK_ALIGNMENT, 1);
            gl.pixel_store_i32(glow::UNPACK_ALIGNMENT, 1);
        }
        Ok(gpu)
    }

    pub fn info(&self) -> &GpuInfo {
        &self.context.info
    }

    /// Whether the driver computes on this machine's processor: llvmpipe and softpipe of Mesa, SwiftShader and their like.
    pub fn is_software(&self) -> bool {
        let renderer = self.info().renderer.to_lowercase();
        ["llvmpipe", "softpipe", "swrast", "software", "swiftshader", "basic render"].iter().any(|name| renderer.contains(name))
    }

    /// Names the driver, because another driver rounds differently.
    pub fn identity(&self) -> Value {
        let GpuInfo { renderer, version, backend, .. } = self.info();
        json!({ "renderer": renderer, "version": version, "backend": backend })
    }

    /// Waits until the device has done all queued work. A clock that is read next then measures work and not queuing.
    pub fn finish(&self) {
        self.context.finish();
    }

    /// Whether the driver has lost this context, by a reset of the device for example. Then its objects are gone, and calls have no effect.
    pub fn is_lost(&self) -> bool {
        self.context.is_lost()
    }

    /// Whether the device still works after this error. It does after an ordinary GL error, such as one of too little memory.
    pub fn goes_on(&self, error: &Error) -> bool {
        matches!(error, Error::Gl { .. }) && !self.is_lost()
    }

    /// Whether shaders can write to any texel ([`super::Uniform::Image`]). This needs OpenGL 4.2.
    pub fn writes_images(&self) -> bool {
        let number = |name| unsafe { self.gl().get_parameter_i32(name) };
        (number(glow::MAJOR_VERSION), number(glow::MINOR_VERSION)) >= (4, 2)
    }

    /// Makes texels that shaders wrote to images visible to all later commands.
    pub fn settle_images(&self) {
        unsafe { self.gl().memory_barrier(glow::ALL_BARRIER_BITS) };
    }

    /// Returns the first GL error since the last call. The error names `stage`.
    pub fn check(&self, stage: &str) -> Result<()> {
        let lost = self.context.lost();
        let code = self.context.error.take();
        // Drop the errors that follow the first. The bound is for lost contexts, which report errors without end.
        for _ in 0..64 {
            if unsafe { self.gl().get_error() } == glow::NO_ERROR {
                break;
            }
        }
        if let Some(cause) = lost {
            return Err(Error::gl(
                format!("the driver has reset {} {cause}: the OpenGL context is lost ({stage})", self.info().renderer),
                "start again; if it happens again, use another device or driver (--gl-device, --backend)",
            ));
        }
        match code {
            glow::NO_ERROR => Ok(()),
            glow::OUT_OF_MEMORY => Err(Error::gl(
                format!("the GL device is out of memory ({stage})"),
                "use a smaller --size, --layer-size or (to bake) --memory, or another device (--gl-device)",
            )),
            code => Err(Error::gl(
                format!("OpenGL error 0x{code:04x} ({stage}) on {}", self.info().renderer),
                "use a smaller --size or --layer-size, for limits may be less than a driver says, or another device or driver (--gl-device, \
                 --backend)",
            )),
        }
    }

    pub(super) fn context(&self) -> &Rc<Context> {
        &self.context
    }

    pub(super) fn gl(&self) -> &glow::Context {
        self.context.current()
    }
}

impl Context {
    /// Makes this context current on the calling thread and returns the GL functions.
    pub(super) fn current(&self) -> &glow::Context {
        if CURRENT.get() != self.identity {
            if !self.platform.make_current() {
                self.lose("and does not take it up again");
            }
            CURRENT.set(self.identity);
        }
        &self.functions
    }

    pub(super) fn finish(&self) {
        let gl = self.current();
        self.wait(|| unsafe { gl.finish() });
        self.queued.set(0.0);
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost().is_some()
    }

    /// Why the context is lost, if it is. A context without a reset status may still report the loss as a GL error.
    fn lost(&self) -> Option<&'static str> {
        let gl = self.current();
        if self.lost.get().is_none() {
            if let Some(cause) = self.reset.cause() {
                self.lose(cause);
            }
            match unsafe { gl.get_error() } {
                glow::CONTEXT_LOST => self.lose("and says no more"),
                error if self.error.get() == glow::NO_ERROR => self.error.set(error),
                _ => {}
            }
        }
        self.lost.get()
    }

    /// Stores why the context is lost, unless a cause is stored already.
    fn lose(&self, cause: &'static str) {
        self.lost.set(self.lost.get().or(Some(cause)));
    }
}

unsafe fn info(gl: &glow::Context, platform: &Platform) -> GpuInfo {
    let integer = |name| u32::try_from(unsafe { gl.get_parameter_i32(name) }).unwrap_or(0);
    let string = |name| unsafe { gl.get_parameter_string(name) };
    let [backend, device] = platform.names().map(str::to_owned);
    GpuInfo {
        renderer: string(glow::RENDERER),
        vendor: string(glow::VENDOR),
        version: string(glow::VERSION),
        glsl: string(glow::SHADING_LANGUAGE_VERSION),
        backend,
        device,
        limits: Limits {
            max_texture_size: integer(glow::MAX_TEXTURE_SIZE),
            max_array_layers: integer(glow::MAX_ARRAY_TEXTURE_LAYERS),
            max_3d_texture_size: integer(glow::MAX_3D_TEXTURE_SIZE),
            max_renderbuffer_size: integer(glow::MAX_RENDERBUFFER_SIZE),
            max_draw_buffers: integer(glow::MAX_DRAW_BUFFERS),
            max_texture_units: integer(glow::MAX_TEXTURE_IMAGE_UNITS),
        },
    }
}
