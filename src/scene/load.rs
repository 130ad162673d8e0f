//! Scene files (TOML) and bare models (OBJ) into a checked [`Scene`].
//!
//! A scene file names the model and overrides what the model says or cannot say:
//!
//! ```toml
//! mesh = "room.obj"            # beside this file or in folders there, as all file names here
//!
//! [camera]                     # without it: the whole model from the front
//! eye = [278, 273, -800]
//! target = [278, 273, 0]
//! up = [0, 1, 0]               # the default
//! fov_y_degrees = 39.3         # 40 by default
//! aperture = 10                # radius of a thin lens; 0, a pinhole, by default
//! focus_distance = 900         # what is sharp; the target by default
//!
//! [environment]                # what lies beyond the model: black without
//! file = "sky.hdr"             # or radiance = [1, 1, 1], the same from everywhere
//! scale = 1                    # the default, as are no
//! turn_degrees = 0             # turns about +y, counter-clockwise from above
//!
//! [settings]                   # any field of `Settings`
//! directions = 1000
//!
//! [materials.floor]            # a material of the model
//! albedo = [0.5, 0.5, 0.5]
//! emission = [0, 0, 0]
//! albedo_texture = "tiles.png"
//! surface = "mirror"           # or "diffuse", or { glass = { index = 1.5, filter = [1, 1, 1] } }; a mirror reflects its albedo
//! ```

use std::collections::{BTreeMap, HashMap};
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use glam::{Vec2, Vec3};
use serde::Deserialize;
use toml::Spanned;

use super::camera::DEFAULT_FOV_Y;
use super::files::{Files, Reader};
use super::mtl::{GLASS_INDEX, beside};
use super::obj::{self, names};
use super::texture::Textures;
use super::{Camera, Lens, Material, Scene, Surface};
use crate::environment::Environment;
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS};
use crate::settings::Settings;

/// That many are read by a person.
const MOST_WARNINGS: usize = 50;

/// How a scene is loaded.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// In the place of the scene's own.
    pub environment: Option<Environment>,
    /// Takes a scene without light, for what needs none, as openness does.
    pub unlit: bool,
    pub files: Files,
}

impl Scene {
    /// Reads a scene file (`.toml`) or a model (`.obj`), with everything that it names, which has to lie in its folder.
    pub fn load(path: &Path) -> Result<Self> {
        Self::load_with(path, LoadOptions::default())
    }

    /// The same as these options have it.
    pub fn load_with(path: &Path, options: LoadOptions) -> Result<Self> {
        let reader = Reader::new(path, &options.files);
        let mut scene = load(&reader, path, options.environment)?;
        scene.files = reader.into_done();
        let is_emissive = |triangle| scene.material(triangle).is_emissive();
        if options.unlit || scene.has_sky() || (0..scene.mesh.triangles.len()).any(is_emissive) {
            return Ok(scene);
        }
        let problem = "no light: no material in use has Ke above 0, and there is no environment that is not black";
        let cure = "give a material that the model uses Ke in the MTL file, or emission under [materials.NAME] in a scene file; or an \
                    environment, as [environment] in a scene file or by --env";
        Err(Error::input(path, None, problem, cure))
    }
}

fn load(reader: &Reader, path: &Path, environment: Option<Environment>) -> Result<Scene> {
    let extension = path.extension().unwrap_or_default();
    if extension.eq_ignore_ascii_case("toml") {
        return load_toml(reader, path, environment);
    }
    if extension.eq_ignore_ascii_case("obj") {
        return build(reader, path, Settings::default(), None, environment, |_, _| Ok(()));
    }
    Err(Error::input(path, None, "not a kind of scene that can be read", "give a scene file (.toml) or a model (.obj)"))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    mesh: String,
    camera: Option<Spanned<CameraTable>>,
    environment: Option<Spanned<EnvironmentTable>>,
    #[serde(default)]
    settings: Settings,
    #[serde(default)]
    materials: BTreeMap<Spanned<String>, MaterialTable>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraTable {
    eye: [f32; 3],
    target: [f32; 3],
    #[serde(default = "upright")]
    up: [f32; 3],
    #[serde(default = "default_fov_y")]
    fov_y_degrees: f32,
    #[serde(default)]
    aperture: f32,
    focus_distance: Option<f32>,
}

fn upright() -> [f32; 3] {
    Vec3::Y.to_array()
}

fn default_fov_y() -> f32 {
    DEFAULT_FOV_Y
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EnvironmentTable {
    file: Option<String>,
    radiance: Option<Spanned<[f32; 3]>>,
    scale: Option<Spanned<f32>>,
    turn_degrees: Option<Spanned<f32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialTable {
    albedo: Option<Spanned<[f32; 3]>>,
    emission: Option<Spanned<[f32; 3]>>,
    albedo_texture: Option<Spanned<String>>,
    surface: Option<Spanned<SurfaceTable>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum SurfaceTable {
    Diffuse,
    Mirror,
    Glass {
        #[serde(default = "glass_index")]
        index: f32,
        #[serde(default = "clear")]
        filter: [f32; 3],
    },
}

fn glass_index() -> f32 {
    GLASS_INDEX
}

fn clear() -> [f32; 3] {
    [1.0; 3]
}

fn load_toml(reader: &Reader, path: &Path, environment: Option<Environment>) -> Result<Scene> {
    let cure = "name an existing TOML file, in UTF-8";
    let bytes = reader.read_named(path, MOST_WORDS).map_err(|unread| unread.error(path, None, "this scene file", cure))?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|error| Error::input(path, None, format!("this scene file is not UTF-8: {error}"), cure))?;
    let line = |span: Range<usize>| text.bytes().take(span.start).filter(|&byte| byte == b'\n').count() + 1;
    let error = |span, problem: String, cure: &str| Error::input(path, Some(line(span)), problem, cure);
    let file: SceneFile = toml::from_str(text).map_err(|fault| {
        let cure = "a scene file has mesh, [camera], [environment], [settings] and [materials.NAME]; see the examples in scenes/";
        Error::input(path, fault.span().map(line), fault.message().trim_end(), cure)
    })?;

    file.settings.validate().map_err(|fault| match fault {
        Error::Usage { problem, cure } => {
            // The problem starts with the setting's name.
            let name = problem.split_whitespace().next().unwrap_or_default().replace('-', "_");
            let named = |line: &str| line.split('=').next().is_some_and(|key| key.trim() == name);
            let line = text.lines().position(named).map(|index| index + 1);
            Error::input(path, line, problem, cure)
        }
        other => other,
    })?;

    let camera = file.camera.map(|table| {
        let CameraTable { eye, target, up, fov_y_degrees, aperture, focus_distance } = *table.get_ref();
        let [eye, target, up] = [eye, target, up].map(Vec3::from);
        let focus_distance = focus_distance.unwrap_or_else(|| eye.distance(target));
        let lens = (aperture != 0.0).then_some(Lens { radius: aperture, focus_distance });
        let camera = Camera { eye, target, up, fov_y_degrees, lens };
        camera.check().map_err(|(problem, cure)| error(table.span(), problem, cure))
    });

    let own_environment = |table: Spanned<EnvironmentTable>| {
        let span = table.span();
        let table = table.into_inner();
        let environment = match (table.file, table.radiance) {
            (Some(file), None) => {
                let file = beside(path, &file);
                let cure = "put the picture there, or correct its name";
                let read = reader.read_named(&file, MOST_BYTES);
                let bytes = read.map_err(|unread| unread.error(&file, None, "this environment", cure))?;
                Environment::decode(&file, &bytes)?
            }
            (None, Some(radiance)) => {
                let value = Vec3::from(*radiance.get_ref());
                Environment::constant(value).map_err(|_| {
                    let cure = "give a finite radiance of 0 or more for each of red, green and blue";
                    error(radiance.span(), format!("radiance is {value}"), cure)
                })?
            }
            _ => return Err(error(span, "an environment has a file or a radiance".into(), "give one of the two")),
        };
        let factor = |number: Option<Spanned<f32>>, name, accepted: RangeInclusive<f32>, default, cure| match number {
            None => Ok(default),
            Some(number) if accepted.contains(number.get_ref()) => Ok(*number.get_ref()),
            Some(number) => Err(error(number.span(), format!("{name} is {}", number.get_ref()), cure)),
        };
        let scale = factor(table.scale, "scale", 0.0..=f32::MAX, 1.0, "give a finite factor of 0 or more")?;
        let turn = factor(table.turn_degrees, "turn_degrees", -360.0..=360.0, 0.0, "give degrees from -360 to 360")?;
        Ok(environment.scaled(scale).turned(turn))
    };
    let environment = match environment {
        None => file.environment.map(own_environment).transpose()?,
        given => given,
    };

    build(reader, &beside(path, &file.mesh), file.settings, camera.transpose()?, environment, |materials, textures| {
        let indices: HashMap<_, _> = materials.iter().enumerate().map(|(i, material)| (material.name.clone(), i)).collect();
        for (name, table) in file.materials {
            let Some(&index) = indices.get(name.get_ref()) else {
                let problem = format!("the model has no material \"{}\"", name.get_ref());
                return Err(error(name.span(), problem, &format!("name one that it has: {}", names(materials))));
            };
            let material = &mut materials[index];
            if let Some(albedo) = table.albedo {
                material.albedo = Vec3::from(*albedo.get_ref());
                if !albedo.get_ref().iter().all(|value| (0.0..=1.0).contains(value)) {
                    let problem = format!("albedo is {}", material.albedo);
                    return Err(error(albedo.span(), problem, "give a reflectance from 0 to 1 for each of red, green and blue"));
                }
            }
            if let Some(emission) = table.emission {
                material.emission = Vec3::from(*emission.get_ref());
                if !emission.get_ref().iter().all(|value| (0.0..=f32::MAX).contains(value)) {
                    let problem = format!("emission is {}", material.emission);
                    let cure = "give a finite radiance of 0 or more for each of red, green and blue";
                    return Err(error(emission.span(), problem, cure));
                }
            }
            if let Some(texture) = table.albedo_texture {
                let named_at = format!("{}:{}", path.display(), line(texture.span()));
                material.albedo_texture = Some(textures.load(&beside(path, texture.get_ref()), &named_at)?);
            }
            if let Some(surface) = table.surface {
                let kind = match *surface.get_ref() {
                    SurfaceTable::Diffuse => Surface::Diffuse,
                    SurfaceTable::Mirror => Surface::Mirror,
                    SurfaceTable::Glass { index, filter } => Surface::Glass { index, filter: filter.into() },
                };
                material.surface = kind.check().map_err(|(problem, cure)| error(surface.span(), problem, cure))?;
            }
        }
        Ok(())
    })
}

/// Loads a model, has `adjust` change its materials, and completes the scene.
fn build(
    reader: &Reader,
    model: &Path,
    settings: Settings,
    camera: Option<Camera>,
    environment: Option<Environment>,
    adjust: impl FnOnce(&mut [Material], &mut Textures) -> Result<()>,
) -> Result<Scene> {
    let mut textures = Textures::new(reader);
    let mut warnings = Vec::new();
    let (mesh, mut materials) = obj::load(reader, model, &mut textures, &mut warnings)?;
    adjust(&mut materials, &mut textures)?;
    warnings.extend(environment.as_ref().and_then(Environment::warning).map(str::to_owned));
    let untextured = mesh.triangles.iter().filter(|triangle| {
        let textured = materials[triangle.material as usize].albedo_texture.is_some();
        textured && triangle.vertices.iter().all(|&vertex| mesh.uvs[vertex as usize] == Vec2::ZERO)
    });
    match untextured.count() {
        0 => {}
        1 => warnings.push("1 triangle with a texture has no texture coordinates and shows one colour".to_owned()),
        count => warnings.push(format!("{count} triangles with a texture have no texture coordinates and show one colour")),
    }
    if warnings.len() > MOST_WARNINGS {
        let more = warnings.len() - MOST_WARNINGS;
        warnings.truncate(MOST_WARNINGS);
        warnings.push(format!("and {more} more of that kind"));
    }
    let framed = camera.is_none();
    let camera = camera.unwrap_or_else(|| Camera::framing(mesh.bounds(), settings.size));
    Ok(Scene { mesh, materials, textures: textures.list, environment, camera, framed, settings, warnings, files: Vec::new() })
}
