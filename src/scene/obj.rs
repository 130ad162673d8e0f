//! Wavefront OBJ and MTL into a mesh and its materials. [`load`] is the entry point.
//!
//! Polygons become triangles, corners with the same position, normal and texture coordinate share a vertex, and triangles
//! without an area are left out. Shading is smooth only where the file has normals (`vn`); smoothing groups are not read.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::files::{Reader, Unread};
use super::mtl::{self, beside};
use super::polygon::triangulate;
use super::scan::{Named, scan};
use super::texture::Textures;
use super::{Material, Mesh, Surface, Triangle};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS};

pub fn load(reader: &Reader, path: &Path, textures: &mut Textures, warnings: &mut Vec<String>) -> Result<(Mesh, Vec<Material>)> {
    let cure = "name an existing OBJ file that you may read";
    let bytes = reader.read_named(path, MOST_BYTES).map_err(|unread| unread.error(path, None, "this model", cure))?;
    let scan = scan(path, &bytes)?;
    let mut materials: Vec<Material> = Vec::new();
    let mut by_name: HashMap<String, usize> = HashMap::new();
    let mut read = HashSet::new();
    for (library, line) in scan.libraries.iter().flat_map(|statement| library_files(reader, path, statement)) {
        let unread = |unread: Unread| {
            let what = format!("material library {}", library.display());
            unread.error(path, Some(line), &what, "put it there, or correct or remove the mtllib line")
        };
        let file = reader.find(&library).map_err(unread)?;
        if !read.insert(file.clone()) {
            continue;
        }
        let bytes = reader.read(&file, MOST_WORDS).map_err(unread)?;
        // A name defined again means the later definition.
        for material in mtl::load(&library, &bytes, textures, warnings)? {
            match by_name.entry(material.name.clone()) {
                Entry::Occupied(known) => materials[*known.get()] = material,
                Entry::Vacant(new) => {
                    new.insert(materials.len());
                    materials.push(material);
                }
            }
        }
    }
    if let Some(unknown) = scan.materials.iter().find(|used| !by_name.contains_key(&used.name)) {
        let problem = format!("no material library defines material \"{}\"", unknown.name);
        let known = names(&materials);
        let cure = format!("define it in a file that mtllib names, or use a defined one: {known}");
        return Err(Error::input(path, Some(unknown.line), problem, cure));
    }
    // Only the names matter to tobj; the materials themselves are read already.
    let (models, _) =
        tobj::load_obj_buf(&mut scan.text.as_bytes(), &tobj::LoadOptions::default(), |_| Ok((Vec::new(), by_name.clone())))
            .map_err(|error| Error::input(path, None, format!("this is not a valid OBJ: {error}"), "export the model again"))?;
    let mesh = assemble(path, &models, &mut materials, warnings)?;
    Ok((mesh, materials))
}

/// For messages: the names of materials, not all of very many.
pub fn names(materials: &[Material]) -> String {
    let names: Vec<_> = materials.iter().take(20).map(|material| material.name.as_str()).collect();
    match materials.len() - names.len() {
        _ if materials.is_empty() => "(there are none)".to_owned(),
        0 => names.join(", "),
        more => format!("{} and {more} more", names.join(", ")),
    }
}

/// The files that a `mtllib` names, each with the statement's line.
fn library_files(reader: &Reader, obj: &Path, statement: &Named) -> Vec<(PathBuf, usize)> {
    // The statement lists files, but exporters also write single names with spaces.
    let whole = beside(obj, &statement.name);
    if reader.has(&whole) {
        return vec![(whole, statement.line)];
    }
    statement.name.split_whitespace().map(|name| (beside(obj, name), statement.line)).collect()
}

fn assemble(path: &Path, models: &[tobj::Model], materials: &mut Vec<Material>, warnings: &mut Vec<String>) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    let mut skipped = 0;
    for model in models.iter().map(|model| &model.mesh).filter(|model| !model.indices.is_empty()) {
        let material = model.material_id.unwrap_or_else(|| {
            let name = "default".into();
            let surface = Surface::Diffuse;
            materials.push(Material { name, albedo: mtl::GREY, emission: Vec3::ZERO, albedo_texture: None, surface });
            materials.len() - 1
        });
        skipped += add_model(&mut mesh, model, material as u32);
    }
    let total = skipped + mesh.triangles.len();
    match skipped {
        0 => {}
        _ if skipped == total => {
            let cure = "check the export's scale, and that vertices differ";
            return Err(Error::input(path, None, format!("none of the {total} triangles has an area"), cure));
        }
        1 => warnings.push(format!("1 of {total} triangles has no area and was skipped")),
        _ => warnings.push(format!("{skipped} of {total} triangles have no area and were skipped")),
    }
    Ok(mesh)
}

/// Adds the faces of one tobj model, which all have the same material. Returns how many triangles have no area.
fn add_model(mesh: &mut Mesh, model: &tobj::Mesh, material: u32) -> usize {
    let vec3 = |values: &[f32], index: u32| Vec3::from_slice(&values[3 * index as usize..]);
    let mut shared: HashMap<[u32; 3], u32> = HashMap::new();
    let mut skipped = 0;
    let mut first = 0;
    // tobj leaves the arities out when there are only triangles.
    let triangles = vec![3; model.indices.len() / 3];
    for &arity in if model.face_arities.is_empty() { &triangles } else { &model.face_arities } {
        let face = first..first + arity as usize;
        first = face.end;
        let corners: Vec<Vec3> = model.indices[face.clone()].iter().map(|&index| vec3(&model.positions, index)).collect();
        let triangles = triangulate(&corners);
        if triangles.is_empty() {
            skipped += corners.len() - 2;
        }
        for triangle in triangles {
            if !super::has_area(triangle.map(|corner| corners[corner])) {
                skipped += 1;
                continue;
            }
            let vertices = triangle.map(|corner| {
                let at = face.start + corner;
                let key = [model.indices[at], model.texcoord_indices[at], model.normal_indices[at]];
                *shared.entry(key).or_insert_with(|| {
                    mesh.positions.push(vec3(&model.positions, key[0]));
                    mesh.uvs.push(Vec2::from_slice(&model.texcoords[2 * key[1] as usize..]));
                    mesh.normals.push(vec3(&model.normals, key[2]));
                    mesh.positions.len() as u32 - 1
                })
            });
            mesh.triangles.push(Triangle { vertices, material });
        }
    }
    skipped
}
