//! Arrays of eight floats; the compiler makes of them what the baseline has.

use super::{Isa, Job, Lanes, sealed};

/// No special instructions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Portable;

impl sealed::Sealed for Portable {}

#[inline(always)]
fn zip(a: Lanes, b: Lanes, f: impl Fn(f32, f32) -> f32) -> Lanes {
    Lanes(std::array::from_fn(|i| f(a.0[i], b.0[i])))
}

#[inline(always)]
fn mask(a: Lanes, b: Lanes, f: impl Fn(f32, f32) -> bool) -> u32 {
    (0..8).fold(0, |bits, i| bits | u32::from(f(a.0[i], b.0[i])) << i)
}

impl Isa for Portable {
    type F32x8 = Lanes;

    #[inline(always)]
    fn splat(self, x: f32) -> Lanes {
        Lanes([x; 8])
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Lanes {
        *lanes
    }

    #[inline(always)]
    fn store(self, a: Lanes) -> Lanes {
        a
    }

    #[inline(always)]
    fn add(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn sqrt(self, a: Lanes) -> Lanes {
        Lanes(a.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn min(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, a: Lanes, b: Lanes) -> Lanes {
        zip(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn select_lt(self, a: Lanes, b: Lanes, then: Lanes, otherwise: Lanes) -> Lanes {
        Lanes(std::array::from_fn(|i| if a.0[i] < b.0[i] { then.0[i] } else { otherwise.0[i] }))
    }

    #[inline(always)]
    fn le(self, a: Lanes, b: Lanes) -> u32 {
        mask(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn lt(self, a: Lanes, b: Lanes) -> u32 {
        mask(a, b, |a, b| a < b)
    }

    #[inline(always)]
    fn prefetch<T>(self, _place: *const T) {}

    #[inline(never)]
    fn outline<J: Job>(self, job: J) -> J::Output {
        job.run(self)
    }
}
