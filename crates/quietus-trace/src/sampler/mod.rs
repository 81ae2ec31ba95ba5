//! The stream of random numbers of one sample: Owen-scrambled Sobol points and nothing else.
//!
//! A [`Sampler`] is a pure function of (seed, pixel, replicate, sample index, dimension), so that any sample can be
//! drawn again alone, in any order, on any thread. Dimensions are padded as Burley does ("Practical Hash-based
//! Owen Scrambling", JCGT 9(4), 2020, section 4): every one- or two-dimensional draw is a scrambled (0, 1)- or
//! (0, 2)-sequence of its own, whose index is shuffled by another nested uniform scramble.

mod owen;

use glam::Vec2;
pub(crate) use owen::mix64;
use owen::{laine_karras, sobol_second_reversed, to_unit};

/// Odd, from the golden ratio: spreads consecutive dimensions over all bits before they are mixed.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Draws the random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    /// Hash of seed, pixel and replicate.
    key: u64,
    /// The sample index with its bits in reverse.
    reversed_index: u32,
    /// The dimension of the next draw.
    dimension: u32,
}

impl Sampler {
    /// The sampler of sample `index` of `replicate` of the pixel in column `x`, row `y` of the full frame;
    /// it starts at dimension 0. Each replicate has its own, independently scrambled sequence.
    #[inline]
    pub fn new(seed: u64, x: u32, y: u32, replicate: u8, index: u32) -> Self {
        let pixel = u64::from(x) | u64::from(y) << 32;
        let stream = mix64(seed ^ u64::from(replicate).wrapping_add(1).wrapping_mul(GOLDEN));
        Self { key: mix64(stream ^ mix64(pixel)), reversed_index: index.reverse_bits(), dimension: 0 }
    }

    /// Makes `dimension` the next one to be drawn. Draws of one sample are independent as long as none shares a
    /// dimension with another: give each purpose (each bounce, say) a block of its own.
    #[inline]
    pub fn start_dimension(&mut self, dimension: u32) {
        self.dimension = dimension;
    }

    /// The next number in `[0, 1)`; takes one dimension.
    #[inline]
    pub fn next_1d(&mut self) -> f32 {
        let seeds = self.dimension_seeds();
        self.dimension += 1;
        // Reversed bits of the shuffled index: the van der Corput sequence, before its own scrambling.
        let radical_inverse = laine_karras(self.reversed_index, seeds as u32);
        to_unit(laine_karras(radical_inverse.reverse_bits(), (seeds >> 32) as u32).reverse_bits())
    }

    /// The next point in `[0, 1)^2`; takes two dimensions.
    #[inline]
    pub fn next_2d(&mut self) -> Vec2 {
        let seeds = self.dimension_seeds();
        self.dimension += 2;
        let index = laine_karras(self.reversed_index, seeds as u32).reverse_bits();
        // The scrambles want the coordinates' bits in reverse, which for the first one is the index itself.
        let x = laine_karras(index, (seeds >> 32) as u32);
        let y = laine_karras(sobol_second_reversed(index), (seeds.wrapping_mul(GOLDEN) >> 32) as u32);
        Vec2::new(to_unit(x.reverse_bits()), to_unit(y.reverse_bits()))
    }

    /// Hashed bits of this sample and the current dimension: the seed of decisions whose number is not known
    /// beforehand. Takes no dimension.
    #[inline]
    pub(crate) fn bits(&self) -> u64 {
        mix64(self.dimension_seeds() ^ u64::from(self.reversed_index))
    }

    /// Independent bits for the scrambles of the current dimension.
    #[inline]
    fn dimension_seeds(&self) -> u64 {
        mix64(self.key.wrapping_add(u64::from(self.dimension).wrapping_mul(GOLDEN)))
    }
}

#[cfg(test)]
mod tests;
