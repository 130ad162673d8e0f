//! Reads and writes NumPy's arrays (`.npy`).
//!
//! The crate `npyz` is not used: it needs a dozen crates to read one header line, and reserves any length that the line states.

use std::path::Path;

use crate::error::{Error, Result};

const MAGIC: &[u8] = b"\x93NUMPY";

/// An array of floats. It borrows the bytes of its file.
pub struct Array<'a> {
    pub shape: Vec<usize>,
    /// For each dimension, the number of items from one index to the next.
    strides: Vec<usize>,
    item: Item,
    data: &'a [u8],
}

/// The type of a number, with its decoder.
#[derive(Clone, Copy)]
enum Item {
    F4(fn([u8; 4]) -> f32),
    F8(fn([u8; 8]) -> f64),
}

impl Item {
    fn size(self) -> usize {
        match self {
            Self::F4(_) => 4,
            Self::F8(_) => 8,
        }
    }
}

impl<'a> Array<'a> {
    /// Parses the `bytes` of the file at `path`.
    pub fn parse(path: &Path, bytes: &'a [u8]) -> Result<Self> {
        let refused = |problem: String| Error::input(path, None, problem, "save it again by numpy.save, as float32 or float64");
        let garbled = || refused("this is not a NumPy array with a header of version 1 to 3".into());
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(garbled)?;
        // The version, then the header's length, in two bytes for version 1 and in four for later versions.
        let (length, rest) = match *rest {
            [1, _, a, b, ref rest @ ..] => (usize::from(u16::from_le_bytes([a, b])), rest),
            [2 | 3, _, a, b, c, d, ref rest @ ..] => (u32::from_le_bytes([a, b, c, d]) as usize, rest),
            _ => return Err(garbled()),
        };
        let (header, data) = rest.split_at_checked(length).ok_or_else(garbled)?;
        let header: String = String::from_utf8_lossy(header).split_whitespace().collect();
        let value = |key: &str| header.split_once(&format!("'{key}':")).map(|(_, value)| value).ok_or_else(garbled);

        let kind = value("descr")?;
        let item = match kind.get(..5) {
            Some("'<f4'") => Item::F4(f32::from_le_bytes),
            Some("'>f4'") => Item::F4(f32::from_be_bytes),
            Some("'<f8'") => Item::F8(f64::from_le_bytes),
            Some("'>f8'") => Item::F8(f64::from_be_bytes),
            _ => return Err(refused(format!("its numbers are of the type {}", kind.split(',').next().unwrap_or_default()))),
        };
        let is_fortran = value("fortran_order")?.starts_with("True");
        let shape = value("shape")?.strip_prefix('(').and_then(|shape| shape.split_once(')')).ok_or_else(garbled)?.0;
        let shape: Result<Vec<usize>, _> = shape.split(',').filter(|side| !side.is_empty()).map(str::parse).collect();
        let shape = shape.map_err(|_| garbled())?;

        // An empty array may have other sides of any length. Their strides must not overflow.
        let least = shape.iter().try_fold(item.size(), |size, &side| size.checked_mul(side.max(1)));
        if least.is_none() || data.len() != item.size() * shape.iter().product::<usize>() {
            return Err(refused(format!(
                "its header says {shape:?} numbers of {} bytes, but {} bytes follow",
                item.size(),
                data.len()
            )));
        }
        let mut strides = vec![1; shape.len()];
        for i in 1..shape.len() {
            let [one, next] = if is_fortran { [i, i - 1] } else { [shape.len() - 1 - i, shape.len() - i] };
            strides[one] = strides[next] * shape[next];
        }
        Ok(Self { shape, strides, item, data })
    }

    /// The number at an index within the shape.
    pub fn at(&self, index: &[usize]) -> f64 {
        let start = self.item.size() * index.iter().zip(&self.strides).map(|(index, stride)| index * stride).sum::<usize>();
        match self.item {
            Item::F4(decode) => decode(std::array::from_fn(|i| self.data[start + i])).into(),
            Item::F8(decode) => decode(std::array::from_fn(|i| self.data[start + i])),
        }
    }
}

/// Encodes 32-bit floats, with the last index running fastest.
pub fn encode(shape: &[usize], numbers: impl Iterator<Item = f32>) -> Vec<u8> {
    encode_words(shape, "<f4", numbers.map(f32::to_le_bytes))
}

/// Encodes whole numbers of 32 bits in the same way.
pub fn encode_u32(shape: &[usize], numbers: impl Iterator<Item = u32>) -> Vec<u8> {
    encode_words(shape, "<u4", numbers.map(u32::to_le_bytes))
}

/// Encodes 64-bit floats in the same way.
pub fn encode_f64(shape: &[usize], numbers: impl Iterator<Item = f64>) -> Vec<u8> {
    encode_words(shape, "<f8", numbers.map(f64::to_le_bytes))
}

/// Encodes a text, as an array without dimensions: `str(array)` in Python.
pub fn encode_text(text: &str) -> Vec<u8> {
    // A text without letters has no type in NumPy.
    let letters = text.chars().count().max(1);
    let words = text.chars().map(u32::from).chain(text.is_empty().then_some(0)).map(u32::to_le_bytes);
    encode_words(&[], &format!("<U{letters}"), words)
}

/// Decodes a text of [`encode_text`].
pub fn parse_text(bytes: &[u8]) -> Option<String> {
    let (length, rest) = bytes.strip_prefix(MAGIC)?.strip_prefix(&[1, 0])?.split_first_chunk()?;
    let words = rest.get(u16::from_le_bytes(*length).into()..)?.as_chunks().0;
    words.iter().map(|word| char::from_u32(u32::from_le_bytes(*word))).filter(|letter| *letter != Some('\0')).collect()
}

/// Whether a file begins as those of [`encode_u32`].
pub fn is_u32(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) && bytes.get(MAGIC.len() + 4..).is_some_and(|header| header.starts_with(b"{'descr': '<u4'"))
}

fn encode_words<const SIZE: usize>(shape: &[usize], kind: &str, words: impl Iterator<Item = [u8; SIZE]>) -> Vec<u8> {
    // In Python, a tuple of one number needs a comma.
    let shape: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let mut header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    // Numbers begin at a multiple of 64 bytes, so that the file can be mapped into memory.
    let start = (MAGIC.len() + 4 + header.len() + 1).next_multiple_of(64);
    header.extend(std::iter::repeat_n(' ', start - MAGIC.len() - 4 - header.len() - 1));
    header.push('\n');
    let length = (header.len() as u16).to_le_bytes();
    let mut bytes = [MAGIC, &[1, 0], &length, header.as_bytes()].concat();
    bytes.extend(words.flatten());
    bytes
}
