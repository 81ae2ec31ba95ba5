//! The numbers after the header, in the order of the elements.

use std::path::Path;

use super::header::{Element, Format, Number};
use crate::error::{ErrorKind, SceneError};

/// Reads rows of elements.
pub(super) struct Body<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// How much of `bytes` has been read.
    at: usize,
    /// Where `bytes` starts in the file.
    offset: usize,
    format: Format,
}

impl<'a> Body<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8], offset: usize, format: Format) -> Self {
        Self { path, bytes, at: 0, offset, format }
    }

    /// An error at the current place.
    pub(super) fn error(&self, kind: ErrorKind, message: impl Into<String>) -> SceneError {
        SceneError::new(kind, self.path, format!("byte {}", self.offset + self.at), message)
    }

    fn truncated(&self, element: &Element) -> SceneError {
        let message = format!("the file ends inside its {} elements called {}", element.count, element.name);
        self.error(ErrorKind::Syntax, message)
    }

    /// Checks that the rest of the file can hold the rows of `element`, so that making room for them is safe.
    pub(super) fn expect(&self, element: &Element) -> Result<usize, SceneError> {
        let least = match self.format {
            // A digit and a space for each property.
            Format::Text => 2 * element.properties.len() as u64,
            _ => element.least_row() as u64,
        };
        // The last number needs no space after it.
        let left = (self.bytes.len() - self.at) as u64 + 1;
        match element.count.checked_mul(least.max(1)) {
            Some(needed) if needed <= left => Ok(element.count as usize),
            _ => Err(self.truncated(element)),
        }
    }

    /// Passes over an element.
    pub(super) fn skip(&mut self, element: &Element) -> Result<(), SceneError> {
        if element.properties.is_empty() {
            return Ok(());
        }
        self.expect(element)?;
        if element.has_lists() {
            return self.lists(element, usize::MAX, |_| {});
        }
        self.rows(element, |_| Ok(()))
    }

    /// Hands every row of an element to `take`, lists left out as 0.
    pub(super) fn rows(
        &mut self,
        element: &Element,
        mut take: impl FnMut(&[f32]) -> Result<(), String>,
    ) -> Result<(), SceneError> {
        let properties = &element.properties;
        let mut row = vec![0.0; properties.len()];
        let all_floats = properties.iter().all(|p| p.list.is_none() && p.number == Number::F32);
        for _ in 0..element.count {
            if all_floats && self.format == Format::LittleEndian {
                let bytes = self.take(4 * row.len()).ok_or_else(|| self.truncated(element))?;
                for (value, bytes) in row.iter_mut().zip(bytes.as_chunks::<4>().0) {
                    *value = f32::from_le_bytes(*bytes);
                }
            } else {
                for (value, property) in row.iter_mut().zip(properties) {
                    match property.list {
                        None => *value = self.number(property.number, element)? as f32,
                        Some(length) => {
                            for _ in 0..self.length(length, element)? {
                                self.number(property.number, element)?;
                            }
                        }
                    }
                }
            }
            take(&row).map_err(|message| self.error(ErrorKind::Invalid, message))?;
        }
        Ok(())
    }

    /// Hands the list in `column` of every row of an element to `take`.
    pub(super) fn lists(
        &mut self,
        element: &Element,
        column: usize,
        mut take: impl FnMut(&[u32]),
    ) -> Result<(), SceneError> {
        let mut list = Vec::new();
        for _ in 0..element.count {
            if self.fast_face(element, &mut take) {
                continue;
            }
            for (i, property) in element.properties.iter().enumerate() {
                let Some(length) = property.list else {
                    self.number(property.number, element)?;
                    continue;
                };
                list.clear();
                for _ in 0..self.length(length, element)? {
                    let value = self.number(property.number, element)?;
                    // What is out of range stays so, and is refused with all indices.
                    list.push(if (0.0..4_294_967_295.0).contains(&value) { value as u32 } else { u32::MAX });
                }
                if i == column {
                    take(&list);
                }
            }
        }
        Ok(())
    }

    /// The row almost all files have: a list of three or four 32-bit integers and nothing else.
    fn fast_face(&mut self, element: &Element, take: &mut impl FnMut(&[u32])) -> bool {
        let [property] = &element.properties[..] else { return false };
        let plain = self.format == Format::LittleEndian
            && property.list == Some(Number::U8)
            && matches!(property.number, Number::I32 | Number::U32);
        if !plain {
            return false;
        }
        let rest = &self.bytes[self.at..];
        let index = |i: usize| u32::from_le_bytes(rest[1 + 4 * i..5 + 4 * i].try_into().unwrap_or_default());
        match rest.first() {
            Some(3) if rest.len() >= 13 => take(&[index(0), index(1), index(2)]),
            Some(4) if rest.len() >= 17 => take(&[index(0), index(1), index(2), index(3)]),
            _ => return false,
        }
        self.at += 1 + 4 * usize::from(rest[0]);
        true
    }

    fn length(&mut self, number: Number, element: &Element) -> Result<u64, SceneError> {
        let length = self.number(number, element)?;
        if length >= 0.0 && length <= (self.bytes.len() - self.at) as f64 {
            return Ok(length as u64);
        }
        let message =
            format!("a list of {length} values in element {}, more than the file has", element.name);
        Err(self.error(ErrorKind::Syntax, message))
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number(&mut self, number: Number, element: &Element) -> Result<f64, SceneError> {
        if self.format == Format::Text {
            return self.text(element);
        }
        let Some(bytes) = self.take(number.size()) else { return Err(self.truncated(element)) };
        let mut ordered = [0; 8];
        ordered[..bytes.len()].copy_from_slice(bytes);
        if self.format == Format::BigEndian {
            ordered[..bytes.len()].reverse();
        }
        let [a, b, c, d, ..] = ordered;
        Ok(match number {
            Number::I8 => i8::from_le_bytes([a]).into(),
            Number::U8 => a.into(),
            Number::I16 => i16::from_le_bytes([a, b]).into(),
            Number::U16 => u16::from_le_bytes([a, b]).into(),
            Number::I32 => i32::from_le_bytes([a, b, c, d]).into(),
            Number::U32 => u32::from_le_bytes([a, b, c, d]).into(),
            Number::F32 => f32::from_le_bytes([a, b, c, d]).into(),
            Number::F64 => f64::from_le_bytes(ordered),
        })
    }

    /// A number in text.
    fn text(&mut self, element: &Element) -> Result<f64, SceneError> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|byte| !byte.is_ascii_whitespace()).unwrap_or(rest.len());
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let word = &rest[start..start + length];
        if word.is_empty() {
            return Err(self.truncated(element));
        }
        let value = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        self.at += start;
        let found = || String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned();
        let value =
            value.ok_or_else(|| self.error(ErrorKind::Syntax, format!("{}, expected a number", found())))?;
        self.at += length;
        Ok(value)
    }
}
