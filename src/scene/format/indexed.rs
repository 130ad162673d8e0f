//! A world of one mesh and one material, made of faces that share vertices. PLY and STL files are such models.

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::polygon::{MOST_CORNERS, triangulate};
use super::warnings::{Fault, Place};
use super::{Loader, origin_of};
use crate::error::Result;
use crate::scene::format::FARTHEST;
use crate::scene::mesh::has_area;
use crate::scene::{Instance, Material, Mesh, Source, Triangle, World};

/// Faces as a file has them. Lists of attributes have one entry for each vertex, or none.
#[derive(Default)]
pub struct Indexed {
    /// The file's own list of vertices, in world space. Faces at a position that is not finite are left out. The loader tells why, see [`unusable`].
    pub positions: Vec<DVec3>,
    /// Unit normals, or zero.
    pub normals: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    /// Linear, in [0, 1].
    pub colors: Vec<Vec3>,
    /// Vertices of all faces, one face after the other.
    pub corners: Vec<u32>,
    /// Texture coordinates of the corners, which replace those of vertices. Empty if there are none.
    pub corner_uvs: Vec<Vec2>,
    /// End of each face in `corners`.
    pub ends: Vec<usize>,
    /// The line of each face in the file. Empty if it has no lines.
    pub lines: Vec<usize>,
}

/// Why a vertex cannot be at this position.
pub fn unusable(position: DVec3) -> Option<String> {
    if !position.is_finite() {
        return Some(format!("at {position}"));
    }
    (position.abs().max_element() > FARTHEST).then(|| format!("farther than {FARTHEST:e} from the origin"))
}

impl Indexed {
    /// Adds a face of the corners that were added to `corners` since the last face.
    pub fn end_face(&mut self, line: Option<usize>) {
        self.ends.push(self.corners.len());
        self.lines.extend(line);
    }

    /// Leaves out faces that are no faces, and triangles without area, with a warning.
    pub fn into_world(self, loader: &mut Loader, path: &Path, material: Material) -> Result<World> {
        let origin = origin_of(self.positions.iter().copied().filter(|position| position.is_finite()));
        let mut mesh = Mesh { source_count: self.positions.len() as u32, ..Mesh::default() };
        let mut shared = Shared { index_of: vec![u32::MAX; self.positions.len()], split: HashMap::new() };
        let (mut first, mut skipped) = (0, 0);
        for (face, &end) in self.ends.iter().enumerate() {
            let range = first..end;
            first = end;
            if let Some(fault) = self.fault(&self.corners[range.clone()]) {
                let problem = || format!("face {face} {}", fault.1);
                let cure = "correct the face, or export the model again";
                let place = Place { path, line: self.lines.get(face).copied() };
                loader.warnings.mend(place, &Fault { kind: fault.0, problem: &problem, mend: "the face is left out", cure })?;
                continue;
            }
            let local = |at: usize| (self.positions[self.corners[at] as usize] - origin).as_vec3();
            let corners: Vec<Vec3> = range.clone().map(local).collect();
            if !corners.iter().all(|corner| corner.is_finite()) {
                continue;
            }
            let triangles = triangulate(&corners);
            if triangles.is_empty() {
                skipped += corners.len() - 2;
            }
            for triangle in triangles {
                if has_area(triangle.map(|corner| corners[corner])) {
                    let vertices = triangle.map(|corner| shared.vertex(&mut mesh, &self, range.start + corner, corners[corner]));
                    mesh.triangles.push(Triangle { vertices, material: 0 });
                } else {
                    skipped += 1;
                }
            }
        }
        loader.skipped(path, skipped, mesh.triangles.len())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let instances = vec![Instance { name, transform: DAffine3::from_translation(origin), ..Instance::default() }];
        Ok(World { meshes: vec![mesh], instances, materials: vec![material], ..World::default() })
    }

    /// What is wrong with a face, if anything: its kind, and the problem.
    fn fault(&self, corners: &[u32]) -> Option<(&'static str, String)> {
        let count = self.positions.len();
        if !(3..=MOST_CORNERS).contains(&corners.len()) {
            return Some(("corners", format!("has {} corners, and 3 to {MOST_CORNERS} can be drawn", corners.len())));
        }
        let outside = corners.iter().find(|&&corner| corner as usize >= count)?;
        let outside = if *outside == u32::MAX { "no vertex".to_owned() } else { format!("vertex {outside}") };
        Some(("index", format!("refers to {outside} of {count}, counted from 0")))
    }
}

/// Finds the vertices of corners in the mesh.
struct Shared {
    /// By vertex of the file. `u32::MAX` if the mesh has none yet.
    index_of: Vec<u32>,
    /// By vertex of the file and the bits of a corner's texture coordinates.
    split: HashMap<(u32, [u32; 2]), u32>,
}

impl Shared {
    /// The vertex of the mesh for a corner, at a place relative to the origin of the mesh.
    fn vertex(&mut self, mesh: &mut Mesh, from: &Indexed, at: usize, position: Vec3) -> u32 {
        let vertex = from.corners[at] as usize;
        let new = mesh.positions.len() as u32;
        let corner_uv = from.corner_uvs.get(at);
        let index = match corner_uv {
            Some(uv) => self.split.entry((from.corners[at], uv.to_array().map(f32::to_bits))).or_insert(u32::MAX),
            None => &mut self.index_of[vertex],
        };
        if *index == u32::MAX {
            *index = new;
            mesh.positions.push(position);
            mesh.normals.push(from.normals.get(vertex).copied().unwrap_or_default());
            mesh.uvs.push(corner_uv.or(from.uvs.get(vertex)).copied().unwrap_or_default());
            mesh.colors.extend(from.colors.get(vertex));
            mesh.sources.push(Source { instance: 0, index: from.corners[at] });
        }
        *index
    }
}
