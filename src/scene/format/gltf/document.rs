//! The container and the JSON of a glTF file: which bytes are what, which version and extensions they need, and where nodes stand.

use std::fmt::Display;
use std::path::Path;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::Root;
use serde::Deserialize;
use serde_json::Value;
use serde_json::value::RawValue;

use crate::error::{Error, Result};

/// What a user can do about a file that no exporter should write.
pub const BROKEN: &str =
    "export the model again; the glTF validator (github.khronos.org/glTF-Validator) tells what is wrong in a file";

/// Extensions that a file may require.
const EXTENSIONS: [&str; 27] = [
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_technique_webgl",
    "KHR_texture_transform",
    "KHR_xmp",
    "KHR_xmp_json_ld",
];

/// The first of some names that is not empty, or else another. Only its start, if it is long: many things can have one name.
pub fn name_of(names: [Option<&String>; 2], otherwise: impl FnOnce() -> String) -> String {
    const MOST: usize = 256;
    match names.into_iter().flatten().find(|name| !name.is_empty()) {
        Some(name) => name[..name.floor_char_boundary(MOST)].to_owned(),
        None => otherwise(),
    }
}

/// The two parts of a file.
pub struct Container<'a> {
    pub json: &'a [u8],
    /// The binary chunk of a `.glb`.
    pub bin: Option<&'a [u8]>,
    /// Number of bytes behind the end that the header states.
    pub rest: usize,
}

impl<'a> Container<'a> {
    /// Tells a binary file by its first bytes, not by its name.
    pub fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        if bytes.starts_with(b"glTF") {
            return Self::parse_binary(path, bytes);
        }
        Ok(Self { json: bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), bin: None, rest: 0 })
    }

    fn parse_binary(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let cut = |at: usize, needs: usize| {
            let problem =
                format!("this binary glTF is cut short: what starts at byte {at} needs {needs} bytes more than the file has");
            Error::input(path, None, problem, "copy or export the file again")
        };
        let word = |at: usize| match bytes.get(at..at + 4) {
            Some(word) => Ok(u32::from_le_bytes([word[0], word[1], word[2], word[3]]) as usize),
            None => Err(cut(at, at + 4 - bytes.len())),
        };
        check_version(path, &word(4)?.to_string())?;
        let length = word(8)?;
        if length > bytes.len() {
            return Err(cut(0, length - bytes.len()));
        }
        let chunk = |at: usize| {
            let (size, kind) = (word(at)?, word(at + 4)?);
            let end = at.saturating_add(8).saturating_add(size);
            let chunk = bytes.get(at + 8..end).ok_or_else(|| cut(at, end - bytes.len()))?;
            Ok::<_, Error>((kind.to_le_bytes(), chunk, end))
        };
        let (kind, json, mut at) = chunk(12)?;
        if !kind.starts_with(b"JSON") {
            let problem = "the first chunk of this binary glTF, at byte 12, is not JSON";
            return Err(Error::input(path, None, problem, BROKEN));
        }
        let mut bin = None;
        // Other chunks than the second are of extensions.
        if at + 8 <= length {
            let (kind, chunk, end) = chunk(at)?;
            bin = kind.starts_with(b"BIN\0").then_some(chunk);
            at = end;
        }
        Ok(Self { json, bin, rest: bytes.len() - length.max(at) })
    }
}

fn check_version(path: &Path, version: &str) -> Result<()> {
    if version == "2" || version.starts_with("2.") {
        return Ok(());
    }
    let cure = "convert it to glTF 2.0: open and export it in Blender, or run gltf-pipeline";
    Err(Error::input(path, None, format!("this is glTF {}, not 2.0", version.trim_matches('"')), cure))
}

/// What is read before the rest, because versions and extensions may change its form.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase", expecting = "the root object of a glTF")]
struct Preamble<'a> {
    #[serde(borrow)]
    asset: Option<About<'a>>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(borrow)]
    nodes: Option<&'a RawValue>,
}

#[derive(Deserialize)]
struct About<'a> {
    #[serde(borrow)]
    version: Option<&'a RawValue>,
}

/// The numbers of a node as the file has them. The crate's own types round them to f32, which moves a georeferenced model by metres.
#[derive(Deserialize)]
struct NodeNumbers {
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

impl NodeNumbers {
    fn transform(&self) -> DAffine3 {
        if let Some(matrix) = &self.matrix {
            return DAffine3::from_mat4(DMat4::from_cols_array(matrix));
        }
        let scale = DVec3::from(self.scale.unwrap_or([1.0; 3]));
        // A zero quaternion turns nothing.
        let rotation = DQuat::from_array(self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]));
        let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
        DAffine3::from_scale_rotation_translation(scale, rotation, DVec3::from(self.translation.unwrap_or_default()))
    }
}

/// The JSON, with what is asked of each of its lists.
pub struct Document<'a> {
    pub path: &'a Path,
    pub root: Root,
    /// From each node to its parent.
    pub transforms: Vec<DAffine3>,
}

impl<'a> Document<'a> {
    pub fn parse(path: &'a Path, container: &Container) -> Result<Self> {
        // A chunk of JSON is one line.
        let is_text = container.bin.is_none();
        let malformed = |error: serde_json::Error| {
            let line = Some(error.line()).filter(|&line| is_text && line > 0);
            Error::input(path, line, format!("this is not a valid glTF: {error}"), BROKEN)
        };
        let preamble: Preamble = serde_json::from_slice(container.json).map_err(malformed)?;
        let version = preamble.asset.and_then(|asset| asset.version).map(|version| version.get().trim_matches('"'));
        let Some(version) = version else {
            let problem = "this is not a glTF: it has no asset.version";
            return Err(Error::input(path, None, problem, "give a glTF 2.0 file"));
        };
        check_version(path, version)?;
        check_extensions(path, &preamble.extensions_required)?;
        let root = parse_root(container.json).map_err(malformed)?;
        let numbers = preamble.nodes.map(|nodes| serde_json::from_str::<Vec<NodeNumbers>>(nodes.get()));
        let numbers = numbers.transpose().map_err(malformed)?.unwrap_or_default();
        let document = Self { path, root, transforms: numbers.iter().map(NodeNumbers::transform).collect() };
        match document.transforms.iter().position(|transform| !transform.is_finite()) {
            Some(node) => Err(document.fault(format_args!("nodes[{node}]"), "its transform is not finite")),
            None => Ok(document),
        }
    }

    /// An error at a place in the JSON.
    pub fn fault(&self, place: impl Display, problem: impl Display) -> Error {
        Error::input(self.path, None, format!("{place}: {problem}"), BROKEN)
    }

    /// An entry of a list that something else refers to.
    pub fn entry<'b, T>(&self, list: &'b [T], name: &str, index: usize) -> Result<&'b T> {
        list.get(index).ok_or_else(|| {
            let problem = format!("the file refers to {name}[{index}], but has {} {name}", list.len());
            Error::input(self.path, None, problem, BROKEN)
        })
    }
}

fn parse_root(json: &[u8]) -> Result<Root, serde_json::Error> {
    serde_json::from_slice(json).or_else(|error| leniently(json).ok_or(error))
}

/// The JSON read once more, without what the crate's types refuse and glTF allows: scenes without nodes, animations of other things than nodes, and
/// whole numbers that are written as 1.0.
fn leniently(json: &[u8]) -> Option<Root> {
    let mut json: Value = serde_json::from_slice(json).ok()?;
    whole(&mut json);
    json.as_object_mut()?.remove("animations");
    for scene in json.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        scene.as_object_mut()?.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    serde_json::from_value(json).ok()
}

/// Makes whole numbers of those that are written as 1.0.
pub fn whole(json: &mut Value) {
    match json {
        Value::Number(number) => {
            let float = number.as_f64().filter(|float| number.is_f64() && *float >= 0.0 && float.fract() == 0.0);
            if let Some(float) = float.filter(|&float| float < 2_f64.powi(53)) {
                *json = Value::from(float as u64);
            }
        }
        Value::Array(list) => list.iter_mut().for_each(whole),
        Value::Object(entries) => entries.values_mut().for_each(whole),
        _ => {}
    }
}

fn check_extensions(path: &Path, required: &[String]) -> Result<()> {
    let Some(unknown) = required.iter().find(|name| !EXTENSIONS.contains(&name.as_str())) else { return Ok(()) };
    let cure = match unknown.as_str() {
        "KHR_texture_basisu" => {
            "convert its KTX2 pictures to PNG: run `gltf-transform png in.glb out.glb`, or `ktx extract` on each; or export with PNG or JPEG"
        }
        _ => "export the model without this extension; or, if it can do without, take its name out of extensionsRequired",
    };
    Err(Error::input(path, None, format!("this glTF requires the extension {unknown}, which is not known here"), cure))
}
