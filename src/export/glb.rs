//! Binary glTF 2.0.
//!
//! Values at points become `COLOR_0` for display, and one custom attribute for each quantity: `_IRRADIANCE`, `_AO`, `_PRT_00` and so on.
//! `COLOR_0` is the light, and viewers multiply it by the albedo of the unlit materials; or it is data, such as openness, and the materials are white.
//!
//! A light map uses `TEXCOORD_1`. It is stored twice, because no ratified extension defines light maps.
//! - By default, materials are unlit (`KHR_materials_unlit`) with the map as base colour, in sRGB with exposure. Any viewer shows the bake as a
//!   PNG does. The mean of an albedo texture stands for the texture.
//! - The variant `lightmap` (`KHR_materials_variants`) is for engines: shaded materials with their own textures, and the extension
//!   `MOZ_lightmap`, which Hubs and an addon of three.js read. It holds linear irradiance over its greatest value, the `intensity`, in 8 bits.
//!   Dark parts show bands where a lamp is near. 16 bits do not help, because browsers drop the lower eight, and the result is darker still.
//!
//! The two are separate materials, because readers of `MOZ_lightmap` would count the light twice in one.
//!
//! Results of a glTF scene are added to its file instead (`round_trip/`).
//!
//! The file is built with `serde_json`, because the types of the crate `gltf-json` write out every absent field. Tests check the result
//! with that crate's reader and the Khronos validator.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use serde_json::{Map, Value, json};

use super::{ExportMesh, Lightmap, PointValues, Positions, round_trip, snake_case};
use crate::error::{Error, Result};
use crate::file::write_file;
use crate::image::{Channel, Image, WriteOptions, encode_png, tone};
use crate::math::Aabb;
use crate::scene::Material;
use crate::scene::gltf::SHOWN_COLOURS;

// glTF denotes types and targets by constants of OpenGL.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
pub const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const POINTS: u32 = 0;
const LINEAR: u32 = 9729;
const CLAMP_TO_EDGE: u32 = 33071;

pub const UNLIT: &str = "KHR_materials_unlit";
pub const VARIANTS: &str = "KHR_materials_variants";
pub const LIGHTMAP: &str = "MOZ_lightmap";

/// Key in `extras` of what a later round may replace: a file may have things of the same name.
pub const MARK: &str = "finalgather";

pub fn write_values(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    if let Some(surface) = values.surface.filter(|surface| surface.source.is_some()) {
        return round_trip::write_values(path, &surface, values, options);
    }
    for column in values.columns {
        check_finite(path, column, 0..column.samples.len() as u32)?;
    }
    let mut file = Builder::default();
    let mut attributes = Map::new();
    attributes.insert("POSITION".into(), file.positions(values.positions).into());
    attributes.insert("NORMAL".into(), file.vec3s(values.normals).into());
    let all: Vec<Option<u32>> = (0..values.positions.world.len() as u32).map(Some).collect();
    attributes.insert("COLOR_0".into(), file.shown_colours(&values.shown(options.exposure), &all).into());
    attributes.extend(file.columns(values.columns, &all));
    match values.surface {
        None => {
            file.materials.push(json!({"name": "points", "extensions": {UNLIT: {}}}));
            file.primitives.push(json!({"attributes": attributes, "mode": POINTS, "material": 0}));
        }
        Some(surface) => {
            let is_textured = |material: &Material| material.albedo_texture.or(material.emission_texture).is_some();
            if surface.materials.iter().any(is_textured) {
                attributes.insert("TEXCOORD_0".into(), file.uvs(&surface.mesh.uvs).into());
            }
            let textures = file.model_textures(&surface)?;
            for (index, indices) in surface.indices_by_material() {
                let material = &surface.materials[index];
                let mut material_json = shaded(material, &textures);
                material_json["extensions"] = json!({UNLIT: {}});
                if !values.shows_light() {
                    // Colours and textures would mix with the data.
                    material_json["pbrMetallicRoughness"] = json!({});
                    for key in ["emissiveFactor", "emissiveTexture"] {
                        material_json.as_object_mut().into_iter().for_each(|material| drop(material.remove(key)));
                    }
                }
                file.materials.push(material_json);
                let indices = file.indices(&indices);
                file.primitives.push(json!({"attributes": attributes, "indices": indices, "material": file.materials.len() - 1}));
            }
        }
    }
    file.write(path, &[UNLIT], options)
}

/// # Errors
/// [`Error::Usage`] when a column is not finite in one of these rows.
pub fn check_finite(path: &Path, column: &Channel, mut rows: impl Iterator<Item = u32>) -> Result<()> {
    if rows.all(|row| column.samples[row as usize].is_finite()) {
        return Ok(());
    }
    let problem = format!("{}: {} is not finite everywhere, as glTF wants it", path.display(), column.name);
    let cure = "write a .ply or .npy; or leave out --per source, with which vertices that no triangle uses have no value";
    Err(Error::usage(problem, cure))
}

pub fn write_lightmap(path: &Path, lightmap: &Lightmap, options: &WriteOptions) -> Result<()> {
    let surface = &lightmap.surface;
    if surface.source.is_some() {
        return round_trip::write_lightmap(path, lightmap, options);
    }
    let mut file = Builder::default();
    let mut attributes = Map::new();
    attributes.insert("POSITION".into(), file.positions(surface.positions).into());
    if surface.has_normals() {
        attributes.insert("NORMAL".into(), file.vec3s(&surface.mesh.normals).into());
    }
    // TEXCOORD_1 needs a TEXCOORD_0, even if nothing reads it.
    attributes.insert("TEXCOORD_0".into(), file.uvs(&surface.mesh.uvs).into());
    attributes.insert("TEXCOORD_1".into(), file.uvs(lightmap.uvs).into());
    if !surface.mesh.colors.is_empty() {
        attributes.insert("COLOR_0".into(), file.vec3s(&surface.mesh.colors).into());
    }

    let map = |file: &mut Builder, name: &str, png: &[u8]| {
        let texture = file.texture(name, png);
        // Mipmaps and repetition would mix texels of different charts.
        file.textures[texture]["sampler"] = 0.into();
        texture
    };
    file.samplers.push(map_sampler());
    let openness = lightmap.openness_png(std::convert::identity)?.map(|png| map(&mut file, "occlusion", &png));
    let light = match lightmap.irradiance {
        None => None,
        Some(irradiance) => {
            let shown = map(&mut file, "shown", &Lightmap::shown_png(irradiance, options.exposure)?);
            let (linear, intensity) = linear_png(irradiance)?;
            Some((shown, map(&mut file, "irradiance", &linear), intensity))
        }
    };
    let textures = file.model_textures(surface)?;
    for (index, indices) in surface.indices_by_material() {
        let material = &surface.materials[index];
        let indices = file.indices(&indices);
        let mut primitive = json!({"attributes": attributes, "indices": indices, "material": file.materials.len()});
        let mut engine = shaded(material, &textures);
        if let Some(openness) = openness {
            engine["occlusionTexture"] = json!({"index": openness, "texCoord": 1});
        }
        if let Some((shown, linear, intensity)) = light {
            let unlit = shown_surface(surface, material, (shown, 1), options.exposure);
            let first = file.materials.len();
            let unlit =
                json!({"name": material.name, "doubleSided": true, "pbrMetallicRoughness": unlit, "extensions": {UNLIT: {}}});
            file.materials.push(unlit);
            engine["extensions"] = json!({LIGHTMAP: {"index": linear, "texCoord": 1, "intensity": intensity}});
            let mappings = json!([{"material": first, "variants": [0]}, {"material": first + 1, "variants": [1]}]);
            primitive["extensions"] = json!({VARIANTS: {"mappings": mappings}});
        }
        file.materials.push(engine);
        file.primitives.push(primitive);
    }
    if light.is_none() {
        return file.write(path, &[], options);
    }
    file.extensions = json!({VARIANTS: {"variants": [{"name": "shown"}, {"name": "lightmap"}]}});
    file.write(path, &[UNLIT, VARIANTS, LIGHTMAP], options)
}

/// The sampler of light maps.
pub fn map_sampler() -> Value {
    json!({"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE})
}

/// `pbrMetallicRoughness` of an unlit material that shows a map, given by its texture and its set of coordinates. The mean of a texture stands for the
/// texture.
pub fn shown_surface(surface: &ExportMesh, material: &Material, (shown, set): (usize, usize), exposure: f32) -> Value {
    if material.is_emissive() {
        let [r, g, b] = (material.mean_emission(surface.textures) * exposure.exp2()).map(tone).to_array();
        return json!({"baseColorFactor": [r, g, b, 1.0]});
    }
    let [r, g, b] = surface.mean_albedo(material).to_array();
    json!({"baseColorFactor": [r, g, b, 1.0], "baseColorTexture": {"index": shown, "texCoord": set}})
}

/// Groups the columns that form one vector, such as `A.R`, `A.G`, `A.B`.
fn components(columns: &[Channel]) -> impl Iterator<Item = &[Channel]> {
    let follows = |one: &str, next: &str| {
        ["RG", "GB", "XY", "YZ"].iter().any(|pair| one.ends_with(&pair[..1]) && next.ends_with(&pair[1..]))
    };
    columns.chunk_by(move |one, next| stem(one) == stem(next) && follows(&one.name, &next.name))
}

/// The name without its last part: `SH.00` for `SH.00.R`.
fn stem(column: &Channel) -> &str {
    column.name.rsplit_once('.').map_or(&column.name, |(stem, _)| stem)
}

/// A material for an engine that lights it; `textures` are the indices of the scene's textures in the file.
fn shaded(material: &Material, textures: &[usize]) -> Value {
    let [r, g, b] = material.albedo.to_array();
    let mut surface = json!({"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0});
    if let Some(texture) = material.albedo_texture {
        surface["baseColorTexture"] = json!({"index": textures[texture]});
    }
    let mut json = json!({"name": material.name, "doubleSided": true, "pbrMetallicRoughness": surface});
    if material.is_emissive() {
        json["emissiveFactor"] = json!(material.emission.min(Vec3::ONE).to_array());
        if let Some(texture) = material.emission_texture {
            json["emissiveTexture"] = json!({"index": textures[texture]});
        }
    }
    json
}

/// Encodes irradiance over its greatest value, and returns both.
pub fn linear_png(irradiance: &Image) -> Result<(Vec<u8>, f32)> {
    let rgb = irradiance.rgb()?;
    let greatest = rgb.iter().copied().flatten().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let intensity = if greatest > 0.0 { greatest } else { 1.0 };
    let Image { width, height, .. } = *irradiance;
    let bytes = (0..width * height).flat_map(|i| rgb.map(|samples| (samples[i] / intensity * 255.0).round() as u8));
    Ok((encode_png(width, height, &bytes.collect::<Vec<_>>())?, intensity))
}

/// The parts of a file so far.
#[derive(Default)]
pub struct Builder {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    pub textures: Vec<Value>,
    pub samplers: Vec<Value>,
    pub materials: Vec<Value>,
    primitives: Vec<Value>,
    extensions: Value,
    /// Of the positions, in world space.
    origin: DVec3,
}

impl Builder {
    /// Takes the lists out of a file, to add to them.
    pub fn of(root: &mut Value, bin: Vec<u8>) -> Self {
        let mut list = |key: &str| root.get_mut(key).and_then(Value::as_array_mut).map(std::mem::take).unwrap_or_default();
        let [views, accessors, images, textures] = ["bufferViews", "accessors", "images", "textures"].map(&mut list);
        let [samplers, materials] = ["samplers", "materials"].map(&mut list);
        Self { bin, views, accessors, images, textures, samplers, materials, ..Self::default() }
    }

    /// Puts the lists into a file, and writes it.
    pub fn finish(mut self, path: &Path, mut root: Value) -> Result<()> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        for (key, values) in [
            ("materials", self.materials),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("images", self.images),
            ("textures", self.textures),
            ("samplers", self.samplers),
        ] {
            if !values.is_empty() {
                root[key] = values.into();
            }
        }
        root["buffers"][0]["byteLength"] = self.bin.len().into();
        encode(path, &root, &self.bin)
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        // glTF requires that numbers begin at multiples of their size.
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    pub fn accessor(&mut self, bytes: &[u8], target: u32, mut json: Value) -> usize {
        let view = self.view(bytes);
        self.views[view]["target"] = target.into();
        json["bufferView"] = view.into();
        self.accessors.push(json);
        self.accessors.len() - 1
    }

    pub fn name(&self, accessor: usize) -> Option<&str> {
        self.accessors.get(accessor)?["name"].as_str()
    }

    /// Sets the distance of an accessor's elements in its view.
    pub fn set_stride(&mut self, accessor: usize, stride: usize) {
        if let Some(view) = self.accessors[accessor]["bufferView"].as_u64() {
            self.views[view as usize]["byteStride"] = stride.into();
        }
    }

    /// An accessor of `width` numbers a vertex, 1 to 4.
    pub fn floats(&mut self, width: usize, numbers: impl Iterator<Item = f32>) -> usize {
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        self.accessor(&bytes, ARRAY_BUFFER, json!({"componentType": FLOAT, "type": kind, "count": bytes.len() / (4 * width)}))
    }

    fn vec3s(&mut self, vectors: &[Vec3]) -> usize {
        self.floats(3, vectors.iter().flat_map(Vec3::to_array))
    }

    /// An accessor of the file's positions. The node of the mesh moves them from their origin, because glTF holds 32 bits at a vertex.
    fn positions(&mut self, positions: Positions) -> usize {
        let local = positions.local();
        let accessor = self.vec3s(&local);
        let bounds = Aabb::from_points(local);
        self.origin = positions.origin;
        self.accessors[accessor]["min"] = json!(bounds.min.to_array());
        self.accessors[accessor]["max"] = json!(bounds.max.to_array());
        accessor
    }

    /// An accessor of coordinates whose v points up; in glTF it points down.
    pub fn uvs(&mut self, uvs: &[Vec2]) -> usize {
        self.floats(2, uvs.iter().flat_map(|uv| [uv.x, 1.0 - uv.y]))
    }

    /// Colours for display, of `PointValues::shown`, at vertices that show rows of them; black without a row. Linear values need 16 bits: with 8, dark
    /// parts would show bands.
    pub fn shown_colours(&mut self, shown: &[Vec3], rows: &[Option<u32>]) -> usize {
        let colour = |row: &Option<u32>| row.map_or(Vec3::ZERO, |row| shown[row as usize]).extend(1.0).to_array();
        let numbers = rows.iter().flat_map(colour).map(|value| (value * 65535.0).round() as u16);
        let bytes: Vec<u8> = numbers.flat_map(u16::to_le_bytes).collect();
        let json = json!({
            "name": SHOWN_COLOURS, "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4", "count": rows.len(),
        });
        self.accessor(&bytes, ARRAY_BUFFER, json)
    }

    /// Attributes with the columns' values at vertices that show rows of them; 0 without a row.
    pub fn columns(&mut self, columns: &[Channel], rows: &[Option<u32>]) -> Map<String, Value> {
        let mut attributes = Map::new();
        for these in components(columns) {
            let name = if these.len() == 1 { &these[0].name } else { stem(&these[0]) };
            let value = |row: Option<u32>| these.iter().map(move |column| row.map_or(0.0, |row| column.samples[row as usize]));
            let accessor = self.floats(these.len(), rows.iter().copied().flat_map(value));
            attributes.insert(format!("_{}", snake_case(name).to_ascii_uppercase()), accessor.into());
        }
        attributes
    }

    pub fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let json = json!({"componentType": UNSIGNED_INT, "type": "SCALAR", "count": indices.len()});
        self.accessor(&bytes, ELEMENT_ARRAY_BUFFER, json)
    }

    pub fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.view(png);
        self.images.push(json!({"name": name, "mimeType": "image/png", "bufferView": view}));
        self.textures.push(json!({"source": self.images.len() - 1}));
        self.textures.len() - 1
    }

    /// Marks the picture of a texture as a map of this program, in its `extras`.
    pub fn mark(&mut self, texture: usize, map: &str) {
        if let Some(image) = self.textures[texture]["source"].as_u64() {
            self.images[image as usize]["extras"] = json!({MARK: map});
        }
    }

    /// Puts a picture in the place of one with this mark, and returns its texture. `None`: there is none.
    pub fn replace_texture(&mut self, map: &str, png: &[u8]) -> Option<usize> {
        let image = self.images.iter().position(|image| image["extras"][MARK] == map)?;
        let texture = self.textures.iter().position(|texture| texture["source"].as_u64() == Some(image as u64))?;
        self.images[image]["bufferView"] = self.view(png).into();
        Some(texture)
    }

    fn model_textures(&mut self, surface: &ExportMesh) -> Result<Vec<usize>> {
        let mut indices = Vec::new();
        for (index, texture) in surface.textures.iter().enumerate() {
            let is_albedo = surface.materials.iter().any(|material| material.albedo_texture == Some(index));
            if !is_albedo && !surface.materials.iter().any(|material| material.emission_texture == Some(index)) {
                // No material of the file names it.
                indices.push(usize::MAX);
                continue;
            }
            let name = if is_albedo { "albedo" } else { "emission" };
            let rgb: Vec<u8> = texture.texels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
            indices.push(self.texture(name, &encode_png(texture.width as usize, texture.height as usize, &rgb)?));
        }
        Ok(indices)
    }

    fn write(mut self, path: &Path, extensions_used: &[&str], options: &WriteOptions) -> Result<()> {
        let mut node = json!({"mesh": 0});
        if self.origin != DVec3::ZERO {
            node["translation"] = json!(self.origin.to_array());
        }
        let mut root = json!({
            "asset": {"version": "2.0", "generator": "finalgather"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [node],
            "meshes": [{"primitives": std::mem::take(&mut self.primitives)}],
            "buffers": [{}],
        });
        if !extensions_used.is_empty() {
            root["extensionsUsed"] = json!(extensions_used);
        }
        if !self.extensions.is_null() {
            root["extensions"] = self.extensions.take();
        }
        if let Some(metadata) = options.metadata {
            root["asset"]["extras"] = metadata_json(metadata);
        }
        self.finish(path, root)
    }
}

/// Metadata as JSON, if it is that.
pub fn metadata_json(metadata: &str) -> Value {
    serde_json::from_str(metadata).unwrap_or_else(|_| metadata.into())
}

/// Writes the container.
fn encode(path: &Path, root: &Value, bin: &[u8]) -> Result<()> {
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let length = |bytes: usize| {
        u32::try_from(bytes).map(u32::to_le_bytes).map_err(|_| {
            Error::usage(format!("{}: a GLB holds 4 GiB, and this takes {bytes} bytes", path.display()), "write a .ply or .npy")
        })
    };
    let total = length(12 + 8 + json.len() + 8 + bin.len())?;
    let [json_length, bin_length] = [length(json.len())?, length(bin.len())?];
    let parts: [&[u8]; 9] = [b"glTF", &2_u32.to_le_bytes(), &total, &json_length, b"JSON", &json, &bin_length, b"BIN\0", bin];
    write_file(path, &parts.concat())
}
