//! Bytes of a glTF file: buffers, URIs, views, and views packed by meshopt. Each is read once.

use std::borrow::Cow;
use std::cell::{Cell, OnceCell};
use std::path::PathBuf;

use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::buffer::View;
use percent_encoding::percent_decode_str;

use super::document::{BROKEN, Document};
use super::meshopt::Packed;
use crate::error::{Error, Result};
use crate::file::MOST_BYTES;
use crate::scene::format::Reader;

/// Exporters leave out padding.
const BASE64: GeneralPurpose =
    GeneralPurpose::new(&STANDARD, GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent));

/// All bytes that a file refers to.
pub struct Buffers<'a> {
    pub document: &'a Document<'a>,
    reader: &'a Reader<'a>,
    bin: Option<&'a [u8]>,
    buffers: Vec<OnceCell<Cow<'a, [u8]>>>,
    /// Those that are packed.
    unpacked: Vec<OnceCell<Vec<u8>>>,
    /// How many more vertices, triangles and instances may be made. A small file can refer to the same bytes again and again.
    left: Cell<usize>,
}

/// What any file may make, and how much more for each of its bytes.
const LEAST_ALLOWANCE: usize = 1 << 22;
const ALLOWANCE: usize = 16;

/// The longest path of a file, as in Linux.
const LONGEST_NAME: usize = 4096;

impl<'a> Buffers<'a> {
    pub fn new(document: &'a Document<'a>, reader: &'a Reader<'a>, bin: Option<&'a [u8]>, length: usize) -> Self {
        let root = &document.root;
        Self {
            document,
            reader,
            bin,
            buffers: root.buffers.iter().map(|_| OnceCell::new()).collect(),
            unpacked: root.buffer_views.iter().map(|_| OnceCell::new()).collect(),
            left: Cell::new(LEAST_ALLOWANCE.saturating_add(length.saturating_mul(ALLOWANCE))),
        }
    }

    /// Counts things that are about to be made.
    ///
    /// # Errors
    /// If the file is too small for so many.
    pub fn take(&self, count: usize) -> Result<()> {
        let Some(left) = self.left.get().checked_sub(count) else {
            let problem = "it asks for far more vertices, triangles or instances than a file of its length holds";
            return Err(self.document.fault("this glTF", problem));
        };
        self.left.set(left);
        Ok(())
    }

    /// How many things may still be made.
    pub fn left(&self) -> usize {
        self.left.get()
    }

    fn buffer(&self, index: usize) -> Result<&[u8]> {
        let buffer = self.document.entry(&self.document.root.buffers, "buffers", index)?;
        let cell = &self.buffers[index];
        if let Some(known) = cell.get() {
            return Ok(known);
        }
        let place = format!("buffers[{index}]");
        let bytes = match (&buffer.uri, self.bin) {
            (Some(uri), _) => self.resource(uri, &place)?,
            (None, Some(bin)) if index == 0 => Cow::Borrowed(bin),
            _ => return Err(self.document.fault(place, "it has no uri, and there is no binary chunk for it")),
        };
        // External bytes allow as much as those of the file itself.
        self.left.set(self.left.get().saturating_add(bytes.len().saturating_mul(ALLOWANCE)));
        Ok(cell.get_or_init(|| bytes))
    }

    /// The bytes that a URI names: in a file beside the model, or in the URI itself.
    pub fn resource(&self, uri: &str, place: &str) -> Result<Cow<'a, [u8]>> {
        if let Some(data) = uri.strip_prefix("data:") {
            return decode_data(data).map(Cow::Owned).map_err(|problem| self.document.fault(place, problem));
        }
        let file = self.file(uri, place)?;
        let cure = "put the file there, or correct its name in the glTF";
        let read = self.reader.read_named(&file, MOST_BYTES);
        read.map_err(|unread| {
            unread.error(&file, None, &format!("this file, named at {place} of {}", self.document.path.display()), cure)
        })
    }

    /// The path of a URI without data. It is relative to the model.
    pub fn file(&self, uri: &str, place: &str) -> Result<PathBuf> {
        if uri.len() > LONGEST_NAME {
            return Err(self.document.fault(place, format!("its uri has {} bytes, more than the name of a file", uri.len())));
        }
        if uri.contains("://") {
            let cure = "download the file, put it beside the model, and name it there";
            let problem = format!("{place}: {uri} is not a file beside the model");
            return Err(Error::input(self.document.path, None, problem, cure));
        }
        let name = percent_decode_str(uri).decode_utf8_lossy();
        let named = super::super::beside(self.document.path, &name);
        // A name may hold a percent sign that encodes nothing.
        let plain = super::super::beside(self.document.path, uri);
        Ok(if !self.reader.has(&named) && self.reader.has(&plain) { plain } else { named })
    }

    /// The bytes of a view, and their stride.
    pub fn view(&self, index: usize) -> Result<(&[u8], Option<usize>)> {
        let view = self.document.entry(&self.document.root.buffer_views, "bufferViews", index)?;
        let Some(packed) = Packed::of(view).map_err(|problem| self.view_fault(index, problem))? else {
            let bytes =
                self.range(index, view.buffer.value(), view.byte_offset.map_or(0, |offset| offset.0), view.byte_length.0)?;
            return Ok((bytes, stride(view)));
        };
        let cell = &self.unpacked[index];
        if cell.get().is_none() {
            let bytes = self.range(index, packed.buffer, packed.byte_offset, packed.byte_length)?;
            packed.check(bytes).map_err(|problem| self.view_fault(index, problem))?;
            // A vertex has some 16 bytes.
            self.take(packed.size() / 16)?;
            let unpacked = packed.unpack(bytes).map_err(|problem| self.view_fault(index, problem))?;
            cell.get_or_init(|| unpacked);
        }
        // An accessor over packed data has the stride of the packing, unless it is of indices, which lie close.
        Ok((cell.get().map_or(&[], Vec::as_slice), packed.vertex_stride().or_else(|| stride(view))))
    }

    fn range(&self, view: usize, buffer: usize, offset: u64, length: u64) -> Result<&[u8]> {
        let bytes = self.buffer(buffer)?;
        let range = usize::try_from(offset).ok().zip(offset.checked_add(length).and_then(|end| usize::try_from(end).ok()));
        range.and_then(|(start, end)| bytes.get(start..end)).ok_or_else(|| {
            let problem =
                format!("{length} bytes from {offset} lie outside of buffers[{buffer}], which has {} bytes", bytes.len());
            self.view_fault(view, problem)
        })
    }

    fn view_fault(&self, view: usize, problem: String) -> Error {
        Error::input(self.document.path, None, format!("bufferViews[{view}]: {problem}"), BROKEN)
    }
}

/// Zero means none to some exporters.
fn stride(view: &View) -> Option<usize> {
    view.byte_stride.map(|stride| stride.0).filter(|&stride| stride > 0)
}

/// The bytes of a data URI after `data:`.
fn decode_data(data: &str) -> Result<Vec<u8>, String> {
    let (about, data) = data.split_once(',').ok_or("its data URI has no comma")?;
    if !about.ends_with(";base64") {
        return Ok(percent_decode_str(data).collect());
    }
    let data = Cow::from(percent_decode_str(data));
    BASE64.decode(data.trim_ascii()).map_err(|error| format!("its data URI is not base64: {error}"))
}
