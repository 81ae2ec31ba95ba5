//! AVX2 with FMA and the bit-manipulation instructions: every x86-64 processor since about 2015.

use std::arch::x86_64::*;

use super::{Isa, Job, Lanes, sealed};

/// Proof that this processor has AVX2, FMA, BMI1, BMI2, LZCNT and POPCNT.
#[derive(Clone, Copy, Debug)]
pub struct Avx2(());

impl Avx2 {
    /// The proof, where it can be given.
    pub fn detect() -> Option<Self> {
        let all = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2")
            && is_x86_feature_detected!("lzcnt")
            && is_x86_feature_detected!("popcnt");
        all.then_some(Self(()))
    }
}

impl sealed::Sealed for Avx2 {}

/// Calls an intrinsic that needs nothing but the instruction itself.
macro_rules! avx2 {
    ($call:expr) => {
        // SAFETY: an `Avx2` exists only where `Avx2::detect` has found the instructions.
        unsafe { $call }
    };
}

impl Isa for Avx2 {
    type F32x8 = __m256;

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        avx2!(_mm256_set1_ps(x))
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> __m256 {
        // SAFETY: the instruction is there (see `avx2!`); the pointer comes from a reference to 8 floats
        // that are aligned to 32 bytes.
        unsafe { _mm256_load_ps(lanes.0.as_ptr()) }
    }

    #[inline(always)]
    fn store(self, a: __m256) -> Lanes {
        let mut lanes = Lanes::default();
        // SAFETY: as in `load`.
        unsafe { _mm256_store_ps(lanes.0.as_mut_ptr(), a) };
        lanes
    }

    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_add_ps(a, b))
    }

    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_sub_ps(a, b))
    }

    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_mul_ps(a, b))
    }

    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_div_ps(a, b))
    }

    #[inline(always)]
    fn sqrt(self, a: __m256) -> __m256 {
        avx2!(_mm256_sqrt_ps(a))
    }

    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_min_ps(a, b))
    }

    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        avx2!(_mm256_max_ps(a, b))
    }

    #[inline(always)]
    fn select_lt(self, a: __m256, b: __m256, then: __m256, otherwise: __m256) -> __m256 {
        avx2!(_mm256_blendv_ps(otherwise, then, _mm256_cmp_ps::<_CMP_LT_OQ>(a, b)))
    }

    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> u32 {
        avx2!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b))) as u32
    }

    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> u32 {
        avx2!(_mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))) as u32
    }

    #[inline(always)]
    fn prefetch<T>(self, place: *const T) {
        avx2!(_mm_prefetch::<_MM_HINT_T0>(place.cast()))
    }

    #[inline(always)]
    fn outline<J: Job>(self, job: J) -> J::Output {
        #[inline(never)]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn with_features<J: Job>(isa: Avx2, job: J) -> J::Output {
            job.run(isa)
        }
        // SAFETY: the token proves that the processor has every feature that the function enables.
        unsafe { with_features(self, job) }
    }
}
