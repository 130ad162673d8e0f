//! Scenes: validated data that the other stages only read.
//!
//! | file | role |
//! |---|---|
//! | `world.rs` | [`World`]: contents of the scene files, in world space; [`World::flatten`] makes the [`Scene`] |
//! | `format/` | [`World::load`] reads files into a [`World`]; a new mesh format goes there |
//! | `light/` | [`Lights`]: all emitters, sampled for photons and direct light; a new kind of light goes there |
//! | `mesh.rs`, `material.rs`, `texture.rs`, `camera.rs` | the parts of worlds and scenes |
//! | `unit_space.rs` | transforms between world space and unit space |
//! | `bvh.rs`, `flat_bvh.rs` | CPU ray queries, and a tree for shaders |
//! | `source_lists.rs` | the lists of vertices in a model's file |
//! | `smoothing.rs` | shading normals where a file has none |
//! | `winding.rs`, `reversed_lamps.rs` | which side is the front, and lamps of which it is the wrong one |
//! | `specular.rs` | paths through mirrors and glass |
//! | `opacity.rs` | cut-outs and partial opacity, and rays that pass through them |
//! | `gloss.rs`, `normal_map.rs` | reflection of glossy surfaces, and maps that turn shading normals |
//!
//! Coordinates are right-handed, in any unit of length. Surfaces are Lambertian, mirrors or glass. Both sides reflect with the same albedo. The front
//! emits: the side from which the triangle winds counter-clockwise. The back emits only if the material is two-sided.
//!
//! In a loaded world every index is in range, every number finite, every albedo in [0, 1], and every triangle has an area. Later stages rely on it.

use std::sync::Arc;

use glam::Vec3;

mod bvh;
mod camera;
mod digest;
mod flat_bvh;
mod format;
mod gloss;
mod light;
mod material;
mod mesh;
mod normal_map;
mod opacity;
mod ray_packet;
mod reversed_lamps;
mod shadow_packet;
mod smoothing;
mod source_lists;
mod specular;
mod texture;
mod unit_space;
mod winding;
mod world;

pub use bvh::{Bvh, Hit, RAY_OFFSET};
pub use camera::{Camera, CameraChange, Lens, WorldCamera};
pub use flat_bvh::FlatBvh;
pub(crate) use format::gltf;
pub use format::{Files, LoadOptions, LoadReport, Loaded, MeshArrays};
pub use gloss::{Brdf, GlossMeans, LobeShares, LobeWeights, facing};
pub use light::{
    Daylight, Environment, Focus, Lamp, LightChoice, LightSample, LightTree, Lights, PunctualKind, PunctualLight, Sky, Sun,
};
pub use material::{Gloss, Material, NormalMap, Opacity, Surface};
pub use mesh::{Mesh, Source, Triangle};
pub use opacity::{Chance, Rays};
pub(crate) use ray_packet::common;
pub use ray_packet::{LANES, Lanes, NO_TRIANGLE, PacketHits, RayPacket, SharedDirection, of_lane};
pub use reversed_lamps::reversed_lamps;
pub use shadow_packet::ShadowPacket;
pub use smoothing::FaceNormals;
pub use source_lists::SourceLists;
pub use specular::{MOST_SPECULAR, Path, Split, fresnel};
pub use texture::{ImageTexture, Sampler, WrapMode};
pub use unit_space::UnitSpace;
pub use world::{GltfFile, GltfPart, Instance, World};

/// All triangles of a [`World`] as one mesh in unit space. Passes draw it.
#[derive(Clone, Debug)]
pub struct Scene {
    pub mesh: Mesh,
    pub materials: Vec<Material>,
    pub textures: Vec<ImageTexture>,
    /// Radiance along rays that hit no surface. `None` is black.
    pub environment: Option<Environment>,
    /// Points, spots and directional lights, in unit space.
    pub lights: Vec<PunctualLight>,
    /// `None`: [`Scene::camera`] makes a camera that sees the whole scene.
    pub camera: Option<Camera>,
    /// Transform back to world space.
    pub space: UnitSpace,
    /// Those of the world, for [`Source::instance`].
    pub instances: Vec<Instance>,
    /// As in [`World::gltf`].
    pub gltf: Option<Arc<GltfFile>>,
    /// What [`Source`]s refer to.
    pub source_lists: SourceLists,
    /// As in [`World::file`].
    pub file: String,
    /// Of [`Self::gloss_mean`].
    pub gloss_means: GlossMeans,
}

impl Scene {
    pub fn material(&self, triangle: usize) -> &Material {
        &self.materials[self.mesh.triangles[triangle].material as usize]
    }

    /// The scene's camera, or else one that sees the whole scene in a picture of `size`.
    pub fn camera(&self, size: [u32; 2]) -> Camera {
        let positions = || self.mesh.positions.iter().map(|position| position.as_dvec3());
        self.camera.unwrap_or_else(|| WorldCamera::framing(positions(), size, &CameraChange::default()).in_own_space())
    }

    /// Radiance along a ray that hits no surface. The unit vector `direction` points along the ray.
    pub fn miss_radiance(&self, direction: Vec3) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |environment| environment.radiance(direction))
    }

    /// The part of [`Self::miss_radiance`] that gather rays bring. Direct light has the rest.
    pub fn gathered_radiance(&self, direction: Vec3) -> Vec3 {
        self.environment.as_ref().map_or(Vec3::ZERO, |environment| environment.gathered_radiance(direction))
    }

    /// Linear reflectance at a point of a triangle, from its barycentric coordinates. Of gloss it is what the material reflects of even light.
    pub fn albedo(&self, triangle: usize, barycentric: Vec3) -> Vec3 {
        let base = self.base_color(triangle, barycentric);
        if self.material(triangle).gloss.is_none() {
            return base;
        }
        let mean = self.gloss_mean(self.mesh.triangles[triangle].material as usize);
        mean.map_or(base, |[share, rest]| base * share + rest)
    }

    /// The same at a position on a triangle.
    pub fn albedo_at(&self, triangle: usize, position: Vec3) -> Vec3 {
        let even = self.even_albedo(self.mesh.triangles[triangle].material as usize);
        even.unwrap_or_else(|| self.albedo(triangle, self.mesh.barycentric(triangle, position)))
    }

    /// Multiplies a light of all hits of a packet by the reflectance there: red, green and blue.
    #[inline(always)]
    pub(crate) fn reflect(&self, hits: &PacketHits, positions: &[Lanes; 3], light: &mut [Lanes; 3]) {
        // All hits are mostly of one material.
        let mut materials = [NO_TRIANGLE; LANES];
        for (material, &triangle) in materials.iter_mut().zip(&hits.triangles).filter(|(_, triangle)| **triangle != NO_TRIANGLE) {
            *material = self.mesh.triangles[triangle as usize].material;
        }
        match common(&materials).and_then(|material| self.even_albedo(material as usize)) {
            Some(albedo) => {
                for (light, albedo) in light.iter_mut().zip(albedo.to_array()) {
                    light.iter_mut().for_each(|light| *light *= albedo);
                }
            }
            None => {
                for lane in (0..LANES).filter(|&lane| hits.triangles[lane] != NO_TRIANGLE) {
                    let position = Vec3::from(of_lane(positions, lane));
                    let albedo = self.albedo_at(hits.triangles[lane] as usize, position);
                    light.iter_mut().zip(albedo.to_array()).for_each(|(light, albedo)| light[lane] *= albedo);
                }
            }
        }
    }

    /// The reflectance of a material, if it is the same everywhere.
    fn even_albedo(&self, material: usize) -> Option<Vec3> {
        let Material { albedo, albedo_texture, gloss, .. } = &self.materials[material];
        (albedo_texture.is_none() && gloss.is_none() && self.mesh.colors.is_empty()).then_some(*albedo)
    }

    /// The colour of a surface there, without its gloss.
    pub fn base_color(&self, triangle: usize, barycentric: Vec3) -> Vec3 {
        let &Material { albedo, albedo_texture, .. } = self.material(triangle);
        let albedo = albedo * self.mesh.color(triangle, barycentric);
        let Some(texture) = albedo_texture else { return albedo };
        albedo * self.textures[texture].sample_linear(self.mesh.uv(triangle, barycentric))
    }

    /// Radiance that the front or the back emits at a point of a triangle, from its barycentric coordinates. The twin of `emission` in
    /// `glsl/include/albedo.glsl`.
    pub fn emission(&self, triangle: usize, barycentric: Vec3, front: bool) -> Vec3 {
        let material = self.material(triangle);
        let emission = material.emission_of(front);
        match material.emission_texture {
            Some(texture) if emission != Vec3::ZERO => {
                emission * self.textures[texture].sample_linear(self.mesh.uv(triangle, barycentric))
            }
            _ => emission,
        }
    }

    /// Whether the emission varies over a triangle, by textures.
    pub fn has_pictures_of_emission(&self) -> bool {
        self.materials.iter().any(|material| material.emission_texture.is_some() && material.is_emissive())
    }

    /// Whether the reflectance of hits is not that of the material alone: it has textures, vertex colours or gloss.
    pub fn is_textured(&self) -> bool {
        let varies = |material: &Material| material.albedo_texture.is_some() || material.shaded_gloss().is_some();
        !self.mesh.colors.is_empty() || self.materials.iter().any(varies)
    }

    /// Whether a surface is glossy.
    pub fn is_glossy(&self) -> bool {
        self.uses(|material| material.shaded_gloss().is_some())
    }

    /// Whether light may come to a diffuse surface by mirrors, glass and narrow lobes alone.
    pub fn has_caustics(&self) -> bool {
        self.uses(|material| material.is_specular() || material.may_be_narrow())
    }

    /// Whether a normal map turns shading normals.
    pub fn has_normal_maps(&self) -> bool {
        self.uses(|material| material.normal_map.is_some())
    }

    /// Whether a surface has a material of which `is` holds. Few scenes look at all their triangles for that.
    fn uses(&self, is: impl Fn(&Material) -> bool) -> bool {
        let of_triangle = |triangle: &Triangle| is(&self.materials[triangle.material as usize]);
        self.materials.iter().any(&is) && self.mesh.triangles.iter().any(of_triangle)
    }

    /// Whether any surface is a mirror or glass.
    pub fn is_specular(&self) -> bool {
        self.uses(Material::is_specular)
    }

    /// The indices of the triangles that are no glass. [`Self::without_glass`] keeps them in this order.
    pub fn not_glass(&self) -> Vec<u32> {
        let is_glass = |triangle: usize| self.material(triangle).is_glass();
        (0..self.mesh.triangles.len()).filter(|&triangle| !is_glass(triangle)).map(|triangle| triangle as u32).collect()
    }

    /// The scene without glass; `None` if it has none. Gather rays ignore glass, and treat a mirror as a Lambertian surface of its albedo.
    pub fn without_glass(&self) -> Option<Self> {
        let is_glass = |triangle: &Triangle| self.materials[triangle.material as usize].is_glass();
        self.mesh.triangles.iter().any(is_glass).then(|| {
            let mut rest = self.clone();
            rest.mesh.triangles.retain(|triangle| !is_glass(triangle));
            rest
        })
    }
}
