//! Reads files into a [`World`]. [`World::load`] is the entry point.
//!
//! A mesh format is a module with a function `load` of type [`MeshLoader`], listed by file ending in [`FORMATS`]. It returns meshes, instances,
//! materials, and cameras if any. Only the [`Loader`] reads further files, and keeps a scene to its own. `polygon.rs` triangulates faces.
//!
//! A scene file (`toml.rs`) names a model of any such format and changes parts of its world.

use std::borrow::Cow;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec2};

use super::texture::Textures;
use super::{Environment, Material, Mesh, PunctualLight, Sky, Sun, UnitSpace, World};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, explained};
use crate::settings::{Background, DisplaySettings, Exposure, Settings};

mod arrays;
mod files;
pub mod gltf;
mod indexed;
mod obj;
mod ply;
mod polygon;
mod stl;
mod toml;
mod warnings;

pub use arrays::MeshArrays;
pub use files::Files;
pub(super) use files::{Reader, Unread};
use warnings::Warnings;

/// Reads a file of one format.
type MeshLoader = fn(&mut Loader, &Path) -> Result<World>;

/// Mesh formats, with the endings of their files.
const FORMATS: [(&str, MeshLoader); 5] =
    [("obj", obj::load), ("glb", gltf::load), ("gltf", gltf::load), ("ply", ply::load), ("stl", stl::load)];

/// Maximum coordinate. The length of a triangle's normal needs the fourth power of an edge, which must stay finite in f32.
const FARTHEST: f64 = 1e9;

/// A loaded scene file or model.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub world: World,
    /// The default settings, changed by the scene file.
    pub settings: Settings,
    pub report: LoadReport,
    lighting: Lighting,
}

/// What [`Loaded::light`] needs to know.
#[derive(Clone, Debug)]
struct Lighting {
    path: PathBuf,
    /// Whether no scene file says how pictures are to look.
    is_bare: bool,
    strict: bool,
    no_default_light: bool,
}

/// Warnings and files of a load.
#[derive(Clone, Debug, Default)]
pub struct LoadReport {
    /// Sentences for the user: things that were repaired or look wrong, such as skipped degenerate triangles and ignored statements.
    pub warnings: Vec<String>,
    /// All files that were read: the scene file and all files that it names.
    pub files: Vec<PathBuf>,
}

/// Options for loading a world.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Replaces the environment of the scene file.
    pub environment: Option<Environment>,
    /// Replaces the sun of the scene file.
    pub sun: Option<Sun>,
    /// Replaces the environment or sky of the scene file by the sky of its sun.
    pub sky: Option<Sky>,
    /// Accepts a world without light. Openness, for example, needs none. [`Loaded::light`] gives it light later.
    pub unlit: bool,
    /// Refuses a world without light. Otherwise it gets a sky, unless its scene file gives one.
    pub no_default_light: bool,
    /// Refuses files with faults. Otherwise what can be understood is mended, with a warning.
    pub strict: bool,
    /// The name of the camera to use. Default: the first.
    pub camera: Option<String>,
    /// The name or number (from 0) of the scene to use in a file with several. Default: the one that the file names.
    pub scene: Option<String>,
    /// Swaps the fronts and backs of all surfaces, as [`Mesh::turn`](super::Mesh::turn) does. A scene file can ask for it too.
    pub flip: bool,
    /// Gives vertices without normals smooth ones, where faces meet at no more than so many degrees, see [`Mesh::smooth`](super::Mesh::smooth). A scene file
    /// can ask for it too.
    pub smooth_angle: Option<f32>,
    /// Gives all surfaces the same grey, see [`World::clay`].
    pub clay: bool,
    pub files: Files,
    /// The bytes of the scene file or model itself, if they are not to be read from its path.
    pub bytes: Option<Vec<u8>>,
}

/// Input for all formats, and the results that they share.
struct Loader<'a> {
    reader: &'a Reader<'a>,
    /// All textures of the world. Each file is read once.
    textures: Textures<'a>,
    warnings: Warnings,
    /// The environment of the options, or else of the scene file.
    environment: Option<Environment>,
    /// As the environment.
    sun: Option<Sun>,
    sky: Option<Sky>,
    /// As in [`LoadOptions`].
    scene: Option<String>,
    /// Whether all surfaces are to be turned, by the options or the scene file.
    flip: bool,
    /// That of the options, or else of the scene file.
    smooth_angle: Option<f32>,
}

impl World {
    /// Endings of the files of models.
    pub const MODELS: [&str; FORMATS.len()] = {
        let mut endings = [""; FORMATS.len()];
        let mut index = 0;
        while index < FORMATS.len() {
            endings[index] = FORMATS[index].0;
            index += 1;
        }
        endings
    };

    /// Checks that there is a file of a kind that can be read.
    ///
    /// # Errors
    /// [`Error::Input`] when there is none.
    pub fn check_path(path: &Path) -> Result<()> {
        let cure = || format!("give a scene file (.toml) or a model ({})", endings());
        let about = fs::metadata(path).map_err(|error| Error::input(path, None, explained(path, error).to_string(), cure()))?;
        if about.is_dir() {
            let files = fs::read_dir(path).into_iter().flatten().flatten().map(|entry| entry.path());
            let mut scenes: Vec<_> = files.filter(|file| is_readable(file)).map(|file| file.display().to_string()).collect();
            scenes.sort_unstable();
            let cure = if scenes.is_empty() { cure() } else { format!("give a file in it: {}", few(scenes.into_iter())) };
            return Err(Error::input(path, None, "it is a folder", cure));
        }
        if !is_readable(path) {
            return Err(Error::input(path, None, "not a kind of scene that can be read", cure()));
        }
        Ok(())
    }

    /// Reads a scene file (`.toml`) or a model (of any format), with all files that it names. These must be in its folder.
    ///
    /// # Errors
    /// [`Error::Input`], with the place in the file: when a file cannot be read, is malformed or outside the folder, or nothing emits light.
    pub fn load(path: &Path) -> Result<Loaded> {
        Self::load_with(path, LoadOptions::default())
    }

    /// The same with options.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with(path: &Path, options: LoadOptions) -> Result<Loaded> {
        if options.bytes.is_none() && !matches!(options.files, Files::Memory(_)) {
            Self::check_path(path)?;
        }
        Self::load_by(path, options, !is_scene_file(path), |loader| loader.read(path))
    }

    /// A world of arrays in memory, as a file of the same mesh would be.
    ///
    /// # Errors
    /// [`Error::Input`] when no face can be drawn, or nothing emits light; [`Error::Usage`] when lists do not fit each other.
    pub fn from_arrays(arrays: MeshArrays, options: LoadOptions) -> Result<Loaded> {
        let path = PathBuf::from(&arrays.name);
        Self::load_by(&path, options, true, |loader| {
            let world = loader.model(|loader| arrays::load(loader, &path, arrays), &path)?;
            Ok((world, Settings::default()))
        })
    }

    /// Reads a world by `read`, and changes it as the options say. `path` is for messages. `is_bare`: no scene file says more about it.
    fn load_by(
        path: &Path,
        mut options: LoadOptions,
        is_bare: bool,
        read: impl FnOnce(&mut Loader) -> Result<(Self, Settings)>,
    ) -> Result<Loaded> {
        let (environment, scene) = (options.environment.take(), options.scene.take());
        let reader = Reader::new(path, &options.files).with_bytes(options.bytes.as_deref());
        let textures = Textures::new(&reader);
        let warnings = Warnings::new(options.strict);
        let (sun, sky) = (options.sun, options.sky);
        let mut loader = Loader {
            reader: &reader,
            textures,
            warnings,
            environment,
            sun,
            sky,
            flip: options.flip,
            smooth_angle: options.smooth_angle,
            scene,
        };
        let loaded = loader.load(path, &options, is_bare, read);
        let warnings = loader.warnings.finish();
        let (mut world, settings) = match loaded {
            Ok(loaded) => loaded,
            Err(error) => return Err(error.after(warnings)),
        };
        if options.bytes.is_some() {
            // It cannot be read again to add results.
            world.gltf = None;
        }
        let LoadOptions { strict, no_default_light, unlit, .. } = options;
        let lighting = Lighting { path: path.to_owned(), is_bare, strict, no_default_light };
        let mut loaded = Loaded { world, settings, report: LoadReport { warnings, files: reader.into_done() }, lighting };
        if !unlit {
            loaded.light()?;
        }
        Ok(loaded)
    }
}

impl Loaded {
    /// Whether [`Self::light`] changes something.
    pub fn needs_light(&self) -> bool {
        self.world.is_dark() || self.world.gets_sky(self.lighting.strict, self.lighting.no_default_light)
    }

    /// Gives a world without light a sky, with a warning, unless its options or its scene file say otherwise.
    ///
    /// # Errors
    /// [`Error::Input`] when the world stays dark.
    pub fn light(&mut self) -> Result<()> {
        if !self.needs_light() {
            return Ok(());
        }
        let Lighting { path, is_bare, strict, no_default_light } = &self.lighting;
        let problem = "no light: no material in use emits, there is no lamp, and no environment that is not black";
        if !self.world.gets_sky(*strict, *no_default_light) {
            let cure = "give a material that the model uses Ke in the MTL file, or emission under [materials.NAME] in a scene file; or an \
                        environment, as [environment] in a scene file or by --env; or a sun, as [sun] or by --sun";
            return Err(Error::input(path, None, problem, cure).after(self.report.warnings.clone()));
        }
        self.world.environment = Some(Environment::soft_sky());
        let warning = format!("{}: it has no light, so a soft sky lights it (--env FILE is another)", path.display());
        self.report.warnings.push(warning);
        // Nobody has said how a bare model should look.
        if *is_bare {
            self.settings.display = DisplaySettings { exposure: Exposure::Auto, background: Background::Transparent };
            self.settings.film.ground = true;
        }
        Ok(())
    }
}

impl<'a> Loader<'a> {
    /// Reads the file of a model. `kind` is what it should be.
    fn read_model(&self, path: &Path, kind: &str) -> Result<Cow<'a, [u8]>> {
        let cure = format!("name an existing {kind} file that you may read");
        let reader: &'a Reader<'a> = self.reader;
        reader.read_named(path, MOST_BYTES).map_err(|unread| unread.error(path, None, "this model", cure))
    }

    /// Reads a scene file or a model.
    fn read(&mut self, path: &Path) -> Result<(World, Settings)> {
        match format_of(path) {
            _ if is_scene_file(path) => toml::load(self, path),
            Some(load) => Ok((self.model(|loader| load(loader, path), path)?, Settings::default())),
            None => Err(Error::input(path, None, "not a kind of scene that can be read", "give it the ending of one")),
        }
    }

    /// Reads a world by `read`, and changes it as the options say.
    fn load(
        &mut self,
        path: &Path,
        options: &LoadOptions,
        is_bare: bool,
        read: impl FnOnce(&mut Self) -> Result<(World, Settings)>,
    ) -> Result<(World, Settings)> {
        let (mut world, mut settings) = read(self)?;
        if is_bare {
            world.lights.extend(self.daylight().map_err(|(problem, cure)| Error::usage(problem, cure))?);
        }
        if let (Some(name), None) = (&self.scene, &world.gltf) {
            let cure = "leave out --gltf-scene, or give a glTF file";
            return Err(Error::input(path, None, format!("there is no scene {name:?}: only a glTF file has several"), cure));
        }
        if let Some(name) = &options.camera {
            choose_camera(&mut world, name, path)?;
        }
        if self.flip {
            world.flip();
        }
        if let Some(degrees) = self.smooth_angle {
            world.smooth(degrees);
        }
        if options.clay {
            world.clay();
        }
        world.environment = self.environment.take();
        world.textures = std::mem::take(&mut self.textures.list);
        self.check(&world);
        if is_bare && !world.lights.is_empty() {
            // Lamps in candela or lux do not say how bright their picture is to be.
            settings.display.exposure = Exposure::Auto;
        }
        Ok((world, settings))
    }

    /// The sun as a light. The sky, if there is one, becomes the environment.
    ///
    /// # Errors
    /// A problem and its cure, when the sun's place or light is unusable, or a sky has no sun.
    fn daylight(&mut self) -> Result<Option<PunctualLight>, (String, &'static str)> {
        let Some(sun) = self.sun else {
            let cure = "give [sun] in a scene file, or --sun AZIMUTH,HEIGHT";
            return if self.sky.is_some() { Err(("a sky needs a sun".to_owned(), cure)) } else { Ok(None) };
        };
        let sky = self.sky.unwrap_or_default().check()?;
        if self.sky.is_some() {
            self.environment = Some(sky.environment(&sun)?);
        }
        sky.light(&sun).map(Some)
    }

    /// Whether the light of a sky or sun is that of a real day.
    fn has_real_daylight(&self) -> bool {
        self.sky.is_some() || self.sun.is_some_and(|sun| sun.illuminance.is_none())
    }

    /// Reads the model of a file of this name.
    fn model(&mut self, load: impl FnOnce(&mut Self) -> Result<World>, path: &Path) -> Result<World> {
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(World { file, ..load(self)? })
    }

    /// Tells of triangles without area that were left out of a model, where `kept` were not.
    ///
    /// # Errors
    /// [`Error::Input`] when no triangle is left.
    fn skipped(&mut self, path: &Path, skipped: usize, kept: usize) -> Result<()> {
        let total = skipped + kept;
        match skipped {
            _ if total == 0 => {
                Err(Error::input(path, None, "no face can be drawn", "correct the faces, or export the model again"))
            }
            0 => Ok(()),
            _ if kept == 0 => {
                let cure = "check the export's scale, and that vertices differ";
                Err(Error::input(path, None, format!("none of the {total} triangles has an area"), cure))
            }
            1 => {
                self.warnings.say(format!("{}: 1 of {total} triangles has no area and was skipped", path.display()));
                Ok(())
            }
            _ => {
                self.warnings.say(format!("{}: {skipped} of {total} triangles have no area and were skipped", path.display()));
                Ok(())
            }
        }
    }

    /// Adds the warnings that all formats share.
    fn check(&mut self, world: &World) {
        self.against_normals(world);
        self.unshaded(world);
        let untextured = world.meshes.iter().flat_map(|mesh| {
            mesh.triangles.iter().filter(|triangle| {
                let textured = world.materials[triangle.material as usize].albedo_texture.is_some();
                textured && triangle.vertices.iter().all(|&vertex| mesh.uvs[vertex as usize] == Vec2::ZERO)
            })
        });
        match untextured.count() {
            0 => {}
            1 => self.warnings.say("1 triangle with a texture has no texture coordinates and shows one colour".to_owned()),
            count => {
                self.warnings.say(format!("{count} triangles with a texture have no texture coordinates and show one colour"));
            }
        }
    }

    /// Tells of instances with shading normals that point to the backs of most faces.
    fn against_normals(&mut self, world: &World) {
        let meshes: Vec<_> = world.meshes.iter().map(against_normals).collect();
        let wrong: Vec<_> =
            world.instances.iter().filter_map(|instance| Some((instance.name.as_str(), meshes[instance.mesh]?))).collect();
        if wrong.is_empty() {
            return;
        }
        let [against, all] = wrong.iter().fold([0, 0], |[a, b], (_, [against, all])| [a + against, b + all]);
        self.warnings.say(format!(
            "the normals of {} point to the back of {against} of {all} triangles, and its fronts are where the winding says; if the \
             normals are right, turn these triangles by --flip, or flip = true in a scene file",
            few(wrong.iter().map(|(name, _)| (*name).to_owned())),
        ));
    }

    /// Tells what files say about materials in use, and pictures do not show.
    fn unshaded(&mut self, world: &World) {
        let mut is_used = vec![false; world.materials.len()];
        world.meshes.iter().flat_map(|mesh| &mesh.triangles).for_each(|triangle| is_used[triangle.material as usize] = true);
        let used = world.materials.iter().zip(is_used).filter(|(material, is_used)| *is_used && !material.unshaded.is_empty());
        let notes: Vec<_> = used.map(|(material, _)| format!("{} ({})", material.name, material.unshaded.join(", "))).collect();
        match notes.len() {
            0 => {}
            1 => self.warnings.say(format!("1 material has what pictures do not show yet: {}", notes[0])),
            count => {
                self.warnings.say(format!("{count} materials have what pictures do not show yet: {}", few(notes.into_iter())))
            }
        }
    }
}

/// What is wrong if the shading normals of most faces of a mesh point to their backs: how many do, of how many.
fn against_normals(mesh: &Mesh) -> Option<[usize; 2]> {
    let known = (0..mesh.triangles.len()).filter_map(|triangle| mesh.is_against_normals(triangle));
    let [against, all] = known.fold([0, 0], |[against, all], is_against| [against + usize::from(is_against), all + 1]);
    (2 * against > all).then_some([against, all])
}

/// Makes the camera of this name the first.
fn choose_camera(world: &mut World, name: &str, path: &Path) -> Result<()> {
    let Some(index) = world.cameras.iter().position(|(known, _)| known == name) else {
        let known: Vec<_> = world.cameras.iter().map(|(name, _)| format!("{name:?}")).collect();
        let cure =
            if known.is_empty() { "leave out --camera".to_owned() } else { format!("name one of these: {}", known.join(", ")) };
        return Err(Error::input(path, None, format!("there is no camera {name:?}"), cure));
    };
    world.cameras[..=index].rotate_right(1);
    Ok(())
}

/// The endings of models for a message.
fn endings() -> String {
    World::MODELS.map(|ending| format!(".{ending}")).join(", ")
}

/// Whether the ending is that of a scene file or a model.
fn is_readable(path: &Path) -> bool {
    is_scene_file(path) || format_of(path).is_some()
}

fn is_scene_file(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

fn format_of(path: &Path) -> Option<MeshLoader> {
    let ending = path.extension()?;
    FORMATS.iter().find(|(known, _)| ending.eq_ignore_ascii_case(known)).map(|&(_, load)| load)
}

/// The origin of a mesh's coordinates, so that f32 holds those of a georeferenced model. Zero for a model that is not far from its own origin.
fn origin_of(positions: impl Iterator<Item = DVec3>) -> DVec3 {
    let grow = |[min, max]: [DVec3; 2], position: DVec3| [min.min(position), max.max(position)];
    UnitSpace::around(positions.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], grow)).local_origin()
}

/// The path of a file that the file `from` names. It accepts both kinds of slash.
fn beside(from: &Path, name: &str) -> PathBuf {
    from.with_file_name(name.replace('\\', "/"))
}

/// A list for a message, at most 5.
fn few(list: impl ExactSizeIterator<Item = String>) -> String {
    const FEW: usize = 5;
    let more = list.len().saturating_sub(FEW);
    let shown = list.take(FEW).collect::<Vec<_>>().join(", ");
    if more == 0 { shown } else { format!("{shown} and {more} more") }
}

/// The names of materials for a message, at most 20.
fn names(materials: &[Material]) -> String {
    let names: Vec<_> = materials.iter().take(20).map(|material| material.name.as_str()).collect();
    match materials.len() - names.len() {
        _ if materials.is_empty() => "(there are none)".to_owned(),
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    }
}
