//! A world of arrays in memory, as programs have them. What is wrong in them is mended as in a file.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};

use super::Loader;
use super::indexed::{Indexed, RawVertex};
use super::warnings::Place;
use crate::error::{Error, Result};
use crate::scene::{ImageTexture, Material, World};

/// A mesh of faces with shared vertices. Lists of attributes have one entry for each vertex, or none.
#[derive(Clone, Debug, Default)]
pub struct MeshArrays {
    /// Stands for the name of a file in messages.
    pub name: String,
    /// In world space.
    pub positions: Vec<DVec3>,
    /// Of any length but 0. Without them, faces are flat.
    pub normals: Vec<DVec3>,
    /// Coordinates on the texture, v up.
    pub uvs: Vec<Vec2>,
    /// Linear colours from 0 to 1, which multiply the albedo.
    pub colors: Vec<Vec3>,
    /// Indices of vertices, face after face, counter-clockwise seen from the front. One that is no vertex makes no face.
    pub faces: Vec<u32>,
    /// Corners of each face, 3 or more.
    pub corners: usize,
    /// Albedo and emission. At least one.
    pub materials: Vec<Material>,
    /// The material of each face. Empty: the first.
    pub material_of: Vec<u32>,
    /// For the materials.
    pub textures: Vec<ImageTexture>,
}

impl MeshArrays {
    /// Checks that the lists fit each other.
    fn check(&self) -> Result<()> {
        let count = self.positions.len();
        let of_vertices = [("normals", self.normals.len()), ("uv", self.uvs.len()), ("colours", self.colors.len())];
        if let Some((name, length)) = of_vertices.into_iter().find(|&(_, length)| length != 0 && length != count) {
            return Err(Error::usage(format!("{name}: {length} rows for {count} vertices"), "give one row a vertex, or none"));
        }
        if self.corners < 3 || !self.faces.len().is_multiple_of(self.corners) {
            let problem = format!("faces: {} indices for faces of {} corners", self.faces.len(), self.corners);
            return Err(Error::usage(problem, "give three corners or more, and the same number for each face"));
        }
        let (faces, materials) = (self.faces.len() / self.corners, self.material_of.len());
        if materials != 0 && materials != faces {
            return Err(Error::usage(format!("materials: {materials} rows for {faces} faces"), "give one row a face, or none"));
        }
        if self.material_of.iter().any(|&material| material as usize >= self.materials.len()) || self.materials.is_empty() {
            return Err(Error::usage("a face has a material that is not there", "give all materials that faces name"));
        }
        let textures = self.materials.iter().flat_map(|material| [material.albedo_texture, material.emission_texture]);
        if textures.flatten().any(|texture| texture >= self.textures.len()) {
            return Err(Error::usage("a material has a texture that is not there", "give all textures that materials name"));
        }
        Ok(())
    }
}

pub fn load(loader: &mut Loader, path: &Path, arrays: MeshArrays) -> Result<World> {
    arrays.check()?;
    let MeshArrays { positions, normals, uvs, colors, faces, corners, materials, material_of, textures, .. } = arrays;
    let mut model = Indexed { materials: material_of, ..Indexed::default() };
    for (vertex, position) in positions.into_iter().enumerate() {
        let normal = normals.get(vertex).copied();
        let (uv, color) = (uvs.get(vertex).copied(), colors.get(vertex).copied());
        model.push_vertex(RawVertex { position, normal, uv, color }, Place { path, line: None }, &mut loader.warnings)?;
    }
    for face in faces.chunks_exact(corners) {
        model.corners.extend(face);
        model.end_face(None);
    }
    loader.textures.list.extend(textures);
    model.into_world(loader, path, materials)
}
