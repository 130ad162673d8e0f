//! Wavefront OBJ with its material libraries (MTL). Each object becomes a mesh with an instance. [`load`] is the entry point.
//!
//! `scan.rs` reads statements and mends them, `faces.rs` writes faces for tobj, which groups them and merges equal corners. `materials.rs` finds
//! libraries and `mtl.rs` reads them. This module triangulates polygons and leaves out triangles without area. Only normals in the file (`vn`) make
//! smooth shading. Smoothing groups are ignored.

use std::path::Path;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use self::materials::Materials;
use self::scan::{Scan, VertexLists, scan};
use self::text::Decoder;
use super::polygon::triangulate;
use super::warnings::{Fault, Place};
use super::{Loader, origin_of};
use crate::error::{Error, Result};
use crate::image::decode_srgb;
use crate::scene::mesh::has_area;
use crate::scene::{Instance, Material, Mesh, Source, Triangle, World};

mod faces;
mod gloss;
mod materials;
mod mtl;
mod number;
mod picture;
mod scan;
mod search;
mod text;
mod unshaded;

pub fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let bytes = loader.read_model(path, "OBJ")?;
    let mut decoder = Decoder::default();
    let text = decoder.decode(&mut loader.warnings, path, &bytes)?;
    let mut scan = scan(&mut loader.warnings, &mut decoder, path, &text)?;
    drop(text);
    drop(bytes);
    decode_colors(loader, path, &mut scan.vertices.colors)?;
    let materials = Materials::read(loader, &mut decoder, path, &scan)?;

    // tobj needs the names of the materials alone. The materials are read already.
    let used = || materials.used.iter().enumerate().map(|(name, &index)| (name.to_string(), index)).collect();
    let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let text = std::mem::take(&mut scan.text);
    let (models, _) = tobj::load_obj_buf(&mut text.as_bytes(), &options, |_| Ok((Vec::new(), used())))
        .map_err(|error| Error::input(path, None, format!("this is not a valid OBJ: {error}"), "export the model again"))?;
    drop(text);

    let positions = &scan.vertices.positions;
    let used =
        models.iter().flat_map(|model| model.mesh.positions.iter().step_by(3)).map(|&number| positions[number as usize - 1]);
    let origin = origin_of(used);
    let mut builder = MeshBuilder::new(&scan, materials, origin);
    models.into_iter().for_each(|model| builder.add(&model.mesh, model.name.parse().ok()));
    builder.finish(loader, path)
}

/// Decodes colours, which are in sRGB from 0 to 1, or from 0 to 255.
fn decode_colors(loader: &mut Loader, path: &Path, colors: &mut [Vec3]) -> Result<()> {
    // One odd number does not make bytes of all: most colours that are not black must be beyond 1.
    let lit = || colors.iter().filter(|color| color.is_finite() && color.max_element() > 0.0);
    let bytes = lit().filter(|color| mtl::is_bytes(**color)).count();
    let scale = if 2 * bytes > lit().count() { 255.0 } else { 1.0 };
    let place = Place { path, line: None };
    if scale > 1.0 {
        loader
            .warnings
            .tell(place, "colour bytes", &|| "the vertex colours are numbers to 255; they are divided by 255".to_owned());
    }
    let is_outside = |color: &&mut Vec3| !color.is_nan() && (color.min_element() < 0.0 || color.max_element() > scale);
    for color in colors.iter_mut().filter(is_outside) {
        let problem = || format!("vertex colour {color} is outside 0 to {scale}");
        loader
            .warnings
            .mend(place, &Fault { kind: "colour", problem: &problem, mend: "it is clamped", cure: "give numbers from 0 to 1" })?;
    }
    for color in colors.iter_mut().filter(|color| !color.is_nan()) {
        *color = (*color / scale).clamp(Vec3::ZERO, Vec3::ONE).to_array().map(decode_srgb).into();
    }
    Ok(())
}

/// Makes meshes of the models of tobj. A model has faces of one object and one material that follow each other.
struct MeshBuilder<'a> {
    vertices: &'a VertexLists,
    names: &'a [String],
    materials: Materials,
    origin: DVec3,
    /// Index of the material of faces without any.
    default: Option<u32>,
    /// Meshes, with the indices of the objects' names, in the order of their first faces.
    meshes: Vec<(Option<usize>, Mesh)>,
    /// Index into `meshes` of each object; that of faces before the first object comes last.
    by_object: Vec<Option<usize>>,
    /// Number of triangles without area.
    skipped: usize,
}

impl<'a> MeshBuilder<'a> {
    fn new(scan: &'a Scan, mut materials: Materials, origin: DVec3) -> Self {
        let (vertices, names) = (&scan.vertices, &scan.objects[..]);
        if !vertices.colors.is_empty() {
            // Where no material says otherwise, the colours themselves show.
            let defined = materials.placements.len();
            materials.list[defined..].iter_mut().for_each(|material| material.albedo = Vec3::ONE);
        }
        let by_object = vec![None; names.len() + 1];
        Self { vertices, names, materials, origin, default: None, meshes: Vec::new(), by_object, skipped: 0 }
    }

    /// Adds the faces of a model. Only faces of the same model share vertices.
    fn add(&mut self, model: &tobj::Mesh, object: Option<usize>) {
        if model.indices.is_empty() {
            return;
        }
        let material = match model.material_id {
            Some(material) => material as u32,
            None => self.default_material(),
        };
        let meshes = &mut self.meshes;
        let index = *self.by_object[object.unwrap_or(self.names.len())].get_or_insert_with(|| {
            meshes.push((object, Mesh::default()));
            meshes.len() - 1
        });
        // Taken out, so that vertices can be made meanwhile.
        let mut mesh = std::mem::take(&mut self.meshes[index].1);
        let positions: Vec<Vec3> = model
            .positions
            .iter()
            .step_by(3)
            .map(|&number| (self.vertices.positions[number as usize - 1] - self.origin).as_vec3())
            .collect();
        let mut shared = vec![u32::MAX; positions.len()];
        let mut corners = Vec::new();
        let mut first = 0;
        // tobj gives no arities if all faces are triangles.
        let triangles = vec![3; if model.face_arities.is_empty() { model.indices.len() / 3 } else { 0 }];
        for &arity in if model.face_arities.is_empty() { &triangles } else { &model.face_arities } {
            let face = &model.indices[first..first + arity as usize];
            first += arity as usize;
            corners.clear();
            corners.extend(face.iter().map(|&vertex| positions[vertex as usize]));
            let triangles = triangulate(&corners);
            if triangles.is_empty() {
                self.skipped += corners.len() - 2;
            }
            for triangle in triangles {
                if !has_area(triangle.map(|corner| corners[corner])) {
                    self.skipped += 1;
                    continue;
                }
                let vertices = triangle.map(|corner| {
                    let vertex = face[corner] as usize;
                    if shared[vertex] == u32::MAX {
                        shared[vertex] = mesh.positions.len() as u32;
                        mesh.positions.push(positions[vertex]);
                        self.push_vertex(&mut mesh, model, vertex, material);
                    }
                    shared[vertex]
                });
                mesh.triangles.push(Triangle { vertices, material });
            }
        }
        self.meshes[index].1 = mesh;
    }

    /// Adds all but the position of a vertex, which the model has as numbers in the lists of the file. 0 is none.
    fn push_vertex(&self, mesh: &mut Mesh, model: &tobj::Mesh, vertex: usize, material: u32) {
        let [position, uv, normal] = [model.positions[3 * vertex], model.texcoords[2 * vertex], model.normals[3 * vertex]]
            .map(|number| (number as usize).checked_sub(1));
        let position = position.unwrap_or(0);
        let placement = self.materials.placements.get(material as usize).copied().unwrap_or_default();
        let uv = uv.map(|uv| self.vertices.uvs[uv]).filter(|uv| !uv.is_nan());
        mesh.uvs.push(uv.map_or(Vec2::ZERO, |uv| uv * placement.scale + placement.offset));
        mesh.normals.push(normal.map_or(Vec3::ZERO, |normal| self.vertices.normals[normal]));
        mesh.sources.push(Source { instance: 0, index: position as u32 });
        if !self.vertices.colors.is_empty() {
            let unsaid = match self.materials.placements.len() > material as usize {
                true => Vec3::ONE,
                // Its albedo is 1, for the sake of the vertices with colours.
                false => Material::GREY,
            };
            let color = self.vertices.colors.get(position).copied().filter(|color| !color.is_nan());
            mesh.colors.push(color.unwrap_or(unsaid));
        }
    }

    fn default_material(&mut self) -> u32 {
        *self.default.get_or_insert_with(|| {
            let albedo = if self.vertices.colors.is_empty() { Material::GREY } else { Vec3::ONE };
            self.materials.list.push(Material { albedo, ..Material::default() });
            self.materials.list.len() as u32 - 1
        })
    }

    fn finish(mut self, loader: &mut Loader, path: &Path) -> Result<World> {
        self.meshes.retain(|(_, mesh)| !mesh.triangles.is_empty());
        let kept = self.meshes.iter().map(|(_, mesh)| mesh.triangles.len()).sum();
        loader.skipped(path, self.skipped, kept)?;
        let own = path.file_stem().unwrap_or_default().to_string_lossy();
        let mut world = World { materials: self.materials.list, has_one_list: true, ..World::default() };
        for (object, mut mesh) in self.meshes {
            let name =
                object.map(|object| self.names[object].as_str()).filter(|name| !name.is_empty()).unwrap_or(&own).to_owned();
            let transform = DAffine3::from_translation(self.origin);
            world.instances.push(Instance { name, mesh: world.meshes.len(), transform, part: None });
            mesh.source_count = self.vertices.positions.len() as u32;
            world.meshes.push(mesh);
        }
        Ok(world)
    }
}
