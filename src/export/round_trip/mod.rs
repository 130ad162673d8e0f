//! Results in the glTF file that they are of. Nodes, names, materials, textures, animations and extras stay. Only these are added:
//!
//! - Light maps: coordinates, as the next free `TEXCOORD_n`, unless the light map uses those that are there. `MOZ_lightmap` in each material with
//!   linear irradiance, and a variant `lit` (`KHR_materials_variants`) of unlit materials with the map as viewers show it. Openness becomes the
//!   `occlusionTexture`.
//! - Values at vertices: an attribute for each quantity, and `COLOR_0` where the primitive has none.
//!
//! A vertex with several results, such as one on a seam of the map, is split. Then the attributes of its primitive are written anew, in the types
//! that they have. A mesh that several nodes share becomes one for each node, because each has light of its own.

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec2;
use serde_json::{Map, Value};

use self::baked::{Parts, PrimitivePlace, baked_parts, separate_meshes};
use self::split::{Renewed, VertexSplit, own_coordinates, renew, split};
use super::glb::{ARRAY_BUFFER, Builder, check_finite, linear_png, map_sampler, metadata_json};
use super::{ExportMesh, Lightmap, PointValues};
use crate::error::Result;
use crate::image::WriteOptions;
use crate::scene::gltf::{PlainGltf, SHOWN_COLOURS};

mod baked;
mod materials;
mod split;

/// The mode of a primitive of separate triangles, a constant of OpenGL.
const TRIANGLES: u32 = 4;

/// Name of the variant with the light map as base colour.
const LIT: &str = "lit";

pub fn write_values(path: &Path, surface: &ExportMesh, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let mut file = LitFile::read(path, surface)?;
    for column in values.columns {
        check_finite(path, column, file.splits.values().flat_map(|split| split.rows.iter().flatten().copied()))?;
    }
    let shown = values.shown(options.exposure);
    for place in file.places() {
        let rows = file.splits[&place].rows.clone();
        let mut added = file.builder.columns(values.columns, &rows);
        let colours = file.primitive(place)["attributes"]["COLOR_0"].as_u64();
        if colours.is_none_or(|colours| file.builder.name(colours as usize) == Some(SHOWN_COLOURS)) {
            added.insert("COLOR_0".into(), file.builder.shown_colours(&shown, &rows).into());
        }
        file.attributes(place).extend(added);
    }
    file.write(path, options)
}

pub fn write_lightmap(path: &Path, lightmap: &Lightmap, options: &WriteOptions) -> Result<()> {
    let mut file = LitFile::read(path, &lightmap.surface)?;
    let set = file.map_coordinates(lightmap.uvs);
    let mut maps = Maps { set, ..Maps::default() };
    if let Some(irradiance) = lightmap.irradiance {
        let (linear, intensity) = linear_png(irradiance)?;
        maps.irradiance = Some((file.texture("irradiance", &linear), intensity));
        maps.shown = Some(file.texture(LIT, &Lightmap::shown_png(irradiance, options.exposure)?));
    }
    if let Some(png) = lightmap.openness_png(std::convert::identity)? {
        maps.openness = Some(file.texture("occlusion", &png));
    }
    file.add_maps(&lightmap.surface, &maps, options.exposure);
    file.write(path, options)
}

/// Textures of the file that hold a light map.
#[derive(Default)]
struct Maps {
    /// The set of coordinates.
    set: usize,
    /// With the factor of its values.
    irradiance: Option<(usize, f32)>,
    shown: Option<usize>,
    openness: Option<usize>,
}

/// A glTF file in the making.
struct LitFile {
    root: Value,
    builder: Builder,
    splits: BTreeMap<PrimitivePlace, VertexSplit>,
    /// Coordinates on a light map that the file has, v up.
    own: BTreeMap<PrimitivePlace, Option<Vec<Vec2>>>,
    sampler: Option<usize>,
}

impl LitFile {
    /// Reads the file of a mesh, with its vertices split as those of the mesh.
    fn read(path: &Path, surface: &ExportMesh) -> Result<Self> {
        let Some(source) = surface.source else { unreachable!("the caller has looked") };
        source.check_copies(path)?;
        let plain = PlainGltf::read(source.file)?;
        let (mut parts, mut splits, mut own) = (Parts::new(), BTreeMap::new(), BTreeMap::new());
        // What takes the place of accessors, by primitive.
        let mut renewed = Vec::new();
        plain.values(source.file, |buffers| {
            parts = baked_parts(buffers, surface.mesh, &source)?;
            for (&place, triangles) in &parts {
                let split = split(buffers, place, triangles)?;
                own.insert(place, own_coordinates(buffers, place)?);
                if split.corners.is_some() {
                    renewed.push((place, renew(buffers, &plain.json, place, &split)));
                }
                splits.insert(place, split);
            }
            Ok(())
        })?;
        let PlainGltf { json: mut root, bin, .. } = plain;
        separate_meshes(&mut root, &parts);
        let builder = Builder::of(&mut root, bin);
        let mut file = Self { root, builder, splits, own, sampler: None };
        for (place, accessors) in renewed {
            file.renew(place, accessors);
        }
        Ok(file)
    }

    fn places(&self) -> Vec<PrimitivePlace> {
        self.splits.keys().copied().collect()
    }

    /// The mesh of a node.
    fn mesh(&self, node: usize) -> usize {
        self.root["nodes"][node]["mesh"].as_u64().unwrap_or_default() as usize
    }

    fn primitive(&mut self, (node, primitive): PrimitivePlace) -> &mut Value {
        let mesh = self.mesh(node);
        &mut self.root["meshes"][mesh]["primitives"][primitive]
    }

    fn attributes(&mut self, place: PrimitivePlace) -> &mut Map<String, Value> {
        let Some(attributes) = self.primitive(place)["attributes"].as_object_mut() else {
            unreachable!("a primitive without attributes was not baked")
        };
        attributes
    }

    /// Gives a primitive its split vertices.
    fn renew(&mut self, place: PrimitivePlace, accessors: Vec<Renewed>) {
        for Renewed { list, name, accessor } in accessors {
            let accessor = accessor.map(|new| {
                let accessor = self.builder.accessor(&new.bytes, ARRAY_BUFFER, new.json);
                self.builder.set_stride(accessor, new.stride);
                accessor
            });
            let Some(list) = self.primitive(place).pointer_mut(&list).and_then(Value::as_object_mut) else { continue };
            match accessor {
                Some(accessor) => drop(list.insert(name, accessor.into())),
                None => drop(list.remove(&name)),
            }
        }
        let corners = self.splits[&place].corners.clone().unwrap_or_default();
        let indices = self.builder.indices(&corners);
        let Some(primitive) = self.primitive(place).as_object_mut() else { return };
        primitive.insert("indices".into(), indices.into());
        // Strips and fans become lists of triangles.
        if let Some(mode) = primitive.get_mut("mode") {
            *mode = TRIANGLES.into();
        }
    }

    /// Gives all vertices their coordinates on the map, and returns the number of the set.
    fn map_coordinates(&mut self, uvs: &[Vec2]) -> usize {
        let at = |row: &Option<u32>| row.map_or(Vec2::ZERO, |row| uvs[row as usize]);
        let is_there = |(place, split): (&PrimitivePlace, &VertexSplit)| {
            split.corners.is_none()
                && self.own[place].as_ref().is_some_and(|own| {
                    own.len() == split.rows.len()
                        && own.iter().zip(&split.rows).all(|(own, row)| row.is_none() || own.abs_diff_eq(at(row), 1e-6))
                })
        };
        if self.splits.iter().all(is_there) {
            return 1;
        }
        let set = self.free_set();
        for place in self.places() {
            let rows = &self.splits[&place].rows;
            let coordinates: Vec<Vec2> = rows.iter().map(at).collect();
            let accessor = self.builder.uvs(&coordinates);
            let attributes = self.attributes(place);
            // glTF wants sets without a gap.
            for set in 0..=set {
                attributes.entry(format!("TEXCOORD_{set}")).or_insert_with(|| accessor.into());
            }
        }
        set
    }

    /// The first set of coordinates from 1 that no primitive of the bake has.
    fn free_set(&mut self) -> usize {
        let places = self.places();
        let mut is_used = |set: &usize| {
            let name = format!("TEXCOORD_{set}");
            places.iter().any(|&place| self.attributes(place).contains_key(&name))
        };
        (1..).find(|set| !is_used(set)).unwrap_or(1)
    }

    /// Adds a map as a texture, or puts it in the place of that of an earlier round.
    fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        if let Some(texture) = self.builder.replace_texture(name, png) {
            return texture;
        }
        let sampler = *self.sampler.get_or_insert_with(|| {
            self.builder.samplers.push(map_sampler());
            self.builder.samplers.len() - 1
        });
        let texture = self.builder.texture(name, png);
        self.builder.mark(texture, name);
        self.builder.textures[texture]["sampler"] = sampler.into();
        texture
    }

    fn write(mut self, path: &Path, options: &WriteOptions) -> Result<()> {
        if let Some(metadata) = options.metadata {
            let extras = &mut self.root["asset"]["extras"];
            // The file's own extras stay. What is no object has no room for more.
            if extras.is_null() || extras.is_object() {
                extras["finalgather"] = metadata_json(metadata);
            }
        }
        self.builder.finish(path, self.root)
    }
}
