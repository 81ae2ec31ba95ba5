//! Wide instructions, chosen once per tile instead of once per ray.
//!
//! `#[target_feature]` on the ray kernel alone would leave shading at the baseline, and a check per ray
//! would cost as much as it saves. So the whole tile renderer is generic over [`Isa`], lives in the
//! `run` method of a [`Job`], and [`Level::run`] compiles it once per instruction set:
//!
//! ```
//! use quietus_trace::isa::{Isa, Job, Level};
//!
//! struct Sum<'a>(&'a [f32]);
//!
//! impl Job for Sum<'_> {
//!     type Output = f32;
//!
//!     #[inline(always)] // into the function that carries the target features
//!     fn run<I: Isa>(self, _isa: I) -> f32 {
//!         self.0.iter().sum()
//!     }
//! }
//!
//! assert_eq!(Level::detect().run(Sum(&[1.0, 2.0])), 3.0);
//! ```
//!
//! What is inlined into `run` is compiled with the wide instructions; what is not inlined is compiled for
//! the baseline. Mark the hot path `#[inline(always)]`, or give a large part that is called from several
//! places a boundary of its own with [`Isa::outline`], as the ray kernel does. The pattern is that of the
//! crate `pulp`.
//!
//! Both levels do the same arithmetic: rustc never contracts `a * b + c`, and neither do the operations of
//! [`Isa`]. A picture does not depend on the level.

use std::fmt;

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;

#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
pub use portable::Portable;

/// Eight floats as they lie in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes(pub [f32; 8]);

/// Proof that an instruction set is there, and the operations on eight floats at once the kernel needs.
///
/// The trait is sealed: holding a value is what makes its instructions safe to execute.
pub trait Isa: Copy + Send + Sync + fmt::Debug + sealed::Sealed {
    /// Eight floats in registers.
    type F32x8: Copy;

    /// All lanes `x`.
    fn splat(self, x: f32) -> Self::F32x8;
    /// From memory.
    fn load(self, lanes: &Lanes) -> Self::F32x8;
    /// To memory.
    fn store(self, a: Self::F32x8) -> Lanes;
    /// `a + b`.
    fn add(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a - b`.
    fn sub(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a * b`.
    fn mul(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `a / b`.
    fn div(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// Square root.
    fn sqrt(self, a: Self::F32x8) -> Self::F32x8;
    /// The lesser; `b` where they don't compare.
    fn min(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// The greater; `b` where they don't compare.
    fn max(self, a: Self::F32x8, b: Self::F32x8) -> Self::F32x8;
    /// `then` where `a < b`, `otherwise` where not or where they don't compare.
    fn select_lt(
        self,
        a: Self::F32x8,
        b: Self::F32x8,
        then: Self::F32x8,
        otherwise: Self::F32x8,
    ) -> Self::F32x8;
    /// Bit i is set where `a <= b` in lane i; never where they don't compare.
    fn le(self, a: Self::F32x8, b: Self::F32x8) -> u32;
    /// Bit i is set where `a < b` in lane i; never where they don't compare.
    fn lt(self, a: Self::F32x8, b: Self::F32x8) -> u32;

    /// Hints that `place` will be read soon.
    fn prefetch<T>(self, place: *const T);

    /// Runs `job` in a function of its own that is compiled with these instructions and never inlined.
    fn outline<J: Job>(self, job: J) -> J::Output;
}

/// Code that is compiled once per instruction set; see the module's example.
pub trait Job {
    /// What it returns.
    type Output;

    /// The code. Implementations must be `#[inline(always)]` to profit from the wide instructions.
    fn run<I: Isa>(self, isa: I) -> Self::Output;
}

/// An instruction set this processor has.
#[derive(Clone, Copy, Debug)]
pub struct Level(Inner);

#[derive(Clone, Copy, Debug)]
enum Inner {
    Portable(Portable),
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
}

impl Level {
    /// The widest there is.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = Avx2::detect() {
            return Self(Inner::Avx2(avx2));
        }
        Self::portable()
    }

    /// What every processor has.
    pub fn portable() -> Self {
        Self(Inner::Portable(Portable))
    }

    /// Its name, for reports: "portable" or "avx2".
    pub fn name(self) -> &'static str {
        match self.0 {
            Inner::Portable(_) => "portable",
            #[cfg(target_arch = "x86_64")]
            Inner::Avx2(_) => "avx2",
        }
    }

    /// Runs `job` with these instructions.
    pub fn run<J: Job>(self, job: J) -> J::Output {
        match self.0 {
            Inner::Portable(isa) => isa.outline(job),
            #[cfg(target_arch = "x86_64")]
            Inner::Avx2(isa) => isa.outline(job),
        }
    }
}

mod sealed {
    pub trait Sealed {}
}
