//! Textures from picture files, and linear reflectance from texels.
//!
//! [`Textures::load`] reads each file once; [`ImageTexture::sample_linear`] samples as the GPU does.

use std::collections::HashMap;
use std::io::{Cursor, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use glam::{DVec3, Vec2, Vec3, Vec4};
use image::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};

use super::format::{Reader, Unread};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, can_hold};
use crate::math::neighbours;

/// An sRGB-encoded picture with its sampler.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageTexture {
    pub width: u32,
    pub height: u32,
    /// RGBA, row by row, the top row (v = 1) first. Alpha is linear; [`super::Opacity`] may use it.
    pub texels: Vec<[u8; 4]>,
    pub sampler: Sampler,
}

/// How coordinates find texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sampler {
    /// Along u and v.
    pub wrap: [WrapMode; 2],
    /// The nearest texel alone, in place of bilinear interpolation.
    pub nearest: bool,
}

/// What lies outside 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WrapMode {
    #[default]
    Repeat,
    /// Every second copy is a mirror image.
    Mirror,
    /// The texel at the edge.
    Clamp,
}

/// Maximum texture size of current OpenGL 3.3 devices.
const LARGEST_SIDE: u32 = 16384;
const MOST_MEMORY: u64 = 1 << 30;
/// The most bytes that a picture may unpack to, however short its file is.
const MOST_PACKED: u64 = 64 << 20;

/// Maximum number of texels of all textures together.
const MOST_TEXELS: usize = 1 << 30;

pub struct Textures<'a> {
    pub list: Vec<ImageTexture>,
    by_file: HashMap<(PathBuf, Sampler), usize>,
    /// Mean colours of pictures that are no textures.
    means: HashMap<PathBuf, Vec3>,
    texels: usize,
    reader: &'a Reader<'a>,
}

impl<'a> Textures<'a> {
    pub fn new(reader: &'a Reader<'a>) -> Self {
        Self { list: Vec::new(), by_file: HashMap::new(), means: HashMap::new(), texels: 0, reader }
    }

    /// Returns the index of the texture in file `path`. `named_at` is the place of the statement that names it.
    pub fn load(&mut self, path: &Path, named_at: &str) -> Result<usize> {
        self.load_with(path, named_at, Sampler::default())
    }

    /// The same with a sampler. One file with two samplers makes two textures.
    pub fn load_with(&mut self, path: &Path, named_at: &str, sampler: Sampler) -> Result<usize> {
        let file = self.find(path, named_at)?;
        if let Some(known) = self.known(&file, sampler) {
            return Ok(known);
        }
        let texture = ImageTexture { sampler, ..self.read(&file, path, named_at)? };
        self.add(file, texture, path, named_at)
    }

    /// Returns the index of a texture whose alpha is the picture's, or its grey if it has none. `None` if it is opaque everywhere.
    pub fn load_opacity(&mut self, path: &Path, named_at: &str, sampler: Sampler) -> Result<Option<usize>> {
        let file = self.find(path, named_at)?;
        let mut grey = file.clone().into_os_string();
        grey.push("#grey");
        if let Some(known) = self.known(Path::new(&grey), sampler) {
            return Ok(Some(known));
        }
        let picture = match self.known(&file, sampler) {
            Some(known) => self.list[known].clone(),
            None => ImageTexture { sampler, ..self.read(&file, path, named_at)? },
        };
        if picture.has_alpha() {
            return self.load_with(path, named_at, sampler).map(Some);
        }
        let masked = picture.with_grey_as_alpha();
        if !masked.has_alpha() {
            return Ok(None);
        }
        self.add(grey.into(), masked, path, named_at).map(Some)
    }

    /// Returns the mean linear colour of a picture, which does not become a texture.
    pub fn mean(&mut self, path: &Path, named_at: &str) -> Result<Vec3> {
        let file = self.find(path, named_at)?;
        if let Some(&mean) = self.means.get(&file) {
            return Ok(mean);
        }
        let mean = self.read(&file, path, named_at)?.mean_linear();
        self.means.insert(file, mean);
        Ok(mean)
    }

    /// Whether a texture has a colour that is not black.
    pub fn shines(&self, texture: usize) -> bool {
        self.list[texture].texels.iter().any(|texel| texel[..3] != [0; 3])
    }

    fn find(&self, path: &Path, named_at: &str) -> Result<PathBuf> {
        self.reader.find(path).map_err(|reason| unread(reason, path, named_at))
    }

    fn read(&self, file: &Path, path: &Path, named_at: &str) -> Result<ImageTexture> {
        let bytes = self.reader.read(file, MOST_BYTES).map_err(|reason| unread(reason, path, named_at))?;
        Self::decode(path, &bytes, named_at)
    }

    /// The index of a texture that was loaded before.
    pub fn known(&self, file: &Path, sampler: Sampler) -> Option<usize> {
        self.by_file.get(&(file.to_owned(), sampler)).copied()
    }

    /// Adds a decoded picture as the texture of a file, or of a part of a file that `file` stands for. `path` is for messages.
    pub fn add(&mut self, file: PathBuf, texture: ImageTexture, path: &Path, named_at: &str) -> Result<usize> {
        let texels = self.texels + texture.texels.len();
        if texels > MOST_TEXELS {
            let problem = format!("this texture, named at {named_at}, makes more than {MOST_TEXELS} texels of them all");
            return Err(Error::input(path, None, problem, "shrink some of them"));
        }
        self.texels = texels;
        self.by_file.insert((file, texture.sampler), self.list.len());
        self.list.push(texture);
        Ok(self.list.len() - 1)
    }

    /// Decodes the bytes of a picture. `path` and `named_at` are for messages.
    pub fn decode(path: &Path, bytes: &[u8], named_at: &str) -> Result<ImageTexture> {
        let refused = |problem: String, cure: String| {
            Error::input(path, None, format!("this texture, named at {named_at}, {problem}"), cure)
        };
        decode(path, bytes).map_err(|error| match error {
            ImageError::Limits(_) => {
                let cure = format!("shrink it to at most {LARGEST_SIDE} pixels on a side and 1 GiB");
                refused(format!("is too large: {error}"), cure)
            }
            _ => refused(format!("cannot be decoded: {error}"), "save it again as 8-bit PNG, JPEG, TGA or BMP".into()),
        })
    }
}

impl WrapMode {
    /// The two texels on either side of a coordinate, and the weight of the second. Texel centres lie at (i + 0.5) / `size`.
    fn neighbours(self, coordinate: f32, size: usize) -> (usize, usize, f32) {
        let inside = match self {
            Self::Repeat => return neighbours(coordinate, size),
            Self::Mirror => 1.0 - (1.0 - coordinate.rem_euclid(2.0)).abs(),
            Self::Clamp => coordinate.clamp(0.0, 1.0),
        };
        let position = inside * size as f32 - 0.5;
        let first = position.floor();
        let at = |index: f32| index.clamp(0.0, (size - 1) as f32) as usize;
        (at(first), at(first + 1.0), position - first)
    }
}

fn unread(reason: Unread, path: &Path, named_at: &str) -> Error {
    reason.error(path, None, &format!("this texture, named at {named_at}"), "put the picture there, or correct its name")
}

fn decode(path: &Path, bytes: &[u8]) -> Result<ImageTexture, ImageError> {
    let mut reader = ImageReader::new(Cursor::new(bytes));
    // A TGA file has no signature. Only its name tells the format.
    if let Ok(format) = ImageFormat::from_path(path) {
        reader.set_format(format);
    }
    let mut reader = reader.with_guessed_format()?;
    let format = reader.format();
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE);
    limits.max_image_height = Some(LARGEST_SIDE);
    limits.max_alloc = Some(MOST_MEMORY);
    reader.limits(limits.clone());
    let decoder = reader.into_decoder()?;
    limits.reserve(decoder.total_bytes())?;
    // A WebP of one colour takes a few bytes, whatever its size.
    if !can_hold(bytes, decoder.total_bytes()) && (format != Some(ImageFormat::WebP) || decoder.total_bytes() > MOST_PACKED) {
        return Err(ImageError::IoError(ErrorKind::UnexpectedEof.into()));
    }
    let picture = DynamicImage::from_decoder(decoder)?.into_rgba8();
    let (width, height) = picture.dimensions();
    Ok(ImageTexture { width, height, texels: picture.into_raw().as_chunks().0.to_vec(), sampler: Sampler::default() })
}

/// sRGB decoding of a byte (IEC 61966-2-1).
static LINEAR: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|byte| match byte as f64 / 255.0 {
        low @ ..=0.04045 => (low / 12.92) as f32,
        high => ((high + 0.055) / 1.055).powf(2.4) as f32,
    })
});

impl ImageTexture {
    /// Linear reflectance at `uv`. Texels are decoded, then interpolated bilinearly unless the sampler wants the nearest. Equals what OpenGL samples of an
    /// sRGB texture with these rows and this sampler, without mipmaps, at (u, 1 - v).
    pub fn sample_linear(&self, uv: Vec2) -> Vec3 {
        self.sample(uv, |[r, g, b, _]| Vec3::from([r, g, b].map(|byte| LINEAR[usize::from(byte)])).extend(0.0)).truncate()
    }

    /// The bytes at `uv` as shares of 255, without the sRGB curve, interpolated as in [`Self::sample_linear`].
    pub fn sample_data(&self, uv: Vec2) -> Vec4 {
        self.sample(uv, |texel| Vec4::from(texel.map(f32::from)) / 255.0)
    }

    /// Alpha at `uv`, from 0 to 1, interpolated in the same way.
    pub fn sample_alpha(&self, uv: Vec2) -> f32 {
        self.sample_data(uv).w
    }

    fn sample(&self, uv: Vec2, value: impl Fn([u8; 4]) -> Vec4) -> Vec4 {
        let Sampler { wrap: [along_u, along_v], nearest } = self.sampler;
        let (left, right, x) = along_u.neighbours(uv.x, self.width as usize);
        let (above, below, y) = along_v.neighbours(1.0 - uv.y, self.height as usize);
        // The nearest texel is the one of greater weight.
        let [x, y] = [x, y].map(|share| if nearest { (share + 0.5).floor() } else { share });
        let texel = |x: usize, y: usize| value(self.texels[y * self.width as usize + x]);
        let row = |row| texel(left, row).lerp(texel(right, row), x);
        row(above).lerp(row(below), y)
    }

    /// Whether a texel is not opaque.
    pub fn has_alpha(&self) -> bool {
        self.texels.iter().any(|texel| texel[3] < 255)
    }

    /// Whether no texel stops any light.
    pub fn is_clear(&self) -> bool {
        self.texels.iter().all(|texel| texel[3] == 0)
    }

    /// The picture with its grey as alpha: the luminance of its bytes, which are linear where they are no colours.
    fn with_grey_as_alpha(mut self) -> Self {
        for [r, g, b, alpha] in &mut self.texels {
            let sum = 2126 * u32::from(*r) + 7152 * u32::from(*g) + 722 * u32::from(*b);
            *alpha = ((sum + 5000) / 10_000) as u8;
        }
        self
    }

    /// Mean linear reflectance of the whole picture.
    pub fn mean_linear(&self) -> Vec3 {
        let texels = (0..self.height as usize).flat_map(|y| (0..self.width as usize).map(move |x| self.texel(x, y).as_dvec3()));
        (texels.sum::<DVec3>() / self.texels.len() as f64).as_vec3()
    }

    /// The linear colour of a texel, from the left and from the top.
    pub(super) fn texel(&self, x: usize, y: usize) -> Vec3 {
        let [r, g, b, _] = self.texels[y * self.width as usize + x];
        Vec3::from([r, g, b].map(|byte| LINEAR[usize::from(byte)]))
    }
}
