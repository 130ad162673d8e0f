//! Render targets: a framebuffer object and its textures.

use std::rc::Rc;

use glow::HasContext;

use super::context::{Context, Gpu};
use super::resource::Resource;
use super::texture::{Format, Texture};
use crate::error::{Error, Result};

/// Colour textures and an optional depth texture, all of one size. A target has at least one texture.
pub struct Target {
    framebuffer: Resource<glow::NativeFramebuffer>,
    colors: Vec<Rc<Texture>>,
    depth: Option<Rc<Texture>>,
    size: [u32; 2],
}

impl Target {
    /// Makes colour textures in the formats `colors`, and a 32-bit float depth texture if `depth` is true.
    ///
    /// # Errors
    /// [`Error::Usage`] if the size exceeds the device's limit, [`Error::Gl`] if the device refuses the target.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2], colors: &[Format], depth: bool) -> Result<Self> {
        let texture = |format| Texture::empty(gpu, format, width, height).map(Rc::new);
        let colors = colors.iter().map(|&format| texture(format)).collect::<Result<Vec<_>>>()?;
        let depth = depth.then(|| texture(Format::Depth32F)).transpose()?;
        Self::of(gpu, colors.into_iter().map(|color| (color, 0)).collect(), depth)
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(size: [u32; 2], colors: &[Format], depth: bool) -> usize {
        let depth = depth.then_some(Format::Depth32F);
        size.map(|side| side as usize).iter().product::<usize>()
            * colors.iter().copied().chain(depth).map(Format::bytes).sum::<usize>()
    }

    /// Renders into a texture (the first element of an array), with a 24-bit depth and stencil texture. Fails as [`Self::new`].
    pub fn with_stencil(gpu: &Gpu, color: Rc<Texture>) -> Result<Self> {
        let depth = Texture::empty(gpu, Format::Depth24Stencil8, color.width(), color.height())?;
        Self::of(gpu, vec![(color, 0)], Some(Rc::new(depth)))
    }

    /// Renders into textures of one size that others share. The number beside a colour texture is the element of an array.
    ///
    /// # Errors
    /// [`Error::Gl`] if the device refuses the target.
    pub fn of(gpu: &Gpu, colors: Vec<(Rc<Texture>, u32)>, depth: Option<Rc<Texture>>) -> Result<Self> {
        let any = colors.first().map(|(color, _)| color).or(depth.as_ref());
        let [width, height] = any.map_or([0; 2], |texture| [texture.width(), texture.height()]);
        let gl = gpu.gl();
        let framebuffer = Resource::own(gpu, |gl| unsafe { gl.create_framebuffer() })?;
        let mut buffers = Vec::new();
        let status = unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer.name()));
            for (i, (color, element)) in (0..).zip(&colors) {
                let attachment = glow::COLOR_ATTACHMENT0 + i;
                if color.kind == glow::TEXTURE_2D_ARRAY {
                    let element = *element as i32;
                    gl.framebuffer_texture_layer(glow::FRAMEBUFFER, attachment, Some(color.name()), 0, element);
                } else {
                    gl.framebuffer_texture_2d(glow::FRAMEBUFFER, attachment, glow::TEXTURE_2D, Some(color.name()), 0);
                }
                buffers.push(attachment);
            }
            if let Some(depth) = &depth {
                let attachment = if depth.has_stencil() { glow::DEPTH_STENCIL_ATTACHMENT } else { glow::DEPTH_ATTACHMENT };
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, attachment, glow::TEXTURE_2D, Some(depth.name()), 0);
            }
            gl.draw_buffers(&buffers);
            if buffers.is_empty() {
                // In OpenGL 3.3 a framebuffer is complete only if its read buffer exists.
                gl.read_buffer(glow::NONE);
            }
            gl.check_framebuffer_status(glow::FRAMEBUFFER)
        };
        gpu.check("making a render target")?;
        if status != glow::FRAMEBUFFER_COMPLETE {
            return Err(Error::gl(
                format!("{} refuses a {width}x{height} render target (0x{status:04x})", gpu.info().renderer),
                "try another device or driver (--gl-device, --backend)",
            ));
        }
        let colors = colors.into_iter().map(|(color, _)| color).collect();
        Ok(Self { framebuffer, colors, depth, size: [width, height] })
    }

    pub fn color(&self, index: usize) -> &Texture {
        &self.colors[index]
    }

    /// Number of colour textures.
    pub fn colors(&self) -> usize {
        self.colors.len()
    }

    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Fills all colour textures, which hold floats, with `color`, the depth texture with `depth`, and the stencil with 0.
    pub fn clear(&self, color: [f32; 4], depth: f32) {
        let gl = self.bind();
        for i in 0..self.colors.len() as u32 {
            unsafe { gl.clear_buffer_f32_slice(glow::COLOR, i, &color) };
        }
        if self.depth.is_some() {
            self.clear_depth(depth);
        }
    }

    /// Fills colour texture `index`, which holds unsigned integers, with `color`.
    pub fn clear_unsigned(&self, index: u32, color: [u32; 4]) {
        unsafe { self.bind().clear_buffer_u32_slice(glow::COLOR, index, &color) };
    }

    /// Fills the depth texture with `depth` and the stencil with 0.
    pub fn clear_depth(&self, depth: f32) {
        let gl = self.bind();
        unsafe {
            gl.depth_mask(true);
            if self.depth.as_ref().is_some_and(|depth| depth.has_stencil()) {
                gl.stencil_mask(0xff);
                gl.clear_buffer_depth_stencil(glow::DEPTH_STENCIL, 0, depth, 0);
            } else {
                gl.clear_buffer_f32_slice(glow::DEPTH, 0, &[depth]);
            }
        }
    }

    pub(super) fn context(&self) -> &Context {
        self.framebuffer.context()
    }

    /// Binds the target for drawing, with a viewport of its whole size.
    pub(super) fn bind(&self) -> &glow::Context {
        let gl = self.framebuffer.gl();
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer.name()));
            gl.viewport(0, 0, self.size[0] as i32, self.size[1] as i32);
            gl.color_mask(true, true, true, true);
        }
        gl
    }
}
