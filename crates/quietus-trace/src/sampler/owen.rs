//! The parts of an Owen-scrambled Sobol sequence: hashes, the Sobol matrix, the scramble.

/// 64-bit finaliser of SplitMix (Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number Generators",
/// with the constants of Stafford's variant 13): a bijection whose every output bit depends on every input bit.
#[inline]
pub(crate) fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Nested uniform (Owen) scramble of a number whose bits are in **reverse**: each bit is flipped by a hash of the
/// bits below it. Laine and Karras 2011 ("Stratified Sampling for Stochastic Transparency", section 3.1) found
/// the form, Vegdahl 2021 ("Building a Better LK Hash") these constants, whose bits depend on each other better.
#[inline]
pub(super) fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// Second coordinate of the Sobol sequence at `index`, its bits in reverse.
///
/// The direction numbers of dimension 2 (Joe and Kuo 2008: `m = 1, 3, 5, 15, 17, 51 ...`) are Pascal's triangle
/// modulo 2: bit `j` of the reversed coordinate is the sum of all index bits `k` with `j & k == j` (Lucas). That
/// matrix is a Kronecker power, hence five butterfly steps instead of 32 look-ups, as Ahmed 2024 observes
/// ("An Implementation Algorithm of 2D Sobol Sequence Fast, Elegant, and Compact").
#[inline]
pub(super) fn sobol_second_reversed(index: u32) -> u32 {
    let mut x = index;
    x ^= (x & 0xaaaa_aaaa) >> 1;
    x ^= (x & 0xcccc_cccc) >> 2;
    x ^= (x & 0xf0f0_f0f0) >> 4;
    x ^= (x & 0xff00_ff00) >> 8;
    x ^ (x >> 16)
}

/// The 24 high bits as a number in `[0, 1)`: as many as an `f32` holds without ever rounding up to 1.
#[inline]
pub(super) fn to_unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}
