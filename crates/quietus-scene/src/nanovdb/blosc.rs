//! Unpacks what the library BLOSC has packed (format of its versions 1: c-blosc's `README_CHUNK_FORMAT.rst`), as far as
//! NanoVDB uses it: blocks packed by LZ4 or zlib, their bytes sorted by their place in each number.

use std::io::Read;

use flate2::read::ZlibDecoder;

/// Bytes of a chunk's header.
const HEADER: usize = 16;
/// What the header's flags say.
const SHUFFLED: u8 = 1;
const COPIED: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const WHOLE: u8 = 16;
/// Codecs, in the upper three bits of the flags.
const LZ4: u8 = 1;
const ZLIB: u8 = 3;
/// Numbers of more bytes are not packed byte by byte, nor are blocks of fewer numbers.
const MOST_PARTS: usize = 16;
const LEAST_PART: usize = 128;

/// Unpacks chunks, each behind its length in eight bytes, until `size` bytes are there.
///
/// # Errors
/// Says what is wrong with the chunks.
pub(super) fn unpack(mut packed: &[u8], size: u64) -> Result<Vec<u8>, String> {
    let mut all = Vec::new();
    while (all.len() as u64) < size {
        let (length, rest) = packed.split_first_chunk().ok_or("a chunk is missing")?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        let chunk = rest.get(..length).ok_or("a chunk is longer than the file")?;
        packed = &rest[length..];
        let left = size - all.len() as u64;
        unpack_chunk(chunk, left, &mut all)?;
    }
    Ok(all)
}

/// Appends what a chunk holds, `most` bytes at most.
fn unpack_chunk(chunk: &[u8], most: u64, all: &mut Vec<u8>) -> Result<(), String> {
    let number = |at: usize| -> Result<usize, String> {
        let bytes = chunk.get(at..).and_then(|rest| rest.first_chunk()).ok_or("a chunk ends too early")?;
        Ok(u32::from_le_bytes(*bytes) as usize)
    };
    let (bytes, block) = (number(4)?, number(8)?);
    let ([flags, width], length) = ([chunk[2], chunk[3]], number(12)?);
    let chunk = chunk.get(..length).filter(|_| length >= HEADER).ok_or("a chunk has a wrong length")?;
    if bytes == 0 || bytes as u64 > most {
        return Err(format!("a chunk unpacks to {bytes} bytes, expected 1 to {most}"));
    }
    if flags & COPIED != 0 {
        let copied = chunk.get(HEADER..HEADER + bytes).ok_or("a chunk ends too early")?;
        all.extend_from_slice(copied);
        return Ok(());
    }
    if flags & BITS_SHUFFLED != 0 {
        return Err("bits are shuffled, which is not read".to_owned());
    }
    // Neither codec packs better than 1 : 1100, and headers come on top.
    if block == 0 || bytes / 2048 > length {
        return Err(format!("{length} bytes in blocks of {block} cannot hold {bytes}"));
    }
    let layout = Layout { flags, width: usize::from(width).max(1) };
    let mut packed = vec![0; block.min(bytes)];
    for (i, start) in (0..bytes).step_by(block).enumerate() {
        let at = number(HEADER + 4 * i)?;
        let source = chunk.get(at..).ok_or("a block begins behind its chunk")?;
        let part = &mut packed[..block.min(bytes - start)];
        layout.unpack(source, part, part.len() < block)?;
        layout.sort(part, all);
    }
    Ok(())
}

/// How the blocks of a chunk are packed.
struct Layout {
    flags: u8,
    /// Bytes per number.
    width: usize,
}

impl Layout {
    /// Unpacks a block into `to`, its bytes still shuffled; `last` says that it is shorter than the others.
    fn unpack(&self, mut source: &[u8], to: &mut [u8], last: bool) -> Result<(), String> {
        let split = self.flags & WHOLE == 0
            && !last
            && self.width <= MOST_PARTS
            && to.len() / self.width >= LEAST_PART
            && to.len().is_multiple_of(self.width);
        let part = if split { to.len() / self.width } else { to.len() };
        for to in to.chunks_mut(part) {
            let (length, rest) = source.split_first_chunk().ok_or("a block ends too early")?;
            let length = u32::from_le_bytes(*length) as usize;
            let packed = rest.get(..length).ok_or("a block is longer than its chunk")?;
            source = &rest[length..];
            if length == to.len() {
                to.copy_from_slice(packed);
            } else {
                self.decode(packed, to)?;
            }
        }
        Ok(())
    }

    fn decode(&self, packed: &[u8], to: &mut [u8]) -> Result<(), String> {
        let found = match self.flags >> 5 {
            LZ4 => lz4_flex::block::decompress_into(packed, to).map_err(|error| error.to_string())?,
            ZLIB => {
                ZlibDecoder::new(packed).read_exact(to).map_err(|error| error.to_string())?;
                to.len()
            }
            codec => {
                return Err(format!("blocks are packed by codec {codec}, of which LZ4 and zlib are read"));
            }
        };
        if found == to.len() {
            return Ok(());
        }
        Err(format!("a block unpacks to {found} bytes, expected {}", to.len()))
    }

    /// Puts the bytes of each number side by side again.
    fn sort(&self, block: &[u8], all: &mut Vec<u8>) {
        let count = block.len() / self.width;
        if self.flags & SHUFFLED == 0 || self.width == 1 {
            all.extend_from_slice(block);
            return;
        }
        all.extend((0..count * self.width).map(|i| block[i % self.width * count + i / self.width]));
        all.extend_from_slice(&block[count * self.width..]);
    }
}
