//! Binary glTF 2.0.
//!
//! Values at points become `COLOR_0` for display, and one custom attribute for each quantity: `_IRRADIANCE`, `_AO`, `_PRT_00` and so on.
//! `COLOR_0` is the light. Viewers multiply it by the albedo of the unlit materials.
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
//! The file is built with `serde_json`, because the types of the crate `gltf-json` write out every absent field. Tests check the result
//! with that crate's reader and the Khronos validator.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use serde_json::{Map, Value, json};

use super::{ExportMesh, Lightmap, PointValues, Positions, snake_case};
use crate::error::{Error, Result};
use crate::file::write_file;
use crate::image::{Channel, Image, WriteOptions, encode_png, tone};
use crate::math::Aabb;
use crate::scene::Material;

// glTF denotes types and targets by constants of OpenGL.
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const POINTS: u32 = 0;
const LINEAR: u32 = 9729;
const CLAMP_TO_EDGE: u32 = 33071;

const UNLIT: &str = "KHR_materials_unlit";
const VARIANTS: &str = "KHR_materials_variants";
const LIGHTMAP: &str = "MOZ_lightmap";

pub fn write_values(path: &Path, values: &PointValues, options: &WriteOptions) -> Result<()> {
    if let Some(column) = values.columns.iter().find(|column| !column.samples.iter().all(|sample| sample.is_finite())) {
        let problem = format!("{}: {} is not finite everywhere, as glTF wants it", path.display(), column.name);
        return Err(Error::usage(problem, "write a .ply or .npy"));
    }
    let mut file = Builder::default();
    let mut attributes = Map::new();
    attributes.insert("POSITION".into(), file.positions(values.positions).into());
    attributes.insert("NORMAL".into(), file.vec3s(values.normals).into());
    // Linear values need 16 bits: with 8, dark parts would show bands.
    let colours = values.shown(options.exposure).into_iter();
    let colours = colours.flat_map(|colour| colour.extend(1.0).to_array().map(|value| (value * 65535.0).round() as u16));
    let colours: Vec<u8> = colours.flat_map(u16::to_le_bytes).collect();
    let count = values.positions.world.len();
    let colours = file.accessor(
        &colours,
        ARRAY_BUFFER,
        json!({"componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4", "count": count}),
    );
    attributes.insert("COLOR_0".into(), colours.into());
    for these in components(values.columns) {
        let name = if these.len() == 1 { &these[0].name } else { stem(&these[0]) };
        let rows = (0..count).flat_map(|i| these.iter().map(move |column| column.samples[i]));
        let accessor = file.floats(these.len(), rows);
        attributes.insert(format!("_{}", snake_case(name).to_ascii_uppercase()), accessor.into());
    }
    match values.surface {
        None => {
            file.materials.push(json!({"name": "points", "extensions": {UNLIT: {}}}));
            file.primitives.push(json!({"attributes": attributes, "mode": POINTS, "material": 0}));
        }
        Some(surface) => {
            let is_textured = surface.materials.iter().any(|material| material.albedo_texture.is_some());
            if is_textured {
                attributes.insert("TEXCOORD_0".into(), file.uvs(&surface.mesh.uvs).into());
            }
            let textures = file.albedo_textures(&surface)?;
            for (index, indices) in surface.indices_by_material() {
                let material = &surface.materials[index];
                let mut material_json = shaded(material, &textures);
                material_json["extensions"] = json!({UNLIT: {}});
                file.materials.push(material_json);
                let indices = file.indices(&indices);
                file.primitives.push(json!({"attributes": attributes, "indices": indices, "material": file.materials.len() - 1}));
            }
        }
    }
    file.write(path, &[UNLIT], options)
}

pub fn write_lightmap(path: &Path, lightmap: &Lightmap, options: &WriteOptions) -> Result<()> {
    let surface = &lightmap.surface;
    let mut file = Builder::default();
    let mut attributes = Map::new();
    attributes.insert("POSITION".into(), file.positions(surface.positions).into());
    if surface.has_normals() {
        attributes.insert("NORMAL".into(), file.vec3s(&surface.mesh.normals).into());
    }
    // TEXCOORD_1 needs a TEXCOORD_0, even if nothing reads it.
    attributes.insert("TEXCOORD_0".into(), file.uvs(&surface.mesh.uvs).into());
    attributes.insert("TEXCOORD_1".into(), file.uvs(lightmap.uvs).into());

    let (linear, intensity) = linear_png(lightmap.irradiance)?;
    let [shown, linear] =
        [("shown", lightmap.shown_png(options.exposure)?), ("irradiance", linear)].map(|(name, png)| file.texture(name, &png));
    // Mipmaps and repetition would mix texels of different charts.
    for map in [shown, linear] {
        file.textures[map]["sampler"] = 0.into();
    }
    file.samplers.push(json!({"magFilter": LINEAR, "minFilter": LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE}));
    let textures = file.albedo_textures(surface)?;
    for (index, indices) in surface.indices_by_material() {
        let material = &surface.materials[index];
        let unlit = if material.is_emissive() {
            let [r, g, b] = (material.emission * options.exposure.exp2()).map(tone).to_array();
            json!({"baseColorFactor": [r, g, b, 1.0]})
        } else {
            let [r, g, b] = surface.mean_albedo(material).to_array();
            json!({"baseColorFactor": [r, g, b, 1.0], "baseColorTexture": {"index": shown, "texCoord": 1}})
        };
        let first = file.materials.len();
        file.materials
            .push(json!({"name": material.name, "doubleSided": true, "pbrMetallicRoughness": unlit, "extensions": {UNLIT: {}}}));
        let mut engine = shaded(material, &textures);
        engine["extensions"] = json!({LIGHTMAP: {"index": linear, "texCoord": 1, "intensity": intensity}});
        file.materials.push(engine);
        let indices = file.indices(&indices);
        let variants =
            json!({VARIANTS: {"mappings": [{"material": first, "variants": [0]}, {"material": first + 1, "variants": [1]}]}});
        file.primitives.push(json!({"attributes": attributes, "indices": indices, "material": first, "extensions": variants}));
    }
    file.extensions = json!({VARIANTS: {"variants": [{"name": "shown"}, {"name": "lightmap"}]}});
    file.write(path, &[UNLIT, VARIANTS, LIGHTMAP], options)
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
    }
    json
}

/// Encodes irradiance over its greatest value, and returns both.
fn linear_png(irradiance: &Image) -> Result<(Vec<u8>, f32)> {
    let rgb = irradiance.rgb()?;
    let greatest = rgb.iter().copied().flatten().copied().filter(|value| value.is_finite()).fold(0.0, f32::max);
    let intensity = if greatest > 0.0 { greatest } else { 1.0 };
    let Image { width, height, .. } = *irradiance;
    let bytes = (0..width * height).flat_map(|i| rgb.map(|samples| (samples[i] / intensity * 255.0).round() as u8));
    Ok((encode_png(width, height, &bytes.collect::<Vec<_>>())?, intensity))
}

/// The parts of a file so far.
#[derive(Default)]
struct Builder {
    bin: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    samplers: Vec<Value>,
    materials: Vec<Value>,
    primitives: Vec<Value>,
    extensions: Value,
    /// Of the positions, in world space.
    origin: DVec3,
}

impl Builder {
    fn view(&mut self, bytes: &[u8]) -> usize {
        // glTF requires that numbers begin at multiples of their size.
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend(bytes);
        self.views.len() - 1
    }

    fn accessor(&mut self, bytes: &[u8], target: u32, mut json: Value) -> usize {
        let view = self.view(bytes);
        self.views[view]["target"] = target.into();
        json["bufferView"] = view.into();
        self.accessors.push(json);
        self.accessors.len() - 1
    }

    /// An accessor of `width` numbers a vertex, 1 to 4.
    fn floats(&mut self, width: usize, numbers: impl Iterator<Item = f32>) -> usize {
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
    fn uvs(&mut self, uvs: &[Vec2]) -> usize {
        self.floats(2, uvs.iter().flat_map(|uv| [uv.x, 1.0 - uv.y]))
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let json = json!({"componentType": UNSIGNED_INT, "type": "SCALAR", "count": indices.len()});
        self.accessor(&bytes, ELEMENT_ARRAY_BUFFER, json)
    }

    fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        let view = self.view(png);
        self.images.push(json!({"name": name, "mimeType": "image/png", "bufferView": view}));
        self.textures.push(json!({"source": self.images.len() - 1}));
        self.textures.len() - 1
    }

    fn albedo_textures(&mut self, surface: &ExportMesh) -> Result<Vec<usize>> {
        let mut indices = Vec::new();
        for texture in surface.textures {
            let rgb: Vec<u8> = texture.texels.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
            indices.push(self.texture("albedo", &encode_png(texture.width as usize, texture.height as usize, &rgb)?));
        }
        Ok(indices)
    }

    fn write(mut self, path: &Path, extensions_used: &[&str], options: &WriteOptions) -> Result<()> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut node = json!({"mesh": 0});
        if self.origin != DVec3::ZERO {
            node["translation"] = json!(self.origin.to_array());
        }
        let mut root = json!({
            "asset": {"version": "2.0", "generator": "finalgather"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [node],
            "meshes": [{"primitives": self.primitives}],
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bin.len()}],
            "extensionsUsed": extensions_used,
        });
        for (key, values) in [("images", self.images), ("textures", self.textures), ("samplers", self.samplers)] {
            if !values.is_empty() {
                root[key] = values.into();
            }
        }
        if !self.extensions.is_null() {
            root["extensions"] = self.extensions;
        }
        if let Some(metadata) = options.metadata {
            root["asset"]["extras"] = serde_json::from_str(metadata).unwrap_or_else(|_| metadata.into());
        }
        let mut json = root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');

        let length = |bytes: usize| {
            u32::try_from(bytes).map(u32::to_le_bytes).map_err(|_| {
                Error::usage(
                    format!("{}: a GLB holds 4 GiB, and this takes {bytes} bytes", path.display()),
                    "write a .ply or .npy",
                )
            })
        };
        let total = length(12 + 8 + json.len() + 8 + self.bin.len())?;
        let [json_length, bin_length] = [length(json.len())?, length(self.bin.len())?];
        let parts: [&[u8]; 9] =
            [b"glTF", &2_u32.to_le_bytes(), &total, &json_length, b"JSON", &json, &bin_length, b"BIN\0", &self.bin];
        write_file(path, &parts.concat())
    }
}
