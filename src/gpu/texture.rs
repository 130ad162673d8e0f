//! Textures. Size and format of a texture never change.

use bytemuck::Pod;
use glow::{HasContext, PixelPackData, PixelUnpackData};

use super::context::Gpu;
use super::resource::Resource;
use crate::error::{Error, Result};

/// Texel formats. OpenGL 3.3 can render to them and sample them as this program does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Rgba32F,
    Rg32F,
    /// Unsigned integers.
    Rgba32Ui,
    R32Ui,
    /// Four bytes. Sampling decodes sRGB.
    Srgb8Alpha8,
    Depth32F,
    Depth24Stencil8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    Nearest,
    Linear,
    /// Trilinear over mipmaps. The upload makes the mipmaps.
    Mipmapped,
    /// The same where texels are smaller than pixels, the nearest texel where they are larger.
    MipmappedNearest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    Clamp,
    Repeat,
    Mirror,
}

impl Wrap {
    /// Along both axes.
    pub const CLAMP: [Self; 2] = [Self::Clamp; 2];
}

/// A 2D or 3D texture, or an array of 2D ones.
pub struct Texture {
    resource: Resource<glow::NativeTexture>,
    /// The GL target.
    pub(super) kind: u32,
    pub(super) format: Format,
    size: [u32; 3],
}

impl Format {
    /// The internal format, and format and type of texels in memory.
    pub(super) fn gl(self) -> (u32, u32, u32) {
        match self {
            Self::Rgba32F => (glow::RGBA32F, glow::RGBA, glow::FLOAT),
            Self::Rg32F => (glow::RG32F, glow::RG, glow::FLOAT),
            Self::Rgba32Ui => (glow::RGBA32UI, glow::RGBA_INTEGER, glow::UNSIGNED_INT),
            Self::R32Ui => (glow::R32UI, glow::RED_INTEGER, glow::UNSIGNED_INT),
            Self::Srgb8Alpha8 => (glow::SRGB8_ALPHA8, glow::RGBA, glow::UNSIGNED_BYTE),
            Self::Depth32F => (glow::DEPTH_COMPONENT32F, glow::DEPTH_COMPONENT, glow::FLOAT),
            Self::Depth24Stencil8 => (glow::DEPTH24_STENCIL8, glow::DEPTH_STENCIL, glow::UNSIGNED_INT_24_8),
        }
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Rgba32F | Self::Rgba32Ui => 16,
            Self::Rg32F => 8,
            Self::R32Ui | Self::Srgb8Alpha8 | Self::Depth32F | Self::Depth24Stencil8 => 4,
        }
    }
}

impl Texture {
    /// An empty 2D texture with nearest filtering, to render into.
    ///
    /// # Errors
    /// [`Error::Usage`] if the size exceeds the device's limit, [`Error::Gl`] if the device has too little memory.
    pub fn empty(gpu: &Gpu, format: Format, width: u32, height: u32) -> Result<Self> {
        Self::new(gpu, glow::TEXTURE_2D, format, [width, height, 1], Filter::Nearest, Wrap::CLAMP, None)
    }

    /// An empty array of `count` 2D textures with nearest filtering, to render into. Fails as [`Self::empty`].
    pub fn empty_array(gpu: &Gpu, format: Format, [width, height]: [u32; 2], count: u32) -> Result<Self> {
        Self::new(gpu, glow::TEXTURE_2D_ARRAY, format, [width, height, count], Filter::Nearest, Wrap::CLAMP, None)
    }

    /// Texels in a row of a table. OpenGL 3.3 promises at least this texture width.
    const TABLE_WIDTH: usize = 1024;

    /// A 2D texture of `texels`, first row at t = 0. Fails as [`Self::empty`].
    pub fn from_texels<T: Pod>(
        gpu: &Gpu,
        format: Format,
        [width, height]: [u32; 2],
        filter: Filter,
        wrap: [Wrap; 2],
        texels: &[T],
    ) -> Result<Self> {
        Self::new(gpu, glow::TEXTURE_2D, format, [width, height, 1], filter, wrap, Some(bytemuck::cast_slice(texels)))
    }

    /// A list of texels as a 2D texture, 1024 in a row, padded with zeros. Fails as [`Self::empty`].
    pub fn table<T: Pod>(gpu: &Gpu, format: Format, mut texels: Vec<T>) -> Result<Self> {
        let rows = texels.len().div_ceil(Self::TABLE_WIDTH).max(1);
        texels.resize(rows * Self::TABLE_WIDTH, T::zeroed());
        Self::from_texels(gpu, format, [Self::TABLE_WIDTH as u32, rows as u32], Filter::Nearest, Wrap::CLAMP, &texels)
    }

    /// An array of 2D textures of `texels`, one texture after the other, with nearest filtering. Fails as [`Self::empty`].
    pub fn array<T: Pod>(gpu: &Gpu, format: Format, [width, height]: [u32; 2], count: u32, texels: &[T]) -> Result<Self> {
        let texels = Some(bytemuck::cast_slice(texels));
        Self::new(gpu, glow::TEXTURE_2D_ARRAY, format, [width, height, count], Filter::Nearest, Wrap::CLAMP, texels)
    }

    /// A 3D texture of `texels`, x fastest, with linear filtering clamped at the edge. Fails as [`Self::empty`].
    pub fn from_texels_3d<T: Pod>(gpu: &Gpu, format: Format, size: [u32; 3], texels: &[T]) -> Result<Self> {
        Self::new(gpu, glow::TEXTURE_3D, format, size, Filter::Linear, Wrap::CLAMP, Some(bytemuck::cast_slice(texels)))
    }

    fn new(
        gpu: &Gpu,
        kind: u32,
        format: Format,
        size: [u32; 3],
        filter: Filter,
        wrap: [Wrap; 2],
        texels: Option<&[u8]>,
    ) -> Result<Self> {
        let limits = gpu.info().limits;
        let (flat, deep) = match kind {
            glow::TEXTURE_3D => (limits.max_3d_texture_size, limits.max_3d_texture_size),
            _ => (limits.max_texture_size, limits.max_array_layers),
        };
        let sides = size.into_iter().zip([flat, flat, deep]);
        if let Some((side, limit)) = sides.into_iter().find(|&(side, limit)| side == 0 || side > limit) {
            return Err(Error::usage(
                format!("a texture side of {side} is asked for, and this GL device takes 1 to {limit}"),
                "choose a smaller size, layer size or grid, or another device",
            ));
        }
        let [width, height, depth] = size.map(|side| side as i32);
        if let Some(texels) = texels {
            assert_eq!(
                texels.len(),
                size.iter().map(|&side| side as usize).product::<usize>() * format.bytes(),
                "texels fill the texture"
            );
        }
        let gl = gpu.gl();
        let resource = Resource::own(gpu, |gl| unsafe { gl.create_texture() })?;
        let (internal, layout, component) = format.gl();
        let data = PixelUnpackData::Slice(texels);
        let (minify, magnify) = match filter {
            Filter::Nearest => (glow::NEAREST, glow::NEAREST),
            Filter::Linear => (glow::LINEAR, glow::LINEAR),
            Filter::Mipmapped => (glow::LINEAR_MIPMAP_LINEAR, glow::LINEAR),
            Filter::MipmappedNearest => (glow::LINEAR_MIPMAP_LINEAR, glow::NEAREST),
        };
        let [along_s, along_t] = wrap.map(|wrap| match wrap {
            Wrap::Clamp => glow::CLAMP_TO_EDGE,
            Wrap::Repeat => glow::REPEAT,
            Wrap::Mirror => glow::MIRRORED_REPEAT,
        });
        unsafe {
            gl.bind_texture(kind, Some(resource.name()));
            if kind == glow::TEXTURE_3D || kind == glow::TEXTURE_2D_ARRAY {
                gl.tex_image_3d(kind, 0, internal as i32, width, height, depth, 0, layout, component, data);
            } else {
                gl.tex_image_2d(kind, 0, internal as i32, width, height, 0, layout, component, data);
            }
            for (name, value) in [
                (glow::TEXTURE_MIN_FILTER, minify),
                (glow::TEXTURE_MAG_FILTER, magnify),
                (glow::TEXTURE_WRAP_S, along_s),
                (glow::TEXTURE_WRAP_T, along_t),
                (glow::TEXTURE_WRAP_R, glow::CLAMP_TO_EDGE),
            ] {
                gl.tex_parameter_i32(kind, name, value as i32);
            }
            if minify == glow::LINEAR_MIPMAP_LINEAR {
                gl.generate_mipmap(kind);
            } else {
                // Without this, some drivers take a texture without mipmaps for incomplete, whatever its filter.
                gl.tex_parameter_i32(kind, glow::TEXTURE_MAX_LEVEL, 0);
            }
        }
        let mebibytes = size.iter().map(|&side| f64::from(side)).product::<f64>() * format.bytes() as f64 / f64::from(1 << 20);
        gpu.check(&format!("making a texture of {width}x{height}x{depth} texels, {mebibytes:.1} MiB"))?;
        Ok(Self { resource, kind, format, size })
    }

    pub fn width(&self) -> u32 {
        self.size[0]
    }

    pub fn height(&self) -> u32 {
        self.size[1]
    }

    /// Returns the texels, first row at t = 0, the elements of an array one after the other. Waits for draws into the texture.
    pub fn read<T: Pod>(&self) -> Vec<T> {
        let mut texels = Vec::new();
        self.read_into(&mut texels);
        texels
    }

    /// The same, into the memory of a list, which is replaced.
    pub fn read_into<T: Pod>(&self, texels: &mut Vec<T>) {
        let (_, layout, component) = self.format.gl();
        let bytes = self.size.iter().map(|&side| side as usize).product::<usize>() * self.format.bytes();
        if texels.len() != bytes / size_of::<T>() {
            *texels = vec![T::zeroed(); bytes / size_of::<T>()];
        }
        let gl = self.resource.gl();
        unsafe {
            gl.bind_texture(self.kind, Some(self.name()));
            let data = PixelPackData::Slice(Some(bytemuck::cast_slice_mut(texels)));
            self.resource.context().wait(|| gl.get_tex_image(self.kind, 0, layout, component, data));
        }
    }

    pub(super) fn has_stencil(&self) -> bool {
        self.format == Format::Depth24Stencil8
    }

    pub(super) fn name(&self) -> glow::NativeTexture {
        self.resource.name()
    }
}
