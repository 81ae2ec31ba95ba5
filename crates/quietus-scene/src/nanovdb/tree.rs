//! The tree of a NanoVDB grid: a root with a table of 4096^3 cells each, upper nodes of 32^3 children, lower nodes of
//! 16^3, leaves of 8^3 values. What a node has no child for is a tile: one value for all of the child's cells.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{IVec3, UVec3};
use quietus_trace::desc::Grid;

use super::Bytes;
use crate::error::SceneError;
use crate::limit;

/// Blocks of 8^3 cells between the outermost values.
const MAX_BLOCKS: u64 = limit(1 << 26);
/// Cells of a leaf along each axis, as a power of 2.
const LEAF: u32 = 3;
/// Bytes of nodes of floats, and where in them what starts.
const LEAF_BYTES: usize = 2144;
const LEAF_VALUES: usize = 96;
const ROOT_TABLE: usize = 64;
const ROOT_ENTRY: usize = 32;

/// An inner kind of node.
struct Kind {
    /// Children along each axis, as a power of 2.
    children: u32,
    /// Cells of a child along each axis, as a power of 2.
    child: u32,
    /// Where the mask of children and the table start; a mask of values comes before.
    mask: usize,
    table: usize,
}

const UPPER: Kind = Kind { children: 5, child: 7, mask: 4128, table: 8256 };
const LOWER: Kind = Kind { children: 4, child: LEAF, mask: 544, table: 1088 };

/// What a tree holds.
pub(super) struct Tree {
    pub(super) grid: Grid<f32>,
    /// The index in the file of the first cell.
    pub(super) origin: IVec3,
    pub(super) clamped: u64,
}

/// Reads the tree at `at`.
pub(super) fn read(bytes: Bytes<'_>, at: usize) -> Result<Tree, SceneError> {
    let leaves = bytes.beside(at, bytes.i64(at)?)?;
    let root = bytes.beside(at, bytes.i64(at + 24)?)?;
    let corner = |place: usize| -> Result<IVec3, SceneError> {
        let axis = |i: usize| Ok(bytes.u32(place + 4 * i)?.cast_signed());
        Ok(IVec3::new(axis(0)?, axis(1)?, axis(2)?))
    };
    let (low, high) = (corner(root)?, corner(root + 12)?);
    let mut filling = Filling::new(bytes, leaves, [low, high], root)?;
    filling.root(root)?;
    Ok(filling.finish())
}

/// A grid being filled.
struct Filling<'a> {
    bytes: Bytes<'a>,
    /// Where leaves lie, one after the other.
    leaves: usize,
    /// The first block, in blocks.
    first: IVec3,
    blocks: UVec3,
    table: Vec<u32>,
    values: Vec<f32>,
    /// Bricks that were made of leaves, and of one value.
    bricks: HashMap<Source, u32>,
    clamped: u64,
}

/// What a brick was made of: a leaf by its place, a tile by the bits of its value.
#[derive(PartialEq, Eq, Hash)]
enum Source {
    Leaf(usize),
    Tile(u32),
}

impl<'a> Filling<'a> {
    /// An empty grid that has room for the cells between two corners, and for one more on each side, so that values fade
    /// to nothing around it as they do in the file.
    fn new(bytes: Bytes<'a>, leaves: usize, [low, high]: [IVec3; 2], at: usize) -> Result<Self, SceneError> {
        let (low, high) = (low.as_i64vec3() - 1, high.as_i64vec3() + 1);
        if (high - low).min_element() < 2 {
            return Err(bytes.fault(at, "the grid is empty"));
        }
        let (first, last) = (low >> i64::from(LEAF), high >> i64::from(LEAF));
        let blocks = (last - first + 1).as_u64vec3();
        let count = u128::from(blocks.x) * u128::from(blocks.y) * u128::from(blocks.z);
        if count > u128::from(MAX_BLOCKS) {
            let message =
                format!("the grid has {count} blocks of 8 x 8 x 8 cells, at most {MAX_BLOCKS} are read");
            return Err(bytes.fault(at, message));
        }
        let table = vec![Grid::<f32>::NOTHING; count as usize];
        let (first, blocks) = (first.as_ivec3(), blocks.as_uvec3());
        Ok(Self { bytes, leaves, first, blocks, table, values: vec![], bricks: HashMap::new(), clamped: 0 })
    }

    fn finish(self) -> Tree {
        let size = (self.blocks << LEAF).to_array();
        let grid = Grid { size, values: self.values, bricks: Some(self.table) };
        Tree { grid, origin: self.first << LEAF as i32, clamped: self.clamped }
    }

    fn root(&mut self, at: usize) -> Result<(), SceneError> {
        let bytes = self.bytes;
        let count = bytes.u32(at + 24)? as usize;
        bytes.part(at + ROOT_TABLE, count.saturating_mul(ROOT_ENTRY))?;
        let mut seen = HashMap::new();
        for entry in (0..count).map(|i| at + ROOT_TABLE + i * ROOT_ENTRY) {
            let key = bytes.u64(entry)?;
            if seen.insert(key, ()).is_some() {
                return Err(bytes.fault(entry, "a part of the grid is given twice"));
            }
            // The upper 20 bits of each coordinate, in 21 bits each, z first.
            let axis = |shift: u32| (((key >> shift & 0x1f_ffff) as u32) << 12).cast_signed();
            let origin = IVec3::new(axis(42), axis(21), axis(0));
            match bytes.i64(entry + 8)? {
                _ if !self.overlaps(origin, 12) => {}
                0 => self.tile(origin, 12, bytes.f32(entry + 20)?),
                child => self.inner(&UPPER, bytes.beside(at, child)?, origin)?,
            }
        }
        Ok(())
    }

    /// The inner node at `at`, whose first cell is `origin`.
    fn inner(&mut self, kind: &Kind, at: usize, origin: IVec3) -> Result<(), SceneError> {
        let bytes = self.bytes;
        let count = 1_usize << (3 * kind.children);
        let mask = bytes.part(at + kind.mask, count / 8)?;
        bytes.part(at + kind.table, 8 * count)?;
        for child in self.children(kind, origin) {
            let i = ((child.x << kind.children | child.y) << kind.children | child.z) as usize;
            let place = origin + (child << kind.child).as_ivec3();
            let entry = at + kind.table + 8 * i;
            if mask[i / 8] >> (i % 8) & 1 == 0 {
                self.tile(place, kind.child, bytes.f32(entry)?);
                continue;
            }
            let child = bytes.beside(at, bytes.i64(entry)?)?;
            match kind.child {
                LEAF => self.leaf(child, place)?,
                _ => self.inner(&LOWER, child, place)?,
            }
        }
        Ok(())
    }

    /// The blocks of the grid among those of a cube of `1 << size` cells: the first of them, and the one behind the last.
    fn span(&self, origin: IVec3, size: u32) -> [UVec3; 2] {
        let low = (origin >> LEAF as i32).as_i64vec3() - self.first.as_i64vec3();
        let clip = |p: glam::I64Vec3| p.clamp(glam::I64Vec3::ZERO, self.blocks.as_i64vec3()).as_uvec3();
        [clip(low), clip(low + (1_i64 << (size - LEAF)))]
    }

    /// The children of a node that overlap the grid. All of their cells have coordinates.
    fn children(&self, kind: &Kind, origin: IVec3) -> impl Iterator<Item = UVec3> + use<> {
        let first = (self.first << LEAF as i32).as_i64vec3() - origin.as_i64vec3();
        let last = first + (self.blocks << LEAF).as_i64vec3() - 1;
        let most = glam::I64Vec3::splat((1 << kind.children) - 1);
        let child = i64::from(kind.child);
        let (low, high) = ((first >> child).max(glam::I64Vec3::ZERO), (last >> child).min(most));
        let along = move |axis: usize| low[axis] as u32..(high[axis] + 1).max(0) as u32;
        along(0).flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| UVec3::new(x, y, z))))
    }

    fn overlaps(&self, origin: IVec3, size: u32) -> bool {
        let [low, high] = self.span(origin, size);
        low.cmplt(high).all()
    }

    /// One value for a cube of `1 << size` cells.
    fn tile(&mut self, origin: IVec3, size: u32, value: f32) {
        let value = self.sound(value);
        if value == 0.0 {
            return;
        }
        let [low, high] = self.span(origin, size);
        let brick =
            self.brick(Source::Tile(value.to_bits()), |values| values.resize(values.len() + 512, value));
        for z in low.z..high.z {
            for y in low.y..high.y {
                let row = ((z * self.blocks.y + y) * self.blocks.x) as usize;
                self.table[row + low.x as usize..row + high.x as usize].fill(brick);
            }
        }
    }

    /// A leaf, whose values have z fastest.
    fn leaf(&mut self, at: usize, origin: IVec3) -> Result<(), SceneError> {
        let bytes = self.bytes;
        if at.checked_sub(self.leaves).is_none_or(|by| !by.is_multiple_of(LEAF_BYTES)) {
            return Err(bytes.fault(at, "a leaf is expected to lie among the others"));
        }
        if self.bricks.contains_key(&Source::Leaf(at)) {
            return Err(bytes.fault(at, "a leaf is used twice"));
        }
        let values = bytes.part(at + LEAF_VALUES, 4 * 512)?;
        let mut clamped = 0;
        let brick = self.brick(Source::Leaf(at), |stored| {
            for i in 0..512 {
                let [x, y, z] = [i % 8, i / 8 % 8, i / 64];
                let place = 4 * ((x * 8 + y) * 8 + z);
                let value = f32::from_le_bytes([0, 1, 2, 3].map(|byte| values[place + byte]));
                clamped += u64::from(!is_sound(value));
                stored.push(if is_sound(value) { value } else { 0.0 });
            }
        });
        self.clamped += clamped;
        let [block, _] = self.span(origin, LEAF);
        let place = (block.z * self.blocks.y + block.y) * self.blocks.x + block.x;
        self.table[place as usize] = brick;
        Ok(())
    }

    fn sound(&mut self, value: f32) -> f32 {
        if is_sound(value) {
            return value;
        }
        self.clamped += 1;
        0.0
    }

    /// The number of the brick made of `source`, which `make` adds where it is new.
    fn brick(&mut self, source: Source, make: impl FnOnce(&mut Vec<f32>)) -> u32 {
        match self.bricks.entry(source) {
            Entry::Occupied(known) => *known.get(),
            Entry::Vacant(new) => {
                let number = (self.values.len() / 512) as u32;
                make(&mut self.values);
                *new.insert(number)
            }
        }
    }
}

/// Whether a value can be a density or a temperature.
fn is_sound(value: f32) -> bool {
    value.is_finite() && value >= 0.0
}
