//! A GL context with its limits, made current on demand.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use glow::HasContext;
use serde::Serialize;
use serde_json::{Value, json};

use super::clock::Stages;
use super::headless::{self, Backend, DeviceChoice, Platform};
use super::reset::ResetStatus;
use crate::error::{Error, Result};

/// An OpenGL 3.3 core context. Clones share it; it lives until the last clone and the last object made from it are gone.
#[derive(Clone)]
pub struct Gpu {
    context: Rc<Context>,
}

/// The context and its function pointers. Objects keep it alive so that they can be deleted.
pub(super) struct Context {
    functions: glow::Context,
    platform: Platform,
    info: GpuInfo,
    reset: ResetStatus,
    /// Why it is lost, if it is. Drivers may say so once only.
    lost: Cell<Option<&'static str>>,
    /// The first that [`Gpu::check`] has not told of.
    error: Cell<u32>,
    /// Seconds of work since it was handed to the device, as far as it is known.
    pub(super) queued: Cell<f64>,
    /// Core profiles draw nothing without a vertex array, not even a triangle that reads no attribute.
    no_vertices: glow::NativeVertexArray,
    /// Distinguishes contexts that one thread uses in turn.
    identity: u64,
    /// What a [`super::StageClock`] has measured; none while there is no such clock.
    pub(super) stages: RefCell<Option<Stages>>,
}

/// What the driver says of itself.
#[derive(Clone, Debug, Serialize)]
pub struct GpuInfo {
    pub renderer: String,
    pub vendor: String,
    pub version: String,
    pub glsl: String,
    /// `egl` or `osmesa`.
    pub backend: String,
    /// The EGL device that was chosen, in words.
    pub device: String,
    pub limits: Limits,
}

/// Limits that a request can run into.
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
    /// Makes a context with no window: EGL on the chosen device, else OSMesa where it is installed.
    ///
    /// On llvmpipe of Mesa 22 the contexts of one process must not work on several threads at once: each looks through the unfinished draws
    /// of all, which another thread may just be changing (`lp_setup_is_resource_referenced`), and the process ends. Newer versions have a lock there.
    /// Contexts on one thread, or in several processes, are safe.
    ///
    /// # Errors
    /// [`Error::Gl`] when no library, no device or no OpenGL 3.3 core context is to be had.
    pub fn headless(backend: Backend, device: DeviceChoice) -> Result<Self> {
        // Whatever comes of it, the context that was current no longer is.
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
        gpu.set_state();
        Ok(gpu)
    }

    pub fn info(&self) -> &GpuInfo {
        &self.context.info
    }

    /// Which driver computes, as far as it tells: another one rounds otherwise.
    pub fn identity(&self) -> Value {
        let GpuInfo { renderer, version, backend, .. } = self.info();
        json!({ "renderer": renderer, "version": version, "backend": backend })
    }

    /// Waits until everything queued has run, so that a clock read next to it measures work and not queuing.
    pub fn finish(&self) {
        self.context.finish();
    }

    /// Whether the driver has reset the device, or given this context up otherwise: then what it held is gone, what reads it finds nothing, and
    /// no call does anything.
    pub fn is_lost(&self) -> bool {
        self.context.is_lost()
    }

    /// Whether after this error of its own, such as that of memory that ended, the device still works.
    pub fn goes_on(&self, error: &Error) -> bool {
        matches!(error, Error::Gl { .. }) && !self.is_lost()
    }

    /// Whether shaders can write to any texel ([`super::Uniform::Image`]): from OpenGL 4.2 on.
    pub fn writes_images(&self) -> bool {
        let number = |name| unsafe { self.gl().get_parameter_i32(name) };
        (number(glow::MAJOR_VERSION), number(glow::MINOR_VERSION)) >= (4, 2)
    }

    /// What shaders have written to images is there for all that comes after.
    pub fn settle_images(&self) {
        unsafe { self.gl().memory_barrier(glow::ALL_BARRIER_BITS) };
    }

    /// Turns GL errors since the last call into one that names `stage`.
    pub fn check(&self, stage: &str) -> Result<()> {
        let lost = self.context.lost();
        let code = self.context.error.take();
        // Errors queue up; the first one is the cause. The bound holds where a lost context reports for ever.
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

    /// The state that every draw relies on and none changes.
    fn set_state(&self) {
        let gl = self.gl();
        unsafe {
            gl.disable(glow::DITHER);
            gl.disable(glow::MULTISAMPLE);
            gl.pixel_store_i32(glow::PACK_ALIGNMENT, 1);
            gl.pixel_store_i32(glow::UNPACK_ALIGNMENT, 1);
        }
    }
}

impl Context {
    pub(super) fn no_vertices(&self) -> glow::NativeVertexArray {
        self.no_vertices
    }

    /// The functions, with this context current on the calling thread.
    pub(super) fn current(&self) -> &glow::Context {
        if CURRENT.get() != self.identity {
            if !self.platform.make_current() {
                self.lose("and does not take it up again");
            }
            CURRENT.set(self.identity);
        }
        &self.functions
    }

    /// Waits until the device has nothing left to do.
    pub(super) fn finish(&self) {
        let gl = self.current();
        self.wait(|| unsafe { gl.finish() });
        self.queued.set(0.0);
    }

    pub(super) fn is_lost(&self) -> bool {
        self.lost().is_some()
    }

    /// Why it is lost, if it is. Those that do not tell when they are reset may still say so by errors.
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

    /// The first cause is the one that counts.
    fn lose(&self, cause: &'static str) {
        self.lost.set(self.lost.get().or(Some(cause)));
    }
}

unsafe fn info(gl: &glow::Context, platform: &Platform) -> GpuInfo {
    let integer = |name| u32::try_from(unsafe { gl.get_parameter_i32(name) }).unwrap_or(0);
    let string = |name| unsafe { gl.get_parameter_string(name) };
    GpuInfo {
        renderer: string(glow::RENDERER),
        vendor: string(glow::VENDOR),
        version: string(glow::VERSION),
        glsl: string(glow::SHADING_LANGUAGE_VERSION),
        backend: platform.backend().to_owned(),
        device: platform.device().to_owned(),
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
