//! Pictures that a material library names: options, places and textures.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::number::{Word, read};
use super::search::Search;
use super::text::{names_of, split_word};
use crate::error::{Error, Result};
use crate::scene::format::warnings::{Fault, Place};
use crate::scene::format::{Loader, beside};
use crate::scene::{ImageTexture, Material, Sampler, WrapMode};

/// A statement that names a picture.
#[derive(Clone, Debug, Default)]
pub struct PictureName {
    /// The file, perhaps with quotes or a comment.
    pub name: String,
    pub line: usize,
    pub placement: Placement,
    sampler: Sampler,
}

/// Where a texture lies: its coordinates are those of the model times `scale` plus `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub scale: Vec2,
    pub offset: Vec2,
}

impl Default for Placement {
    fn default() -> Self {
        Self { scale: Vec2::ONE, offset: Vec2::ZERO }
    }
}

impl PictureName {
    /// Reads options such as `-clamp on` and `-s 2 2 1`, then the file name with its spaces. Also returns an option that is not used.
    pub fn parse(text: &str, line: usize) -> (Self, Option<&str>) {
        let mut picture = Self { line, ..Self::default() };
        let mut ignored = None;
        let mut rest = text.trim();
        while rest.starts_with('-') {
            let (option, arguments) = split_word(rest);
            let lower = option.to_lowercase();
            let most = match lower.as_str() {
                "-o" | "-s" | "-t" => 3,
                "-mm" => 2,
                _ => 1,
            };
            rest = arguments;
            let (mut numbers, mut first) = (Vec::new(), "");
            for argument in 0..most {
                let (word, after) = split_word(rest);
                let (Word::Number(value) | Word::Odd(value)) = read(word) else {
                    // Of the numbers, only the first is required.
                    if argument == 0 {
                        (first, rest) = (word, after);
                    }
                    break;
                };
                numbers.push(value as f32);
                rest = after;
            }
            let pair =
                |unsaid: f32| Vec2::new(numbers.first().copied().unwrap_or(unsaid), numbers.get(1).copied().unwrap_or(unsaid));
            match lower.as_str() {
                "-s" if pair(1.0).is_finite() => picture.placement.scale = pair(1.0),
                "-o" if pair(0.0).is_finite() => picture.placement.offset = pair(0.0),
                "-clamp" if first.eq_ignore_ascii_case("on") => picture.sampler.wrap = [WrapMode::Clamp; 2],
                "-clamp" | "-blendu" | "-blendv" | "-boost" | "-texres" | "-bm" | "-colorspace" => {}
                "-t" | "-cc" if numbers.iter().all(|&number| number == 0.0) && !first.eq_ignore_ascii_case("on") => {}
                "-mm" if numbers == [0.0, 1.0] => {}
                _ => ignored = Some(option),
            }
        }
        picture.name = rest.to_owned();
        (picture, ignored)
    }

    /// The file name without folders, for a message.
    pub fn base(&self) -> String {
        let name = names_of(&self.name).last().unwrap_or_default();
        name.rsplit(['/', '\\']).next().unwrap_or_default().to_owned()
    }

    /// The names that the statement may mean, the likeliest first. Some exporters write options behind the name.
    fn names(&self) -> Vec<Cow<'_, str>> {
        let before_options = self.name.split_once(" -").map(|(name, _)| name);
        names_of(&self.name).chain(before_options.into_iter().flat_map(names_of)).collect()
    }
}

/// Loads the pictures of one library.
pub struct Pictures<'a, 'b> {
    loader: &'a mut Loader<'b>,
    search: &'a mut Search<'b>,
    /// The library and its model.
    files: [&'a Path; 2],
    /// Pictures that could not be read.
    failed: HashSet<PathBuf>,
    /// Which textures have texels that are not opaque.
    alpha: HashMap<usize, bool>,
}

impl<'a, 'b> Pictures<'a, 'b> {
    pub fn new(loader: &'a mut Loader<'b>, search: &'a mut Search<'b>, files: [&'a Path; 2]) -> Self {
        Self { loader, search, files, failed: HashSet::new(), alpha: HashMap::new() }
    }

    /// The index of a texture. `None`, with a warning that tells the `mend`, if it cannot be read.
    pub fn texture(&mut self, picture: &PictureName, mend: &str) -> Result<Option<usize>> {
        self.open(picture, mend, |loader, path, named_at| loader.textures.load_with(path, named_at, picture.sampler))
    }

    /// The radiance of a lamp with a picture, and the texture that multiplies it. `placement` is that of the material's other textures. A picture that is
    /// placed in another way has its mean colour in the radiance. Without `Ke` the picture shines as it is.
    pub fn glow(
        &mut self,
        picture: &PictureName,
        emission: Option<Vec3>,
        placement: Option<Placement>,
    ) -> Result<(Vec3, Option<usize>)> {
        const MEND: &str = "the material has its Ke alone";
        let (unread, radiance) = (emission.unwrap_or(Vec3::ZERO), emission.unwrap_or(Vec3::ONE));
        let place = Place { path: self.files[0], line: Some(picture.line) };
        if placement.is_none_or(|placement| placement == picture.placement) {
            if radiance != Vec3::ZERO {
                let Some(texture) = self.texture(picture, MEND)? else { return Ok((unread, None)) };
                if self.loader.textures.shines(texture) {
                    return Ok((radiance, Some(texture)));
                }
            }
            self.loader.warnings.tell(place, "map_Ke", &|| "map_Ke has no effect: it or Ke is black".to_owned());
            return Ok((Vec3::ZERO, None));
        }
        let mean = self.open(picture, MEND, |loader, path, named_at| loader.textures.mean(path, named_at))?;
        let Some(mean) = mean else { return Ok((unread, None)) };
        let radiance = radiance * mean;
        let radiance = if radiance.max_element() < Material::LEAST_GLOW { Vec3::ZERO } else { radiance };
        let text = || match radiance {
            Vec3::ZERO => {
                "map_Ke has no effect: it has other -s or -o than map_Kd, and its mean is too dark for a lamp".to_owned()
            }
            Vec3 { x, y, z } => {
                format!("map_Ke has other -s or -o than map_Kd: its mean colour shines, radiance {x:.3} {y:.3} {z:.3}")
            }
        };
        self.loader.warnings.tell(place, "map_Ke", &text);
        Ok((radiance, None))
    }

    /// The index of a texture whose alpha is the opacity that a picture says. `None` if it is opaque everywhere, or, with a warning, if it cannot be read.
    pub fn mask(&mut self, picture: &PictureName) -> Result<Option<usize>> {
        let loaded = self.open(picture, "the material is as opaque as its d", |loader, path, named_at| {
            loader.textures.load_opacity(path, named_at, picture.sampler)
        });
        Ok(loaded?.flatten())
    }

    /// Whether a texture stops no light at all.
    pub fn is_clear(&self, texture: usize) -> bool {
        self.loader.textures.list[texture].is_clear()
    }

    /// Warns of a material that would be invisible.
    pub fn tell_invisible(&mut self, name: &str, line: usize) {
        let place = Place { path: self.files[0], line: (line > 0).then_some(line) };
        let text = || format!("material \"{name}\" would be invisible, by d, Tr or the alpha of its picture, which is ignored");
        self.loader.warnings.tell(place, "invisible", &text);
    }

    /// A texture that was loaded.
    pub fn picture(&self, texture: usize) -> &ImageTexture {
        &self.loader.textures.list[texture]
    }

    /// The index of a texture that is made of others. `name` tells it from all others.
    pub fn derived(&mut self, name: &str, from: &[usize], make: impl Fn(&[&ImageTexture]) -> ImageTexture) -> Result<usize> {
        let list = &self.loader.textures.list;
        let (name, sampler) = (PathBuf::from(name), list[from[0]].sampler);
        if let Some(known) = self.loader.textures.known(&name, sampler) {
            return Ok(known);
        }
        let texture = make(&from.iter().map(|&texture| &list[texture]).collect::<Vec<_>>());
        let library = self.files[0];
        self.loader.textures.add(name, texture, library, &library.display().to_string())
    }

    /// Tells what is made of a picture.
    pub fn tell(&mut self, picture: &PictureName, what: &'static str, text: &str) {
        let place = Place { path: self.files[0], line: Some(picture.line) };
        self.loader.warnings.tell(place, what, &|| text.to_owned());
    }

    pub fn has_alpha(&mut self, texture: usize) -> bool {
        let textures = &self.loader.textures.list;
        *self.alpha.entry(texture).or_insert_with(|| textures[texture].has_alpha())
    }

    fn open<T>(
        &mut self,
        picture: &PictureName,
        mend: &str,
        load: impl Fn(&mut Loader, &Path, &str) -> Result<T>,
    ) -> Result<Option<T>> {
        let library = self.files[0];
        let named_at = format!("{}:{}", library.display(), picture.line);
        let path = self.find(picture)?;
        let is_new = !self.failed.contains(&path);
        if is_new || self.loader.warnings.is_strict() {
            match load(self.loader, &path, &named_at) {
                Ok(loaded) => return Ok(Some(loaded)),
                Err(error) => self.loader.warnings.mend_error(library, "picture", error, mend)?,
            }
            self.failed.insert(path);
        } else {
            let place = Place { path: library, line: Some(picture.line) };
            self.loader.warnings.tell(place, "picture", &|| format!("{} cannot be read; {mend}", path.display()));
        }
        Ok(None)
    }

    /// The place of a picture: the named one, or where a file of this name is.
    fn find(&mut self, picture: &PictureName) -> Result<PathBuf> {
        let library = self.files[0];
        let named = beside(library, &picture.name);
        if self.loader.warnings.is_strict() || self.loader.reader.has(&named) {
            return Ok(named);
        }
        let names = picture.names();
        let place = Place { path: library, line: Some(picture.line) };
        let here = names.iter().map(|name| beside(library, name)).find(|path| self.loader.reader.has(path));
        let Some(found) = here.or_else(|| self.search.find(self.files, &names)) else { return Ok(named) };
        let reason = self.loader.reader.find(&named).err().map(|unread| unread.error(library, None, "it", ""));
        let problem = || match &reason {
            Some(Error::Input { problem, .. }) => format!("picture {}: {problem}", picture.name),
            _ => format!("there is no picture {}", picture.name),
        };
        let (mend, cure) = (format!("{} is used", found.display()), "correct its name");
        self.loader.warnings.mend(place, &Fault { kind: "other picture", problem: &problem, mend: &mend, cure })?;
        Ok(found)
    }
}
