//! Tensor files of the RGL material database (`.bsdf`): named arrays of numbers of any dimensions (Dupuy and Jakob 2018;
//! the layout is that of its public readers).
//!
//! Little-endian: `tensor_file`, a zero, two bytes of version, the number of fields; for each the length of its name, the
//! name, the number of dimensions, the type of its numbers, where they start, and the dimensions.

use std::path::Path;

use crate::error::{ErrorKind, SceneError};
use crate::limit;

const MAGIC: &[u8; 12] = b"tensor_file\0";
/// The type of 32-bit floats.
const FLOAT: u8 = 10;
/// Numbers of a field.
const MAX_NUMBERS: u64 = limit(1 << 30);
/// Dimensions of a field. The files have five at most.
const MAX_DIMENSIONS: u16 = 16;

/// The fields of a file, as they are.
#[derive(Debug)]
pub(crate) struct Tensors<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    fields: Vec<Field>,
}

#[derive(Debug)]
struct Field {
    name: String,
    kind: u8,
    start: u64,
    shape: Vec<u64>,
}

/// Numbers with their dimensions, the last of which runs fastest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) shape: Vec<usize>,
    pub(crate) numbers: Vec<f32>,
}

impl<'a> Tensors<'a> {
    /// Reads what fields there are in the file whose content is `bytes`.
    ///
    /// # Errors
    /// Where it is no tensor file, or ends too early.
    pub(crate) fn read(path: &'a Path, bytes: &'a [u8]) -> Result<Self, SceneError> {
        let mut tensors = Self { path, bytes, fields: Vec::new() };
        if !bytes.starts_with(MAGIC) {
            return Err(tensors.fault("", "is no tensor file, which starts with \"tensor_file\""));
        }
        let version: [u8; 2] = tensors.array(12)?;
        if version[0] != 1 {
            let message =
                format!("is of version {}.{} of tensor files, of which 1 is read", version[0], version[1]);
            return Err(SceneError::new(ErrorKind::Unsupported, path, "", message));
        }
        let count = u32::from_le_bytes(tensors.array(14)?);
        let mut at = 18;
        for _ in 0..count {
            at = tensors.field(at)?;
        }
        Ok(tensors)
    }

    /// Reads what is said of a field; returns where that ends.
    fn field(&mut self, at: usize) -> Result<usize, SceneError> {
        let length = usize::from(u16::from_le_bytes(self.array(at)?));
        let name = String::from_utf8_lossy(self.part(at + 2, length)?).into_owned();
        let at = at + 2 + length;
        let dimensions = u16::from_le_bytes(self.array(at)?);
        if dimensions > MAX_DIMENSIONS {
            return Err(
                self.fault(&name, format!("has {dimensions} dimensions, expected {MAX_DIMENSIONS} at most"))
            );
        }
        let [kind] = self.array(at + 2)?;
        let start = u64::from_le_bytes(self.array(at + 3)?);
        let dimension = |i: usize| Ok(u64::from_le_bytes(self.array(at + 11 + 8 * i)?));
        let shape = (0..usize::from(dimensions)).map(dimension).collect::<Result<Vec<_>, SceneError>>()?;
        self.fields.push(Field { name, kind, start, shape });
        Ok(at + 11 + 8 * usize::from(dimensions))
    }

    /// The floats of the field called `name`, which has so many dimensions.
    ///
    /// # Errors
    /// Where there is no such field, or it holds something else, or fewer numbers than it says.
    pub(crate) fn floats(&self, name: &str, dimensions: usize) -> Result<Tensor, SceneError> {
        let Some(field) = self.fields.iter().find(|field| field.name == name) else {
            return Err(self.fault(name, "is expected in the file, but is not there"));
        };
        if field.kind != FLOAT || field.shape.len() != dimensions {
            let found = format!("numbers of type {} in {} dimensions", field.kind, field.shape.len());
            return Err(
                self.fault(name, format!("holds {found}, expected 32-bit floats ({FLOAT}) in {dimensions}"))
            );
        }
        let count = field.shape.iter().try_fold(1_u64, |product, &n| product.checked_mul(n));
        let count = count.filter(|&count| count > 0 && count <= MAX_NUMBERS).ok_or_else(|| {
            self.fault(
                name,
                format!("has the dimensions {:?}, expected 1 to {MAX_NUMBERS} numbers", field.shape),
            )
        })?;
        let start = usize::try_from(field.start).unwrap_or(usize::MAX);
        let bytes = self.part(start, 4 * count as usize).map_err(|error| error.or_at(name))?;
        let numbers: Vec<f32> =
            bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect();
        if let Some(place) = numbers.iter().position(|number| !number.is_finite()) {
            return Err(self.fault(name, format!("number {place} is {}", numbers[place])));
        }
        Ok(Tensor { shape: field.shape.iter().map(|&n| n as usize).collect(), numbers })
    }

    /// An error about a field, or about the whole file.
    pub(crate) fn fault(&self, field: &str, message: impl Into<String>) -> SceneError {
        let place = if field.is_empty() { String::new() } else { format!("field \"{field}\"") };
        SceneError::new(ErrorKind::Syntax, self.path, place, message)
    }

    fn part(&self, at: usize, length: usize) -> Result<&'a [u8], SceneError> {
        let end = at.checked_add(length).filter(|&end| end <= self.bytes.len());
        end.map(|end| &self.bytes[at..end]).ok_or_else(|| {
            let left = self.bytes.len().saturating_sub(at);
            let message = format!("{length} bytes are expected, but {left} are left");
            SceneError::new(ErrorKind::Syntax, self.path, format!("byte {at}"), message)
        })
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], SceneError> {
        Ok(self.part(at, N)?.try_into().unwrap_or([0; N]))
    }
}
