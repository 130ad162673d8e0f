//! glTF 2.0, binary (`.glb`) and text (`.gltf`). Each primitive of a mesh becomes a mesh of the world, and each node with a mesh an instance of each of
//! its primitives. [`load`] is the entry point.
//!
//! | file | role |
//! |---|---|
//! | `document.rs` | container, JSON, versions and extensions |
//! | `buffers.rs`, `meshopt.rs` | bytes: buffers, URIs, views, packed views |
//! | `accessors.rs`, `draco.rs` | typed values |
//! | `nodes.rs` | which scene, which nodes, where they stand |
//! | `primitive.rs`, `pose.rs` | triangles and vertices, morphed and skinned |
//! | `material.rs`, `images.rs` | materials and textures |
//! | `plain.rs` | the same file in one piece, to add to it |
//!
//! Nothing in a file is believed: each index, offset and count is checked before use, and [`Buffers::take`] bounds what a file may ask for.

use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

pub use self::buffers::Buffers;
use self::document::{BROKEN, Container, Document, name_of};
use self::material::FileMaterials;
use self::nodes::{Placed, Walk};
pub use self::plain::PlainGltf;
use self::pose::Pose;
pub use self::primitive::triangles_of;
use self::primitive::{Primitives, Tally};
use super::warnings::{Fault, Place};
use super::{FARTHEST, Loader};
use crate::error::{Error, Result};
use crate::scene::mesh::has_area;
use crate::scene::{GltfFile, GltfPart, Instance, Mesh, World};

mod accessors;
mod buffers;
mod document;
mod draco;
mod gloss;
mod images;
mod material;
mod meshopt;
mod nodes;
mod plain;
mod pose;
mod primitive;

/// Name of accessors of `COLOR_0` that show a bake. They are light, not the colours of the surface.
pub const SHOWN_COLOURS: &str = "finalgather: light for display";

/// So many copies of triangles count as one thing that is made. Files with many instances are meant to be short.
const PLACED_SHARE: usize = 16;

/// The most triangles of all instances together: flat scenes count vertices in 32 bits.
const MOST_PLACED: usize = 1 << 28;

pub(super) fn load(loader: &mut Loader, path: &Path) -> Result<World> {
    let reader = loader.reader;
    let bytes = loader.read_model(path, "glTF")?;
    let container = Container::parse(path, &bytes)?;
    if container.rest > 0 {
        let problem = || format!("{} bytes follow the end that the header states", container.rest);
        let fault = Fault { kind: "rest", problem: &problem, mend: "they are ignored", cure: "copy or export the file again" };
        loader.warnings.mend(Place { path, line: None }, &fault)?;
    }
    let document = Document::parse(path, &container)?;
    let buffers = Buffers::new(&document, reader, container.bin, bytes.len());
    let walk = Walk::of(loader, &document)?;
    let materials = FileMaterials::load(loader, &buffers)?;
    let primitives = Primitives { buffers: &buffers, tally: Tally::default() };
    let mut assembly = Assembly {
        buffers: &buffers,
        walk: &walk,
        materials,
        primitives,
        known: HashMap::new(),
        morphed: HashSet::new(),
        world: World::default(),
        placed: 0,
    };
    for placed in &walk.nodes {
        assembly.node(loader, placed)?;
    }
    let Assembly { materials, primitives, mut world, .. } = assembly;
    finish(loader, path, &primitives.tally, &world)?;
    world.materials = materials.list;
    world.cameras = walk.cameras(loader, &document)?;
    world.lights = walk.lights(loader, &document)?;
    let (scene, files) = reader.origin();
    world.gltf = Some(Arc::new(GltfFile { path: path.to_owned(), scene: scene.to_owned(), files: files.clone() }));
    Ok(world)
}

/// A world in the making.
struct Assembly<'a, 'b> {
    buffers: &'a Buffers<'b>,
    walk: &'a Walk,
    materials: FileMaterials,
    primitives: Primitives<'a, 'b>,
    /// Meshes of the world by mesh and primitive of the file. `None`: nothing to draw.
    known: HashMap<(usize, usize), Option<usize>>,
    /// Meshes of the file that have morph targets.
    morphed: HashSet<usize>,
    world: World,
    /// Triangles of all instances.
    placed: usize,
}

impl Assembly<'_, '_> {
    /// Adds the instances of a node.
    fn node(&mut self, loader: &mut Loader, placed: &Placed) -> Result<()> {
        let document = self.buffers.document;
        let json = &document.root.nodes[placed.node];
        let Some(index) = json.mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        let mesh = document.entry(&document.root.meshes, "meshes", index)?;
        let pose = Pose {
            weights: json.weights.clone().or_else(|| mesh.weights.clone()).unwrap_or_default(),
            ..self.walk.skin(loader, self.buffers, placed)?
        };
        let copies = self.copies(placed)?;
        self.primitives.tally.skinned += usize::from(pose.is_skinned());
        if mesh.primitives.iter().any(|primitive| primitive.targets.is_some()) {
            self.primitives.tally.morphed += usize::from(self.morphed.insert(index));
        }
        let name = name_of([json.name.as_ref(), mesh.name.as_ref()], || format!("node {}", placed.node));
        // Only a mesh in the pose of its own is shared.
        let shared = !pose.is_skinned() && json.weights.is_none();
        for (primitive, json) in mesh.primitives.iter().enumerate() {
            let known = self.known.get(&(index, primitive)).copied().filter(|_| shared);
            let mesh = match known {
                Some(known) => known,
                None => {
                    let look = self.materials.look(self.buffers, json.material.map(|material| material.value()))?;
                    let place = format!("meshes[{index}].primitives[{primitive}]");
                    let mesh = self.primitives.load(&mut loader.warnings, json, &place, look, &pose)?;
                    let mesh = mesh.map(|mesh| {
                        self.world.meshes.push(mesh);
                        self.world.meshes.len() - 1
                    });
                    if shared {
                        self.known.insert((index, primitive), mesh);
                    }
                    mesh
                }
            };
            let Some(mesh) = mesh else { continue };
            for (copy, &transform) in copies.iter().enumerate() {
                let transform = if pose.is_skinned() { DAffine3::from_translation(pose.origin) } else { transform };
                let part = GltfPart { node: placed.node, primitive, copy: placed.earlier * copies.len() + copy };
                self.place(loader, Instance { name: name.clone(), mesh, transform, part: Some(part) })?;
            }
        }
        Ok(())
    }

    fn place(&mut self, loader: &mut Loader, instance: Instance) -> Result<()> {
        let document = self.buffers.document;
        let mesh = &self.world.meshes[instance.mesh];
        let GltfPart { node, .. } = instance.part.unwrap_or(GltfPart { node: 0, primitive: 0, copy: 0 });
        // A copy of a triangle takes a place in the flat scene.
        self.buffers.take(mesh.triangles.len() / PLACED_SHARE)?;
        self.placed = self.placed.saturating_add(mesh.triangles.len());
        if self.placed > MOST_PLACED {
            let problem = format!("its instances have more than {MOST_PLACED} triangles together");
            return Err(Error::input(document.path, None, problem, "leave out some of them"));
        }
        if farthest(mesh, instance.transform) > FARTHEST {
            let problem = format!("nodes[{node}]: {} reaches farther than {FARTHEST:e} from the origin", instance.name);
            return Err(Error::input(document.path, None, problem, "scale the model down"));
        }
        if is_flattened(mesh, instance.transform) {
            let problem = || format!("nodes[{node}] scales {} down to nothing", instance.name);
            let fault = Fault { kind: "scale", problem: &problem, mend: "it is left out", cure: "give it a scale that is not 0" };
            return loader.warnings.mend(Place { path: document.path, line: None }, &fault);
        }
        self.world.instances.push(instance);
        Ok(())
    }

    /// The transforms of all copies of a node to the world.
    fn copies(&self, placed: &Placed) -> Result<Vec<DAffine3>> {
        let json = &self.buffers.document.root.nodes[placed.node];
        let Some(extensions) = &json.extensions else { return Ok(vec![placed.transform]) };
        match extensions.others.get("EXT_mesh_gpu_instancing") {
            Some(extension) => self.walk.copies(self.buffers, placed, extension),
            None => Ok(vec![placed.transform]),
        }
    }
}

/// The largest coordinate of a mesh in the world.
fn farthest(mesh: &Mesh, transform: DAffine3) -> f64 {
    let bounds = mesh.bounds();
    let [min, max] = [bounds.min, bounds.max].map(|corner| corner.as_dvec3());
    let corner = |i: u32| DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), max, min);
    (0..8).map(|i| transform.transform_point3(corner(i)).abs().max_element()).fold(0.0, f64::max)
}

/// Whether a transform leaves no triangle of a mesh with an area.
fn is_flattened(mesh: &Mesh, transform: DAffine3) -> bool {
    let placed = |corner: glam::Vec3| transform.transform_vector3(corner.as_dvec3()).as_vec3();
    transform.matrix3.determinant() == 0.0
        && !(0..mesh.triangles.len()).any(|triangle| has_area(mesh.corners(triangle).map(placed)))
}

/// Tells what was skipped. Fails if nothing is left.
fn finish(loader: &mut Loader, path: &Path, tally: &Tally, world: &World) -> Result<()> {
    let &Tally { triangles, flat, lines, morphed, skinned } = tally;
    if world.instances.is_empty() {
        let (problem, cure) = match triangles {
            _ if flat > 0 && flat == triangles => return loader.skipped(path, flat, 0),
            0 if lines > 0 => {
                ("it has points or lines alone, no triangle".to_owned(), "export the model with its faces, as a mesh")
            }
            0 => ("there is no mesh in its scene".to_owned(), "export the model with its meshes"),
            _ => ("no triangle of it can be drawn".to_owned(), BROKEN),
        };
        return Err(Error::input(path, None, problem, cure));
    }
    loader.skipped(path, flat, triangles - flat)?;
    let mut tell = |count: usize, one: &str, many: &str| match count {
        0 => {}
        1 => loader.warnings.say(format!("1 {one}")),
        _ => loader.warnings.say(format!("{count} {many}")),
    };
    tell(lines, "primitive of points or lines is not shown", "primitives of points or lines are not shown");
    let weights = "shown with the weights of the file";
    tell(morphed, &format!("mesh with morph targets is {weights}"), &format!("meshes with morph targets are {weights}"));
    let rest = "shown at rest, with joints where their nodes stand";
    tell(skinned, &format!("skinned mesh is {rest}"), &format!("skinned meshes are {rest}"));
    Ok(())
}
