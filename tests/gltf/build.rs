//! Builds small glTF files from JSON and numbers.

use std::collections::BTreeMap;
use std::path::Path;

use finalgather::error::Result;
use finalgather::scene::{Files, LoadOptions, Loaded, Mesh, Scene, World};
use glam::{DVec3, Vec3};
use serde_json::{Value, json};

/// The options of a test: a world may be without light, so that no warning tells of it.
pub fn options() -> LoadOptions {
    LoadOptions { unlit: true, ..LoadOptions::default() }
}

/// A file in the making: its JSON, and its bytes.
#[derive(Clone)]
pub struct Model {
    pub json: Value,
    pub bin: Vec<u8>,
}

/// Component types.
pub const I8: u32 = 5120;
pub const U8: u32 = 5121;
pub const I16: u32 = 5122;
pub const U16: u32 = 5123;
pub const U32: u32 = 5125;
pub const F32: u32 = 5126;

impl Model {
    pub fn new() -> Self {
        Self { json: json!({ "asset": { "version": "2.0" } }), bin: Vec::new() }
    }

    /// A triangle in the plane z = 0 with corners (0, 0), (1, 0) and (0, 1), in one node.
    pub fn triangle() -> Self {
        let mut model = Self::new();
        let positions = model.floats(3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        model.mesh(json!({ "attributes": { "POSITION": positions } }));
        model
    }

    /// The unit square in the plane z = 0, whose image has its top left corner at (0, 1), in one node with a material.
    pub fn square(material: Value) -> Self {
        let mut model = Self::new();
        let positions = model.floats(3, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        let uvs = model.floats(2, &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        let indices = model.accessor(U8, "SCALAR", &[0, 1, 2, 0, 2, 3]);
        model.push("materials", material);
        let attributes = json!({ "POSITION": positions, "TEXCOORD_0": uvs });
        model.mesh(json!({ "attributes": attributes, "indices": indices, "material": 0 }));
        model
    }

    /// Adds an entry to a list of the root, and returns its index.
    pub fn push(&mut self, list: &str, entry: Value) -> usize {
        let root = self.json.as_object_mut().unwrap();
        let list = root.entry(list).or_insert_with(|| json!([])).as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    }

    /// Adds a mesh of one primitive, and a node with it.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({ "primitives": [primitive] }));
        self.push("nodes", json!({ "mesh": mesh }))
    }

    /// Adds bytes, aligned as glTF wants it.
    pub fn bytes(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend(bytes);
        offset
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.bytes(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    /// Adds an accessor whose elements lie close together.
    pub fn accessor(&mut self, component: u32, kind: &str, bytes: &[u8]) -> usize {
        let size = match component {
            I8 | U8 => 1,
            I16 | U16 => 2,
            _ => 4,
        };
        let width = ["SCALAR", "?", "VEC2", "VEC3", "VEC4"].iter().position(|&known| known == kind);
        let width = width.map_or(16, |width| width.max(1));
        let view = self.view(bytes);
        let count = bytes.len() / (size * width);
        self.push("accessors", json!({ "bufferView": view, "componentType": component, "type": kind, "count": count }))
    }

    /// The same of floats, `width` in an element.
    pub fn floats(&mut self, width: usize, floats: &[f32]) -> usize {
        let kinds = ["?", "SCALAR", "VEC2", "VEC3", "VEC4"];
        self.accessor(F32, kinds.get(width).unwrap_or(&"MAT4"), &le(floats))
    }

    /// Adds a picture, a sampler and a texture.
    pub fn texture(&mut self, picture: &[u8], sampler: Value) -> usize {
        let view = self.view(picture);
        let image = self.push("images", json!({ "bufferView": view, "mimeType": "image/png" }));
        let sampler = self.push("samplers", sampler);
        self.push("textures", json!({ "source": image, "sampler": sampler }))
    }

    /// The JSON with a buffer of the bytes.
    pub fn root(&self, uri: Option<&str>) -> Value {
        let mut root = self.json.clone();
        if root.get("buffers").is_none() && !self.bin.is_empty() {
            root["buffers"] = json!([{ "byteLength": self.bin.len() }]);
            if let Some(uri) = uri {
                root["buffers"][0]["uri"] = json!(uri);
            }
        }
        root
    }

    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.root(None).to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let word = |word: usize| (word as u32).to_le_bytes();
        let header = [*b"glTF", word(2), word(28 + json.len() + bin.len()), word(json.len()), *b"JSON"].concat();
        [&header[..], &json, &word(bin.len()), b"BIN\0", &bin].concat()
    }

    pub fn load_with(&self, options: LoadOptions) -> Result<Loaded> {
        load(BTreeMap::from([("m.glb", self.glb())]), "m.glb", options)
    }

    /// Loads it, with the warnings. The one about what is not shown of materials has a test of its own.
    pub fn load(&self) -> (World, Vec<String>) {
        let Loaded { world, report, .. } = self.load_with(options()).unwrap_or_else(|error| panic!("{error}"));
        let warnings = report.warnings.into_iter().filter(|warning| !warning.contains("what pictures do not show yet"));
        (world, warnings.collect())
    }

    /// Loads it without a warning.
    pub fn world(&self) -> World {
        let (world, warnings) = self.load();
        assert_eq!(warnings, [""; 0]);
        world
    }

    /// The message of its refusal.
    pub fn refusal(&self) -> String {
        self.load_with(options()).expect_err("it is not sound").to_string()
    }
}

/// Loads a file among others in memory.
pub fn load(files: BTreeMap<&str, Vec<u8>>, name: &str, options: LoadOptions) -> Result<Loaded> {
    let files = files.into_iter().map(|(name, bytes)| (name.into(), bytes)).collect();
    World::load_with(Path::new(name), LoadOptions { files: Files::Memory(files), ..options })
}

/// All of a world but the file that it is of.
pub fn contents(world: World) -> String {
    format!("{:?}", World { gltf: None, file: String::new(), ..world })
}

/// The bytes of floats.
pub fn le(floats: &[f32]) -> Vec<u8> {
    floats.iter().flat_map(|float| float.to_le_bytes()).collect()
}

/// The only mesh of a world.
pub fn only(world: &World) -> &Mesh {
    let [mesh] = &world.meshes[..] else { panic!("{} meshes", world.meshes.len()) };
    mesh
}

/// A PNG of these pixels, row by row from the top.
pub fn png(width: u32, pixels: &[[u8; 3]]) -> Vec<u8> {
    encoded(width, pixels, image::ImageFormat::Png)
}

pub fn encoded(width: u32, pixels: &[[u8; 3]], format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_raw(width, pixels.len() as u32 / width, pixels.concat()).unwrap();
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// World positions of the corners of all triangles of an instance.
pub fn placed(world: &World, instance: usize) -> Vec<DVec3> {
    let instance = &world.instances[instance];
    let mesh = &world.meshes[instance.mesh];
    let corners = (0..mesh.triangles.len()).flat_map(|triangle| mesh.corners(triangle));
    corners.map(|corner| instance.transform.transform_point3(corner.as_dvec3())).collect()
}

pub fn assert_near(found: &[DVec3], expected: &[[f64; 3]], tolerance: f64) {
    let near = found.len() == expected.len()
        && found.iter().zip(expected).all(|(found, &expected)| found.distance(expected.into()) <= tolerance);
    assert!(near, "{found:?} is not {expected:?}");
}

/// Albedo of a flat scene at a world position, which lies in some triangle.
pub fn albedo_at(scene: &Scene, position: [f64; 3]) -> Vec3 {
    let position = scene.space.enter_point(DVec3::from(position));
    let found = (0..scene.mesh.triangles.len()).find_map(|triangle| {
        let weights = scene.mesh.barycentric(triangle, position);
        let [a, b, c] = scene.mesh.corners(triangle);
        let on = a * weights.x + b * weights.y + c * weights.z;
        (weights.min_element() >= -1e-5 && on.distance(position) < 1e-5).then(|| scene.base_color(triangle, weights))
    });
    found.unwrap_or_else(|| panic!("no triangle at {position}"))
}
