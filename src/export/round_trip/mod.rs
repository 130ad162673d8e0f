//! Results in the glTF file that they are of. Nodes, names, materials, textures, animations and extras stay. Only these are added:
//!
//! - Light maps: coordinates, as the next free `TEXCOORD_n`, unless the light map uses those that are there. `MOZ_lightmap` in each material with
//!   linear irradiance, and a variant `lit` (`KHR_materials_variants`) of unlit materials with the map as viewers show it. Openness becomes the
//!   `occlusionTexture`.
//! - Values at vertices: an attribute for each quantity, and `COLOR_0` where the primitive has none.
//!
//! A vertex with several results, such as one on a seam of the map, is split. Then the attributes of its primitive are written anew, in the types
//! that they have. A mesh that several nodes share becomes one for each node, because each has light of its own.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::Path;

use glam::Vec2;
use serde_json::{Map, Value, json};

use self::split::{Place, Renewed, Split, baked_parts, coordinates, renew, separate_meshes, split};
use super::glb::{ARRAY_BUFFER, Builder, LIGHTMAP, UNLIT, VARIANTS, linear_png, map_sampler, metadata_json, shown_surface};
use super::{ExportMesh, Lightmap, PointValues};
use crate::error::Result;
use crate::image::WriteOptions;
use crate::scene::Material;
use crate::scene::gltf::PlainGltf;

mod split;

/// The mode of a primitive of separate triangles, a constant of OpenGL.
const TRIANGLES: u32 = 4;

/// Name of the variant with the light map as base colour.
const LIT: &str = "lit";

pub fn write_values(path: &Path, surface: &ExportMesh, values: &PointValues, options: &WriteOptions) -> Result<()> {
    let mut file = LitFile::read(path, surface)?;
    for place in file.places() {
        let rows = file.splits[&place].rows.clone();
        let mut added = file.builder.columns(values.columns, &rows);
        if file.primitive(place)["attributes"]["COLOR_0"].is_null() {
            let colours = file.builder.shown_colours(values, options.exposure, &rows);
            added.insert("COLOR_0".into(), colours.into());
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
    if let Some(png) = lightmap.openness_png()? {
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
    splits: BTreeMap<Place, Split>,
    /// Coordinates that are in the file at the vertices of a primitive, by set, v up.
    sets: BTreeMap<Place, Vec<Vec<Vec2>>>,
    sampler: Option<usize>,
}

impl LitFile {
    /// Reads the file of a mesh, with its vertices split as those of the mesh.
    fn read(path: &Path, surface: &ExportMesh) -> Result<Self> {
        let Some(source) = surface.source else { unreachable!("the caller has looked") };
        let PlainGltf { mut json, bin } = PlainGltf::read(source.file)?;
        let baked = baked_parts(path, surface.mesh, &source)?;
        separate_meshes(&mut json, &baked);
        let plain = PlainGltf { json, bin };
        let (mut splits, mut sets) = (BTreeMap::new(), BTreeMap::new());
        // The accessors that take the place of others, by primitive.
        let mut renewed = Vec::new();
        plain.values(source.file, |buffers| {
            for (&place, triangles) in &baked {
                let split = split(buffers, place, surface.mesh, triangles)?;
                sets.insert(place, coordinates(buffers, place)?);
                if split.corners.is_some() {
                    renewed.push((place, renew(buffers, place, &split)?));
                }
                splits.insert(place, split);
            }
            Ok(())
        })?;
        let PlainGltf { json: mut root, bin } = plain;
        let builder = Builder::of(&mut root, bin);
        let mut file = Self { root, builder, splits, sets, sampler: None };
        for (place, accessors) in renewed {
            file.renew(place, accessors);
        }
        Ok(file)
    }

    fn places(&self) -> Vec<Place> {
        self.splits.keys().copied().collect()
    }

    fn primitive(&mut self, (node, primitive): Place) -> &mut Value {
        let mesh = self.root["nodes"][node]["mesh"].as_u64().unwrap_or_default() as usize;
        &mut self.root["meshes"][mesh]["primitives"][primitive]
    }

    fn attributes(&mut self, place: Place) -> &mut Map<String, Value> {
        let Some(attributes) = self.primitive(place)["attributes"].as_object_mut() else {
            unreachable!("a primitive without attributes was not baked")
        };
        attributes
    }

    /// Gives a primitive its split vertices.
    fn renew(&mut self, place: Place, accessors: Vec<Renewed>) {
        for Renewed { pointer, bytes, stride, json } in accessors {
            let accessor = self.builder.accessor(&bytes, ARRAY_BUFFER, json);
            self.builder.set_stride(accessor, stride);
            if let Some(index) = self.primitive(place).pointer_mut(&pointer) {
                *index = accessor.into();
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
        let is_there = |(place, split): (&Place, &Split)| {
            let own = self.sets[place].get(1);
            split.corners.is_none()
                && own.is_some_and(|own| {
                    own.iter().zip(&split.rows).all(|(own, row)| row.is_none() || own.abs_diff_eq(at(row), 1e-6))
                })
        };
        if self.splits.iter().all(is_there) {
            return 1;
        }
        let set = self.sets.values().map(Vec::len).max().unwrap_or_default().max(1);
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

    /// Adds a map as a texture.
    fn texture(&mut self, name: &str, png: &[u8]) -> usize {
        let sampler = *self.sampler.get_or_insert_with(|| {
            self.builder.samplers.push(map_sampler());
            self.builder.samplers.len() - 1
        });
        let texture = self.builder.texture(name, png);
        self.builder.textures[texture]["sampler"] = sampler.into();
        texture
    }

    /// Puts the maps into the materials of all primitives of the bake.
    fn add_maps(&mut self, surface: &ExportMesh, maps: &Maps, exposure: f32) {
        let variant = maps.shown.map(|_| self.variant());
        // The unlit copy of each material.
        let mut lit: HashMap<usize, usize> = HashMap::new();
        let mut with_maps = HashSet::new();
        for place in self.places() {
            let material = match self.primitive(place)["material"].as_u64() {
                Some(material) => material as usize,
                None => {
                    self.builder.materials.push(json!({}));
                    self.builder.materials.len() - 1
                }
            };
            self.primitive(place)["material"] = material.into();
            if with_maps.insert(material) {
                self.add_to_material(material, maps);
            }
            let Some((variant, shown)) = variant.zip(maps.shown) else { continue };
            let lit = *lit.entry(material).or_insert_with(|| {
                let row = self.splits[&place].rows.iter().flatten().next();
                let shown = row
                    .and_then(|&row| material_of(surface, row))
                    .map(|material| shown_surface(surface, material, (shown, maps.set), exposure));
                let mut unlit = json!({"pbrMetallicRoughness": shown, "extensions": {UNLIT: {}}});
                for key in ["name", "doubleSided"] {
                    if let Some(value) = self.builder.materials[material].get(key) {
                        unlit[key] = value.clone();
                    }
                }
                self.builder.materials.push(unlit);
                self.builder.materials.len() - 1
            });
            let mappings = &mut self.primitive(place)["extensions"][VARIANTS]["mappings"];
            let mapping = json!({"material": lit, "variants": [variant]});
            match mappings.as_array_mut() {
                Some(mappings) => mappings.push(mapping),
                None => *mappings = json!([mapping]),
            }
        }
        if maps.irradiance.is_some() {
            self.uses(LIGHTMAP);
        }
        if maps.shown.is_some() {
            self.uses(VARIANTS);
            self.uses(UNLIT);
        }
    }

    fn add_to_material(&mut self, material: usize, maps: &Maps) {
        let json = &mut self.builder.materials[material];
        if let Some((texture, intensity)) = maps.irradiance {
            json["extensions"][LIGHTMAP] = json!({"index": texture, "texCoord": maps.set, "intensity": intensity});
        }
        if let Some(texture) = maps.openness {
            json["occlusionTexture"] = json!({"index": texture, "texCoord": maps.set});
        }
    }

    /// Adds the variant, and returns its number.
    fn variant(&mut self) -> usize {
        let variants = &mut self.root["extensions"][VARIANTS]["variants"];
        if !variants.is_array() {
            *variants = json!([]);
        }
        let Some(variants) = variants.as_array_mut() else { unreachable!("it was made a list") };
        variants.push(json!({"name": LIT}));
        variants.len() - 1
    }

    fn uses(&mut self, extension: &str) {
        let used = &mut self.root["extensionsUsed"];
        match used.as_array_mut() {
            Some(used) if used.iter().any(|name| name == extension) => {}
            Some(used) => used.push(extension.into()),
            None => *used = json!([extension]),
        }
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

/// The material of a triangle with this vertex.
fn material_of<'a>(surface: &ExportMesh<'a>, row: u32) -> Option<&'a Material> {
    let triangle = surface.mesh.triangles.iter().find(|triangle| triangle.vertices.contains(&row))?;
    Some(&surface.materials[triangle.material as usize])
}
