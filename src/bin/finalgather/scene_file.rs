//! Writes scene files: one for a model, with all that can be changed, or a copy of a scene file with another camera and other settings.

use std::fmt::Display;
use std::fs;
use std::path::{Component, Path, PathBuf};

use finalgather::error::{Error, Result};
use finalgather::file::folder_of;
use finalgather::scene::{Gloss, Material, PunctualLight, World, WorldCamera};
use finalgather::settings::Settings;
use toml_edit::{DocumentMut, Item, Key, Table, TableLike, Value};

use crate::about_scene::{line_of_punctual, punctual};

/// The view that a written scene file is to show.
pub struct SceneView<'a> {
    /// A scene file or a model.
    pub source: &'a Path,
    pub world: &'a World,
    pub camera: WorldCamera,
    pub settings: Settings,
}

impl SceneView<'_> {
    /// The text of a scene file in `folder` for a model, with these keys about its surfaces: `flip`, `smooth_angle`. It renders as the model, with this
    /// camera and these settings.
    ///
    /// # Errors
    /// [`Error::Usage`] when the model lies outside `folder`, because a scene file reads only files in its folder.
    pub fn text(&self, folder: &Path, flip: bool, smooth_angle: Option<f32>) -> Result<String> {
        let flip = if flip { "flip = true\n" } else { "" };
        let smooth = smooth_angle.map(|degrees| format!("smooth_angle = {degrees}\n")).unwrap_or_default();
        Ok(self.of_model(&quoted(&rebased(self.source, folder)?), &format!("{flip}{smooth}")))
    }

    fn of_model(&self, mesh: &str, surfaces: &str) -> String {
        let Self { world, camera, settings, .. } = self;
        let mut text =
            String::from("# Take away a # to change what stands behind it. docs/scene-format.md explains every key.\n");
        text += &format!("mesh = {mesh}\n{surfaces}\n[camera]");
        if let [(name, _), rest @ ..] = &world.cameras[..] {
            text += &format!(" # {name:?} of the file");
            if !rest.is_empty() {
                let names: Vec<_> = rest.iter().map(|(name, _)| format!("{name:?}")).collect();
                text += &format!(", which also has {}: --camera NAME", names.join(", "));
            }
        }
        text += "\n";
        camera_keys(camera).iter().for_each(|(key, value)| text += &format!("{key} = {value}\n"));
        text += match &world.environment {
            Some(_) => "\n# Without this table, a sun or a lamp, a soft sky lights the scene, for no material emits.\n",
            None => "\n# Light from outside, beside that of lamps and materials that emit.\n",
        };
        text += "# [environment]\n# radiance = 1          # the same from all directions\n";
        text += "# file = \"sky.hdr\"      # or a lat-long picture, .hdr or .exr\n# scale = 1\n# turn_degrees = 0\n";
        text += "\n# The sun, and a clear sky in place of [environment].\n# [sun]\n# azimuth_degrees = 120    # clockwise from -z as seen from above\n";
        text += "# height_degrees = 40\n# illuminance = 1e5      # lux; without it the real sun's\n# [sky]\n# turbidity = 3\n";
        text += &lights(&world.lights);
        text += "\n[settings]\n";
        for ((key, value), (_, default)) in setting_keys(settings).into_iter().zip(setting_keys(&Settings::default())) {
            let mark = if value != default || ["size", "directions"].contains(&key.as_str()) { "" } else { "# " };
            text += &format!("{mark}{key} = {value}\n");
        }
        text += "\n# Materials, with the values of the model.\n";
        world.materials.iter().for_each(|material| text += &material_table(material));
        text
    }

    /// The text of the source, a scene file, for `folder`, with this camera and the settings that differ from its own.
    ///
    /// # Errors
    /// As [`Self::text`]; [`Error::Input`] when the source is no longer readable.
    pub fn changed(&self, folder: &Path, of_file: &Settings) -> Result<String> {
        let Self { source, camera, settings, .. } = self;
        let bad = |problem: String| Error::input(source, None, problem, "save again when it can be read");
        let text = fs::read_to_string(source).map_err(|error| bad(error.to_string()))?;
        let mut scene: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| bad(error.message().to_owned()))?;
        let camera_table = table(&mut scene, "camera");
        camera_keys(camera).iter().try_for_each(|(key, value)| set(camera_table, key, value))?;
        let settings_table = table(&mut scene, "settings");
        for ((key, value), (_, before)) in setting_keys(settings).into_iter().zip(setting_keys(of_file)) {
            if value != before {
                set(settings_table, &key, &value)?;
            }
        }
        let named = |scene: &mut DocumentMut, path: [&str; 3]| -> Result<()> {
            let keys = path.iter().filter(|key| !key.is_empty());
            // An item's own get_mut would make a missing table.
            let item = { keys }.try_fold(scene.as_item_mut(), |item, key| item.as_table_like_mut()?.get_mut(key));
            if let Some(item) = item
                && let Some(name) = item.as_str()
            {
                let place = source.with_file_name(name.replace('\\', "/"));
                *item = Item::Value(Value::from(name_of(&rebased(&place, folder)?)));
            }
            Ok(())
        };
        named(&mut scene, ["mesh", "", ""])?;
        named(&mut scene, ["environment", "file", ""])?;
        let materials = scene.get("materials").and_then(Item::as_table_like);
        let materials: Vec<_> = materials.into_iter().flat_map(TableLike::iter).map(|(name, _)| name.to_owned()).collect();
        for key in ["albedo_texture", "emission_texture", "opacity_texture", "gloss_texture", "normal_map"] {
            materials.iter().try_for_each(|name| named(&mut scene, ["materials", name, key]))?;
        }
        Ok(scene.to_string())
    }
}

/// The table of this name, made if there is none.
fn table<'a>(scene: &'a mut DocumentMut, name: &str) -> &'a mut dyn TableLike {
    let item = scene.entry(name).or_insert_with(|| Item::Table(Table::new()));
    item.as_table_like_mut().unwrap_or_else(|| unreachable!("{name} is a table, or the scene would not have opened"))
}

/// Sets a key that may be written with hyphens.
fn set(table: &mut dyn TableLike, key: &str, value: &str) -> Result<()> {
    let value: Value = value.parse().map_err(|error: toml_edit::TomlError| {
        Error::usage(format!("{key} cannot be written: {}", error.message()), "change it")
    })?;
    let written = if table.contains_key(key) { key.to_owned() } else { key.replace('_', "-") };
    match table.get_mut(&written) {
        Some(item) => *item = Item::Value(value),
        None => drop(table.insert(key, Item::Value(value))),
    }
    Ok(())
}

/// Keys of a scene file and their values, as TOML.
pub fn camera_keys(camera: &WorldCamera) -> Vec<(&'static str, String)> {
    let mut keys = vec![
        ("eye", numbers(camera.eye.to_array())),
        ("target", numbers(camera.target.to_array())),
        ("up", numbers(camera.up.to_array())),
        ("fov_y_degrees", camera.fov_y_degrees.to_string()),
    ];
    if let Some(lens) = camera.lens {
        keys.extend([("aperture", lens.radius.to_string()), ("focus_distance", lens.focus_distance.to_string())]);
    }
    keys
}

/// All settings, in their order.
pub fn setting_keys(settings: &Settings) -> Vec<(String, String)> {
    let text = toml::to_string(settings).unwrap_or_default();
    text.lines().filter_map(|line| line.split_once(" = ")).map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}

/// Comments on the lights of a model, and a table of one more.
fn lights(lights: &[PunctualLight]) -> String {
    /// A model may have thousands.
    const MOST: usize = 20;
    let mut text = String::from("\n# Lamps without a surface");
    text += if lights.is_empty() { ".\n" } else { ", beside those of the model:\n" };
    for light in lights.iter().take(MOST) {
        text += &format!("#   {}\n", line_of_punctual(&punctual(light)).replace(char::is_control, " "));
    }
    if lights.len() > MOST {
        text += &format!("#   and {} more\n", lights.len() - MOST);
    }
    text += "# [[lights]]\n# kind = \"point\"         # or \"spot\", \"directional\"\n# position = [0, 1, 0]\n# intensity = 100        # cd\n# radius = 0\n";
    text
}

fn material_table(material: &Material) -> String {
    let Material { name, albedo, emission, gloss, unshaded, .. } = material;
    let mut text = format!("# [materials.{}]\n", Key::new(name.as_str()));
    text += &format!("# albedo = {}\n# emission = {}\n", numbers(albedo.to_array()), numbers(emission.to_array()));
    if let Some(Gloss { roughness, metallic, specular, .. }) = gloss {
        let specular = numbers(specular.to_array());
        text += &format!("# roughness = {roughness}\n# metallic = {metallic}\n# specular = {specular}\n");
    }
    if !unshaded.is_empty() {
        text += &format!("#   not shown yet: {}\n", unshaded.join(", ").replace(char::is_control, " "));
    }
    text
}

fn numbers<T: Display, const N: usize>(values: [T; N]) -> String {
    format!("[{}]", values.map(|value| value.to_string()).join(", "))
}

fn quoted(path: &Path) -> String {
    Value::from(name_of(path)).to_string()
}

/// With slashes, as in scene files.
fn name_of(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// The path of `file`, relative to `folder`.
fn rebased(file: &Path, folder: &Path) -> Result<PathBuf> {
    let inside = fs::canonicalize(folder).ok().and_then(|folder| {
        // By the name that the scene gives, if that is below the folder; a link counts as its target.
        let place = std::path::absolute(file).ok()?;
        let plain = !place.components().any(|part| part == Component::ParentDir);
        let by_name = place.strip_prefix(&folder).ok().filter(|_| plain).map(Path::to_owned);
        by_name.or_else(|| fs::canonicalize(file).ok()?.strip_prefix(&folder).ok().map(Path::to_owned))
    });
    inside.ok_or_else(|| {
        Error::usage(
            format!("{}: lies outside the folder of the scene file, {}", file.display(), folder.display()),
            format!("write the scene file into {}", folder_of(file).display()),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_stand_by_their_keys() {
        let keys = setting_keys(&Settings::default());
        let value = |key: &str| keys.iter().find(|(name, _)| name == key).map(|(_, value)| value.as_str());
        assert_eq!(value("size"), Some("[512, 512]"));
        // As written, not as the nearest f64.
        assert_eq!(value("stop_fraction"), Some("0.001"));
        assert_eq!(value("pipeline"), Some("\"auto\""));
    }

    #[test]
    fn a_file_is_named_from_the_folder_of_its_scene() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().canonicalize().unwrap();
        fs::create_dir(place.join("models")).unwrap();
        fs::write(place.join("models/a.obj"), "").unwrap();
        assert_eq!(rebased(&place.join("models/a.obj"), &place).unwrap(), Path::new("models/a.obj"));
        let error = rebased(&place.join("models/a.obj"), &place.join("other")).unwrap_err();
        assert!(error.to_string().contains("models"), "{error}");
    }
}
