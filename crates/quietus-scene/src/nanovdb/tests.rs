//! Files written here and read back, and what is wrong with files.

use std::io::Write;

use flate2::{Compression, write::ZlibEncoder};
use glam::IVec3;

use super::*;

/// A grid to be written: leaves at their first cells, with values by cell; and tiles of 128^3 cells.
struct Sketch {
    name: &'static str,
    leaves: Vec<(IVec3, Values)>,
    tiles: Vec<(IVec3, f32)>,
    /// The outermost cells.
    bounds: [IVec3; 2],
    scale: f64,
}

/// Values by cell.
type Values = fn(IVec3) -> f32;

/// Bytes that are written at their places.
#[derive(Default)]
struct Paper(Vec<u8>);

impl Paper {
    fn put(&mut self, at: usize, bytes: &[u8]) {
        self.0.resize(self.0.len().max(at + bytes.len()), 0);
        self.0[at..at + bytes.len()].copy_from_slice(bytes);
    }

    fn corner(&mut self, at: usize, p: IVec3) {
        p.to_array().iter().enumerate().for_each(|(i, v)| self.put(at + 4 * i, &v.to_le_bytes()));
    }

    fn set_bit(&mut self, at: usize, bit: usize) {
        let byte = self.0[at + bit / 8] | 1 << (bit % 8);
        self.put(at + bit / 8, &[byte]);
    }
}

/// The root's key of a cell.
fn key(p: IVec3) -> u64 {
    let part = |v: i32| u64::from(v as u32 >> 12);
    part(p.z) | part(p.y) << 21 | part(p.x) << 42
}

/// Where a cell is in the table of an upper (`child` is 7, `children` 5) or lower node (3, 4).
fn entry(p: IVec3, child: i32, children: i32) -> usize {
    let part = |v: i32| (v >> child & ((1 << children) - 1)) as usize;
    (part(p.x) << children | part(p.y)) << children | part(p.z)
}

impl Sketch {
    /// The grid as it lies in memory: one root entry, one upper and one lower node for each thing on it, then leaves.
    fn memory(&self) -> Vec<u8> {
        let mut paper = Paper::default();
        let tree = HEADER;
        let root = tree + 64;
        let mut keys: Vec<u64> =
            self.leaves.iter().map(|leaf| key(leaf.0)).chain(self.tiles.iter().map(|t| key(t.0))).collect();
        keys.sort_unstable();
        keys.dedup();
        let lowers: Vec<IVec3> = {
            let mut all: Vec<_> = self.leaves.iter().map(|(p, _)| (*p >> 7_i32).to_array()).collect();
            all.sort_unstable();
            all.dedup();
            all.into_iter().map(|p| IVec3::from_array(p) << 7).collect()
        };
        let upper = |i: usize| root + 64 + 32 * keys.len() + i * 270_400;
        let lower = |i: usize| upper(keys.len()) + i * 33_856;
        let leaf = |i: usize| lower(lowers.len()) + i * 2144;
        let end = leaf(self.leaves.len());
        paper.put(end - 1, &[0]);
        paper.put(0, b"NanoVDB0");
        paper.put(16, &(32_u32 << 21 | 3 << 10).to_le_bytes());
        paper.put(32, &(end as u64).to_le_bytes());
        paper.put(40, self.name.as_bytes());
        for i in 0..3 {
            paper.put(296 + 88 + 32 * i, &self.scale.to_le_bytes());
            paper.put(296 + 232 + 8 * i, &(i as f64).to_le_bytes());
        }
        paper.put(636, &FLOAT.to_le_bytes());
        let level = [leaf(0), lower(0), upper(0), root];
        level
            .iter()
            .enumerate()
            .for_each(|(i, at)| paper.put(tree + 8 * i, &((at - tree) as i64).to_le_bytes()));
        paper.corner(root, self.bounds[0]);
        paper.corner(root + 12, self.bounds[1]);
        paper.put(root + 24, &(keys.len() as u32).to_le_bytes());
        for (i, key) in keys.iter().enumerate() {
            paper.put(root + 64 + 32 * i, &key.to_le_bytes());
            paper.put(root + 64 + 32 * i + 8, &((upper(i) - root) as i64).to_le_bytes());
        }
        let upper_of = |p: IVec3| upper(keys.iter().position(|&k| k == key(p)).expect("a key"));
        for (p, value) in &self.tiles {
            paper.put(upper_of(*p) + 8256 + 8 * entry(*p, 7, 5), &value.to_le_bytes());
        }
        for (i, p) in lowers.iter().enumerate() {
            let (node, entry) = (upper_of(*p), entry(*p, 7, 5));
            paper.set_bit(node + 4128, entry);
            paper.put(node + 8256 + 8 * entry, &((lower(i) - node) as i64).to_le_bytes());
        }
        for (i, (p, value)) in self.leaves.iter().enumerate() {
            let node = lower(lowers.iter().position(|l| *l == *p >> 7 << 7).expect("a lower node"));
            let entry = entry(*p, 3, 4);
            paper.set_bit(node + 544, entry);
            paper.put(node + 1088 + 8 * entry, &((leaf(i) as i64) - (node as i64)).to_le_bytes());
            for cell in 0..512 {
                let at = IVec3::new(cell >> 6, cell >> 3 & 7, cell & 7);
                paper.put(leaf(i) + 96 + 4 * cell as usize, &value(*p + at).to_le_bytes());
            }
        }
        paper.0
    }
}

/// A file of one segment.
fn file(grids: &[Sketch], codec: u16) -> Vec<u8> {
    let (mut metas, mut contents) = (Vec::new(), Vec::new());
    for sketch in grids {
        let memory = sketch.memory();
        let packed = match codec {
            1 => {
                let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
                encoder.write_all(&memory).expect("memory");
                let packed = encoder.finish().expect("memory");
                [&(packed.len() as u64).to_le_bytes()[..], &packed].concat()
            }
            _ => memory.clone(),
        };
        let mut meta = Paper::default();
        meta.put(META - 1, &[0]);
        meta.put(0, &(memory.len() as u64).to_le_bytes());
        meta.put(8, &(packed.len() as u64).to_le_bytes());
        meta.put(136, &(sketch.name.len() as u32 + 1).to_le_bytes());
        metas.extend(meta.0);
        metas.extend(sketch.name.bytes().chain([0]));
        contents.extend(packed);
    }
    let mut header = b"NanoVDB0".to_vec();
    header.extend((32_u32 << 21 | 3 << 10).to_le_bytes());
    header.extend((grids.len() as u16).to_le_bytes());
    header.extend(codec.to_le_bytes());
    [header, metas, contents].concat()
}

fn value(p: IVec3) -> f32 {
    (p.x.rem_euclid(50) * 100 + p.y.rem_euclid(50) * 10 + p.z.rem_euclid(50)) as f32 / 64.0
}

/// Leaves on both sides of 0, and far from each other; a tile beside them.
fn density() -> Sketch {
    Sketch {
        name: "density",
        leaves: vec![
            (IVec3::new(-8, 0, -16), value),
            (IVec3::new(0, 8, 0), value),
            (IVec3::new(130, 0, 0), value),
        ]
        .into_iter()
        .map(|(p, value)| (p >> 3 << 3, value as Values))
        .collect(),
        tiles: vec![(IVec3::new(0, 128, 0), 0.75)],
        bounds: [IVec3::new(-8, 0, -16), IVec3::new(135, 140, 7)],
        scale: 0.5,
    }
}

fn temperature() -> Sketch {
    let hot = |p: IVec3| -> f32 { if p.x == 3 { -1.0 } else { 1000.0 } };
    let leaves = vec![(IVec3::new(0, 8, 0), hot as Values)];
    let bounds = [IVec3::new(0, 8, 0), IVec3::new(7, 15, 7)];
    Sketch { name: "temperature", leaves, tiles: vec![], bounds, scale: 0.5 }
}

fn path() -> &'static Path {
    Path::new("a.nvdb")
}

/// The value of a cell of the file.
fn at(read: &NanoGrid, p: IVec3) -> f32 {
    let origin = read.to_space.inverse().transform_point3(0.5 * DVec3::ZERO + DVec3::new(0.0, 1.0, 2.0));
    let [x, y, z] = (p.as_dvec3() + origin).round().as_uvec3().to_array();
    let ([nx, ny, _], bricks) = (read.grid.blocks(), read.grid.bricks.as_ref().expect("bricks"));
    let brick = bricks[((z / 8 * ny + y / 8) * nx + x / 8) as usize];
    let place = (z % 8 * 8 + y % 8) * 8 + x % 8;
    if brick == Grid::<f32>::NOTHING { 0.0 } else { read.grid.values[(brick * 512 + place) as usize] }
}

#[test]
fn grids_come_back_as_they_were_written() {
    for codec in [0, 1] {
        let bytes = file(&[density(), temperature()], codec);
        let read = read(path(), &bytes, "density").expect("sound").expect("there");
        for (origin, _) in &density().leaves {
            for cell in 0..512 {
                let p = *origin + IVec3::new(cell >> 6, cell >> 3 & 7, cell & 7);
                assert_eq!(at(&read, p), value(p), "{p}");
            }
        }
        for (p, expected) in [
            (IVec3::new(0, 130, 5), 0.75),
            (IVec3::new(127, 128, 0), 0.75),
            (IVec3::new(128, 130, 0), 0.0),
            (IVec3::new(50, 50, 0), 0.0),
        ] {
            assert_eq!(at(&read, p), expected, "{p}");
        }
        // Where the file says that the cell 0, 0, 0 lies.
        let space = read.to_space.transform_vector3(DVec3::X);
        assert!(space.abs_diff_eq(0.5 * DVec3::X, 1e-9), "{space}");
        assert_eq!(read.clamped, 0);
        // Room around the outermost cells, so that values fade.
        let low = read.to_space.transform_point3(DVec3::ZERO);
        assert!(low.cmplt(0.5 * DVec3::new(-8.0, 0.0, -16.0) + DVec3::new(0.0, 1.0, 2.0)).all());
    }
    assert_eq!(read(path(), &file(&[temperature()], 0), "density").expect("sound"), None);
    let memory = density().memory();
    let bare = [b"NanoVDB1", &memory[8..]].concat();
    assert_eq!(read_all(path(), &bare).expect("grids without a file around them").len(), 1);
}

/// A ball of fog of radius 5 around (1, 2, -3), in cells of 1 that begin at (0.5, -0.25, 1), written by NanoVDB 10.0.1 itself
/// with zlib 1.2.13 and c-blosc 1.21.3.
#[test]
fn files_of_the_library_itself() {
    let files: [&[u8]; 2] = [
        include_bytes!("../../tests/compressed/sphere-zip.nvdb"),
        include_bytes!("../../tests/compressed/sphere-blosc.nvdb"),
    ];
    let grids = files.map(|bytes| read(path(), bytes, "density").expect("sound").expect("there"));
    assert_eq!(grids[0], grids[1]);
    let grid = &grids[0];
    let value = |place: DVec3| {
        let cell = grid.to_space.inverse().transform_point3(place).round().as_uvec3();
        let [nx, ny, _] = grid.grid.blocks();
        let bricks = grid.grid.bricks.as_ref().expect("bricks");
        let brick = bricks[((cell.z / 8 * ny + cell.y / 8) * nx + cell.x / 8) as usize];
        let at = (cell.z % 8 * 8 + cell.y % 8) * 8 + cell.x % 8;
        if brick == Grid::<f32>::NOTHING { 0.0 } else { grid.grid.values[(brick * 512 + at) as usize] }
    };
    // Fog is full two cells below the ball's surface and thins out linearly to it.
    for x in -5..=5 {
        for (y, z) in [(0, 0), (1, 2), (-3, 0), (3, 3)] {
            let place =
                DVec3::new(0.5, -0.25, 1.0) + DVec3::new(f64::from(x), f64::from(y + 2), f64::from(z - 4));
            let depth = 5.0 - place.distance(DVec3::new(1.0, 2.0, -3.0));
            let expected = (0.5 * depth).clamp(0.0, 1.0);
            assert!((f64::from(value(place)) - expected).abs() < 1e-5, "{place} {expected} {}", value(place));
        }
    }
}

/// Chunks with bytes changed unpack to as much as they should, or not at all.
#[test]
fn damaged_chunks_are_unpacked_or_refused() {
    let file = include_bytes!("../../tests/compressed/sphere-blosc.nvdb");
    let packed = &file[SEGMENT + META + "density".len() + 1..];
    let size = Bytes { path: path(), bytes: file }.u64(SEGMENT).expect("there");
    assert_eq!(blosc::unpack(packed, size).expect("sound").len() as u64, size);
    let mut refused = 0;
    for i in 0..400 {
        let mut damaged = packed.to_vec();
        let at = if i < 200 { i } else { i * 26 % packed.len() };
        damaged[at] ^= [1, 0x80, 0xff][i % 3];
        match blosc::unpack(&damaged, size) {
            Ok(bytes) => assert_eq!(bytes.len() as u64, size),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 20, "{refused}");
}

#[test]
fn grids_of_the_same_space_are_brought_to_the_same_cells() {
    let bytes = file(&[density(), temperature()], 0);
    let grid = |name| read(path(), &bytes, name).expect("sound").expect("there");
    let (density, temperature) = (grid("density"), grid("temperature"));
    assert_eq!(temperature.clamped, 64);
    let same = NanoGrid { grid: temperature.within(&density).expect("the same cells"), ..density.clone() };
    assert_eq!(same.grid.size, density.grid.size);
    for p in [
        IVec3::new(0, 8, 0),
        IVec3::new(7, 15, 7),
        IVec3::new(3, 8, 0),
        IVec3::new(8, 8, 0),
        IVec3::new(-1, 0, -9),
    ] {
        assert_eq!(at(&same, p), at(&temperature, p.clamp(IVec3::splat(-1), IVec3::splat(16))), "{p}");
    }
    let stretched =
        NanoGrid { to_space: density.to_space * DAffine3::from_scale(DVec3::splat(2.0)), ..density.clone() };
    assert!(temperature.within(&stretched).is_none());
}

#[test]
fn what_is_wrong_is_said() {
    let sound = file(&[density()], 0);
    let said = |spoil: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = sound.clone();
        spoil(&mut bytes);
        read_all(path(), &bytes).expect_err("spoilt").to_string()
    };
    let grid = SEGMENT + META + "density".len() + 1;
    let put = |at: usize, with: &[u8]| {
        let with = with.to_vec();
        move |bytes: &mut Vec<u8>| bytes[at..at + with.len()].copy_from_slice(&with)
    };
    assert!(said(&put(0, b"OpenVDB0")).contains("a segment of a NanoVDB file is expected"));
    assert!(said(&put(8, &(29_u32 << 21).to_le_bytes())).contains("version 29.0"));
    assert!(said(&put(14, &[2])).contains("cannot be unpacked: a chunk is longer than the file"));
    assert!(said(&put(14, &[7])).contains("number 7"));
    assert!(said(&put(grid + 636, &[6])).contains("values of type 6"));
    assert!(said(&|bytes| bytes.truncate(5000)).contains("bytes are expected"));
    // A box of 2^31 cells along x.
    let root = grid + HEADER + 64;
    assert!(said(&put(root + 12, &i32::MAX.to_le_bytes())).contains("blocks of 8 x 8 x 8"));
    assert!(said(&put(root + 64 + 32, &bytes_of(&sound, root + 64))).contains("given twice"));
    assert!(said(&put(root + 64 + 8, &i64::MIN.to_le_bytes())).contains("leads out of the grid"));
    assert!(said(&put(grid + HEADER, &[1])).contains("among the others"));
}

fn bytes_of(bytes: &[u8], at: usize) -> [u8; 8] {
    bytes[at..at + 8].try_into().expect("8 bytes")
}

/// Headers, offsets and masks, which are few among the bytes of a file, with bytes changed: each gives grids or words.
#[test]
fn damaged_headers_are_read_or_refused() {
    let sound = file(&[density()], 0);
    let grid = SEGMENT + META + "density".len() + 1;
    let upper = grid + HEADER + 64 + 64 + 3 * 32;
    let places = [0..grid, grid..grid + 700, grid + HEADER..upper + 32, upper + 4128..upper + 8256 + 4096];
    let mut bits = 0x5eed_u64;
    let mut below = |end: usize| {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (bits >> 33) as usize % end
    };
    let mut outcomes = [0, 0];
    for _ in 0..1500 {
        let mut damaged = sound.clone();
        for _ in 0..1 + below(3) {
            let place = &places[below(places.len())];
            let at = place.start + below(place.len());
            damaged[at] = [damaged[at] ^ 1 << below(8), 0, 255, 128][below(4)];
        }
        let outcome = read_all(path(), &damaged);
        outcomes[usize::from(outcome.is_err())] += 1;
        if let Ok(grids) = &outcome {
            let stored = |grid: &NanoGrid| (grid.grid.values.len() / 512) as u32;
            let sound = |grid: &NanoGrid| {
                let all = grid.grid.bricks.iter().flatten().copied();
                all.into_iter().all(|brick| brick == Grid::<f32>::NOTHING || brick < stored(grid))
            };
            assert!(grids.iter().all(sound));
        }
    }
    assert!(outcomes.iter().all(|&count| count > 100), "{outcomes:?}");
}
