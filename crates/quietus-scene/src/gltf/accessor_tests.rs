//! Property tests of the accessor reader: whatever the numbers, it gives what a plain reading of the bytes gives, or
//! an error, and never reads outside of the data.

use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use proptest::prelude::*;
use serde_json::json;

use super::Component;
use crate::gltf::Choice;
use crate::gltf::document::Document;

/// Reads accessor 0 over `bytes`, whose fields are as given.
fn read(
    bytes: &[u8],
    code: u32,
    normalized: bool,
    kind: &str,
    numbers: [u64; 5],
) -> Result<Vec<[f32; 4]>, String> {
    let [view_offset, view_length, stride, offset, count] = numbers;
    let mut view = json!({"buffer": 0, "byteOffset": view_offset, "byteLength": view_length});
    if stride > 0 {
        view["byteStride"] = json!(stride);
    }
    let text = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": bytes.len(), "uri": format!("data:;base64,{}", STANDARD.encode(bytes))}],
        "bufferViews": [view],
        "accessors": [{"bufferView": 0, "byteOffset": offset, "componentType": code, "normalized": normalized,
            "count": count, "type": kind}]
    })
    .to_string();
    let document = Document::open(Path::new("test.gltf"), text.as_bytes(), Choice::default())
        .map_err(|e| e.to_string())?;
    let kinds = ["SCALAR", "VEC2", "VEC3", "VEC4"];
    document.read_floats(0, "test", &kinds, [9.0; 4]).map_err(|e| e.to_string())
}

/// What the specification says, written as plainly as possible, for numbers known to be in range.
fn plain(
    bytes: &[u8],
    code: u32,
    normalized: bool,
    arity: usize,
    [view, _, stride, offset, count]: [u64; 5],
) -> Vec<[f32; 4]> {
    let size = Component::from_code(code).expect("a known code").size();
    let stride = if stride == 0 { size * arity } else { stride as usize };
    let number = |at: usize| {
        let bits = (0..size).fold(0_u32, |bits, i| bits | u32::from(bytes[at + i]) << (8 * i));
        let (value, unit) = match code {
            5120 => (f64::from(bits as u8 as i8), 127.0),
            5121 => (f64::from(bits), 255.0),
            5122 => (f64::from(bits as u16 as i16), 32767.0),
            5123 => (f64::from(bits), 65535.0),
            5125 => (f64::from(bits), f64::from(u32::MAX)),
            _ => return f32::from_bits(bits),
        };
        if normalized { (value / unit).max(-1.0) as f32 } else { value as f32 }
    };
    let start = (view + offset) as usize;
    let element = |i: usize| {
        std::array::from_fn(|c| if c < arity { number(start + i * stride + c * size) } else { 9.0 })
    };
    (0..count as usize).map(element).collect()
}

fn codes() -> impl Strategy<Value = u32> {
    prop::sample::select(vec![5120, 5121, 5122, 5123, 5125, 5126])
}

const KINDS: [&str; 4] = ["SCALAR", "VEC2", "VEC3", "VEC4"];

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Numbers around the limits: in range they are read exactly, outside they are refused.
    #[test]
    fn in_range_exact_outside_refused(
        bytes in prop::collection::vec(any::<u8>(), 0..96),
        code in codes(), normalized: bool, arity in 1..=4_usize,
        view_offset in 0..16_u64, view_length in 0..96_u64, stride in 0..24_u64, offset in 0..16_u64,
        count in 0..12_u64,
    ) {
        let numbers = [view_offset, view_length, stride, offset, count];
        let size = (Component::from_code(code).expect("a known code").size() * arity) as u64;
        let step = if stride == 0 { size } else { stride };
        let end = offset + if count == 0 { 0 } else { step * (count - 1) + size };
        let fits = view_offset + view_length <= bytes.len() as u64 && end <= view_length && step >= size;
        let result = read(&bytes, code, normalized, KINDS[arity - 1], numbers);
        if !fits {
            prop_assert!(result.is_err());
            return Ok(());
        }
        let expected = plain(&bytes, code, normalized, arity, numbers);
        if expected.iter().flatten().all(|value| value.is_finite()) {
            let result = result.map_err(TestCaseError::fail)?;
            prop_assert_eq!(result.len(), expected.len());
            for (a, b) in result.iter().flatten().zip(expected.iter().flatten()) {
                // The plain reading divides in f64: one unit in the last place apart at most.
                prop_assert!((a - b).abs() <= f32::EPSILON * b.abs(), "{} {}", a, b);
            }
        } else {
            prop_assert!(result.is_err());
        }
    }

    /// Any numbers at all: a vector or an error.
    #[test]
    fn never_panics(
        bytes in prop::collection::vec(any::<u8>(), 0..40),
        code in prop_oneof![codes(), any::<u32>()], normalized: bool, numbers: [u64; 5],
        kind in prop::sample::select(vec!["SCALAR", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4", ""]),
    ) {
        let _ = read(&bytes, code, normalized, kind, numbers);
    }
}
