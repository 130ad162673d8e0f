//! A glTF file in one piece: all buffers and pictures in one binary chunk, nothing packed. What is added to a file is added to this.

use gltf::json::Root;
use serde_json::{Map, Value, json};

use super::accessors::AccessorValues;
use super::buffers::Buffers;
use super::document::{Container, Document};
use super::draco::Unpacked;
use crate::error::{Error, Result};
use crate::file::MOST_BYTES;
use crate::scene::GltfFile;
use crate::scene::format::Reader;

/// Extensions that are gone when nothing is packed.
const PACKING: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A glTF file in one piece. Indices of its lists are those of the file. Views and accessors may be more.
pub struct PlainGltf {
    pub json: Value,
    pub bin: Vec<u8>,
}

impl PlainGltf {
    /// Reads a file again.
    ///
    /// # Errors
    /// [`Error::Input`] when it cannot be read any more.
    pub fn read(file: &GltfFile) -> Result<Self> {
        let GltfFile { path, scene, files } = file;
        let reader = Reader::new(scene, files);
        let bytes =
            reader.read_named(path, MOST_BYTES).map_err(|unread| unread.error(path, None, "this model again", "put it back"))?;
        let container = Container::parse(path, &bytes)?;
        let document = Document::parse(path, &container)?;
        let buffers = Buffers::new(&document, &reader, container.bin, bytes.len());
        let json = serde_json::from_slice(container.json)
            .map_err(|error| Error::input(path, None, format!("this is not a valid glTF: {error}"), "export the model again"))?;
        let root = &document.root;
        let mut plain = Self { json, bin: container.bin.map(<[u8]>::to_vec).unwrap_or_default() };
        let is_plain = root.buffers.len() <= 1 && root.buffers.iter().all(|buffer| buffer.uri.is_none()) && !plain.is_packed();
        if !is_plain {
            plain.join_views(&buffers)?;
            plain.unpack_primitives(&buffers)?;
            plain.forget_packing();
        }
        plain.embed_images(root, &buffers);
        Ok(plain)
    }

    /// Calls `work` with the values of the file.
    ///
    /// # Errors
    /// As `work`.
    pub fn values<T>(&self, file: &GltfFile, work: impl FnOnce(&Buffers) -> Result<T>) -> Result<T> {
        let json = self.json.to_string().into_bytes();
        let container = Container { json: &json, bin: Some(&self.bin), rest: 0 };
        let document = Document::parse(&file.path, &container)?;
        work(&Buffers::new(&document, &Reader::new(&file.scene, &file.files), container.bin, self.bin.len()))
    }

    fn is_packed(&self) -> bool {
        let used = self.json["extensionsUsed"].as_array();
        used.into_iter().flatten().any(|name| PACKING.iter().any(|packing| name == packing))
    }

    /// Adds bytes at a multiple of four, and returns a view of them.
    fn view(&mut self, bytes: &[u8]) -> Value {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        view
    }

    fn push_view(&mut self, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        push(&mut self.json, "bufferViews", view)
    }

    /// Puts the bytes of all views into one buffer.
    fn join_views(&mut self, buffers: &Buffers) -> Result<()> {
        self.bin.clear();
        for index in 0..buffers.document.root.buffer_views.len() {
            let (bytes, stride) = buffers.view(index)?;
            let joined = self.view(bytes);
            let Some(view) = self.json["bufferViews"][index].as_object_mut() else { continue };
            view.extend(joined.as_object().cloned().unwrap_or_default());
            let is_packed = drop_packing(view);
            if let Some(stride) = stride.filter(|_| is_packed && view.get("target").is_none_or(|target| *target != json!(34963)))
            {
                view.insert("byteStride".into(), stride.into());
            }
        }
        self.json["buffers"] = json!([{}]);
        Ok(())
    }

    /// Gives the accessors of primitives that draco packs their values.
    fn unpack_primitives(&mut self, buffers: &Buffers) -> Result<()> {
        for (mesh, json) in buffers.document.root.meshes.iter().enumerate() {
            for (index, primitive) in json.primitives.iter().enumerate() {
                let place = format!("meshes[{mesh}].primitives[{index}]");
                let Some(unpacked) = Unpacked::of(buffers, primitive, &place)? else { continue };
                for (name, accessor) in &primitive.attributes {
                    let gltf::json::validation::Checked::Valid(name) = name else { continue };
                    if let Some(values) = unpacked.values(buffers, &name.to_string(), accessor.value())? {
                        // Vertices begin at multiples of four bytes.
                        self.unpack(accessor.value(), &values, 4);
                    }
                }
                if let Some(indices) = primitive.indices {
                    let corners: Vec<f32> = unpacked.triangles().as_flattened().iter().map(|&vertex| vertex as f32).collect();
                    // Numbers of vertices are whole in f32 up to 2^24; beyond, the accessor's own count is in doubt anyway.
                    self.unpack(indices.value(), &AccessorValues::from_floats(corners, 1), 1);
                }
                if let Some(primitive) = self.json["meshes"][mesh]["primitives"][index].as_object_mut() {
                    drop_packing(primitive);
                }
            }
        }
        Ok(())
    }

    /// Stores the values of an accessor in a view of its own, each at a multiple of `align` bytes.
    fn unpack(&mut self, accessor: usize, values: &AccessorValues, align: usize) {
        let entry = &self.json["accessors"][accessor];
        let (component, normalized) = (entry["componentType"].as_u64().unwrap_or_default(), entry["normalized"] == true);
        let (bytes, stride) = values.encode(0..values.count, component, normalized, align);
        let view = self.push_view(&bytes);
        if align > 1 {
            self.json["bufferViews"][view]["byteStride"] = stride.into();
        }
        if let Some(entry) = self.json["accessors"][accessor].as_object_mut() {
            entry.remove("byteOffset");
            entry.insert("bufferView".into(), view.into());
            entry.insert("count".into(), values.count.into());
        }
    }

    /// Pictures in files of their own become views. A picture that is not there stays a name.
    fn embed_images(&mut self, root: &Root, buffers: &Buffers) {
        for (index, image) in root.images.iter().enumerate() {
            let Some(uri) = image.uri.as_ref().filter(|uri| !uri.starts_with("data:")) else { continue };
            let Ok(bytes) = buffers.resource(uri, &format!("images[{index}]")) else { continue };
            let Some(kind) = mime_type(&bytes) else { continue };
            let view = self.push_view(&bytes);
            if let Some(image) = self.json["images"][index].as_object_mut() {
                image.remove("uri");
                image.insert("mimeType".into(), kind.into());
                image.insert("bufferView".into(), view.into());
            }
        }
    }

    fn forget_packing(&mut self) {
        for list in ["extensionsUsed", "extensionsRequired"] {
            let Some(names) = self.json.get_mut(list).and_then(Value::as_array_mut) else { continue };
            names.retain(|name| !PACKING.iter().any(|packing| name == packing));
            if names.is_empty()
                && let Some(root) = self.json.as_object_mut()
            {
                root.remove(list);
            }
        }
    }
}

/// Adds an entry to a list of the root, and returns its index.
fn push(root: &mut Value, list: &str, entry: Value) -> usize {
    if !root[list].is_array() {
        root[list] = json!([]);
    }
    let entries = root[list].as_array_mut().unwrap_or_else(|| unreachable!("it was made a list"));
    entries.push(entry);
    entries.len() - 1
}

/// Takes the packing off an entry. Returns whether there was one.
fn drop_packing(entry: &mut Map<String, Value>) -> bool {
    let Some(extensions) = entry.get_mut("extensions").and_then(Value::as_object_mut) else { return false };
    let before = extensions.len();
    extensions.retain(|name, _| !PACKING.contains(&name.as_str()));
    let (left, is_packed) = (extensions.len(), extensions.len() < before);
    if left == 0 {
        entry.remove("extensions");
    }
    is_packed
}

/// The kind of a picture, by its first bytes.
fn mime_type(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], _); 3] = [(b"\x89PNG", "image/png"), (b"\xff\xd8\xff", "image/jpeg"), (b"RIFF", "image/webp")];
    kinds.into_iter().find(|(first, _)| bytes.starts_with(first)).map(|(_, kind)| kind)
}
