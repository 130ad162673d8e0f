//! Files into a [`World`]. [`World::load`] is the entry point.
//!
//! A mesh format is a module here with a function `load` of the type [`MeshLoader`], listed in [`FORMATS`] by the ending of its files. It returns the
//! whole world of the file: meshes, instances and materials, with cameras if the format has them. Other files and pictures it reads by the
//! [`Loader`] alone, so that a scene reaches no files but its own. `polygon.rs` cuts faces of many corners.
//!
//! A scene file (`toml.rs`) names a model of any such format and changes parts of its world.

use std::path::{Path, PathBuf};

use glam::Vec2;

use super::texture::Textures;
use super::{Environment, Material, World};
use crate::error::{Error, Result};
use crate::settings::Settings;

mod files;
mod obj;
mod polygon;
mod toml;

pub use files::Files;
pub(super) use files::{Reader, Unread};

/// Reads a file of one format.
type MeshLoader = fn(&mut Loader, &Path) -> Result<World>;

/// Mesh formats, by the endings of their files.
const FORMATS: [(&str, MeshLoader); 1] = [("obj", obj::load)];

/// A person reads that many.
const MOST_WARNINGS: usize = 50;

/// What was loaded.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub world: World,
    /// The defaults, overridden by the scene file.
    pub settings: Settings,
    pub report: LoadReport,
}

/// How loading went.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// What was mended or looks wrong, in sentences for a person (degenerate triangles skipped, unused statements).
    pub warnings: Vec<String>,
    /// All files that were read: the scene file, and all that it names.
    pub files: Vec<PathBuf>,
}

/// How a world is loaded.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// In the place of the scene file's own.
    pub environment: Option<Environment>,
    /// Takes a world without light, for what needs none, as openness does.
    pub unlit: bool,
    pub files: Files,
}

/// What formats read with, and where they put what all of them share.
struct Loader<'a> {
    reader: &'a Reader<'a>,
    /// All textures of the world, each read once.
    textures: Textures<'a>,
    warnings: Vec<String>,
    /// That of the options, or else the scene file's.
    environment: Option<Environment>,
}

impl World {
    /// Reads a scene file (`.toml`) or a model (`.obj`), with everything that it names, which has to lie in its folder.
    ///
    /// # Errors
    /// [`Error::Input`], with the place in the file: when a file cannot be read, is malformed or lies outside, or nothing emits.
    pub fn load(path: &Path) -> Result<Loaded> {
        Self::load_with(path, LoadOptions::default())
    }

    /// The same by these options.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with(path: &Path, options: LoadOptions) -> Result<Loaded> {
        let reader = Reader::new(path, &options.files);
        let textures = Textures::new(&reader);
        let mut loader = Loader { reader: &reader, textures, warnings: Vec::new(), environment: options.environment };
        let ending = path.extension().unwrap_or_default();
        let (mut world, settings) = match format_of(path) {
            _ if ending.eq_ignore_ascii_case("toml") => toml::load(&mut loader, path)?,
            Some(load) => (load(&mut loader, path)?, Settings::default()),
            None => {
                let problem = "not a kind of scene that can be read";
                return Err(Error::input(path, None, problem, "give a scene file (.toml) or a model (.obj)"));
            }
        };
        world.environment = loader.environment.take();
        loader.check(&world);
        let Loader { textures, warnings, .. } = loader;
        world.textures = textures.list;
        if !options.unlit && world.is_dark() {
            let problem = "no light: no material in use has Ke above 0, and there is no environment that is not black";
            let cure = "give a material that the model uses Ke in the MTL file, or emission under [materials.NAME] in a scene file; or an \
                        environment, as [environment] in a scene file or by --env";
            return Err(Error::input(path, None, problem, cure));
        }
        Ok(Loaded { world, settings, report: LoadReport { warnings, files: reader.into_done() } })
    }
}

impl Loader<'_> {
    /// Warns of what every format may have, and cuts a list that is too long.
    fn check(&mut self, world: &World) {
        self.warnings.extend(world.environment.as_ref().and_then(Environment::warning).map(str::to_owned));
        let untextured = world.meshes.iter().flat_map(|mesh| {
            mesh.triangles.iter().filter(|triangle| {
                let textured = world.materials[triangle.material as usize].albedo_texture.is_some();
                textured && triangle.vertices.iter().all(|&vertex| mesh.uvs[vertex as usize] == Vec2::ZERO)
            })
        });
        match untextured.count() {
            0 => {}
            1 => self.warnings.push("1 triangle with a texture has no texture coordinates and shows one colour".to_owned()),
            count => {
                self.warnings.push(format!("{count} triangles with a texture have no texture coordinates and show one colour"));
            }
        }
        if self.warnings.len() > MOST_WARNINGS {
            let more = self.warnings.len() - MOST_WARNINGS;
            self.warnings.truncate(MOST_WARNINGS);
            self.warnings.push(format!("and {more} more of that kind"));
        }
    }
}

fn format_of(path: &Path) -> Option<MeshLoader> {
    let ending = path.extension()?;
    FORMATS.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known)).map(|&(_, load)| load)
}

/// The path of a file that `from` names, with either kind of slash.
fn beside(from: &Path, name: &str) -> PathBuf {
    from.with_file_name(name.replace('\\', "/"))
}

/// For messages: the names of materials, not all of very many.
fn names(materials: &[Material]) -> String {
    let names: Vec<_> = materials.iter().take(20).map(|material| material.name.as_str()).collect();
    match materials.len() - names.len() {
        _ if materials.is_empty() => "(there are none)".to_owned(),
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    }
}
