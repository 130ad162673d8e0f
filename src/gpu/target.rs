//! Render targets: a framebuffer object and the textures that it owns.

use std::rc::Rc;

use glow::HasContext;

use super::context::{Context, Gpu};
use super::resource::Resource;
use super::texture::{Format, Texture};
use crate::error::{Error, Result};

/// Colour textures of one size and, if asked for, a float depth texture.
pub struct Target {
    framebuffer: Resource<glow::NativeFramebuffer>,
    colors: Vec<Rc<Texture>>,
    depth: Option<Rc<Texture>>,
    size: [u32; 2],
}

impl Target {
    /// Colour textures in the formats `colors`, and a 32-bit float depth texture if `depth`.
    ///
    /// # Errors
    /// [`Error::Usage`] when the size is beyond the device's limit, [`Error::Gl`] when it refuses the target.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2], colors: &[Format], depth: bool) -> Result<Self> {
        let texture = |format| Texture::empty(gpu, format, width, height).map(Rc::new);
        let colors = colors.iter().map(|&format| texture(format)).collect::<Result<Vec<_>>>()?;
        let depth = depth.then(|| texture(Format::Depth32F)).transpose()?;
        Self::of(gpu, colors, 0, depth)
    }

    /// Targets for the `count` elements of a new array of textures, each with the same depth texture: draw into one after the other.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn array(gpu: &Gpu, size: [u32; 2], color: Format, count: u32) -> Result<Vec<Self>> {
        let color = Rc::new(Texture::empty_array(gpu, color, size, count)?);
        let depth = Rc::new(Texture::empty(gpu, Format::Depth32F, size[0], size[1])?);
        (0..count).map(|element| Self::of(gpu, vec![color.clone()], element, Some(depth.clone()))).collect()
    }

    /// Renders into `element` of `colors` that are arrays.
    fn of(gpu: &Gpu, colors: Vec<Rc<Texture>>, element: u32, depth: Option<Rc<Texture>>) -> Result<Self> {
        let [width, height] = [colors[0].width(), colors[0].height()];
        let gl = gpu.gl();
        let framebuffer = Resource::own(gpu, unsafe { gl.create_framebuffer() })?;
        let mut buffers = Vec::new();
        let status = unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(framebuffer.name()));
            for (i, color) in (0..).zip(&colors) {
                let attachment = glow::COLOR_ATTACHMENT0 + i;
                if color.kind() == glow::TEXTURE_2D_ARRAY {
                    let element = element as i32;
                    gl.framebuffer_texture_layer(glow::FRAMEBUFFER, attachment, Some(color.name()), 0, element);
                } else {
                    gl.framebuffer_texture_2d(glow::FRAMEBUFFER, attachment, glow::TEXTURE_2D, Some(color.name()), 0);
                }
                buffers.push(attachment);
            }
            if let Some(depth) = &depth {
                gl.framebuffer_texture_2d(glow::FRAMEBUFFER, glow::DEPTH_ATTACHMENT, glow::TEXTURE_2D, Some(depth.name()), 0);
            }
            gl.draw_buffers(&buffers);
            gl.check_framebuffer_status(glow::FRAMEBUFFER)
        };
        gpu.check("making a render target")?;
        if status != glow::FRAMEBUFFER_COMPLETE {
            return Err(Error::gl(
                format!("{} refuses a {width}x{height} float render target (0x{status:04x})", gpu.info().renderer),
                "try another device or driver (--gl-device, --backend)",
            ));
        }
        Ok(Self { framebuffer, colors, depth, size: [width, height] })
    }

    pub fn color(&self, index: usize) -> &Texture {
        &self.colors[index]
    }

    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Fills every colour texture with `color` and the depth texture with `depth`.
    pub fn clear(&self, color: [f32; 4], depth: f32) {
        let gl = self.bind();
        unsafe {
            for i in (0..).zip(&self.colors).map(|(i, _)| i) {
                gl.clear_buffer_f32_slice(glow::COLOR, i, &color);
            }
            if self.depth.is_some() {
                gl.depth_mask(true);
                gl.clear_buffer_f32_slice(glow::DEPTH, 0, &[depth]);
            }
        }
    }

    /// Waits where the driver must not be given more before it is done: llvmpipe (seen in Mesa 22.3) can crash where a draw begins while
    /// others still run on its threads, for it looks through the resources of a scene that these are giving back.
    pub fn settle(&self) {
        let context = self.framebuffer.context();
        if context.is_llvmpipe() {
            let gl = context.current();
            context.wait(|| unsafe { gl.finish() });
        }
    }

    pub(super) fn context(&self) -> &Context {
        self.framebuffer.context()
    }

    /// Binds it for drawing, the viewport over all of it.
    pub(super) fn bind(&self) -> &glow::Context {
        let gl = self.framebuffer.gl();
        unsafe {
            gl.bind_framebuffer(glow::FRAMEBUFFER, Some(self.framebuffer.name()));
            gl.viewport(0, 0, self.size[0] as i32, self.size[1] as i32);
        }
        gl
    }
}
