//! Textures of a glTF file: pictures in views, in URIs and in files, with their samplers.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use glam::Vec3;
use gltf::json::image::Image;
use gltf::json::texture::{MagFilter, Sampler as JsonSampler, Texture, WrappingMode};
use gltf::json::validation::Checked;

use super::buffers::Buffers;
use super::document::name_of;
use crate::error::{Error, Result};
use crate::scene::format::Loader;
use crate::scene::format::warnings::{Fault, Place};
use crate::scene::texture::Textures;
use crate::scene::{ImageTexture, Sampler, WrapMode};

/// Pictures that have been looked at.
pub struct Images<'a, 'b> {
    buffers: &'a Buffers<'b>,
    /// Indices into the textures of the world, by those of the file. `None`: the picture cannot be read.
    textures: HashMap<usize, Option<usize>>,
    /// Mean linear colours by picture.
    means: HashMap<usize, Vec3>,
    /// Pictures that cannot be read. Each is told once.
    broken: HashSet<usize>,
}

/// Where the bytes of a picture are.
struct Origin {
    /// Index of the picture.
    image: usize,
    /// The file, or a name for a part of the model's.
    path: PathBuf,
    /// Its place in the JSON, alone and with the model.
    place: String,
    named_at: String,
}

impl<'a, 'b> Images<'a, 'b> {
    pub fn new(buffers: &'a Buffers<'b>) -> Self {
        Self { buffers, textures: HashMap::new(), means: HashMap::new(), broken: HashSet::new() }
    }

    /// The index of a texture in the world. `None` if its picture cannot be read; then a warning tells.
    pub fn texture(&mut self, loader: &mut Loader, index: usize) -> Result<Option<usize>> {
        if let Some(&known) = self.textures.get(&index) {
            return Ok(known);
        }
        let loaded = match self.origin(index) {
            Ok((_, origin)) if self.broken.contains(&origin.image) => None,
            Ok((image, origin)) => {
                let loaded = self.load(loader, index, image, &origin);
                self.mended(loader, Some(origin.image), loaded)?
            }
            Err(error) => self.mended(loader, None, Err(error))?,
        };
        self.textures.insert(index, loaded);
        Ok(loaded)
    }

    /// The mean linear colour of a texture. `None` as above.
    pub fn mean(&mut self, loader: &mut Loader, index: usize) -> Result<Option<Vec3>> {
        let (image, origin) = match self.origin(index) {
            Ok(found) => found,
            Err(error) => return self.mended(loader, None, Err(error)),
        };
        if self.broken.contains(&origin.image) {
            return Ok(None);
        }
        if let Some(&known) = self.means.get(&origin.image) {
            return Ok(Some(known));
        }
        let mean = self.decode(image, &origin).map(|picture| picture.mean_linear());
        let mean = self.mended(loader, Some(origin.image), mean)?;
        self.means.extend(mean.map(|mean| (origin.image, mean)));
        Ok(mean)
    }

    /// The result; `None` with a warning if it cannot be had. `image` is then broken.
    fn mended<T>(&mut self, loader: &mut Loader, image: Option<usize>, result: Result<T>) -> Result<Option<T>> {
        match result {
            Err(Error::Input { path, problem, cure, .. }) => {
                self.broken.extend(image);
                let problem = || format!("{}: {problem}", path.display());
                let fault = Fault { kind: "picture", problem: &problem, mend: "its material has its colour alone", cure: &cure };
                loader.warnings.mend(Place { path: self.buffers.document.path, line: None }, &fault)?;
                Ok(None)
            }
            other => other.map(Some),
        }
    }

    fn load(&self, loader: &mut Loader, index: usize, image: &Image, origin: &Origin) -> Result<usize> {
        let sampler = self.sampler(index)?;
        if let Some(known) = loader.textures.known(&origin.path, sampler) {
            return Ok(known);
        }
        let texture = ImageTexture { sampler, ..self.decode(image, origin)? };
        loader.textures.add(origin.path.clone(), texture, &origin.path, &origin.named_at)
    }

    fn decode(&self, image: &Image, origin: &Origin) -> Result<ImageTexture> {
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => self.buffers.resource(uri, &origin.place)?,
            (None, Some(view)) => Cow::Borrowed(self.buffers.view(view.value())?.0),
            (None, None) => return Err(self.buffers.document.fault(&origin.place, "it has neither a uri nor a bufferView")),
        };
        Textures::decode(&origin.path, &bytes, &origin.named_at)
    }

    fn entry(&self, index: usize) -> Result<&'a Texture> {
        self.buffers.document.entry(&self.buffers.document.root.textures, "textures", index)
    }

    /// The picture of a texture, and where it is.
    fn origin(&self, index: usize) -> Result<(&'a Image, Origin)> {
        let document = self.buffers.document;
        let texture = self.entry(index)?;
        let others = texture.extensions.as_ref().map(|extensions| &extensions.others);
        let source = |name| others.and_then(|others| others.get(name)?.get("source")?.as_u64());
        let source = match source("EXT_texture_webp") {
            Some(webp) => webp as usize,
            None => texture.source.value(),
        };
        if source == u32::MAX as usize {
            let problem = match others.is_some_and(|others| others.contains_key("KHR_texture_basisu")) {
                true => "its picture is KTX2 (KHR_texture_basisu) alone, which is not read",
                false => "it names no picture",
            };
            let cure = "convert KTX2 pictures to PNG: run `gltf-transform png in.glb out.glb`; or export with PNG or JPEG";
            return Err(Error::input(document.path, None, format!("textures[{index}]: {problem}"), cure));
        }
        let image = document.entry(&document.root.images, "images", source)?;
        let place = format!("images[{source}]");
        let named_at = format!("{place} of {}", document.path.display());
        let path = match &image.uri {
            Some(uri) if !uri.starts_with("data:") => self.buffers.file(uri, &place)?,
            _ => {
                let mut name = document.path.as_os_str().to_owned();
                name.push(format!("#{place}"));
                name.into()
            }
        };
        Ok((image, Origin { image: source, path, place, named_at }))
    }

    fn sampler(&self, index: usize) -> Result<Sampler> {
        let Some(sampler) = self.entry(index)?.sampler else { return Ok(Sampler::default()) };
        let document = self.buffers.document;
        let JsonSampler { mag_filter, wrap_s, wrap_t, .. } =
            document.entry(&document.root.samplers, "samplers", sampler.value())?;
        let wrap = |mode: &Checked<WrappingMode>| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => WrapMode::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => WrapMode::Mirror,
            _ => WrapMode::Repeat,
        };
        Ok(Sampler { wrap: [wrap(wrap_s), wrap(wrap_t)], nearest: *mag_filter == Some(Checked::Valid(MagFilter::Nearest)) })
    }

    /// What a user calls the picture of a texture.
    pub fn name(&self, index: usize) -> String {
        match self.origin(index) {
            Ok((Image { uri, name, .. }, _)) => {
                let file = uri.as_ref().filter(|uri| !uri.starts_with("data:"));
                name_of([file, name.as_ref()], || format!("textures[{index}]"))
            }
            Err(_) => format!("textures[{index}]"),
        }
    }
}
