//! Wavefront OBJ with its material libraries (MTL). It becomes one mesh and one instance. [`load`] is the entry point.
//!
//! `scan.rs` checks statements, tobj reads them, and `mtl.rs` reads libraries. This module triangulates polygons, merges corners with equal position, normal and texture
//! coordinate, and leaves out triangles without area. Only normals in the file (`vn`) make smooth shading. Smoothing groups are ignored.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec2, DVec3, Vec3};

use self::scan::{Named, scan};
use super::polygon::triangulate;
use super::{Loader, Reader, Unread, beside, names, origin_of};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS};
use crate::scene::mesh::has_area;
use crate::scene::{Instance, Material, Mesh, Triangle, World};

mod mtl;
mod scan;

pub fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let cure = "name an existing OBJ file that you may read";
    let reader = loader.reader;
    let bytes = reader.read_named(path, MOST_BYTES).map_err(|unread| unread.error(path, None, "this model", cure))?;
    let scan = scan(path, &bytes)?;
    drop(bytes);
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
        // A later definition of a name replaces the earlier one.
        for material in mtl::load(loader, &library, &bytes)? {
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

    // tobj needs the names of the materials alone. The materials are read already.
    let (models, _) =
        tobj::load_obj_buf(&mut scan.text.as_bytes(), &tobj::LoadOptions::default(), |_| Ok((Vec::new(), by_name.clone())))
            .map_err(|error| Error::input(path, None, format!("this is not a valid OBJ: {error}"), "export the model again"))?;
    let positions = models.iter().flat_map(|model| model.mesh.positions.as_chunks::<3>().0);
    let origin = origin_of(positions.map(|&position| position.into()));
    let mut mesh = Mesh::default();
    let mut skipped = 0;
    for model in models.iter().map(|model| &model.mesh).filter(|model| !model.indices.is_empty()) {
        let material = model.material_id.unwrap_or_else(|| {
            materials.push(Material::default());
            materials.len() - 1
        });
        skipped += add_model(&mut mesh, model, origin, material as u32);
    }
    loader.skipped(path, skipped, mesh.triangles.len())?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let instances = vec![Instance { name, mesh: 0, transform: DAffine3::from_translation(origin), part: None }];
    Ok(World { meshes: vec![mesh], instances, materials, ..World::default() })
}

/// The files that a `mtllib` statement names, each with the statement's line.
fn library_files(reader: &Reader, obj: &Path, statement: &Named) -> Vec<(PathBuf, usize)> {
    // The statement is a list of files. But some exporters write a single name with spaces.
    let whole = beside(obj, &statement.name);
    if reader.has(&whole) {
        return vec![(whole, statement.line)];
    }
    statement.name.split_whitespace().map(|name| (beside(obj, name), statement.line)).collect()
}

/// Adds the faces of a model of tobj, which all have the same material. Only faces of the same model share vertices. Returns the number of
/// triangles without area.
fn add_model(mesh: &mut Mesh, model: &tobj::Mesh, origin: DVec3, material: u32) -> usize {
    let vec3 = |values: &[f64], index: u32| DVec3::from_slice(&values[3 * index as usize..]);
    let position = |index: u32| (vec3(&model.positions, index) - origin).as_vec3();
    let mut shared: HashMap<[u32; 3], u32> = HashMap::new();
    let mut skipped = 0;
    let mut first = 0;
    // tobj gives no arities if all faces are triangles.
    let triangles = vec![3; model.indices.len() / 3];
    for &arity in if model.face_arities.is_empty() { &triangles } else { &model.face_arities } {
        let face = first..first + arity as usize;
        first = face.end;
        let corners: Vec<Vec3> = model.indices[face.clone()].iter().map(|&index| position(index)).collect();
        let triangles = triangulate(&corners);
        if triangles.is_empty() {
            skipped += corners.len() - 2;
        }
        for triangle in triangles {
            if !has_area(triangle.map(|corner| corners[corner])) {
                skipped += 1;
                continue;
            }
            let vertices = triangle.map(|corner| {
                let at = face.start + corner;
                let key = [model.indices[at], model.texcoord_indices[at], model.normal_indices[at]];
                *shared.entry(key).or_insert_with(|| {
                    mesh.positions.push(position(key[0]));
                    mesh.uvs.push(DVec2::from_slice(&model.texcoords[2 * key[1] as usize..]).as_vec2());
                    mesh.normals.push(vec3(&model.normals, key[2]).as_vec3());
                    mesh.positions.len() as u32 - 1
                })
            });
            mesh.triangles.push(Triangle { vertices, material });
        }
    }
    skipped
}
