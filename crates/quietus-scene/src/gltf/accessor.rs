//! Checked reading of accessors (specification, section 3.6.2): every range is compared with the bytes there are
//! before a single one is read or allocated.

use super::document::Document;
use super::schema::{Accessor, Sparse};
use crate::error::{ErrorKind, SceneError};
use crate::limit;

/// Most elements of an accessor without a buffer view: it stands for zeros, so no data bounds it.
const MAX_ZEROS: u64 = limit(1 << 24);

/// Type of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// Whether numbers of this type may be indices.
    fn is_index(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    /// Size in bytes.
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The integer that stands for 1 where integers are normalized.
    fn unit(self) -> f32 {
        match self {
            Self::I8 => 127.0,
            Self::U8 => 255.0,
            Self::I16 => 32767.0,
            Self::U16 => 65535.0,
            Self::U32 => u32::MAX as f32,
            Self::F32 => 1.0,
        }
    }

    /// The number in the first bytes of `bytes`, which are at least `size`; normalized integers as section 3.11
    /// of the specification says.
    fn decode(self, bytes: &[u8], normalized: bool) -> f32 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let value = match self {
            Self::I8 => f32::from(i8::from_le_bytes([bytes[0]])),
            Self::U8 => f32::from(bytes[0]),
            Self::I16 => f32::from(i16::from_le_bytes(two())),
            Self::U16 => f32::from(u16::from_le_bytes(two())),
            Self::U32 => u32::from_le_bytes(four()) as f32,
            Self::F32 => return f32::from_le_bytes(four()),
        };
        if normalized { (value / self.unit()).max(-1.0) } else { value }
    }

    fn decode_index(self, bytes: &[u8]) -> u32 {
        match self {
            Self::U8 | Self::I8 => u32::from(bytes[0]),
            Self::U16 | Self::I16 => u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            Self::U32 | Self::F32 => u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        }
    }
}

/// Number of components of an accessor's `type`. Matrices of two and three columns, whose columns may be padded,
/// are never read.
fn arity(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => 16,
    }
}

/// A checked run of elements in a buffer view; all of them are inside `bytes`.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let (bytes, stride, size) = (self.bytes, self.stride, self.size);
        (0..self.count).map(move |i| &bytes[i * stride..i * stride + size])
    }
}

impl Document<'_> {
    /// Reads accessor `index`, referred to from `place`, as finite vectors of one of the `kinds` (SCALAR, VEC2 to
    /// VEC4, MAT4, of at most `N` components); missing components keep the value of `fill`.
    pub(super) fn read_floats<const N: usize>(
        &self,
        index: usize,
        place: &str,
        kinds: &[&str],
        fill: [f32; N],
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let elements = self.read_any_floats(index, place, kinds, fill)?;
        match elements.iter().position(|element| element.iter().any(|value| !value.is_finite())) {
            None => Ok(elements),
            Some(at) => {
                let message = format!("element {at} is {:?}, expected finite numbers", elements[at]);
                Err(self.invalid(&format!("accessors[{index}] (for {place})"), message))
            }
        }
    }

    /// As [`Self::read_floats`], for what can be mended: infinities and what is no number are among them.
    pub(super) fn read_any_floats<const N: usize>(
        &self,
        index: usize,
        place: &str,
        kinds: &[&str],
        fill: [f32; N],
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let (accessor, component) = self.accessor(index, place)?;
        if !kinds.contains(&accessor.kind.as_str()) {
            let wanted = kinds.join(" or ");
            let message = format!("accessors[{index}] has type {}, expected {wanted}", accessor.kind);
            return Err(self.invalid(place, message));
        }
        let arity = arity(&accessor.kind).min(N);
        let decode = |bytes: &[u8]| {
            let mut element = fill;
            for (value, bytes) in element.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *value = component.decode(bytes, accessor.normalized);
            }
            element
        };
        let mut zero = fill;
        zero[..arity].fill(0.0);
        self.read(index, accessor, component.size() * arity, zero, decode)
    }

    /// Reads accessor `index`, referred to from `place`, as scalar unsigned integers.
    pub(super) fn read_indices(&self, index: usize, place: &str) -> Result<Vec<u32>, SceneError> {
        let (accessor, component) = self.accessor(index, place)?;
        if accessor.kind != "SCALAR" || !component.is_index() {
            let message = format!(
                "accessors[{index}] has type {} and componentType {}, expected SCALAR and 5121, 5123 or 5125",
                accessor.kind, accessor.component_type
            );
            return Err(self.invalid(place, message));
        }
        self.read(index, accessor, component.size(), 0, |bytes| component.decode_index(bytes))
    }

    /// Number of elements of accessor `index`, referred to from `place`.
    pub(super) fn accessor_count(&self, index: usize, place: &str) -> Result<u64, SceneError> {
        Ok(self.get(&self.root.accessors, index, "accessors", place)?.count)
    }

    /// What the integers of accessor `index`, referred to from `place`, are to be divided by: 1 unless they are
    /// normalized.
    pub(super) fn unit(&self, index: usize, place: &str) -> Result<f32, SceneError> {
        let (accessor, component) = self.accessor(index, place)?;
        Ok(if accessor.normalized { component.unit() } else { 1.0 })
    }

    /// Refuses accessor `index`, referred to from `place`, unless its components have one of the types `codes`.
    pub(super) fn expect_components(
        &self,
        index: usize,
        place: &str,
        codes: &[u32],
    ) -> Result<(), SceneError> {
        let code = self.accessor(index, place)?.0.component_type;
        if codes.contains(&code) {
            return Ok(());
        }
        let wanted: Vec<_> = codes.iter().map(u32::to_string).collect();
        let message =
            format!("accessors[{index}] has componentType {code}, expected {}", wanted.join(" or "));
        Err(self.invalid(place, message))
    }

    fn accessor(&self, index: usize, place: &str) -> Result<(&Accessor, Component), SceneError> {
        let accessor = self.get(&self.root.accessors, index, "accessors", place)?;
        let component = Component::from_code(accessor.component_type).ok_or_else(|| {
            let message = format!("is {}, expected 5120 to 5123, 5125 or 5126", accessor.component_type);
            self.invalid(&format!("accessors[{index}].componentType"), message)
        })?;
        Ok((accessor, component))
    }

    /// Reads all elements, dense and sparse, of `size` bytes each.
    fn read<T: Clone>(
        &self,
        index: usize,
        accessor: &Accessor,
        size: usize,
        zero: T,
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, SceneError> {
        let own = format!("accessors[{index}]");
        let claim = accessor.count.saturating_mul(size_of::<T>() as u64);
        let mut elements = if let Some(view) = accessor.buffer_view {
            let dense = self.elements(&own, view, accessor.byte_offset, accessor.count, size)?;
            self.claim_geometry(&own, claim)?;
            dense.iter().map(&decode).collect()
        } else {
            if accessor.count > MAX_ZEROS {
                let message =
                    format!("is {} without a bufferView, expected at most {MAX_ZEROS}", accessor.count);
                return Err(self.error(ErrorKind::Unsupported, &format!("{own}.count"), message));
            }
            self.claim_geometry(&own, claim)?;
            vec![zero; accessor.count as usize]
        };
        if let Some(sparse) = &accessor.sparse {
            self.read_sparse(&format!("{own}.sparse"), sparse, size, &mut elements, decode)?;
        }
        Ok(elements)
    }

    /// Replaces the elements that `sparse` lists.
    fn read_sparse<T>(
        &self,
        place: &str,
        sparse: &Sparse,
        size: usize,
        elements: &mut [T],
        decode: impl Fn(&[u8]) -> T,
    ) -> Result<(), SceneError> {
        let code = sparse.indices.component_type;
        let component = Component::from_code(code).filter(|component| component.is_index());
        let component = component.ok_or_else(|| {
            let message = format!("is {code}, expected 5121, 5123 or 5125");
            self.invalid(&format!("{place}.indices.componentType"), message)
        })?;
        let (at, from) = (&sparse.indices, &sparse.values);
        let indices_place = format!("{place}.indices");
        let indices =
            self.elements(&indices_place, at.buffer_view, at.byte_offset, sparse.count, component.size())?;
        let values = self.elements(
            &format!("{place}.values"),
            from.buffer_view,
            from.byte_offset,
            sparse.count,
            size,
        )?;
        let count = elements.len();
        for (i, (index, value)) in indices.iter().zip(values.iter()).enumerate() {
            let index = component.decode_index(index) as usize;
            let slot = elements.get_mut(index).ok_or_else(|| {
                let message = format!("index {i} is {index}, but the accessor has {count} elements");
                self.invalid(&indices_place, message)
            })?;
            *slot = decode(value);
        }
        Ok(())
    }

    /// The bytes of `count` elements of `size` bytes in buffer view `view`, from `offset` on.
    fn elements(
        &self,
        place: &str,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
    ) -> Result<Elements<'_>, SceneError> {
        let (bytes, description) = self.view(view, &format!("{place}.bufferView"))?;
        let stride = description.byte_stride.unwrap_or(size as u64);
        if stride < size as u64 {
            let message = format!("is {stride}, but {place} has elements of {size} bytes");
            return Err(self.invalid(&format!("bufferViews[{view}].byteStride"), message));
        }
        // Offset of the last byte plus one; the last element needs no padding behind it.
        let end = match count {
            0 => Some(offset),
            _ => stride.checked_mul(count - 1).and_then(|n| n.checked_add(size as u64)?.checked_add(offset)),
        };
        if end.is_none_or(|end| end > bytes.len() as u64) {
            let message = format!(
                "{count} elements of {size} bytes, {stride} bytes apart, from byte {offset} on, \
                 but bufferViews[{view}] has {} bytes",
                bytes.len()
            );
            return Err(self.invalid(place, message));
        }
        let bytes = &bytes[offset as usize..];
        Ok(Elements { bytes, stride: stride as usize, size, count: count as usize })
    }
}

#[cfg(test)]
#[path = "accessor_tests.rs"]
mod tests;
