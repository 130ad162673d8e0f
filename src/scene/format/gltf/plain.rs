//! A glTF file in one piece: all buffers and pictures in one binary chunk, nothing packed. What is added to a file is added to this.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use gltf::json::Root;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde_json::{Map, Value, json};

use super::accessors::AccessorValues;
use super::buffers::Buffers;
use super::document::{Container, Document, whole};
use super::draco::Unpacked;
use crate::error::{Error, Result};
use crate::file::MOST_BYTES;
use crate::scene::GltfFile;
use crate::scene::format::Reader;

/// Extensions that are gone when nothing is packed.
const PACKING: [&str; 3] = ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Constants of OpenGL: a mode, and two types.
const TRIANGLES: u64 = 4;
const UNSIGNED_INT: u64 = 5125;
const FLOAT: u64 = 5126;

/// A glTF file in one piece. Indices of its lists are those of the file. Views and accessors may be more.
pub struct PlainGltf {
    pub json: Value,
    pub bin: Vec<u8>,
    /// All files that were read, also pictures that no material of the scene uses.
    pub files: Vec<PathBuf>,
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
        let mut json = serde_json::from_slice(container.json)
            .map_err(|error| Error::input(path, None, format!("this is not a valid glTF: {error}"), "export the model again"))?;
        if Root::deserialize(&json).is_err() {
            whole(&mut json);
        }
        check_objects(&document, &json)?;
        if json["buffers"].get(0).is_none() {
            json["buffers"] = json!([{}]);
        }
        let root = &document.root;
        let mut plain = Self { json, bin: container.bin.map(<[u8]>::to_vec).unwrap_or_default(), files: Vec::new() };
        let is_plain = root.buffers.len() <= 1 && root.buffers.iter().all(|buffer| buffer.uri.is_none()) && !plain.is_packed();
        if !is_plain {
            plain.join_views(&buffers)?;
            plain.unpack_primitives(&buffers)?;
            plain.forget_packing();
        }
        plain.embed_images(root, &buffers);
        Ok(Self { files: reader.into_done(), ..plain })
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
        let used = self.json["extensionsUsed"].as_array().into_iter().flatten();
        let views = self.json["bufferViews"].as_array().into_iter().flatten();
        used.filter_map(Value::as_str).any(|name| PACKING.contains(&name)) || views.chain(primitives(&self.json)).any(has_packing)
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

    /// Puts the bytes of all views into one buffer, those that views share once.
    fn join_views(&mut self, buffers: &Buffers) -> Result<()> {
        let is_packed = |json: &Self, view: usize| has_packing(&json.json["bufferViews"][view]);
        let views = 0..buffers.document.root.buffer_views.len();
        let (packed, plain): (Vec<_>, Vec<_>) = views.partition(|&view| is_packed(self, view));
        self.bin.clear();
        self.join_plain(buffers, plain)?;
        let mut strides = HashMap::new();
        for index in packed {
            let (bytes, stride) = buffers.view(index)?;
            let place = self.view(bytes);
            self.put_view(index, place);
            strides.extend(stride.map(|stride| (index, stride)));
        }
        self.set_strides(buffers, &strides);
        let mut first = self.json["buffers"][0].take();
        if let Some(first) = first.as_object_mut() {
            drop_packing(first);
            first.remove("uri");
        }
        self.json["buffers"] = json!([first]);
        Ok(())
    }

    /// Puts the bytes of views that are not packed into the buffer. Many views may lie on the same bytes.
    fn join_plain(&mut self, buffers: &Buffers, mut views: Vec<usize>) -> Result<()> {
        let all = &buffers.document.root.buffer_views;
        let start = |view: usize| (all[view].buffer.value(), all[view].byte_offset.map_or(0, |offset| offset.0 as usize));
        views.sort_by_key(|&view| start(view));
        // A buffer, and the part of it that was put last, with its place.
        let (mut last, mut first, mut end, mut at) = (None, 0, 0, 0);
        for view in views {
            let (bytes, _) = buffers.view(view)?;
            let (buffer, offset) = start(view);
            if last != Some(buffer) || offset > end {
                // Numbers stay at multiples of their size.
                let aligned = self.bin.len().next_multiple_of(4) + offset % 4;
                self.bin.resize(aligned, 0);
                (last, first, end, at) = (Some(buffer), offset, offset, aligned);
            }
            self.bin.extend(bytes.get(end - offset..).unwrap_or_default());
            end = end.max(offset + bytes.len());
            self.put_view(view, json!({"buffer": 0, "byteOffset": at + offset - first, "byteLength": bytes.len()}));
        }
        Ok(())
    }

    /// Gives a view its place.
    fn put_view(&mut self, index: usize, place: Value) {
        if let (Some(view), Value::Object(place)) = (self.json["bufferViews"][index].as_object_mut(), place) {
            view.extend(place);
            drop_packing(view);
        }
    }

    /// Sets the strides of unpacked views of vertices. Accessors of other things may have none, so their values are stored again if they do not lie close.
    fn set_strides(&mut self, buffers: &Buffers, strides: &HashMap<usize, usize>) {
        let accessors = &buffers.document.root.accessors;
        let lists = primitives(&self.json).flat_map(|primitive| {
            let targets = primitive["targets"].as_array().into_iter().flatten();
            targets.chain([&primitive["attributes"]])
        });
        let numbers = lists.filter_map(Value::as_object).flat_map(Map::values).filter_map(Value::as_u64);
        let of_vertices: HashSet<usize> = numbers.map(|accessor| accessor as usize).collect();
        let view_of = |accessor: usize| accessors.get(accessor)?.buffer_view.map(|view| view.value());
        let of_vertices_views: HashSet<usize> = of_vertices.iter().filter_map(|&accessor| view_of(accessor)).collect();
        for (&view, &stride) in strides.iter().filter(|(view, _)| of_vertices_views.contains(*view)) {
            self.json["bufferViews"][view]["byteStride"] = stride.into();
        }
        for accessor in (0..accessors.len()).filter(|accessor| !of_vertices.contains(accessor)) {
            let Some((view, &stride)) = view_of(accessor).and_then(|view| Some((view, strides.get(&view)?))) else { continue };
            // Nothing has asked for what cannot be read.
            let Ok(values) = buffers.values(accessor, &[1, 2, 3, 4, 9, 16]) else { continue };
            if of_vertices_views.contains(&view) || self.size_of(accessor, values.width) != stride {
                self.unpack(accessor, &values, 1);
            }
        }
    }

    /// The size of an accessor's elements, each of `width` components.
    fn size_of(&self, accessor: usize, width: usize) -> usize {
        let component = self.json["accessors"][accessor]["componentType"].as_u64();
        width * component.and_then(number_size).unwrap_or(4)
    }

    /// Gives the accessors of primitives that draco packs their values.
    fn unpack_primitives(&mut self, buffers: &Buffers) -> Result<()> {
        for (mesh, json) in buffers.document.root.meshes.iter().enumerate() {
            for (index, primitive) in json.primitives.iter().enumerate() {
                let place = format!("meshes[{mesh}].primitives[{index}]");
                let Some(unpacked) = Unpacked::of(buffers, primitive, &place)? else { continue };
                for (name, accessor) in &primitive.attributes {
                    let Checked::Valid(name) = name else { continue };
                    if let Some(values) = unpacked.values(buffers, &name.to_string(), accessor.value())? {
                        // Vertices begin at multiples of four bytes.
                        self.unpack(accessor.value(), &values, 4);
                    }
                }
                let corners: Vec<f32> = unpacked.triangles().as_flattened().iter().map(|&vertex| vertex as f32).collect();
                let indices = primitive.indices.map_or_else(
                    || push(&mut self.json, "accessors", json!({"componentType": UNSIGNED_INT, "type": "SCALAR"})),
                    |indices| indices.value(),
                );
                // Numbers of vertices are whole in f32 up to 2^24; beyond, the accessor's own count is in doubt anyway.
                self.unpack(indices, &AccessorValues::from_floats(corners, 1), 1);
                if let Some(primitive) = self.json["meshes"][mesh]["primitives"][index].as_object_mut() {
                    drop_packing(primitive);
                    primitive.insert("indices".into(), indices.into());
                    // What was a strip is a list of triangles.
                    if let Some(mode) = primitive.get_mut("mode") {
                        *mode = TRIANGLES.into();
                    }
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
            ["byteOffset", "sparse"].iter().for_each(|key| drop(entry.remove(*key)));
            entry.insert("bufferView".into(), view.into());
            entry.insert("count".into(), values.count.into());
            // Packing moves values a little.
            if values.count > 0 && ["min", "max"].iter().any(|key| entry.contains_key(*key)) {
                let [min, max] = bounds(&bytes, stride, values.width, component);
                entry.insert("min".into(), min);
                entry.insert("max".into(), max);
            }
        }
    }

    /// Pictures in files of their own become views. A picture that is not there stays a name.
    fn embed_images(&mut self, root: &Root, buffers: &Buffers) {
        let mut views = HashMap::new();
        for (index, image) in root.images.iter().enumerate() {
            let Some(uri) = image.uri.as_ref().filter(|uri| !uri.starts_with("data:")) else { continue };
            let known = views.entry(uri).or_insert_with(|| {
                let bytes = buffers.resource(uri, &format!("images[{index}]")).ok()?;
                Some((mime_type(&bytes)?, self.push_view(&bytes)))
            });
            let Some((kind, view)) = *known else { continue };
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

/// All primitives of all meshes.
fn primitives(root: &Value) -> impl Iterator<Item = &Value> {
    let meshes = root["meshes"].as_array().into_iter().flatten();
    meshes.flat_map(|mesh| mesh["primitives"].as_array().into_iter().flatten())
}

/// Refuses lists in place of objects, which the crate's types read as well.
fn check_objects(document: &Document, root: &Value) -> Result<()> {
    let is_sound = |entry: &Value| entry.is_object() && (entry["extensions"].is_null() || entry["extensions"].is_object());
    let fault = |place: &str| Err(document.fault(place, "it or its extensions are no object"));
    if !is_sound(root) || !is_sound(&root["asset"]) {
        return fault("asset or the root");
    }
    for list in ["accessors", "buffers", "bufferViews", "images", "materials", "meshes", "nodes", "samplers", "textures"] {
        if let Some(index) = root[list].as_array().and_then(|list| list.iter().position(|entry| !is_sound(entry))) {
            return fault(&format!("{list}[{index}]"));
        }
    }
    if primitives(root).all(is_sound) { Ok(()) } else { fault("a primitive") }
}

fn has_packing(entry: &Value) -> bool {
    PACKING.iter().any(|packing| !entry["extensions"][packing].is_null())
}

/// Takes the packing off an entry.
fn drop_packing(entry: &mut Map<String, Value>) {
    let Some(extensions) = entry.get_mut("extensions").and_then(Value::as_object_mut) else { return };
    extensions.retain(|name, _| !PACKING.contains(&name.as_str()));
    if extensions.is_empty() {
        entry.remove("extensions");
    }
}

/// The least and the greatest of each component, as stored.
fn bounds(bytes: &[u8], stride: usize, width: usize, component: u64) -> [Value; 2] {
    let size = number_size(component).unwrap_or(4);
    let mut bounds = [vec![f64::INFINITY; width], vec![f64::NEG_INFINITY; width]];
    for element in bytes.chunks_exact(stride.max(1)) {
        for (at, number) in element.chunks_exact(size).take(width).enumerate() {
            let number = stored(number, component);
            bounds[0][at] = bounds[0][at].min(number);
            bounds[1][at] = bounds[1][at].max(number);
        }
    }
    let number = |number: f64| if component == FLOAT { json!(number) } else { json!(number as i64) };
    bounds.map(|bounds| bounds.into_iter().map(number).collect())
}

/// A number of a component type, not normalised.
fn stored(bytes: &[u8], component: u64) -> f64 {
    match (component, bytes) {
        (5120, &[a]) => f64::from(a.cast_signed()),
        (_, &[a]) => f64::from(a),
        (5122, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
        (_, &[a, b]) => f64::from(u16::from_le_bytes([a, b])),
        (FLOAT, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
        (_, &[a, b, c, d]) => f64::from(u32::from_le_bytes([a, b, c, d])),
        _ => 0.0,
    }
}

/// The size of a component in bytes.
fn number_size(component: u64) -> Option<usize> {
    match component {
        5120 | 5121 => Some(1),
        5122 | 5123 => Some(2),
        UNSIGNED_INT | FLOAT => Some(4),
        _ => None,
    }
}

/// The kind of a picture, by its first bytes.
fn mime_type(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(usize, &[u8], _); 5] = [
        (0, b"\x89PNG", "image/png"),
        (0, b"\xff\xd8\xff", "image/jpeg"),
        (0, b"RIFF", "image/webp"),
        (0, b"\xabKTX 20", "image/ktx2"),
        (4, b"ftypavif", "image/avif"),
    ];
    let is = |&&(at, first, _): &&(usize, &[u8], _)| bytes.get(at..).is_some_and(|bytes| bytes.starts_with(first));
    kinds.iter().find(is).map(|&(_, _, kind)| kind)
}
