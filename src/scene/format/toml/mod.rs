//! Scene files (TOML). A scene file names a model, and adds to it or overrides parts of it:
//!
//! ```toml
//! mesh = "room.obj"            # in this file's folder or below it, as all files named here
//! flip = false                 # the default; true: fronts of all surfaces become backs
//! smooth_angle = 40            # smooth normals for vertices without, where faces meet at no more degrees; default: none, flat
//!
//! [camera]                     # default: shows the whole model from the front
//! eye = [278, 273, -800]
//! target = [278, 273, 0]
//! up = [0, 1, 0]               # the default
//! fov_y_degrees = 39.3         # 40 by default
//! aperture = 10                # radius of a thin lens; 0, a pinhole, by default
//! focus_distance = 900         # distance of the sharp plane; default: distance of the target
//!
//! [environment]                # light from outside the model; default: black
//! file = "sky.hdr"             # or radiance = [1, 1, 1], the same from all directions
//! scale = 1                    # the default
//! turn_degrees = 0             # the default; turns about +y, counter-clockwise from above
//!
//! [sun]                        # a light from afar, as directional lights
//! direction = [1, 2, 1]        # towards the sun; or azimuth_degrees (clockwise from -z, 90 is +x) and height_degrees
//! illuminance = 1e5            # lux on a surface that faces it; default: of the real sun, through the air of [sky]
//! angle_degrees = 0.53         # its diameter, the default; 0: sharp shadows
//!
//! [sky]                        # the clear sky of [sun], in place of [environment]
//! turbidity = 3                # the default; from 2, very clear, to 10, haze
//! scale = 1                    # the default; of the sun too, if it has no illuminance
//!
//! [[lights]]                   # beside those of the model
//! kind = "spot"                # or "point", without direction and angles, or "directional", with direction and illuminance
//! position = [0, 3, 0]
//! direction = [0, -1, 0]       # in which it shines
//! intensity = 800              # cd, one number or red, green and blue
//! radius = 0.1                 # 0, sharp shadows, by default
//! inner_degrees = 20           # whole intensity up to this angle from the axis; 0 by default
//! outer_degrees = 30           # and none beyond this; 45 by default
//!
//! [settings]                   # any key of `Settings`
//! directions = 1000
//!
//! [materials.floor]            # a material of the model
//! albedo = [0.5, 0.5, 0.5]
//! emission = [0, 0, 0]
//! two_sided = true             # emits from the back too; false by default
//! flip = false                 # the default; true: fronts of this material's surfaces become backs
//! albedo_texture = "tiles.png"
//! opacity = 1                  # share of the light that it stops; 1 by default
//! opacity_texture = "leaf.png" # its alpha, or its grey if it has none, multiplies the opacity
//! cutoff = 0.5                 # what is less opaque is not there, and all else is opaque; default: a share of the light passes
//! emission_texture = "screen.png"  # multiplies the emission, which is then 1 by default
//! roughness = 0.3              # with any of these five keys the surface is glossy: metallic-roughness as in glTF 2.0; default: that of the model, or 1
//! metallic = 0                 # 1 is a metal, which reflects its albedo; default: that of the model, or 0
//! specular = 0.04              # reflectance of a dielectric straight on, a number or [r, g, b]; default: that of the model, or 0.04
//! gloss_texture = "worn.png"   # its green multiplies the roughness, its blue the metal
//! normal_map = "bricks.png"    # turns shading normals
//! surface = "mirror"           # or "diffuse", or { glass = { index = 1.5, filter = [1, 1, 1] } }; a mirror reflects its albedo
//! ```

mod fault;
mod lenient;
mod lights;

use std::collections::{BTreeMap, HashMap};
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use glam::{DVec3, Vec3};
use serde::Deserialize;
use toml::Spanned;
use toml::de::DeTable;

use fault::SceneText;
use lights::{LightTable, SkyTable, SunTable};

use super::{Loader, Unread, beside, format_of, names, obj};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS};
use crate::scene::{Camera, Environment, Lens, NormalMap, Sampler, Surface, World, WorldCamera};
use crate::settings::{Exposure, Settings};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    mesh: Spanned<String>,
    #[serde(default)]
    flip: bool,
    smooth_angle: Option<Spanned<f32>>,
    camera: Option<Spanned<CameraTable>>,
    environment: Option<Spanned<EnvironmentTable>>,
    sun: Option<Spanned<SunTable>>,
    sky: Option<Spanned<SkyTable>>,
    #[serde(default)]
    lights: Vec<Spanned<LightTable>>,
    #[serde(default)]
    settings: Settings,
    #[serde(default)]
    materials: BTreeMap<Spanned<String>, MaterialTable>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraTable {
    eye: [f64; 3],
    target: [f64; 3],
    up: Option<[f32; 3]>,
    fov_y_degrees: Option<f32>,
    #[serde(default)]
    aperture: f32,
    focus_distance: Option<f32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EnvironmentTable {
    file: Option<String>,
    radiance: Option<Spanned<[f32; 3]>>,
    scale: Option<Spanned<f32>>,
    turn_degrees: Option<Spanned<f32>>,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialTable {
    albedo: Option<Spanned<[f32; 3]>>,
    emission: Option<Spanned<[f32; 3]>>,
    two_sided: Option<Spanned<bool>>,
    #[serde(default)]
    flip: bool,
    albedo_texture: Option<Spanned<String>>,
    opacity: Option<Spanned<f32>>,
    opacity_texture: Option<Spanned<String>>,
    cutoff: Option<Spanned<f32>>,
    emission_texture: Option<Spanned<String>>,
    roughness: Option<Spanned<f32>>,
    metallic: Option<Spanned<f32>>,
    specular: Option<Spanned<[f32; 3]>>,
    gloss_texture: Option<Spanned<String>>,
    normal_map: Option<Spanned<String>>,
    surface: Option<Spanned<SurfaceTable>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum SurfaceTable {
    Diffuse,
    Mirror,
    Glass { index: Option<f32>, filter: Option<[f32; 3]> },
}

/// Returns the changed world of the model, and the settings.
pub fn load(loader: &mut Loader, path: &Path) -> Result<(World, Settings)> {
    let reader = loader.reader;
    let cure = "name an existing TOML file, in UTF-8";
    let bytes = reader.read_named(path, MOST_WORDS).map_err(|unread| unread.error(path, None, "this scene file", cure))?;
    let text = std::str::from_utf8(&bytes)
        .map_err(|error| Error::input(path, None, format!("this scene file is not UTF-8: {error}"), cure))?;
    let source = SceneText { path, text };
    let error = |span: Range<usize>, problem: String, cure: &str| source.error(&span, &problem, cure);
    let mut table = DeTable::parse(text).map_err(|fault| source.refused(&fault))?;
    if let Some((span, most)) = lenient::too_long(table.get_ref()) {
        return Err(error(span, "a list with too many numbers".into(), &format!("give {most} numbers")));
    }
    let replacements = lenient::replacements(table.get_ref());
    let places = lenient::settle(table.get_mut(), &replacements);
    let mut file = SceneFile::deserialize(toml::Deserializer::from(table)).map_err(|fault| source.refused(&fault))?;

    file.settings.validate().map_err(|fault| match fault {
        Error::Usage { problem, cure } => {
            // The problem starts with the name of the setting.
            let key = problem.split_whitespace().next().unwrap_or_default().replace('-', "_");
            match places.get(&key) {
                Some(span) => source.error(span, &problem, &cure),
                None => Error::input(path, None, problem, cure),
            }
        }
        other => other,
    })?;

    for (key, reason) in Settings::WITHOUT_EFFECT {
        if let Some(span) = places.get(key) {
            let warning = format!("{}:{}: {key} has no effect, for {reason}; leave it out", path.display(), source.line(span));
            loader.warnings.say(warning);
        }
    }

    let camera = file.camera.map(|table| {
        let CameraTable { eye, target, up, fov_y_degrees, aperture, focus_distance } = *table.get_ref();
        let ([eye, target], up) = ([eye, target].map(DVec3::from), Vec3::from(up.unwrap_or([0.0, 1.0, 0.0])));
        let focus_distance = focus_distance.unwrap_or_else(|| eye.distance(target) as f32);
        let lens = (aperture != 0.0).then_some(Lens { radius: aperture, focus_distance });
        let camera = WorldCamera { eye, target, up, fov_y_degrees: fov_y_degrees.unwrap_or(Camera::DEFAULT_FOV_Y), lens };
        camera.check().map_err(|(problem, cure)| error(table.span(), problem, cure))
    });
    let camera = camera.transpose()?;

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
    let refused = |span: Range<usize>| move |(problem, cure): (String, &'static str)| source.error(&span, &problem, cure);
    // The environment or sky of the options replaces that of the file, which is not read.
    let mut daylight_at = None;
    if loader.environment.is_none() && loader.sky.is_none() {
        if let (Some(_), Some(sky)) = (&file.environment, &file.sky) {
            return Err(error(sky.span(), "a scene has an environment or a sky".into(), "leave out one of the two tables"));
        }
        loader.environment = file.environment.map(own_environment).transpose()?;
        daylight_at = file.sky.as_ref().map(Spanned::span);
        loader.sky = file.sky.map(|table| table.get_ref().sky().map_err(refused(table.span()))).transpose()?;
    }
    if let (None, Some(table)) = (loader.sun, file.sun) {
        loader.sun = Some(table.get_ref().sun().map_err(refused(table.span()))?);
        daylight_at = Some(table.span());
    }
    let sun = loader.daylight().map_err(|(problem, cure)| match daylight_at {
        Some(span) => source.error(&span, &problem, cure),
        None => Error::usage(problem, cure),
    })?;
    // Daylight is a hundred thousand times as bright as lamps of radiance 1.
    if loader.has_real_daylight() && !places.contains_key("exposure") {
        file.settings.display.exposure = Exposure::Auto;
    }
    let lights = file.lights.into_iter().enumerate().map(|(index, table)| {
        let span = table.span();
        table.into_inner().light(|| format!("light {index}")).map_err(refused(span))
    });
    let lights = lights.collect::<Result<Vec<_>>>()?;

    // A model of unknown ending is read as OBJ.
    let mesh = beside(path, file.mesh.get_ref());
    let missing = |unread: Unread| match unread.error(&mesh, None, "this model", "put it there, or correct its name") {
        Error::Input { path, problem, cure, .. } => error(file.mesh.span(), format!("{}: {problem}", path.display()), &cure),
        other => other,
    };
    reader.find(&mesh).map_err(missing)?;
    let load = format_of(&mesh).unwrap_or(obj::load);
    let mut world = loader.model(|loader| load(loader, &mesh), &mesh)?;
    loader.flip |= file.flip;
    if let Some(angle) = file.smooth_angle {
        let degrees = *angle.get_ref();
        if !World::SMOOTH_ANGLES.contains(&degrees) {
            return Err(error(angle.span(), format!("smooth_angle is {degrees}"), World::SMOOTH_ANGLE_CURE));
        }
        loader.smooth_angle = loader.smooth_angle.or(Some(degrees));
    }
    world.cameras.splice(0..0, camera.map(|camera| ("camera".to_owned(), camera)));
    world.lights.extend(lights.into_iter().chain(sun));
    // A glTF file may have several materials of one name. A table is of all of them.
    let mut indices: HashMap<String, Vec<usize>> = HashMap::new();
    for (index, material) in world.materials.iter().enumerate() {
        indices.entry(material.name.clone()).or_default().push(index);
    }
    let mut tables = Vec::new();
    for (name, table) in file.materials {
        let Some(same) = indices.get(name.get_ref()) else {
            let problem = format!("the model has no material \"{}\"", name.get_ref());
            return Err(error(name.span(), problem, &format!("name one that it has: {}", names(&world.materials))));
        };
        tables.extend(same.iter().map(|&index| (index, table.clone())));
    }
    for (index, table) in tables {
        let material = &mut world.materials[index];
        let color = |value: Spanned<[f32; 3]>, what, accepted: RangeInclusive<f32>, cure| {
            let color = Vec3::from(*value.get_ref());
            let sound = value.get_ref().iter().all(|value| accepted.contains(value));
            sound.then_some(color).ok_or_else(|| error(value.span(), format!("{what} is {color}"), cure))
        };
        let emission_is_pictured = table.emission_texture.is_some();
        if let Some(albedo) = table.albedo {
            let cure = "give a reflectance from 0 to 1 for each of red, green and blue";
            material.albedo = color(albedo, "albedo", 0.0..=1.0, cure)?;
        }
        let mut texture = |name: Spanned<String>| {
            let named_at = format!("{}:{}", path.display(), source.line(&name.span()));
            loader.textures.load(&beside(path, name.get_ref()), &named_at)
        };
        material.albedo_texture = table.albedo_texture.map(&mut texture).transpose()?.or(material.albedo_texture);
        material.emission_texture = table.emission_texture.map(&mut texture).transpose()?.or(material.emission_texture);
        if let Some(emission) = table.emission {
            let cure = "give a finite radiance of 0 or more for each of red, green and blue";
            material.emission = color(emission, "emission", 0.0..=f32::MAX, cure)?;
        } else if emission_is_pictured && !material.is_emissive() {
            material.emission = Vec3::ONE;
        }
        if material.emission_texture.is_some_and(|texture| !loader.textures.shines(texture)) {
            (material.emission, material.emission_texture) = (Vec3::ZERO, None);
        }
        if let Some(two_sided) = table.two_sided {
            material.two_sided = *two_sided.get_ref();
            if material.two_sided && !material.is_emissive() {
                let place = format!("{}:{}", path.display(), source.line(&two_sided.span()));
                loader.warnings.say(format!("{place}: two_sided has no effect: material \"{}\" does not emit", material.name));
            }
        }
        if table.flip {
            world.meshes.iter_mut().for_each(|mesh| mesh.turn(|triangle| triangle.material as usize == index));
        }
        let share = |value: Spanned<f32>, what: &str| match *value.get_ref() {
            share if (0.0..=1.0).contains(&share) => Ok(share),
            share => Err(error(value.span(), format!("{what} is {share}"), "give a number from 0 to 1")),
        };
        let is_glossy =
            table.roughness.is_some() || table.metallic.is_some() || table.specular.is_some() || table.gloss_texture.is_some();
        if is_glossy {
            // Mirrors and glass of the model have no gloss.
            material.surface = Surface::Diffuse;
        }
        if let Some(roughness) = table.roughness {
            material.own_gloss().roughness = share(roughness, "roughness")?;
        }
        if let Some(metallic) = table.metallic {
            material.own_gloss().metallic = share(metallic, "metallic")?;
        }
        if let Some(specular) = table.specular {
            let cure = "give a reflectance from 0 to 1, or one for each of red, green and blue";
            material.own_gloss().specular = color(specular, "specular", 0.0..=1.0, cure)?;
        }
        if let Some(opacity) = table.opacity {
            material.opacity.share = share(opacity, "opacity")?;
        }
        if let Some(cutoff) = table.cutoff {
            material.opacity.cutoff = Some(share(cutoff, "cutoff")?);
        }
        if let Some(name) = table.opacity_texture {
            let named_at = format!("{}:{}", path.display(), source.line(&name.span()));
            let picture = beside(path, name.get_ref());
            material.opacity.texture = loader.textures.load_opacity(&picture, &named_at, Sampler::default())?;
        }
        let mut picture = |name: Spanned<String>| {
            let named_at = format!("{}:{}", path.display(), source.line(&name.span()));
            loader.textures.load(&beside(path, name.get_ref()), &named_at)
        };
        if let Some(texture) = table.gloss_texture {
            material.own_gloss().texture = Some(picture(texture)?);
        }
        if let Some(texture) = table.normal_map {
            material.normal_map = Some(NormalMap { texture: picture(texture)?, scale: 1.0 });
        }
        if let Some(surface) = table.surface {
            let kind = match *surface.get_ref() {
                SurfaceTable::Diffuse => Surface::Diffuse,
                SurfaceTable::Mirror => Surface::Mirror,
                SurfaceTable::Glass { index, filter } => {
                    Surface::Glass { index: index.unwrap_or(Surface::GLASS_INDEX), filter: filter.map_or(Vec3::ONE, Vec3::from) }
                }
            };
            if is_glossy && kind != Surface::Diffuse {
                let cure = "leave out surface, or the keys of gloss: roughness, metallic, specular and gloss_texture";
                return Err(error(surface.span(), "a mirror or glass has no gloss".into(), cure));
            }
            material.surface = kind.check().map_err(|(problem, cure)| error(surface.span(), problem, cure))?;
        }
    }
    Ok((world, file.settings))
}
