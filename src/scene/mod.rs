//! The scene: plain, validated data that the other stages only read.
//!
//! Right-handed world coordinates, any unit of length. Surfaces are Lambertian, mirrors or glass, and two-sided: both sides reflect with the
//! same albedo. Emission leaves the front side only, the one from which the triangle winds counter-clockwise.
//!
//! [`Scene::load`] is the entry point. After it returns, every index is in range, every number is finite, every albedo lies in
//! [0, 1], every triangle has an area, and at least one triangle or the environment sends light; later stages rely on that and check nothing again.

use std::path::PathBuf;

use glam::{Vec2, Vec3};

use crate::environment::Environment;
use crate::math::Aabb;
use crate::settings::Settings;

mod bvh;
mod camera;
mod digest;
mod files;
mod flat_bvh;
mod light;
mod load;
mod mtl;
mod obj;
mod polygon;
mod scan;
mod specular;
mod texture;
mod unit_space;

pub use bvh::{Bvh, Hit, RAY_OFFSET};
pub use files::Files;
pub use flat_bvh::FlatBvh;
pub use light::{LightPoint, Lights};
pub use load::LoadOptions;
pub use specular::{MOST_SPECULAR, Path, Split, fresnel};
pub use unit_space::UnitSpace;

/// Everything that is rendered.
#[derive(Clone, Debug)]
pub struct Scene {
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// What is seen where no surface is; black without.
    pub environment: Option<Environment>,
    pub camera: Camera,
    /// Whether the camera was framed to fit, for `settings.size`; a render of another size frames it again.
    pub framed: bool,
    /// Defaults overridden by the scene file.
    pub settings: Settings,
    /// What was mended or looks wrong, in sentences for a person (degenerate triangles skipped, unused files).
    pub warnings: Vec<String>,
    /// What it was read from: the scene file, and all that it names.
    pub files: Vec<PathBuf>,
}

impl Scene {
    /// The material of a triangle.
    pub fn material(&self, triangle: usize) -> &Material {
        &self.materials[self.mesh.triangles[triangle].material as usize]
    }

    /// Radiance that comes from beyond all surfaces, from where the unit vector `direction` points.
    pub fn beyond(&self, direction: Vec3) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |environment| environment.radiance(direction))
    }

    /// Whether light comes from beyond.
    pub fn has_sky(&self) -> bool {
        self.environment.as_ref().is_some_and(|environment| environment.power() > 0.0)
    }

    /// Linear reflectance at a point of a triangle, by the weights of its three corners.
    pub fn albedo(&self, triangle: usize, barycentric: Vec3) -> Vec3 {
        let &Material { albedo, albedo_texture, .. } = self.material(triangle);
        let Some(texture) = albedo_texture else { return albedo };
        let [a, b, c] = self.mesh.triangles[triangle].vertices.map(|vertex| self.mesh.uvs[vertex as usize]);
        albedo * self.textures[texture].sample_linear(a * barycentric.x + b * barycentric.y + c * barycentric.z)
    }

    /// Whether anything is a mirror or glass.
    pub fn is_specular(&self) -> bool {
        (0..self.mesh.triangles.len()).any(|triangle| self.material(triangle).surface != Surface::Diffuse)
    }

    /// What gather rays see, where that is not the whole scene: they pass straight through glass. A mirror is to them a Lambertian surface
    /// that reflects as much.
    pub fn without_glass(&self) -> Option<Self> {
        let glass = |triangle: &Triangle| matches!(self.materials[triangle.material as usize].surface, Surface::Glass { .. });
        self.mesh.triangles.iter().any(glass).then(|| {
            let mut rest = self.clone();
            rest.mesh.triangles.retain(|triangle| !glass(triangle));
            rest
        })
    }
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

impl Mesh {
    pub fn bounds(&self) -> Aabb {
        Aabb::from_points(self.positions.iter().copied())
    }

    /// The corners' positions.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].vertices.map(|vertex| self.positions[vertex as usize])
    }

    /// The unit normal of the face, on its front side; in f64, as thin triangles need.
    pub fn geometric_normal(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners(triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a).normalize().as_vec3()
    }

    /// That normal, turned to the side that a ray along `direction` meets.
    pub fn side_met(&self, triangle: usize, direction: Vec3) -> Vec3 {
        let normal = self.geometric_normal(triangle);
        if normal.dot(direction) < 0.0 { normal } else { -normal }
    }

    /// The unit shading normal at a point of the triangle, on the side of `side`, the face's own normal there.
    pub fn shading_normal(&self, triangle: usize, barycentric: Vec3, side: Vec3) -> Vec3 {
        let [a, b, c] = self.triangles[triangle].vertices.map(|vertex| self.normals[vertex as usize]);
        let normal = a * barycentric.x + b * barycentric.y + c * barycentric.z;
        // As in glsl/visible_points.frag.
        if normal.length_squared() < 1e-12 {
            return side;
        }
        let normal = normal.normalize();
        if normal.dot(side) < 0.0 { -normal } else { normal }
    }

    pub fn area(&self, triangle: usize) -> f32 {
        let [a, b, c] = self.corners(triangle);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Weights of the corners at a point of the triangle.
    pub fn barycentric(&self, triangle: usize, position: Vec3) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        let normal = (b - a).cross(c - a);
        let weight = |from: Vec3, to: Vec3| (to - from).cross(position - from).dot(normal) / normal.length_squared();
        let (u, v) = (weight(c, a), weight(a, b));
        Vec3::new(1.0 - u - v, u, v)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Triangle {
    /// Into [`Mesh::positions`] and its siblings; counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// Into [`Scene::materials`].
    pub material: u32,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear reflectance in [0, 1], RGB; a texture multiplies it.
    pub albedo: Vec3,
    /// Radiance emitted from the front, RGB, W/(m² sr) in each channel.
    pub emission: Vec3,
    /// Into [`Scene::textures`].
    pub albedo_texture: Option<usize>,
    pub surface: Surface,
}

/// What a surface does with the light that meets it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Surface {
    /// Reflects it by Lambert's law.
    #[default]
    Diffuse,
    /// Reflects it in one direction; the albedo is what it keeps.
    Mirror,
    /// Reflects and refracts it; the albedo means nothing.
    Glass {
        /// Index of refraction of what is behind the fronts, over that of what is before them.
        index: f32,
        /// What a body lets pass of the light that does not turn back, half of it (the square root) at each of two faces.
        filter: Vec3,
    },
}

impl Surface {
    /// Itself, or what is wrong with it and the cure.
    pub fn check(self) -> Result<Self, (String, &'static str)> {
        match self {
            Self::Glass { index, .. } if !(1.0..=10.0).contains(&index) => {
                Err((format!("index of refraction is {index}"), "give a number from 1 to 10; glass has 1.5"))
            }
            Self::Glass { filter, .. } if !filter.to_array().iter().all(|share| (0.0..=1.0).contains(share)) => {
                Err((format!("filter is {filter}"), "give a share from 0 to 1 for each of red, green and blue"))
            }
            _ => Ok(self),
        }
    }
}

impl Material {
    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }
}

/// An sRGB-encoded picture, repeated in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    pub width: u32,
    pub height: u32,
    /// RGBA, row by row, the top row (v = 1) first; alpha is ignored.
    pub texels: Vec<[u8; 4]>,
}

/// A pinhole camera, or one with a thin lens in place of the hole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub eye: Vec3,
    pub target: Vec3,
    pub up: Vec3,
    /// Full vertical angle of view.
    pub fov_y_degrees: f32,
    pub lens: Option<Lens>,
}

/// A thin lens about the eye, across the direction of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    pub radius: f32,
    /// Along the direction of view; what is there is sharp.
    pub focus_distance: f32,
}

/// Whether a normal can be computed in f32, on the GPU for one: the cross product of the edges must stand out from the
/// rounding of its terms, and its square must not underflow.
fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > (longest * 1e-6).max(1e-18)
}
