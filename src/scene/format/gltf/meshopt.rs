//! Views packed by meshopt: `EXT_meshopt_compression`, and `KHR_meshopt_compression` with the same contents.
//!
//! The decoders are meshoptimizer's own. They check what they read, but take sizes on trust; those are checked here.

use gltf::json::buffer::View;
use meshopt::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer, decode_index_sequence,
    decode_vertex_buffer,
};
use serde::Deserialize;

use crate::file::can_hold;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Packed {
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    byte_stride: usize,
    pub count: usize,
    mode: Coding,
    #[serde(default)]
    filter: Filtering,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
enum Coding {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
enum Filtering {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Packed {
    /// How a view is packed, if it is.
    pub fn of(view: &View) -> Result<Option<Self>, String> {
        let extensions = view.extensions.as_ref().map(|extensions| &extensions.others);
        let find = |name| extensions.and_then(|extensions| extensions.get(name));
        let Some(value) = find("EXT_meshopt_compression").or_else(|| find("KHR_meshopt_compression")) else { return Ok(None) };
        Self::deserialize(value).map(Some).map_err(|error| format!("its meshopt compression is malformed: {error}"))
    }

    pub fn vertex_stride(&self) -> Option<usize> {
        matches!(self.mode, Coding::Attributes).then_some(self.byte_stride)
    }

    /// Whether the bytes can hold what is said of them. Each index takes a part of a byte, and each block of equal vertices a few.
    pub fn check(&self, bytes: &[u8]) -> Result<(), String> {
        let size = self.count.checked_mul(self.byte_stride);
        if !size.is_some_and(|size| can_hold(bytes, size as u64)) {
            return Err(format!("{} packed bytes cannot hold {} of {} bytes", bytes.len(), self.count, self.byte_stride));
        }
        Ok(())
    }

    /// The number of unpacked bytes.
    pub fn size(&self) -> usize {
        self.count.saturating_mul(self.byte_stride)
    }

    /// Unpacks bytes that [`Self::check`] has accepted.
    pub fn unpack(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let unpacked = match (self.mode, self.byte_stride) {
            (Coding::Attributes, stride) => return self.vertices(stride, bytes),
            (Coding::Triangles, _) if !self.count.is_multiple_of(3) => {
                return Err(format!("{} indices are no whole triangles", self.count));
            }
            (Coding::Triangles, 2) => decode_index_buffer::<u16>(bytes, self.count).map(bytes_of),
            (Coding::Triangles, 4) => decode_index_buffer::<u32>(bytes, self.count).map(bytes_of),
            (Coding::Indices, 2) => decode_index_sequence::<u16>(bytes, self.count).map(bytes_of),
            (Coding::Indices, 4) => decode_index_sequence::<u32>(bytes, self.count).map(bytes_of),
            (_, stride) => return Err(format!("its packed indices have {stride} bytes")),
        };
        unpacked.map_err(|_| CORRUPT.to_owned())
    }

    fn vertices(&self, stride: usize, bytes: &[u8]) -> Result<Vec<u8>, String> {
        /// The size of a vertex is known to the compiler alone.
        macro_rules! by_words {
            ($($words:literal)*) => {
                match stride {
                    $(_ if stride == 4 * $words => self.filtered::<$words>(bytes),)*
                    _ => Err(format!("its packed vertices have {stride} bytes, no multiple of 4 up to 256")),
                }
            };
        }
        by_words!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37 38 39 40
            41 42 43 44 45 46 47 48 49 50 51 52 53 54 55 56 57 58 59 60 61 62 63 64)
    }

    /// Vertices of `N` words.
    fn filtered<const N: usize>(&self, bytes: &[u8]) -> Result<Vec<u8>, String> {
        let words: Vec<Vertex<N>> = decode_vertex_buffer(bytes, self.count).map_err(|_| CORRUPT.to_owned())?;
        let mut words: Vec<[u32; N]> = words.into_iter().map(|Vertex(words)| words).collect();
        let flat = words.as_flattened_mut();
        match (self.filter, N) {
            (Filtering::None, _) => {}
            (Filtering::Octahedral, 1) => decode_filter_oct(bytemuck::cast_slice_mut::<_, [i8; 4]>(flat)),
            (Filtering::Octahedral, 2) => decode_filter_oct(bytemuck::cast_slice_mut::<_, [i16; 4]>(flat)),
            (Filtering::Quaternion, 2) => decode_filter_quat(bytemuck::cast_slice_mut(flat)),
            (Filtering::Exponential, _) => decode_filter_exp(&mut words),
            (Filtering::Color, 1) => decode_filter_color(bytemuck::cast_slice_mut::<_, [u8; 4]>(flat)),
            (Filtering::Color, 2) => decode_filter_color(bytemuck::cast_slice_mut::<_, [u16; 4]>(flat)),
            _ => return Err(format!("its filter does not fit vertices of {} bytes", 4 * N)),
        }
        Ok(bytemuck::cast_slice(words.as_flattened()).to_vec())
    }
}

const CORRUPT: &str = "its packed bytes are corrupt";

/// An array of any length has no default of its own.
#[derive(Clone, Copy)]
struct Vertex<const N: usize>([u32; N]);

impl<const N: usize> Default for Vertex<N> {
    fn default() -> Self {
        Self([0; N])
    }
}

fn bytes_of<T: bytemuck::NoUninit>(values: Vec<T>) -> Vec<u8> {
    bytemuck::cast_slice(&values).to_vec()
}
