//! Portable float maps (Debevec 2001): a text header of three lines, then 32-bit floats, the bottom row first.

use super::check_size;
use super::exr_file::Floats;
use crate::error::ErrorKind;

/// Decodes a colour (`PF`) or grey (`Pf`) map. The header's scale only tells the byte order by its sign.
pub(super) fn decode(bytes: &[u8]) -> Result<Floats, (ErrorKind, String)> {
    let mut rest = bytes;
    let channels = if word(&mut rest).is_some_and(|word| word == "PF") { 3 } else { 1 };
    let width: u32 = number(&mut rest, "a width")?;
    let height: u32 = number(&mut rest, "a height")?;
    let scale: f32 = number(&mut rest, "a scale")?;
    check_size(width.into(), height.into())?;
    let row_bytes = width as usize * channels * 4;
    if rest.len() < row_bytes * height as usize {
        let expected = row_bytes * height as usize;
        let message = format!("ends after {} bytes of texels, expected {expected}", rest.len());
        return Err((ErrorKind::Syntax, message));
    }
    let float = |bytes: &[u8]| {
        let bytes: [u8; 4] = bytes.try_into().expect("cut into fours");
        if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
    };
    let texel = |bytes: &[u8]| {
        let values = [0, 1, 2].map(|i| float(&bytes[4 * (i % channels)..][..4]));
        [values[0], values[1], values[2], 1.0]
    };
    let rows = rest[..row_bytes * height as usize].chunks_exact(row_bytes).rev();
    Ok(([width, height], rows.flat_map(|row| row.chunks_exact(4 * channels)).map(texel).collect()))
}

/// The next word of the header; takes the one byte of white space behind it, too.
fn word<'a>(rest: &mut &'a [u8]) -> Option<&'a str> {
    let start = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
    let end = start + rest[start..].iter().position(u8::is_ascii_whitespace)?;
    let word = std::str::from_utf8(&rest[start..end]).ok();
    *rest = &rest[end + 1..];
    word
}

fn number<T: std::str::FromStr>(rest: &mut &[u8], what: &str) -> Result<T, (ErrorKind, String)> {
    let number = word(rest).and_then(|word| word.parse().ok());
    number.ok_or_else(|| (ErrorKind::Syntax, format!("is not a whole PFM picture: expected {what}")))
}
