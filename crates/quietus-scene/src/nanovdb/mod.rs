//! The reader of NanoVDB files (`.nvdb`): grids of numbers with much nothing in them (Museth 2021, "NanoVDB: A GPU-Friendly
//! and Portable VDB Data Structure For Real-Time Rendering And Simulation"; layout of versions 32).
//!
//! A file is a list of segments, each with a header, what is known of each of its grids, and the grids, which may be
//! packed with zlib or [`blosc`]. A grid is a tree of nodes in one piece of memory (`tree`), which becomes a grid in bricks.
//!
//! Limits: files of 4 GiB; grids of 16 GiB unpacked, of 2^26 blocks of 8 x 8 x 8 cells between their outermost values.

mod blosc;
mod tree;

use std::io::Read;
use std::path::Path;

use flate2::read::ZlibDecoder;
use glam::{DAffine3, DMat3, DVec3};
use quietus_trace::desc::Grid;

use crate::error::{ErrorKind, SceneError};
use crate::limit;

/// "NanoVDB0", "NanoVDB1" and "NanoVDB2": of older files and grids, of grids, of files.
const MAGIC: [&[u8; 8]; 3] = [b"NanoVDB0", b"NanoVDB1", b"NanoVDB2"];
/// The version that fixed the layout.
const MAJOR: u32 = 32;
/// Largest grid, unpacked.
const MAX_GRID_BYTES: u64 = limit(1 << 34);
/// Bytes of a segment's header, of what is known of a grid, and of a grid's own header.
const SEGMENT: usize = 16;
const META: usize = 176;
const HEADER: usize = 672;
/// What is read of all the types of numbers.
const FLOAT: u32 = 1;

/// A grid of numbers, and where it lies.
#[derive(Clone, Debug, PartialEq)]
pub struct NanoGrid {
    /// What the file calls it.
    pub name: String,
    /// Its values, at least 0.
    pub grid: Grid<f32>,
    /// From the cells of `grid`, whose middles have the coordinates 0, 1, 2, ..., to the space of the file.
    pub to_space: DAffine3,
    /// How many values were negative or no numbers, which are 0 now.
    pub clamped: u64,
}

impl NanoGrid {
    /// Its values in the cells of another grid, where these are the same cells of the same space.
    pub(crate) fn within(&self, other: &Self) -> Option<Grid<f32>> {
        let to_own = self.to_space.inverse() * other.to_space;
        let shift = to_own.translation.round();
        let same = DAffine3::from_translation(shift);
        let shift = shift.as_i64vec3();
        let side = i64::from(Grid::<f32>::BRICK);
        if !to_own.abs_diff_eq(same, 1e-3) || shift % side != glam::I64Vec3::ZERO {
            return None;
        }
        let (bricks, blocks) = (self.grid.bricks.as_ref()?, self.grid.blocks());
        let [nx, ny, nz] = other.grid.blocks();
        let brick = |[x, y, z]: [u32; 3]| {
            let at = (glam::I64Vec3::new(x.into(), y.into(), z.into()) + shift / side).to_array();
            let inside = at.iter().zip(blocks).all(|(at, n)| (0..i64::from(n)).contains(at));
            let [x, y, z] = at;
            let [nx, ny, _] = blocks.map(i64::from);
            if inside { bricks[((z * ny + y) * nx + x) as usize] } else { Grid::<f32>::NOTHING }
        };
        let all = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])));
        let bricks = Some(all.map(brick).collect());
        Some(Grid { size: other.grid.size, values: self.grid.values.clone(), bricks })
    }
}

/// Reads the grid called `name` of the file whose content is `bytes`; `None` where there is none of that name.
///
/// # Errors
/// Where the file is malformed, packed in a way that is not read, or of another type than 32-bit floats.
pub(crate) fn read(path: &Path, bytes: &[u8], name: &str) -> Result<Option<NanoGrid>, SceneError> {
    let mut found = None;
    each(path, bytes, |entry| match found {
        None if entry.name == name => {
            found = Some(entry.grid()?);
            Ok(())
        }
        _ => Ok(()),
    })?;
    Ok(found)
}

/// Reads all grids of a file.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_all(path: &Path, bytes: &[u8]) -> Result<Vec<NanoGrid>, SceneError> {
    let mut grids = Vec::new();
    each(path, bytes, |entry| {
        grids.push(entry.grid()?);
        Ok(())
    })?;
    Ok(grids)
}

/// A grid as it lies in a file.
struct Entry<'a> {
    path: &'a Path,
    name: String,
    packed: Packed<'a>,
    /// Its size, unpacked.
    bytes: u64,
}

/// How a grid lies in a file.
enum Packed<'a> {
    Not(&'a [u8]),
    Zlib(&'a [u8]),
    Blosc(&'a [u8]),
}

/// Bytes of which the file may hold fewer than it says.
#[derive(Clone, Copy)]
struct Bytes<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

impl<'a> Bytes<'a> {
    fn fault(&self, at: usize, message: impl Into<String>) -> SceneError {
        SceneError::new(ErrorKind::Syntax, self.path, format!("byte {at}"), message)
    }

    fn part(&self, at: usize, length: usize) -> Result<&'a [u8], SceneError> {
        let end = at.checked_add(length).filter(|&end| end <= self.bytes.len());
        end.map(|end| &self.bytes[at..end]).ok_or_else(|| {
            self.fault(
                at,
                format!("{length} bytes are expected, but {} are left", self.bytes.len().saturating_sub(at)),
            )
        })
    }

    fn array<const N: usize>(&self, at: usize) -> Result<[u8; N], SceneError> {
        Ok(self.part(at, N)?.try_into().unwrap_or([0; N]))
    }

    fn u16(&self, at: usize) -> Result<u16, SceneError> {
        Ok(u16::from_le_bytes(self.array(at)?))
    }

    fn u32(&self, at: usize) -> Result<u32, SceneError> {
        Ok(u32::from_le_bytes(self.array(at)?))
    }

    fn u64(&self, at: usize) -> Result<u64, SceneError> {
        Ok(u64::from_le_bytes(self.array(at)?))
    }

    /// A length, as such.
    fn length(&self, at: usize) -> Result<usize, SceneError> {
        Ok(usize::try_from(self.u64(at)?).unwrap_or(usize::MAX))
    }

    fn f32(&self, at: usize) -> Result<f32, SceneError> {
        Ok(f32::from_le_bytes(self.array(at)?))
    }

    fn f64(&self, at: usize) -> Result<f64, SceneError> {
        Ok(f64::from_le_bytes(self.array(at)?))
    }

    /// The place `offset` bytes from `at`, which may lie before it.
    fn beside(&self, at: usize, offset: i64) -> Result<usize, SceneError> {
        let place = usize::try_from(offset.unsigned_abs()).ok().and_then(|by| match offset {
            0.. => at.checked_add(by),
            _ => at.checked_sub(by),
        });
        place
            .filter(|&place| place <= self.bytes.len())
            .ok_or_else(|| self.fault(at, format!("an offset of {offset} leads out of the grid")))
    }

    fn i64(&self, at: usize) -> Result<i64, SceneError> {
        Ok(i64::from_le_bytes(self.array(at)?))
    }

    /// A name, up to its end or that of the bytes.
    fn name(&self, at: usize, length: usize) -> Result<String, SceneError> {
        let name = self.part(at, length)?;
        let end = name.iter().position(|&byte| byte == 0).unwrap_or(name.len());
        Ok(String::from_utf8_lossy(&name[..end]).into_owned())
    }

    fn version(&self, at: usize) -> Result<(), SceneError> {
        let version = self.u32(at)?;
        let (major, minor) = (version >> 21, version >> 10 & 0x7ff);
        if major == MAJOR {
            return Ok(());
        }
        let message = format!("is of version {major}.{minor} of NanoVDB, of which only {MAJOR} is read");
        Err(SceneError::new(ErrorKind::Unsupported, self.path, format!("byte {at}"), message))
    }
}

/// Calls `f` with each grid of a file.
fn each<'a>(
    path: &'a Path,
    bytes: &'a [u8],
    mut f: impl FnMut(Entry<'a>) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let file = Bytes { path, bytes };
    let mut at = 0;
    while at < bytes.len() {
        let magic: [u8; 8] = file.array(at)?;
        if &magic == MAGIC[1] {
            // Grids as they lie in memory, without a file around them.
            let length = file.length(at + 32)?;
            let packed = Packed::Not(file.part(at, length.max(HEADER))?);
            f(Entry { path, name: file.name(at + 40, 256)?, packed, bytes: length as u64 })?;
            at += length.max(HEADER);
            continue;
        }
        if !MAGIC.contains(&&magic) {
            return Err(file.fault(at, "a segment of a NanoVDB file is expected, which starts with NanoVDB"));
        }
        file.version(at + 8)?;
        at = segment(file, at, &mut f)?;
    }
    Ok(())
}

/// Calls `f` with each grid of the segment at `start`; returns where it ends.
fn segment<'a>(
    file: Bytes<'a>,
    start: usize,
    f: &mut impl FnMut(Entry<'a>) -> Result<(), SceneError>,
) -> Result<usize, SceneError> {
    let (count, codec) = (file.u16(start + 12)?, file.u16(start + 14)?);
    let mut at = start + SEGMENT;
    let mut grids = Vec::new();
    for _ in 0..count {
        let (bytes, length) = (file.u64(at)?, file.length(at + 8)?);
        let name_length = file.u32(at + 136)? as usize;
        file.part(at, META)?;
        grids.push((file.name(at + META, name_length)?, bytes, length));
        at += META + name_length;
    }
    for (name, bytes, length) in grids {
        let content = file.part(at, length)?;
        let packed = match codec {
            0 => Packed::Not(content),
            // The length of what follows, once more.
            1 => Packed::Zlib(content.get(8..).unwrap_or(&[])),
            2 => Packed::Blosc(content),
            _ => {
                return Err(
                    file.fault(start + 14, format!("the codec has number {codec}, expected 0, 1 or 2"))
                );
            }
        };
        f(Entry { path: file.path, name, packed, bytes })?;
        at += length;
    }
    Ok(at)
}

impl Entry<'_> {
    fn refuse(&self, message: String) -> SceneError {
        SceneError::new(ErrorKind::Unsupported, self.path, self.place(), message)
    }

    fn place(&self) -> String {
        format!("grid \"{}\"", self.name)
    }

    /// Unpacks and reads it.
    fn grid(self) -> Result<NanoGrid, SceneError> {
        if self.bytes > MAX_GRID_BYTES {
            return Err(self.refuse(format!("is larger than {MAX_GRID_BYTES} bytes")));
        }
        let unpacked;
        let bytes = match self.packed {
            Packed::Not(bytes) => bytes,
            Packed::Zlib(bytes) => {
                unpacked = self.unpack(bytes)?;
                &unpacked
            }
            Packed::Blosc(bytes) => {
                let fault = |message| SceneError::new(ErrorKind::Syntax, self.path, self.place(), message);
                unpacked = blosc::unpack(bytes, self.bytes)
                    .map_err(|message| fault(format!("cannot be unpacked: {message}")))?;
                &unpacked
            }
        };
        self.header(Bytes { path: self.path, bytes })
    }

    fn unpack(&self, packed: &[u8]) -> Result<Vec<u8>, SceneError> {
        let mut bytes = Vec::new();
        let read = ZlibDecoder::new(packed).take(self.bytes + 1).read_to_end(&mut bytes);
        let fault = |message| SceneError::new(ErrorKind::Syntax, self.path, self.place(), message);
        read.map_err(|error| fault(format!("cannot be unpacked: {error}")))?;
        if bytes.len() as u64 != self.bytes {
            let found = bytes.len();
            return Err(fault(format!("unpacks to {found} bytes or more, expected {}", self.bytes)));
        }
        Ok(bytes)
    }

    /// Reads what stands before the tree, and the tree.
    fn header(&self, bytes: Bytes<'_>) -> Result<NanoGrid, SceneError> {
        bytes.part(0, HEADER)?;
        bytes.version(16)?;
        let kind = bytes.u32(636)?;
        if kind != FLOAT {
            let message = format!("holds values of type {kind}, of which only 32-bit floats (1) are read");
            return Err(self.refuse(message));
        }
        // Of the affine map, in doubles: the matrix, its inverse, the translation.
        let number = |i: usize| bytes.f64(296 + 88 + 8 * i);
        let row = |i: usize| Ok::<_, SceneError>(DVec3::new(number(i)?, number(i + 1)?, number(i + 2)?));
        let map = DAffine3 {
            // Rows in the file, columns here.
            matrix3: DMat3::from_cols(row(0)?, row(3)?, row(6)?).transpose(),
            translation: row(18)?,
        };
        let tree = tree::read(bytes, HEADER)?;
        let to_space = map * DAffine3::from_translation(tree.origin.as_dvec3());
        if !(to_space.is_finite() && to_space.inverse().is_finite()) {
            return Err(self.refuse("lies in a space that is flat, or nowhere".to_owned()));
        }
        Ok(NanoGrid { name: self.name.clone(), grid: tree.grid, to_space, clamped: tree.clamped })
    }
}

#[cfg(test)]
mod tests;
