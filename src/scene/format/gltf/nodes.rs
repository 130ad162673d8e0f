//! The nodes of the chosen scene: where they stand, and their copies, joints, cameras and lights.

use std::collections::{HashMap, HashSet};
use std::f32::consts::FRAC_PI_4;

use glam::{DAffine3, DMat4, DQuat, DVec3, Vec3};
use gltf::json::Index;
use gltf::json::camera::Type;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type as LightKind};
use gltf::json::scene::Node;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::Value;

use super::buffers::Buffers;
use super::document::{BROKEN, Document, name_of};
use super::pose::Pose;
use crate::error::{Error, Result};
use crate::scene::format::Loader;
use crate::scene::format::warnings::{Fault, Place};
use crate::scene::{PunctualKind, PunctualLight, WorldCamera};

/// A node that is a child of several is placed under each. More of these places are refused: each level of nodes could double them.
const MOST_REPEATED: usize = 1 << 16;

/// A node in the world.
pub struct Placed {
    pub node: usize,
    pub transform: DAffine3,
    /// How often it was placed before, as a child of other nodes.
    pub earlier: usize,
}

/// All nodes of a scene, depth first, in the order of the file.
pub struct Walk {
    pub nodes: Vec<Placed>,
    /// Transforms to the world by node.
    transforms: HashMap<usize, DAffine3>,
}

/// What a walk does next.
enum WalkStep {
    /// Goes to a node, from a parent with this transform.
    Enter(usize, DAffine3),
    Leave(usize),
}

impl Walk {
    pub fn of(loader: &mut Loader, document: &Document) -> Result<Self> {
        let mut walk = Self { nodes: Vec::new(), transforms: HashMap::new() };
        let (mut above, mut places, mut entered) = (HashSet::new(), HashMap::new(), 0);
        let enter = |parent| move |node: &Index<Node>| WalkStep::Enter(node.value(), parent);
        let mut waiting: Vec<_> = roots(loader, document)?.iter().rev().map(enter(DAffine3::IDENTITY)).collect();
        while let Some(step) = waiting.pop() {
            let (node, parent) = match step {
                WalkStep::Enter(node, parent) => (node, parent),
                WalkStep::Leave(node) => {
                    above.remove(&node);
                    continue;
                }
            };
            let json = document.entry(&document.root.nodes, "nodes", node)?;
            let fault = |problem| Err(document.fault(format_args!("nodes[{node}]"), problem));
            entered += 1;
            if entered > document.root.nodes.len() + MOST_REPEATED {
                return fault("too many nodes are children of several");
            }
            if is_hidden(json) {
                continue;
            }
            let transform = parent * document.transforms[node];
            if !transform.is_finite() {
                return fault("its place in the world is not finite");
            }
            if !above.insert(node) {
                return fault("it is below itself");
            }
            let place = places.entry(node).or_insert(0);
            let earlier = std::mem::replace(place, *place + 1);
            if earlier > 0 {
                repeated(loader, document, node)?;
            }
            walk.transforms.entry(node).or_insert(transform);
            walk.nodes.push(Placed { node, transform, earlier });
            waiting.push(WalkStep::Leave(node));
            waiting.extend(json.children.iter().flatten().rev().map(enter(transform)));
        }
        Ok(walk)
    }

    /// The transforms to the world of all copies that `EXT_mesh_gpu_instancing` makes of a node.
    pub fn copies(&self, buffers: &Buffers, placed: &Placed, extension: &Value) -> Result<Vec<DAffine3>> {
        #[derive(Deserialize)]
        struct Instancing {
            attributes: HashMap<String, usize>,
        }
        let fault =
            |problem: String| buffers.document.fault(format_args!("nodes[{}].EXT_mesh_gpu_instancing", placed.node), problem);
        let Instancing { attributes } = Instancing::deserialize(extension).map_err(|error| fault(error.to_string()))?;
        let values = |name, width| attributes.get(name).map(|&index| buffers.values(index, &[width])).transpose();
        let (translations, rotations, scales) = (values("TRANSLATION", 3)?, values("ROTATION", 4)?, values("SCALE", 3)?);
        let mut counts = [&translations, &rotations, &scales].into_iter().flatten().map(|values| values.count);
        let Some(count) = counts.next() else { return Ok(vec![placed.transform]) };
        if counts.any(|other| other != count) {
            return Err(fault("its attributes differ in number".into()));
        }
        // An instance is larger than a vertex.
        buffers.take(count.saturating_mul(4))?;
        let vector = |values: &super::accessors::AccessorValues, copy| Vec3::from(values.get(copy)).as_dvec3();
        let copies = (0..count).map(|copy| {
            let translation = translations.as_ref().map_or(DVec3::ZERO, |values| vector(values, copy));
            let rotation =
                rotations.as_ref().map_or(DQuat::IDENTITY, |values| DQuat::from_array(values.get::<4>(copy).map(f64::from)));
            let scale = scales.as_ref().map_or(DVec3::ONE, |values| vector(values, copy));
            let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
            let transform = placed.transform * DAffine3::from_scale_rotation_translation(scale, rotation, translation);
            if transform.is_finite() { Ok(transform) } else { Err(fault(format!("copy {copy} has no finite place"))) }
        });
        copies.collect()
    }

    /// The joints of a node's skin, where they stand.
    pub fn skin(&self, loader: &mut Loader, buffers: &Buffers, placed: &Placed) -> Result<Pose> {
        let document = buffers.document;
        let Some(index) = document.root.nodes[placed.node].skin else { return Ok(Pose::default()) };
        let skin = document.entry(&document.root.skins, "skins", index.value())?;
        let transforms: Option<Vec<DAffine3>> =
            skin.joints.iter().map(|joint| self.transforms.get(&joint.value()).copied()).collect();
        let Some(joints) = transforms.filter(|joints| !joints.is_empty()) else {
            let problem = || format!("skins[{}] has joints that are not in the scene", index.value());
            let fault = Fault { kind: "skin", problem: &problem, mend: "its mesh is not bent", cure: BROKEN };
            loader.warnings.mend(Place { path: document.path, line: None }, &fault)?;
            return Ok(Pose::default());
        };
        let inverse = skin.inverse_bind_matrices.map(|accessor| buffers.values(accessor.value(), &[16])).transpose()?;
        if inverse.as_ref().is_some_and(|inverse| inverse.count < joints.len()) {
            return Err(document.fault(format_args!("skins[{}]", index.value()), "it has fewer inverseBindMatrices than joints"));
        }
        buffers.take(joints.len())?;
        let origin = joints[0].translation;
        let bound = |(joint, &transform): (usize, &DAffine3)| {
            let to_joint = inverse.as_ref().map_or(DAffine3::IDENTITY, |inverse| {
                DAffine3::from_mat4(DMat4::from_cols_array(&inverse.get::<16>(joint).map(f64::from)))
            });
            DAffine3::from_translation(-origin) * transform * to_joint
        };
        Ok(Pose { weights: Vec::new(), joints: joints.iter().enumerate().map(bound).collect(), origin })
    }

    /// The cameras of the scene with their names.
    pub fn cameras(&self, loader: &mut Loader, document: &Document) -> Result<Vec<(String, WorldCamera)>> {
        let mut cameras = Vec::new();
        for &Placed { node, transform, .. } in &self.nodes {
            let json = &document.root.nodes[node];
            let Some(index) = json.camera else { continue };
            let camera = document.entry(&document.root.cameras, "cameras", index.value())?;
            let name = name_of([json.name.as_ref(), camera.name.as_ref()], || format!("camera {}", cameras.len()));
            let found = match (&camera.perspective, camera.type_) {
                (Some(perspective), Checked::Valid(Type::Perspective)) => perspective_camera(transform, perspective.yfov),
                (_, Checked::Valid(Type::Orthographic)) => Err("it is orthographic; cameras have a perspective here".to_owned()),
                _ => Err("it has no perspective".to_owned()),
            };
            match found {
                Ok(camera) => cameras.push((name, camera)),
                Err(problem) => {
                    let place = Place { path: document.path, line: None };
                    loader.warnings.tell(place, "camera", &|| format!("camera {name} is left out: {problem}"));
                }
            }
        }
        Ok(cameras)
    }

    /// The lights of the scene (`KHR_lights_punctual`), each along the -z of its node.
    pub fn lights(&self, loader: &mut Loader, document: &Document) -> Result<Vec<PunctualLight>> {
        let known = document.root.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref());
        let known = known.map_or(&[][..], |extension| &extension.lights);
        let place = Place { path: document.path, line: None };
        let mut lights = Vec::new();
        for &Placed { node, transform, .. } in &self.nodes {
            let json = &document.root.nodes[node];
            let Some(index) = json.extensions.as_ref().and_then(|extensions| extensions.khr_lights_punctual.as_ref()) else {
                continue;
            };
            let found = known.get(index.light.value());
            let name =
                name_of([json.name.as_ref(), found.and_then(|light| light.name.as_ref())], || format!("light {}", lights.len()));
            let made = found.ok_or_else(|| format!("the file has no lights[{}]", index.light.value()));
            match made.and_then(|light| punctual(light, name.clone(), transform)) {
                Ok(light) => lights.push(light),
                Err(problem) => {
                    let problem = || format!("light {name}: {problem}");
                    let fault = Fault { kind: "light", problem: &problem, mend: "it is left out", cure: BROKEN };
                    loader.warnings.mend(place, &fault)?;
                }
            }
            if let Some(range) = found.and_then(|light| light.range) {
                let text = || {
                    format!(
                        "light {name} reaches beyond its range of {range}: its light falls by the square of the distance alone"
                    )
                };
                loader.warnings.tell(place, "range", &text);
            }
        }
        Ok(lights)
    }
}

/// A light at the origin of a node that shines along its -z. The node's scale does not change it.
fn punctual(light: &Light, name: String, transform: DAffine3) -> Result<PunctualLight, String> {
    let kind = match (light.type_, &light.spot) {
        (Checked::Valid(LightKind::Point), _) => PunctualKind::Point { radius: 0.0 },
        (Checked::Valid(LightKind::Directional), _) => PunctualKind::Directional { angle: 0.0 },
        (Checked::Valid(LightKind::Spot), spot) => {
            let (inner, outer) = spot.as_ref().map_or((0.0, FRAC_PI_4), |spot| (spot.inner_cone_angle, spot.outer_cone_angle));
            PunctualKind::Spot { radius: 0.0, inner, outer }
        }
        (Checked::Invalid, _) => return Err("it is no point, spot or directional light".to_owned()),
    };
    let strength = light.intensity * Vec3::from(light.color);
    // A node of scale 0 has no direction, and a point needs none.
    let direction = match kind {
        PunctualKind::Point { .. } => Vec3::NEG_Z,
        _ => -transform.matrix3.z_axis.normalize_or_zero().as_vec3(),
    };
    let made = PunctualLight { name, kind, position: transform.translation, direction, strength };
    made.check().map_err(|(problem, _)| problem)
}

/// A camera at the origin of a node that looks along its -z.
fn perspective_camera(transform: DAffine3, yfov: f32) -> Result<WorldCamera, String> {
    let eye = transform.translation;
    let [forward, up] = [-transform.matrix3.z_axis, transform.matrix3.y_axis].map(DVec3::normalize_or_zero);
    let camera = WorldCamera { eye, target: eye + forward, up: up.as_vec3(), fov_y_degrees: yfov.to_degrees(), lens: None };
    camera.check().map_err(|(problem, _)| problem)
}

/// The root nodes of the chosen scene.
fn roots(loader: &Loader, document: &Document) -> Result<Vec<Index<Node>>> {
    let scenes = &document.root.scenes;
    let chosen = match &loader.scene {
        Some(wanted) => {
            let named = scenes.iter().position(|scene| scene.name.as_ref() == Some(wanted));
            let number = named.or_else(|| wanted.parse().ok().filter(|&number| number < scenes.len()));
            Some(number.ok_or_else(|| unknown_scene(document, wanted))?)
        }
        // A file that names a scene and has none shows all its nodes.
        None => (!scenes.is_empty()).then(|| document.root.scene.map_or(0, |scene| scene.value())),
    };
    if let Some(chosen) = chosen {
        let scene = document.entry(scenes, "scenes", chosen)?;
        return Ok(scene.nodes.clone());
    }
    let nodes = &document.root.nodes;
    let mut is_root = vec![true; nodes.len()];
    for child in nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        if let Some(is_root) = is_root.get_mut(child.value()) {
            *is_root = false;
        }
    }
    Ok((0..nodes.len()).filter(|&node| is_root[node]).map(|node| Index::new(node as u32)).collect())
}

/// Tells of a node that is a child of several.
fn repeated(loader: &mut Loader, document: &Document, node: usize) -> Result<()> {
    let problem = || format!("nodes[{node}] is a child of several nodes");
    let fault = Fault { kind: "children", problem: &problem, mend: "it is shown under each", cure: BROKEN };
    loader.warnings.mend(Place { path: document.path, line: None }, &fault)
}

fn unknown_scene(document: &Document, wanted: &str) -> Error {
    let scenes = document.root.scenes.iter().enumerate();
    let names: Vec<String> =
        scenes.take(20).map(|(number, scene)| scene.name.clone().unwrap_or_else(|| number.to_string())).collect();
    let cure = match names.len() {
        0 => "leave out --gltf-scene".to_owned(),
        _ => format!("name one of these, or give a number from 0: {}", names.join(", ")),
    };
    Error::input(document.path, None, format!("there is no scene {wanted:?}"), cure)
}

/// Whether `KHR_node_visibility` hides a node and all below it.
fn is_hidden(node: &Node) -> bool {
    let visibility = node.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_node_visibility"));
    visibility.and_then(|visibility| visibility.get("visible")).and_then(Value::as_bool) == Some(false)
}
