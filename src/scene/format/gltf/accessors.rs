//! Typed values of a glTF file: all component types, normalised or not, with any stride, sparse, and from draco.

use std::collections::HashMap;

use gltf::json::accessor::sparse::Sparse;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;

use super::buffers::Buffers;
use crate::error::Result;

/// Component types, as constants of OpenGL.
const I8: u64 = 5120;
const U8: u64 = 5121;
const I16: u64 = 5122;
const U16: u64 = 5123;
const U32: u64 = 5125;

/// Values that an accessor gives, each of some components. All are checked to be there.
pub struct AccessorValues<'a> {
    pub count: usize,
    /// Components of a value.
    pub width: usize,
    storage: Storage<'a>,
}

enum Storage<'a> {
    /// From bytes, or zero where there are none, with exceptions by index.
    Packed {
        elements: Option<Elements<'a>>,
        exceptions: HashMap<u32, u32>,
        exceptional: Option<Elements<'a>>,
        format: ComponentFormat,
    },
    Floats(Vec<f32>),
}

/// How a component is stored.
#[derive(Clone, Copy)]
struct ComponentFormat {
    component: ComponentType,
    normalized: bool,
}

/// Bytes from the first element on.
#[derive(Clone, Copy)]
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl ComponentFormat {
    fn number(self, bytes: &[u8], at: usize) -> f32 {
        let most = |most: f32| if self.normalized { most } else { 1.0 };
        let least = if self.normalized { -1.0 } else { f32::MIN };
        match self.component {
            ComponentType::I8 => (f32::from(bytes[at] as i8) / most(127.0)).max(least),
            ComponentType::U8 => f32::from(bytes[at]) / most(255.0),
            ComponentType::I16 => (f32::from(i16::from_le_bytes([bytes[at], bytes[at + 1]])) / most(32767.0)).max(least),
            ComponentType::U16 => f32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])) / most(65535.0),
            ComponentType::U32 => word(bytes, at) as f32 / most(u32::MAX as f32),
            ComponentType::F32 => f32::from_bits(word(bytes, at)),
        }
    }
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

/// A whole number of one, two or four bytes.
fn whole(component: ComponentType, bytes: &[u8], at: usize) -> u32 {
    match component.size() {
        1 => u32::from(bytes[at]),
        2 => u32::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])),
        _ => word(bytes, at),
    }
}

impl AccessorValues<'_> {
    /// AccessorValues from numbers in sequence.
    pub fn from_floats(floats: Vec<f32>, width: usize) -> Self {
        Self { count: floats.len() / width, width, storage: Storage::Floats(floats) }
    }

    /// The first `N` components of a value; zero where it has fewer. `index` must be below `count`.
    pub fn get<const N: usize>(&self, index: usize) -> [f32; N] {
        let most = self.width.min(N);
        let mut value = [0.0; N];
        match &self.storage {
            Storage::Floats(floats) => value[..most].copy_from_slice(&floats[index * self.width..][..most]),
            Storage::Packed { format, .. } => {
                if let Some((bytes, at)) = self.place(index) {
                    for (component, value) in value[..most].iter_mut().enumerate() {
                        *value = format.number(bytes, at + component * format.component.size());
                    }
                }
            }
        }
        value
    }

    /// The value as an index. `index` must be below `count`.
    pub fn index(&self, index: usize) -> u32 {
        match &self.storage {
            Storage::Floats(floats) => floats[index * self.width] as u32,
            Storage::Packed { format, .. } => self.place(index).map_or(0, |(bytes, at)| whole(format.component, bytes, at)),
        }
    }

    /// Some of the values, in a component type of glTF that need not be their own, each at a multiple of `align` bytes. Also returns their distance.
    pub fn encode(&self, order: impl Iterator<Item = usize>, component: u64, normalized: bool, align: usize) -> (Vec<u8>, usize) {
        let size = match component {
            I8 | U8 => 1,
            I16 | U16 => 2,
            _ => 4,
        };
        let stride = (size * self.width).next_multiple_of(align);
        let most = |most: f32| if normalized { most } else { 1.0 };
        let mut bytes = Vec::new();
        for index in order {
            let end = bytes.len() + stride;
            if let Some(stored) = self.stored(index, size, component, normalized) {
                bytes.extend(stored);
                bytes.resize(end, 0);
                continue;
            }
            for number in (0..self.width).map(|component| self.number(index, component)) {
                match component {
                    I8 => bytes.push(((number * most(127.0)).round() as i8).cast_unsigned()),
                    U8 => bytes.push((number * most(255.0)).round() as u8),
                    I16 => bytes.extend(((number * most(32767.0)).round() as i16).to_le_bytes()),
                    U16 => bytes.extend(((number * most(65535.0)).round() as u16).to_le_bytes()),
                    U32 => bytes.extend((number as u32).to_le_bytes()),
                    _ => bytes.extend(number.to_le_bytes()),
                }
            }
            bytes.resize(end, 0);
        }
        (bytes, stride)
    }

    /// The bytes of a value that are of this type already. No bit of them may change, and floats hold no whole number beyond 2^24.
    fn stored(&self, index: usize, size: usize, component: u64, normalized: bool) -> Option<&[u8]> {
        let Storage::Packed { format, .. } = &self.storage else { return None };
        let is_same = u64::from(format.component.as_gl_enum()) == component && format.normalized == normalized;
        let (bytes, at) = self.place(index).filter(|_| is_same)?;
        bytes.get(at..at + size * self.width)
    }

    fn number(&self, index: usize, component: usize) -> f32 {
        match &self.storage {
            Storage::Floats(floats) => floats[index * self.width + component],
            Storage::Packed { format, .. } => {
                self.place(index).map_or(0.0, |(bytes, at)| format.number(bytes, at + component * format.component.size()))
            }
        }
    }

    /// The bytes of a value, and where in them it starts.
    fn place(&self, index: usize) -> Option<(&[u8], usize)> {
        let Storage::Packed { elements, exceptions, exceptional, .. } = &self.storage else { return None };
        // Most accessors have no exceptions, and a look-up takes longer than a read.
        let exception = if exceptions.is_empty() { None } else { exceptions.get(&(index as u32)) };
        let (elements, index) = match exception {
            Some(&exception) => (exceptional.as_ref()?, exception as usize),
            None => (elements.as_ref()?, index),
        };
        Some((elements.bytes, index * elements.stride))
    }
}

impl<'a> Buffers<'a> {
    /// The values of an accessor, whose type has one of these numbers of components.
    pub fn values(&self, index: usize, widths: &[usize]) -> Result<AccessorValues<'_>> {
        let accessor = self.document.entry(&self.document.root.accessors, "accessors", index)?;
        let place = format!("accessors[{index}]");
        let fault = |problem: String| self.document.fault(&place, problem);
        let (width, format) = shape(accessor).map_err(fault)?;
        if !widths.contains(&width) {
            return Err(fault(format!("its values have {width} components, not {widths:?}")));
        }
        let size = width * format.component.size();
        let (count, elements) = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                let elements = self.elements(&place, view.value(), offset, accessor.count.0, size)?;
                (elements.count, Some(elements))
            }
            None => (self.zeros(accessor.count.0).map_err(fault)?, None),
        };
        let (mut exceptions, mut exceptional) = (HashMap::new(), None);
        if let Some(Sparse { count, indices, values, .. }) = &accessor.sparse {
            let Checked::Valid(component) = indices.component_type else {
                return Err(fault("its sparse indices are of no known type".into()));
            };
            let places =
                self.elements(&place, indices.buffer_view.value(), indices.byte_offset.0, count.0, component.0.size())?;
            let values = self.elements(&place, values.buffer_view.value(), values.byte_offset.0, count.0, size)?;
            self.take(places.count)?;
            let place = |entry: usize| whole(component.0, places.bytes, entry * places.stride);
            exceptions = (0..places.count).map(|entry| (place(entry), entry as u32)).collect();
            exceptional = Some(values);
        }
        Ok(AccessorValues { count, width, storage: Storage::Packed { elements, exceptions, exceptional, format } })
    }

    /// A number of values that have no bytes of their own, if so many may be made.
    fn zeros(&self, count: u64) -> Result<usize, String> {
        let problem = || format!("its count is {count}, and the file is too small for that");
        usize::try_from(count).ok().filter(|&count| count <= self.left()).ok_or_else(problem)
    }

    /// Elements of a view, all of which are there. `place` refers to them.
    fn elements(&self, place: &str, view: usize, offset: u64, count: u64, size: usize) -> Result<Elements<'_>> {
        let (all, stride) = self.view(view)?;
        let stride = stride.unwrap_or(size);
        let bytes = usize::try_from(offset).ok().and_then(|offset| all.get(offset..));
        let count_there = usize::try_from(count).ok().filter(|&count| count < u32::MAX as usize);
        let end = |count: usize| count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
        match (bytes, count_there, count_there.and_then(end)) {
            (Some(bytes), Some(count), Some(end)) if end <= bytes.len() => Ok(Elements { bytes, stride, count }),
            _ => {
                let elements = format!("{count} elements of {size} bytes, {stride} apart, from byte {offset}");
                Err(self.document.fault(place, format!("{elements} do not fit into bufferViews[{view}] of {} bytes", all.len())))
            }
        }
    }
}

/// Number of components, and their format.
fn shape(accessor: &Accessor) -> Result<(usize, ComponentFormat), String> {
    let Checked::Valid(component) = accessor.component_type else { return Err("its componentType is unknown".into()) };
    let width = match accessor.type_ {
        Checked::Valid(Type::Scalar) => 1,
        Checked::Valid(Type::Vec2) => 2,
        Checked::Valid(Type::Vec3) => 3,
        Checked::Valid(Type::Vec4 | Type::Mat2) => 4,
        Checked::Valid(Type::Mat3) => 9,
        Checked::Valid(Type::Mat4) => 16,
        Checked::Invalid => return Err("its type is unknown".into()),
    };
    Ok((width, ComponentFormat { component: component.0, normalized: accessor.normalized }))
}

/// What an accessor divides its whole numbers by.
pub fn divisor(accessor: &Accessor) -> f32 {
    match accessor.component_type {
        Checked::Valid(component) if accessor.normalized => match component.0 {
            ComponentType::I8 => 127.0,
            ComponentType::U8 => 255.0,
            ComponentType::I16 => 32767.0,
            ComponentType::U16 => 65535.0,
            ComponentType::U32 | ComponentType::F32 => 1.0,
        },
        _ => 1.0,
    }
}
