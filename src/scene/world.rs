//! The world: contents of the scene files in world space. [`World::flatten`] makes the scene that passes draw.

use std::collections::HashSet;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::mesh::has_area;
use super::{
    CameraChange, Environment, Files, GlossMeans, ImageTexture, Material, Mesh, PunctualLight, Scene, Source, SourceLists,
    Surface, Triangle, UnitSpace, WorldCamera,
};

/// A world of meshes. Each mesh can be placed several times.
///
/// Emissive materials, the environment and the lights without a surface emit. [`Lights::new`](super::Lights::new) collects them from the flat scene.
#[derive(Clone, Debug, Default)]
pub struct World {
    pub meshes: Vec<Mesh>,
    pub instances: Vec<Instance>,
    /// The triangles of all meshes refer to these.
    pub materials: Vec<Material>,
    pub textures: Vec<ImageTexture>,
    /// Cameras with their names. A render uses the first. Without a camera it shows the whole world.
    pub cameras: Vec<(String, WorldCamera)>,
    /// Radiance from outside the scene. `None` is black.
    pub environment: Option<Environment>,
    /// Points, spots and directional lights, in world space.
    pub lights: Vec<PunctualLight>,
    /// Name of the model's file, without its folder. Empty if there is none.
    pub file: String,
    /// Whether all instances refer to one list of vertices, as the objects of an OBJ do. Otherwise each has its own.
    pub has_one_list: bool,
    /// The glTF file that the instances are of, if there is one.
    pub gltf: Option<Arc<GltfFile>>,
}

/// A glTF file, which can be read again to write it with more in it.
#[derive(Clone, Debug)]
pub struct GltfFile {
    pub path: PathBuf,
    /// The scene that names it, or itself, and where files may be.
    pub scene: PathBuf,
    pub files: Files,
}

/// A mesh placed in the world. The default places mesh 0 without a transform.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instance {
    pub name: String,
    /// Index into [`World::meshes`].
    pub mesh: usize,
    /// From mesh space to world space. A mirrored instance keeps its fronts and backs.
    pub transform: DAffine3,
    /// Its place in a glTF file.
    pub part: Option<GltfPart>,
}

/// One primitive of one node of a glTF file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GltfPart {
    pub node: usize,
    /// Index into the primitives of the node's mesh.
    pub primitive: usize,
    /// Which of the node's copies, with `EXT_mesh_gpu_instancing`.
    pub copy: usize,
}

impl World {
    /// The material of each triangle of each instance.
    pub fn surfaces(&self) -> impl Iterator<Item = &Material> {
        let triangles = self.instances.iter().flat_map(|instance| &self.meshes[instance.mesh].triangles);
        triangles.map(|triangle| &self.materials[triangle.material as usize])
    }

    /// Whether nothing emits light.
    pub fn is_dark(&self) -> bool {
        self.environment.as_ref().is_none_or(Environment::is_black)
            && !self.lights.iter().any(PunctualLight::shines)
            && !self.surfaces().any(Material::is_emissive)
    }

    /// Whether it gets the soft sky when it is to have light. A scene file's own environment stays, even if it is black.
    pub fn gets_sky(&self, strict: bool, no_default_light: bool) -> bool {
        self.is_dark() && self.environment.is_none() && !strict && !no_default_light
    }

    /// The first camera, or else one that sees the whole world in a picture of `size`.
    pub fn camera(&self, size: [u32; 2]) -> WorldCamera {
        self.changed_camera(size, &CameraChange::default())
    }

    /// The same with the parts of `change`. A camera that sees the whole world looks at its middle if its eye is changed.
    pub fn changed_camera(&self, size: [u32; 2], change: &CameraChange) -> WorldCamera {
        if let Some((_, camera)) = self.cameras.first() {
            return camera.changed(change);
        }
        let framing = WorldCamera::framing(self.positions(), size, change);
        let [min, max] = self.bounds();
        let target = if change.eye.is_some() { 0.5 * (min + max) } else { framing.target };
        WorldCamera { target, ..framing }.changed(change)
    }

    fn positions(&self) -> impl Iterator<Item = DVec3> {
        let positions = |instance: &'_ Instance| self.meshes[instance.mesh].positions.iter().map(placed(instance.transform));
        self.instances.iter().flat_map(positions)
    }

    /// Minimum and maximum coordinates.
    pub fn bounds(&self) -> [DVec3; 2] {
        let grow = |[min, max]: [DVec3; 2], position: DVec3| [min.min(position), max.max(position)];
        self.positions().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], grow)
    }

    /// Makes all surfaces diffuse, in one light grey without textures and vertex colours. Lamps stay lamps.
    pub fn clay(&mut self) {
        const ALBEDO: Vec3 = Vec3::splat(0.8);
        for material in &mut self.materials {
            (material.albedo, material.albedo_texture, material.surface) = (ALBEDO, None, Surface::Diffuse);
            (material.gloss, material.normal_map) = (None, None);
            material.unshaded.clear();
        }
        self.meshes.iter_mut().for_each(|mesh| mesh.colors.clear());
    }

    /// Joins all instances into one mesh in unit space, in f64 up to there. It drops duplicate triangles, and those too small for normals in f32.
    pub fn flatten(&self) -> Scene {
        let space = UnitSpace::around(self.bounds());
        let mut mesh = Mesh::default();
        // Meshes without colours are white beside others with them. Meshes without light-map coordinates make the whole scene one without.
        let placed_meshes = || self.instances.iter().map(|instance| &self.meshes[instance.mesh]);
        let colored = placed_meshes().any(|mesh| !mesh.colors.is_empty());
        let mapped = placed_meshes().all(|mesh| mesh.lightmap_uvs.len() == mesh.positions.len());
        let known = placed_meshes().all(|mesh| mesh.sources.len() == mesh.positions.len());
        for (instance, &Instance { mesh: index, transform, .. }) in (0..).zip(&self.instances) {
            let source = &self.meshes[index];
            let first = mesh.positions.len() as u32;
            let mirrored = transform.matrix3.determinant() < 0.0;
            mesh.positions.extend(source.positions.iter().map(placed(transform)).map(|position| space.enter_point(position)));
            mesh.normals.extend(source.normals.iter().map(turned(transform.matrix3)));
            mesh.uvs.extend(&source.uvs);
            if mapped {
                mesh.lightmap_uvs.extend(&source.lightmap_uvs);
            }
            if colored {
                mesh.colors.extend(&source.colors);
                mesh.colors.resize(mesh.positions.len(), Vec3::ONE);
            }
            if known {
                mesh.sources.extend(source.sources.iter().map(|&at| Source { instance, ..at }));
            }
            mesh.triangles.extend(source.triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.vertices.map(|vertex| first + vertex);
                // A mirror image has the opposite winding.
                Triangle { vertices: if mirrored { [a, c, b] } else { [a, b, c] }, ..*triangle }
            }));
        }
        let Mesh { positions, triangles, .. } = &mut mesh;
        triangles.retain(|triangle| has_area(triangle.vertices.map(|vertex| positions[vertex as usize])));
        drop_doubles(&mut mesh, &self.materials);
        Scene {
            mesh,
            materials: self.materials.clone(),
            textures: self.textures.clone(),
            environment: self.environment.clone(),
            lights: self.lights.iter().map(|light| light.in_space(space)).collect(),
            camera: self.cameras.first().map(|(_, camera)| space.enter_camera(*camera)),
            space,
            instances: self.instances.clone(),
            gltf: self.gltf.clone(),
            source_lists: SourceLists::of(self),
            file: self.file.clone(),
            gloss_means: GlossMeans::default(),
        }
    }
}

/// Transforms positions to world space.
fn placed(transform: DAffine3) -> impl Fn(&Vec3) -> DVec3 {
    move |position| transform.transform_point3(position.as_dvec3())
}

/// Transforms normals to world space by the inverse transpose: cofactor matrix over determinant. The cofactor matrix is always finite.
fn turned(linear: DMat3) -> impl Fn(&Vec3) -> Vec3 {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = linear;
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * linear.determinant().signum();
    // An identity transform keeps all bits.
    move |&normal| if linear == DMat3::IDENTITY { normal } else { (cofactors * normal.as_dvec3()).normalize_or_zero().as_vec3() }
}

/// Removes triangles with the same three corners as another, in any order. Exports with two-sided faces contain such pairs. Surfaces are two-sided
/// anyway, and the two copies would share the light. Emissive triangles all stay: two back to back are a lamp that shines both ways.
fn drop_doubles(mesh: &mut Mesh, materials: &[Material]) {
    let Mesh { positions, triangles, .. } = mesh;
    let emissive = |triangle: &Triangle| materials[triangle.material as usize].is_emissive();
    let place = |triangle: &Triangle| {
        let mut corners = triangle.vertices.map(|vertex| positions[vertex as usize].to_array().map(f32::to_bits));
        corners.sort_unstable();
        corners
    };
    let mut taken: HashSet<_> = triangles.iter().filter(|&triangle| emissive(triangle)).map(place).collect();
    triangles.retain(|triangle| emissive(triangle) || taken.insert(place(triangle)));
}
