//! Maps in the materials of a glTF file.

use std::collections::{HashMap, HashSet};

use serde_json::{Value, json};

use super::super::ExportMesh;
use super::super::glb::{LIGHTMAP, MARK, UNLIT, VARIANTS, shown_surface};
use super::baked::PrimitivePlace;
use super::{LIT, LitFile, Maps};
use crate::scene::Material;

impl LitFile {
    /// Puts the maps into the materials of all primitives of the bake.
    pub(super) fn add_maps(&mut self, surface: &ExportMesh, maps: &Maps, exposure: f32) {
        let shown = maps.shown.map(|shown| (self.variant(), shown));
        // Materials of the last round whose places are free.
        let mut free = shown.map_or_else(Vec::new, |(variant, _)| self.forget(variant));
        let elsewhere = self.used_elsewhere();
        let mut with_maps: HashMap<Option<usize>, usize> = HashMap::new();
        // The unlit copy of each material.
        let mut lit: HashMap<usize, usize> = HashMap::new();
        for place in self.places() {
            let of_file = self.primitive(place)["material"].as_u64().map(|material| material as usize);
            let material = *with_maps.entry(of_file).or_insert_with(|| {
                let material = self.material(of_file, &elsewhere);
                self.add_to_material(material, maps);
                material
            });
            self.primitive(place)["material"] = material.into();
            let Some((variant, shown)) = shown else { continue };
            let lit = *lit.entry(material).or_insert_with(|| {
                let unlit = self.unlit(surface, place, material, (shown, maps.set), exposure);
                match free.pop() {
                    Some(free) => {
                        self.builder.materials[free] = unlit;
                        free
                    }
                    None => self.push_material(unlit),
                }
            });
            self.map(place, json!({"material": lit, "variants": [variant]}));
        }
        if maps.irradiance.is_some() {
            self.uses(LIGHTMAP);
        }
        if maps.shown.is_some() {
            self.uses(VARIANTS);
            self.uses(UNLIT);
        }
    }

    fn push_material(&mut self, material: Value) -> usize {
        self.builder.materials.push(material);
        self.builder.materials.len() - 1
    }

    /// The material that gets the maps. It is a copy if primitives outside of the bake, which have no coordinates on the map, use that of the file.
    fn material(&mut self, of_file: Option<usize>, elsewhere: &HashSet<u64>) -> usize {
        let json = of_file.and_then(|material| self.builder.materials.get(material));
        match (of_file, json) {
            (Some(material), Some(json)) if elsewhere.contains(&(material as u64)) => {
                let copy = json.clone();
                self.push_material(copy)
            }
            (Some(material), Some(_)) => material,
            // The file's own default is a rough metal, on which a light map does not show.
            _ => self.push_material(json!({"pbrMetallicRoughness": {"metallicFactor": 0}})),
        }
    }

    /// The materials and the variants' materials of primitives outside of the bake.
    fn used_elsewhere(&mut self) -> HashSet<u64> {
        let baked: HashSet<_> = self.places().into_iter().map(|(node, primitive)| (self.mesh(node), primitive)).collect();
        let mut used = HashSet::new();
        for (mesh, json) in self.root["meshes"].as_array().into_iter().flatten().enumerate() {
            for (index, primitive) in json["primitives"].as_array().into_iter().flatten().enumerate() {
                if !baked.contains(&(mesh, index)) {
                    used.extend(materials_of(primitive));
                }
            }
        }
        used
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

    /// The unlit copy of a material, which shows the map.
    fn unlit(&self, surface: &ExportMesh, place: PrimitivePlace, material: usize, map: (usize, usize), exposure: f32) -> Value {
        let row = self.splits[&place].rows.iter().flatten().next();
        let of_scene = row.and_then(|&row| material_of(surface, row));
        let mut unlit = json!({"extensions": {UNLIT: {}}});
        let of_file = &self.builder.materials[material];
        if let Some(of_scene) = of_scene {
            let mut shown = shown_surface(surface, of_scene, map, exposure);
            if let Some(alpha) = of_file["pbrMetallicRoughness"]["baseColorFactor"].get(3) {
                shown["baseColorFactor"][3] = alpha.clone();
            }
            unlit["pbrMetallicRoughness"] = shown;
        }
        for key in ["name", "doubleSided", "alphaMode", "alphaCutoff"] {
            if let Some(value) = of_file.get(key) {
                unlit[key] = value.clone();
            }
        }
        unlit
    }

    /// Adds a mapping of variants to a primitive.
    fn map(&mut self, place: PrimitivePlace, mapping: Value) {
        let variants = &mut self.primitive(place)["extensions"][VARIANTS];
        if !variants.is_object() {
            *variants = json!({});
        }
        match variants["mappings"].as_array_mut() {
            Some(mappings) => mappings.push(mapping),
            None => variants["mappings"] = json!([mapping]),
        }
    }

    /// The number of the variant, which is added if there is none of an earlier round.
    fn variant(&mut self) -> usize {
        let extension = &mut self.root["extensions"][VARIANTS];
        if !extension.is_object() {
            *extension = json!({});
        }
        let variants = &mut extension["variants"];
        if !variants.is_array() {
            *variants = json!([]);
        }
        let Some(variants) = variants.as_array_mut() else { unreachable!("it was made a list") };
        if let Some(known) = variants.iter().position(|variant| variant["extras"][MARK] == LIT) {
            return known;
        }
        variants.push(json!({"name": LIT, "extras": {MARK: LIT}}));
        variants.len() - 1
    }

    /// Takes the mappings of a variant away. Returns the materials that nothing uses any more.
    fn forget(&mut self, variant: usize) -> Vec<usize> {
        let mut forgotten = Vec::new();
        let meshes = self.root["meshes"].as_array_mut().into_iter().flatten();
        let mut primitives: Vec<_> = meshes.filter_map(|mesh| mesh.get_mut("primitives")?.as_array_mut()).flatten().collect();
        for primitive in &mut primitives {
            let mappings = primitive.pointer_mut(&format!("/extensions/{VARIANTS}/mappings")).and_then(Value::as_array_mut);
            let Some(mappings) = mappings else { continue };
            mappings.retain_mut(|mapping| {
                let material = mapping["material"].as_u64();
                let Some(variants) = mapping.get_mut("variants").and_then(Value::as_array_mut) else { return true };
                let before = variants.len();
                variants.retain(|known| known.as_u64() != Some(variant as u64));
                if variants.len() < before && variants.is_empty() {
                    forgotten.extend(material);
                }
                variants.len() == before || !variants.is_empty()
            });
        }
        let used: HashSet<u64> = primitives.iter().flat_map(|primitive| materials_of(primitive)).collect();
        forgotten.sort_unstable();
        forgotten.dedup();
        forgotten.retain(|material| !used.contains(material));
        let there = self.builder.materials.len();
        // The first comes last, to be taken first.
        forgotten.into_iter().rev().map(|material| material as usize).filter(|&material| material < there).collect()
    }

    fn uses(&mut self, extension: &str) {
        let used = &mut self.root["extensionsUsed"];
        match used.as_array_mut() {
            Some(used) if used.iter().any(|name| name == extension) => {}
            Some(used) => used.push(extension.into()),
            None => *used = json!([extension]),
        }
    }
}

/// The material of a primitive, and those of its variants.
fn materials_of(primitive: &Value) -> impl Iterator<Item = u64> {
    let mappings = primitive["extensions"][VARIANTS]["mappings"].as_array().into_iter().flatten();
    mappings.chain([primitive]).filter_map(|entry| entry["material"].as_u64())
}

/// The material of a triangle with this vertex.
fn material_of<'a>(surface: &ExportMesh<'a>, row: u32) -> Option<&'a Material> {
    let triangle = surface.mesh.triangles.iter().find(|triangle| triangle.vertices.contains(&row))?;
    Some(&surface.materials[triangle.material as usize])
}
