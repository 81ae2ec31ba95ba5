//! The decoder against data that the reference implementation wrote (meshoptimizer 1.0 by way of the crate `meshopt`
//! 0.7, streams of version 0): `tests/compressed/*.bin` are the streams, `*.out` what it decodes filtered ones to.

use proptest::prelude::*;

use super::*;

macro_rules! stored {
    ($name:literal) => {
        include_bytes!(concat!("../../tests/compressed/", $name))
    };
}

/// Knuth's linear congruential generator (MMIX), as the writer of the files had it.
fn random(seed: u64) -> impl FnMut() -> u32 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as u32
    }
}

#[test]
fn attributes_of_three_blocks() {
    let mut random = random(1);
    // Slow, fast and random numbers, one that changes rarely, and constants.
    let element = |i: u32| -> [u8; 12] {
        let numbers = [i * 37, i * i, random(), i / 100].map(|n| (n as u16).to_le_bytes());
        let [[a, b], [c, d], [e, f], [g, h]] = numbers;
        [a, b, c, d, e, f, g, h, 7, 0, 0, 255]
    };
    let expected: Vec<u8> = (0..700).flat_map(element).collect();
    let found = decode(Mode::Attributes, Filter::None, stored!("attributes.bin"), 700, 12);
    assert_eq!(found.as_deref(), Ok(&expected[..]));
    let found = decode(Mode::Attributes, Filter::None, stored!("attribute.bin"), 1, 4);
    assert_eq!(found.as_deref(), Ok(&[1, 2, 3, 4][..]));
}

/// Streams of version 1, by meshoptimizer's own encoder (its package 1.3 for JavaScript, at its highest level), of numbers
/// that it packs by bytes and by pairs of them, and of some that change but in a few of their 32 bits.
#[test]
fn attributes_of_the_second_version() {
    let mut random = random(1);
    let element = |i: u32| -> [u8; 16] {
        let [[a, b], [c, d], [e, f], [g, h]] =
            [i * 37, i * i, random(), i / 100].map(|n| (n as u16).to_le_bytes());
        let [p, q, r, s] = i.wrapping_mul(0x9e37_79b1).to_le_bytes();
        [a, b, c, d, e, f, g, h, 7, 0, 0, 255, p, q, r, s]
    };
    let expected: Vec<u8> = (0..700).flat_map(element).collect();
    let found = decode(Mode::Attributes, Filter::None, stored!("attributes-v1.bin"), 700, 16);
    assert_eq!(found.as_deref(), Ok(&expected[..]));
    let found = decode(Mode::Attributes, Filter::None, stored!("xor-v1.bin"), 256, 4);
    assert_eq!(found.as_deref(), Ok(stored!("xor-v1.out").as_slice()));
}

/// The same triangles: the encoder may begin them with another corner.
#[test]
fn triangles_of_a_grid_and_of_none() {
    let mut expected = Vec::new();
    for y in 0..12 {
        for a in (0..12).map(|x| 13 * y + x) {
            expected.extend([[a, a + 1, a + 13], [a + 13, a + 1, a + 14]]);
        }
    }
    let mut random = random(7);
    expected.extend((0..30).map(|_| [random(), random(), random()].map(|index| index % 169)));
    let found = triangles(stored!("triangles.bin"), 3 * expected.len()).expect("a sound stream");
    for (found, expected) in found.chunks(3).zip(expected) {
        let turned = |by: usize| (0..3).all(|i| found[i] == expected[(i + by) % 3]);
        assert!((0..3).any(turned), "{found:?}, expected {expected:?}");
    }
    let short = decode(Mode::Triangles, Filter::None, stored!("triangles.bin"), found.len(), 2);
    let bytes: Vec<u8> = found.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect();
    assert_eq!(short, Ok(bytes));
}

#[test]
fn indices_of_two_sequences() {
    let mut expected: Vec<u32> = (0..60).flat_map(|i| [i, 1000 + 2 * i]).collect();
    expected.extend([70_000, 3]);
    let bytes: Vec<u8> = expected.iter().flat_map(|index| index.to_le_bytes()).collect();
    assert_eq!(decode(Mode::Indices, Filter::None, stored!("indices.bin"), 122, 4), Ok(bytes));
}

/// Within one unit in the last place, which is what the specification allows.
#[test]
fn filters() {
    let bytes = |filter, data, stride| decode(Mode::Attributes, filter, data, 40, stride).expect("sound");
    let found = bytes(Filter::Octahedral, stored!("octahedral-4.bin"), 4);
    let near = |(a, b): (&u8, &u8)| (*a as i8).abs_diff(*b as i8) <= 1;
    assert!(found.iter().zip(stored!("octahedral-4.out")).all(near));
    let near = |found: &[u8], expected: &[u8]| {
        let numbers = |bytes: &[u8]| -> Vec<i16> {
            bytes.as_chunks::<2>().0.iter().map(|bytes| i16::from_le_bytes(*bytes)).collect()
        };
        let (found, expected) = (numbers(found), numbers(expected));
        assert!(
            found.iter().zip(&expected).all(|(a, b)| a.abs_diff(*b) <= 1),
            "{found:?}, expected {expected:?}"
        );
    };
    near(&bytes(Filter::Octahedral, stored!("octahedral-8.bin"), 8), stored!("octahedral-8.out"));
    near(&bytes(Filter::Quaternion, stored!("quaternion-8.bin"), 8), stored!("quaternion-8.out"));
    assert_eq!(bytes(Filter::Color, stored!("color-4.bin"), 4), stored!("color-4.out"));
    assert_eq!(bytes(Filter::Color, stored!("color-8.bin"), 8), stored!("color-8.out"));
    assert_eq!(bytes(Filter::Exponential, stored!("exponential-12.bin"), 12), stored!("exponential-12.out"));
}

#[test]
fn what_is_wrong_is_said() {
    let fail = |mode, data: &[u8], count, stride| {
        decode(mode, Filter::None, data, count, stride).expect_err("broken data")
    };
    let sound = stored!("attributes.bin");
    assert_eq!(fail(Mode::Attributes, &[], 0, 4), "is empty");
    assert_eq!(fail(Mode::Triangles, &[0xa0; 40], 3, 4), "starts with 0xa0, expected 0xe1");
    let end = [&[0xa1_u8, 0xaa][..], &[0; 23], &[3]].concat();
    assert_eq!(fail(Mode::Attributes, &end, 1, 4), "has a channel of mode 0x03");
    assert_eq!(fail(Mode::Attributes, &sound[..9], 1, 4), "ends before its tail");
    assert_eq!(fail(Mode::Attributes, &sound[..sound.len() - 1], 700, 12), "ends too early");
    assert!(fail(Mode::Attributes, sound, 300, 12).ends_with("bytes too many"));
    assert_eq!(
        fail(Mode::Attributes, &[0xa0; 40], 1000, 4),
        "has 40 bytes, too few for 1000 elements of 4 bytes"
    );
    assert_eq!(
        fail(Mode::Indices, &[0xd1, 255, 255, 255, 255, 255, 0, 0, 0, 0], 1, 4),
        "has an integer of more than five bytes"
    );
}

proptest! {
    /// Neither panics nor endless loops, whatever the data.
    #[test]
    fn any_bytes(header in prop::sample::select(vec![0xa0_u8, 0xa1, 0xe1, 0xd1]), mut data in prop::collection::vec(any::<u8>(), 0..300),
        count in 0_usize..200, stride in prop::sample::select(vec![4_usize, 8, 12, 256])) {
        data.insert(0, header);
        for filter in [Filter::None, Filter::Exponential] {
            let _ = decode(Mode::Attributes, filter, &data, count, stride);
        }
        for mode in [Mode::Triangles, Mode::Indices] {
            if let Ok(bytes) = decode(mode, Filter::None, &data, count / 3 * 3, 4) {
                prop_assert_eq!(bytes.len(), count / 3 * 12);
            }
        }
        for filter in [Filter::Octahedral, Filter::Quaternion, Filter::Color] {
            let _ = decode(Mode::Attributes, filter, &data, count, 8);
        }
    }
}
