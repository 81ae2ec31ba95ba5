//! Decompression of buffer views: EXT_meshopt_compression, and KHR_meshopt_compression, which adds a second version of
//! attributes and a filter of colours (its specification's appendices A and B are the sections named below).
//!
//! The sizes of the results are stated by the file and checked against its limits before anything is decoded here.

use std::array::from_fn;

/// How a view is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Elements of any kind, by the differences of their bytes.
    Attributes,
    /// Corners of triangles.
    Triangles,
    /// Other indices.
    Indices,
}

/// What is done to attributes afterwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    /// Nothing.
    None,
    /// Directions become vectors.
    Octahedral,
    /// Three components become four.
    Quaternion,
    /// Mantissas and exponents become floats.
    Exponential,
    /// Luma and two differences of colour become red, green and blue.
    Color,
}

/// Header of attributes in the second version.
const VERSION_1: u8 = 0xa1;

/// Elements per group: their differences are packed together.
const GROUP: usize = 16;

/// Decodes `count` elements of `stride` bytes from `data`.
///
/// # Errors
/// What is wrong with the data.
pub(super) fn decode(
    mode: Mode,
    filter: Filter,
    data: &[u8],
    count: usize,
    stride: usize,
) -> Result<Vec<u8>, String> {
    // A byte of elements takes at least two bits for every sixteen (four bytes of up to 256 at least a byte in the second
    // version), an index or triangle at least a byte.
    let most = match mode {
        Mode::Attributes if data.first() == Some(&VERSION_1) => data.len().saturating_mul(1024) / stride,
        Mode::Attributes => data.len().saturating_mul(64) / stride,
        Mode::Triangles => data.len().saturating_mul(3),
        Mode::Indices => data.len(),
    };
    if count > most {
        return Err(format!("has {} bytes, too few for {count} elements of {stride} bytes", data.len()));
    }
    match mode {
        Mode::Attributes => {
            let mut bytes = attributes(data, count, stride)?;
            apply(filter, &mut bytes, stride);
            Ok(bytes)
        }
        Mode::Triangles => Ok(pack(&triangles(data, count)?, stride)),
        Mode::Indices => Ok(pack(&indices(data, count)?, stride)),
    }
}

/// Indices as little-endian integers of 2 or 4 bytes.
fn pack(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

/// Takes bytes off the front of a stream.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    /// A stream behind the header byte `header`, in front of a tail of `tail` bytes; and that tail.
    fn open(data: &'a [u8], header: u8, tail: usize) -> Result<(Self, &'a [u8]), String> {
        let Some((&found, rest)) = data.split_first() else { return Err("is empty".to_owned()) };
        if found != header {
            return Err(format!("starts with {found:#04x}, expected {header:#04x}"));
        }
        let body = rest.len().checked_sub(tail).ok_or("ends before its tail")?;
        let (body, tail) = rest.split_at(body);
        Ok((Self(body), tail))
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or("ends too early")?;
        self.0 = rest;
        Ok(taken)
    }

    fn byte(&mut self) -> Result<u8, String> {
        Ok(self.take(1)?[0])
    }

    /// An integer in groups of seven bits, the lowest first.
    fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err("has an integer of more than five bytes".to_owned())
    }

    fn finish(&self) -> Result<(), String> {
        match self.0.len() {
            0 => Ok(()),
            left => Err(format!("has {left} bytes too many")),
        }
    }
}

/// Section "Mode 0: attributes", of both versions: the first one has neither controls nor channels.
fn attributes(data: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let second = data.first() == Some(&VERSION_1);
    let (header, tail, least) =
        if second { (VERSION_1, stride + stride / 4, 24) } else { (0xa0, stride, 32) };
    let (mut reader, end) = Reader::open(data, header, tail.max(least))?;
    // The first element ends the tail, with how its numbers are joined behind it.
    let (first, channels) = end[end.len() - tail..].split_at(stride);
    let mut previous = first.to_vec();
    let mut bytes = vec![0; count * stride];
    let most = ((8192 / stride) & !(GROUP - 1)).min(256);
    for block in bytes.chunks_mut(most * stride) {
        let controls = reader.take(channels.len())?;
        for (k, previous) in previous.as_chunks_mut::<4>().0.iter_mut().enumerate() {
            let control = controls.get(k).copied();
            let elements = block.len() / stride;
            let mut planes: [Vec<u8>; 4] = Default::default();
            for (j, plane) in planes.iter_mut().enumerate() {
                *plane = deltas(&mut reader, control.map(|control| control >> (2 * j) & 3), elements)?;
            }
            let channel = channels.get(k).copied().unwrap_or(0);
            for (i, element) in block.chunks_mut(stride).enumerate() {
                *previous = join(*previous, from_fn(|j| planes[j][i]), channel)?;
                element[4 * k..][..4].copy_from_slice(previous);
            }
        }
    }
    reader.finish()?;
    Ok(bytes)
}

/// Four bytes from those before and their differences: bytes, numbers of 16 bits, or bits of one of 32, which were rotated,
/// as `channel` says.
fn join(before: [u8; 4], deltas: [u8; 4], channel: u8) -> Result<[u8; 4], String> {
    let short = |bytes: [u8; 4], i: usize| u16::from_le_bytes([bytes[i], bytes[i + 1]]);
    match channel & 3 {
        0 => Ok(from_fn(|j| before[j].wrapping_add(unzigzag(deltas[j])))),
        1 => {
            let sum = |i: usize| {
                let delta = short(deltas, i);
                let delta = (delta >> 1) ^ (delta & 1).wrapping_neg();
                short(before, i).wrapping_add(delta).to_le_bytes()
            };
            let [[a, b], [c, d]] = [sum(0), sum(2)];
            Ok([a, b, c, d])
        }
        2 => {
            let bits = u32::from_le_bytes(deltas).rotate_right(u32::from(channel >> 4));
            Ok((u32::from_le_bytes(before) ^ bits).to_le_bytes())
        }
        _ => Err(format!("has a channel of mode {channel:#04x}")),
    }
}

fn unzigzag(value: u8) -> u8 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Differences of one byte of `elements` elements, as `control` says in the second version.
fn deltas(reader: &mut Reader<'_>, control: Option<u8>, elements: usize) -> Result<Vec<u8>, String> {
    let widths = match control {
        None => [0, 2, 4, 8],
        Some(0) => [0, 1, 2, 4],
        Some(1) => [1, 2, 4, 8],
        Some(2) => return Ok(vec![0; elements]),
        Some(_) => return Ok(reader.take(elements)?.to_vec()),
    };
    let groups = elements.div_ceil(GROUP);
    let modes = reader.take(groups.div_ceil(4))?;
    let mut deltas = Vec::with_capacity(groups * GROUP);
    for group in 0..groups {
        let mode = modes[group / 4] >> (2 * (group % 4)) & 3;
        deltas.extend(group_deltas(reader, widths[usize::from(mode)])?);
    }
    Ok(deltas)
}

/// Differences of one byte of sixteen elements, in 0, 1, 2, 4 or 8 `bits` each.
fn group_deltas(reader: &mut Reader<'_>, bits: usize) -> Result<[u8; GROUP], String> {
    if bits == 0 {
        return Ok([0; GROUP]);
    }
    if bits == 8 {
        let deltas = reader.take(GROUP)?;
        return Ok(from_fn(|i| deltas[i]));
    }
    let (per_byte, largest) = (8 / bits, (1_u8 << bits) - 1);
    let packed = reader.take(GROUP / per_byte)?;
    let mut deltas = from_fn(|i| {
        let place = i % per_byte;
        // Single bits alone begin with the lowest.
        let shift = if bits == 1 { place } else { 8 - bits * (place + 1) };
        packed[i / per_byte] >> shift & largest
    });
    for delta in &mut deltas {
        // Where all bits are set the difference did not fit, and follows as a byte.
        if *delta == largest {
            *delta = reader.byte()?;
        }
    }
    Ok(deltas)
}

/// Where the decoder of triangles stands.
struct Corners<'a> {
    data: Reader<'a>,
    next: u32,
    last: u32,
    /// The last sixteen edges and vertices; entry 0 is the latest.
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
}

/// The last sixteen things.
struct Recent<T> {
    ring: [T; 16],
    count: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self { ring: [T::default(); 16], count: 0 }
    }

    fn push(&mut self, item: T) {
        self.ring[self.count % 16] = item;
        self.count += 1;
    }

    /// The item pushed `age` pushes before the latest one.
    fn get(&self, age: u8) -> T {
        self.ring[self.count.wrapping_sub(1 + usize::from(age)) % 16]
    }
}

/// Section "Mode 1: triangles".
fn triangles(data: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (mut codes, table) = Reader::open(data, 0xe1, 16)?;
    let data = Reader(codes.0);
    let codes = codes.take(count / 3)?;
    let data = Reader(&data.0[codes.len()..]);
    let mut corners = Corners { data, next: 0, last: 0, edges: Recent::new(), vertices: Recent::new() };
    let mut indices = Vec::with_capacity(count);
    for &code in codes {
        indices.extend(match code {
            0xf0..=0xff => corners.loose_triangle(code & 15, table)?,
            _ => corners.triangle_on_edge(code >> 4, code & 15)?,
        });
    }
    corners.data.finish()?;
    Ok(indices)
}

impl Corners<'_> {
    /// A triangle over the edge of age `edge`.
    fn triangle_on_edge(&mut self, edge: u8, vertex: u8) -> Result<[u32; 3], String> {
        let [a, b] = self.edges.get(edge);
        let c = match vertex {
            0 => self.fresh(),
            1..=12 => self.vertices.get(vertex),
            13 => self.stated(self.last.wrapping_sub(1)),
            14 => self.stated(self.last.wrapping_add(1)),
            _ => self.explicit()?,
        };
        if !(1..=12).contains(&vertex) {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Ok([a, b, c])
    }

    /// A triangle whose corners are coded one by one.
    fn loose_triangle(&mut self, code: u8, table: &[u8]) -> Result<[u32; 3], String> {
        let pair = if code < 14 { table[usize::from(code)] } else { self.data.byte()? };
        if code >= 14 && pair == 0 {
            self.next = 0;
        }
        let a = if code == 15 { self.explicit()? } else { self.fresh() };
        // The ages of b and c were counted before a and b were remembered.
        let b = self.corner(pair >> 4, code >= 14)?;
        let c = self.corner(pair & 15, code >= 14)?;
        self.vertices.push(a);
        for (vertex, nibble) in [(b, pair >> 4), (c, pair & 15)] {
            if nibble == 0 || nibble == 15 {
                self.vertices.push(vertex);
            }
        }
        [[b, a], [c, b], [a, c]].into_iter().for_each(|edge| self.edges.push(edge));
        Ok([a, b, c])
    }

    fn corner(&mut self, nibble: u8, may_be_explicit: bool) -> Result<u32, String> {
        match nibble {
            0 => Ok(self.fresh()),
            15 if may_be_explicit => self.explicit(),
            15 => Err("has a table with an entry of 15".to_owned()),
            age => Ok(self.vertices.get(age - 1)),
        }
    }

    /// The next vertex not seen so far.
    fn fresh(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    /// A vertex by its difference to the last one that was stated so.
    fn explicit(&mut self) -> Result<u32, String> {
        let delta = self.data.varint()?;
        let delta = (delta >> 1) ^ (delta & 1).wrapping_neg();
        Ok(self.stated(self.last.wrapping_add(delta)))
    }

    fn stated(&mut self, index: u32) -> u32 {
        self.last = index;
        index
    }
}

/// Section "Mode 2: indices".
fn indices(data: &[u8], count: usize) -> Result<Vec<u32>, String> {
    let (mut reader, _) = Reader::open(data, 0xd1, 4)?;
    let mut last = [0_u32; 2];
    let mut indices = Vec::with_capacity(count);
    for _ in 0..count {
        let code = reader.varint()?;
        let baseline = &mut last[(code & 1) as usize];
        let delta = (code >> 2) ^ (code >> 1 & 1).wrapping_neg();
        *baseline = baseline.wrapping_add(delta);
        indices.push(*baseline);
    }
    reader.finish()?;
    Ok(indices)
}

/// Appendix B.
fn apply(filter: Filter, bytes: &mut [u8], stride: usize) {
    match filter {
        Filter::None => {}
        Filter::Octahedral if stride == 4 => {
            for element in bytes.as_chunks_mut::<4>().0 {
                let [x, y, z] = octahedral([0, 1, 2].map(|i| f32::from(element[i] as i8)), 127.0);
                [element[0], element[1], element[2]] = [x, y, z].map(|v| v as i8 as u8);
            }
        }
        Filter::Octahedral => shorts(bytes, |[x, y, z, w]| {
            let [x, y, z] = octahedral([x, y, z].map(f32::from), 32767.0);
            [x as i16, y as i16, z as i16, w]
        }),
        Filter::Quaternion => shorts(bytes, quaternion),
        Filter::Color if stride == 4 => {
            for element in bytes.as_chunks_mut::<4>().0 {
                let [y, co, cg, alpha] = *element;
                let found = color([y.into(), (co as i8).into(), (cg as i8).into(), alpha.into()], 255.0);
                *element = found.map(|v| v as u8);
            }
        }
        Filter::Color => shorts(bytes, |[y, co, cg, alpha]| {
            let unsigned = |v: i16| i32::from(v as u16);
            color([unsigned(y), co.into(), cg.into(), unsigned(alpha)], 65535.0).map(|v| v as u16 as i16)
        }),
        Filter::Exponential => {
            for number in bytes.as_chunks_mut::<4>().0 {
                let code = i32::from_le_bytes(*number);
                let value = (f64::from(code << 8 >> 8) * f64::from(code >> 24).exp2()) as f32;
                *number = value.to_le_bytes();
            }
        }
    }
}

/// Applies `change` to every element of four numbers of 16 bits.
fn shorts(bytes: &mut [u8], change: impl Fn([i16; 4]) -> [i16; 4]) {
    for element in bytes.as_chunks_mut::<8>().0 {
        let numbers = change(from_fn(|i| i16::from_le_bytes([element[2 * i], element[2 * i + 1]])));
        element.as_chunks_mut::<2>().0.iter_mut().zip(numbers).for_each(|(to, n)| *to = n.to_le_bytes());
    }
}

/// The unit vector of octahedral coordinates x and y, of which `one` is 1, times `scale` and rounded.
fn octahedral([x, y, one]: [f32; 3], scale: f32) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| (v / length * scale).round())
}

/// Red, green, blue and alpha, `scale` for 1 and rounded, of a luma, two differences and an alpha whose highest bit says how many
/// bits all of them have.
fn color([y, co, cg, alpha]: [i32; 4], scale: f32) -> [f32; 4] {
    let highest = alpha.checked_ilog2().unwrap_or(0);
    let all = (1 << (highest + 1)) - 1;
    let alpha = alpha & (all >> 1);
    let alpha = alpha << 1 | alpha & 1;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|v| (v as f32 * (scale / all as f32)).round())
}

/// The quaternion whose largest component was left out; which one that is stands in the lowest bits of the last
/// number, whose others say what 1 is.
fn quaternion([x, y, z, code]: [i16; 4]) -> [i16; 4] {
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(code | 3);
    let [x, y, z] = [x, y, z].map(|v| f32::from(v) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let mut all = [0; 4];
    for (i, value) in [w, x, y, z].into_iter().enumerate() {
        all[((code & 3) as usize + i) % 4] = (value * 32767.0).round() as i16;
    }
    all
}

#[cfg(test)]
#[path = "meshopt_tests.rs"]
mod tests;
