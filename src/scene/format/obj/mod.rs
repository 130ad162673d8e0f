//! Wavefront OBJ with its material libraries (MTL). It becomes one mesh and one instance. [`load`] is the entry point.
//!
//! `scan.rs` reads statements, `mtl.rs` libraries. This module triangulates polygons, merges corners with equal position, normal and texture
//! coordinate, and leaves out triangles without area. Only normals in the file (`vn`) make smooth shading. Smoothing groups are ignored.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::Vec3;

use self::scan::{Named, Run, Scan};
use super::polygon::triangulate;
use super::{Loader, Reader, Unread, beside, names};
use crate::error::{Error, Result};
use crate::file::{MOST_BYTES, MOST_WORDS};
use crate::scene::mesh::has_area;
use crate::scene::{Instance, Material, Mesh, Surface, Triangle, World};

mod mtl;
mod scan;

pub fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let cure = "name an existing OBJ file that you may read";
    let reader = loader.reader;
    let bytes = reader.read_named(path, MOST_BYTES).map_err(|unread| unread.error(path, None, "this model", cure))?;
    let scan = Scan::new(path, &bytes)?;
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

    let mut mesh = Mesh::default();
    let mut skipped = 0;
    for run in scan.runs.iter().filter(|run| !run.faces.is_empty()) {
        let material = run.material.map_or_else(
            || {
                let (name, albedo, surface) = ("default".into(), mtl::GREY, Surface::Diffuse);
                materials.push(Material { name, albedo, emission: Vec3::ZERO, albedo_texture: None, surface });
                materials.len() - 1
            },
            |used| by_name[&scan.materials[used].name],
        );
        skipped += add_run(&mut mesh, &scan, run, material as u32);
    }
    let total = skipped + mesh.triangles.len();
    match skipped {
        0 => {}
        _ if skipped == total => {
            let cure = "check the export's scale, and that vertices differ";
            return Err(Error::input(path, None, format!("none of the {total} triangles has an area"), cure));
        }
        1 => loader.warnings.push(format!("1 of {total} triangles has no area and was skipped")),
        _ => loader.warnings.push(format!("{skipped} of {total} triangles have no area and were skipped")),
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let instances = vec![Instance { name, ..Instance::default() }];
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

/// Adds the faces of a run. Only faces of the same run share vertices. Returns the number of triangles without area.
fn add_run(mesh: &mut Mesh, scan: &Scan, run: &Run, material: u32) -> usize {
    let mut shared: HashMap<[u32; 3], u32> = HashMap::new();
    let mut skipped = 0;
    for face in &run.faces {
        let face = &scan.corners[face.clone()];
        let positions: Vec<Vec3> = face.iter().map(|&[position, ..]| scan.positions[position as usize]).collect();
        let triangles = triangulate(&positions);
        if triangles.is_empty() {
            skipped += face.len() - 2;
        }
        for triangle in triangles {
            if !has_area(triangle.map(|corner| positions[corner])) {
                skipped += 1;
                continue;
            }
            let vertices = triangle.map(|corner| {
                let [position, uv, normal] = face[corner];
                *shared.entry(face[corner]).or_insert_with(|| {
                    mesh.positions.push(scan.positions[position as usize]);
                    mesh.uvs.push(scan.uvs[uv as usize]);
                    mesh.normals.push(scan.normals[normal as usize]);
                    mesh.positions.len() as u32 - 1
                })
            });
            mesh.triangles.push(Triangle { vertices, material });
        }
    }
    skipped
}
