//! A world of one mesh, made of faces that share vertices. PLY and STL files are such models, and arrays in memory.

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, DVec3, Vec2, Vec3};

use super::polygon::{MOST_CORNERS, triangulate};
use super::warnings::{Fault, Place, Warnings};
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
    /// The material of each face. Empty: the first.
    pub materials: Vec<u32>,
}

/// A vertex as a file has it.
pub struct RawVertex {
    pub position: DVec3,
    pub normal: Option<DVec3>,
    pub uv: Option<Vec2>,
    pub color: Option<Vec3>,
}

/// Why a vertex cannot be at this position.
pub fn unusable(position: DVec3) -> Option<String> {
    if !position.is_finite() {
        return Some(format!("at {position}"));
    }
    (position.abs().max_element() > FARTHEST).then(|| format!("farther than {FARTHEST:e} from the origin"))
}

impl Indexed {
    /// Adds a vertex, and mends what is wrong with it.
    ///
    /// # Errors
    /// [`Error::Input`](crate::error::Error::Input) where faults are errors.
    pub fn push_vertex(&mut self, vertex: RawVertex, place: Place, warnings: &mut Warnings) -> Result<()> {
        let number = self.positions.len();
        let mut mend = |kind, problem: &dyn Fn() -> String, mend| {
            let cure = "correct it, or export the model again";
            warnings.mend(place, &Fault { kind, problem, mend, cure })
        };
        let RawVertex { position, normal, uv, color } = vertex;
        let problem = unusable(position);
        self.positions.push(if problem.is_some() { DVec3::NAN } else { position });
        if let Some(problem) = problem {
            mend("position", &|| format!("vertex {number} is {problem}"), "its faces are left out")?;
        }
        if let Some(normal) = normal {
            self.normals.push(normal.normalize_or_zero().as_vec3());
            if !normal.is_finite() {
                mend("normal", &|| format!("vertex {number} has the normal {normal}"), "it gets none")?;
            }
        }
        if let Some(uv) = uv {
            self.uvs.push(if uv.is_finite() { uv } else { Vec2::ZERO });
            if !uv.is_finite() {
                mend("uv", &|| format!("vertex {number} has the texture coordinates {uv}"), "they become 0")?;
            }
        }
        if let Some(color) = color {
            // Not a number becomes 0.
            let shown = color.max(Vec3::ZERO).min(Vec3::ONE);
            self.colors.push(shown);
            if shown != color {
                mend("color", &|| format!("vertex {number} has the colour {color}"), "it becomes one from 0 to 1")?;
            }
        }
        Ok(())
    }

    /// Adds a face of the corners that were added to `corners` since the last face.
    pub fn end_face(&mut self, line: Option<usize>) {
        self.ends.push(self.corners.len());
        self.lines.extend(line);
    }

    /// Leaves out faces that are no faces, and triangles without area, with a warning.
    pub fn into_world(self, loader: &mut Loader, path: &Path, materials: Vec<Material>) -> Result<World> {
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
                    let material = self.materials.get(face).copied().unwrap_or(0);
                    mesh.triangles.push(Triangle { vertices, material });
                } else {
                    skipped += 1;
                }
            }
        }
        loader.skipped(path, skipped, mesh.triangles.len())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let instances = vec![Instance { name, transform: DAffine3::from_translation(origin), ..Instance::default() }];
        Ok(World { meshes: vec![mesh], instances, materials, ..World::default() })
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
