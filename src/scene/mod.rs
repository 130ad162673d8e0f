//! The scene: plain, validated data that the other stages only read.
//!
//! Right-handed world coordinates, any unit of length. Surfaces are Lambertian and two-sided: both sides reflect with the
//! same albedo. Emission leaves the front side only, the one from which the triangle winds counter-clockwise.
//!
//! [`Scene::load`] is the entry point. After it returns, every index is in range, every number is finite, every albedo lies in
//! [0, 1], every triangle has an area, and at least one triangle emits; later stages rely on that and check nothing again.

use glam::{Vec2, Vec3};

use crate::settings::Settings;

mod load;
mod obj;
mod texture;

/// Everything that is rendered.
#[derive(Clone, Debug)]
pub struct Scene {
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub camera: Camera,
    /// Defaults overridden by the scene file.
    pub settings: Settings,
    /// What was mended or looks wrong, in sentences for a person (degenerate triangles skipped, unused files).
    pub warnings: Vec<String>,
}

/// Triangles with shared vertices.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one a vertex; zero where the face's own normal is meant (flat shading).
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a vertex, v up; zero where the file has none.
    pub uvs: Vec<Vec2>,
    pub triangles: Vec<Triangle>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Into [`Mesh::positions`] and its siblings; counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Into [`Scene::materials`].
    pub material: u32,
}

/// A Lambertian surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear reflectance in [0, 1], RGB; a texture multiplies it.
    pub albedo: Vec3,
    /// Radiance emitted from the front, RGB, W/(m² sr) in each channel.
    pub emission: Vec3,
    /// Into [`Scene::textures`].
    pub albedo_texture: Option<usize>,
}

/// An sRGB-encoded picture, repeated in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    pub width: u32,
    pub height: u32,
    /// RGBA, row by row, the top row (v = 1) first; alpha is ignored.
    pub texels: Vec<[u8; 4]>,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub eye: Vec3,
    pub target: Vec3,
    pub up: Vec3,
    /// Full vertical angle of view.
    pub fov_y_degrees: f32,
}
