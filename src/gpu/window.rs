//! The GL context of a window, in which egui draws. It is made from window handles, so any window library can be used.
//!
//! It shares nothing with [`super::Gpu`], and its thread has no other context.

use std::num::NonZeroU32;
use std::sync::Arc;

use egui_glow::Painter;
use glutin::config::Config;
use glutin::context::{NotCurrentGlContext, PossiblyCurrentContext};
use glutin::display::{Display, GetGlDisplay, GlDisplay};
use glutin::surface::{GlSurface, Surface, SurfaceAttributesBuilder, SwapInterval, WindowSurface};
use raw_window_handle::{HasWindowHandle, RawWindowHandle};

use super::headless::{create_context, load_functions};
use super::reset::ResetStatus;
use crate::error::{Error, Result};

/// The drawing surface of a window.
pub struct Screen {
    painter: Painter,
    surface: Surface<WindowSurface>,
    context: PossiblyCurrentContext,
    display: Display,
    reset_status: ResetStatus,
    /// Outlives the surface.
    _window: Arc<dyn HasWindowHandle>,
}

impl Screen {
    /// Makes a context and a surface of `size` pixels for a window of `config`'s display.
    ///
    /// # Errors
    /// [`Error::Gl`] if the driver makes no OpenGL 3.3 context.
    pub fn new(window: Arc<dyn HasWindowHandle>, config: &Config, size: [u32; 2]) -> Result<Self> {
        let error = |problem: String| {
            Error::gl(
                format!("the window has no OpenGL 3.3: {problem}"),
                "install a GL driver for windows (Debian, Ubuntu: apt-get install libgl1-mesa-dri); render works without",
            )
        };
        let failed = |problem: glutin::error::Error| error(problem.to_string());
        let handle = window.window_handle().map_err(|problem| error(problem.to_string()))?.as_raw();
        let display = config.display();
        let [width, height] = sides(size);
        let context = create_context(&display, config, |attributes| attributes.build(Some(handle))).map_err(failed)?;
        let surface = SurfaceAttributesBuilder::<WindowSurface>::new().build(handle, width, height);
        let surface = unsafe { display.create_window_surface(config, &surface) }.map_err(failed)?;
        let context = context.make_current(&surface).map_err(failed)?;

        // Wayland paces a window by events. There, a swap that waits would wait for ever while the window is hidden.
        let paced = matches!(handle, RawWindowHandle::Wayland(_));
        let interval = if paced { SwapInterval::DontWait } else { SwapInterval::Wait(NonZeroU32::MIN) };
        // A surface that cannot wait for the screen does not wait.
        let _ = surface.set_swap_interval(&context, interval);

        let (functions, reset_status) = load_functions(&display);
        let painter = Painter::new(Arc::new(functions), "", None, false).map_err(|problem| error(problem.to_string()))?;
        Ok(Self { painter, surface, context, display, reset_status, _window: window })
    }

    /// The library that made the context: `EGL` or `GLX`.
    pub fn api(&self) -> &'static str {
        match self.display {
            Display::Egl(_) => "EGL",
            Display::Glx(_) => "GLX",
        }
    }

    /// The largest side of a texture.
    pub fn max_texture_side(&self) -> usize {
        self.painter.max_texture_side()
    }

    pub fn resize(&self, size: [u32; 2]) {
        let [width, height] = sides(size);
        self.surface.resize(&self.context, width, height);
    }

    /// Draws a frame of egui.
    pub fn paint(
        &mut self,
        size: [u32; 2],
        pixels_per_point: f32,
        primitives: &[egui::ClippedPrimitive],
        textures: &mut egui::TexturesDelta,
    ) {
        self.painter.clear(size, [0.0, 0.0, 0.0, 1.0]);
        self.painter.paint_and_update_textures(size, pixels_per_point, primitives, textures);
    }

    /// Returns the frame's pixels, row by row from the top.
    pub fn read(&self, size: [u32; 2]) -> egui::ColorImage {
        self.painter.read_screen_rgba(size)
    }

    /// Shows the frame.
    ///
    /// # Errors
    /// [`Error::Gl`] if the context is lost, with all its objects.
    pub fn present(&self) -> Result<()> {
        let swapped = self.surface.swap_buffers(&self.context);
        let problem = match (swapped, self.reset_status.cause()) {
            (Err(problem), _) => problem.to_string(),
            (Ok(()), Some(cause)) => format!("the driver reset it {cause}"),
            (Ok(()), None) => return Ok(()),
        };
        Err(Error::gl(format!("the window lost its OpenGL context: {problem}"), "start again"))
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.painter.destroy();
    }
}

/// Sides of a surface. A surface is never empty, but a window may be.
fn sides(size: [u32; 2]) -> [NonZeroU32; 2] {
    size.map(|side| NonZeroU32::new(side).unwrap_or(NonZeroU32::MIN))
}
