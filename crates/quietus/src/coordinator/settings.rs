//! What a renderer asks of the adaptive sampling, and what it is told where that makes no sense.

use std::fmt;

use crate::{
    Approach, PassCounts, PassSchedule, PixelRect, Policy, TileGrid, policy::Rebuild, protocol::Mode,
};

/// How a tile is checked against its region's tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum Checks {
    /// By looking into the tree under one of an array of reader-writer locks: the talk's way (section 4.3).
    StripedLocks,
    /// By loading a published mask: no lock.
    #[default]
    Published,
}

/// What a renderer asks for. [`Settings::new`] has the defaults: write `Settings { min_samples: 32, ..Settings::new(w, h) }`,
/// which goes on to compile where settings are added.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width of the full frame, in pixels.
    pub width: u32,
    /// Height of the full frame, in pixels.
    pub height: u32,
    /// The part to sample, in pixels of the full frame; all of it by default. Tiles start at its corner.
    pub crop: Option<PixelRect>,
    /// N_img of the region error, in pixels: the full frame by default, so that a crop keeps the meaning of the
    /// target.
    pub frame_area: Option<f64>,
    /// Regions along each axis: 2 (the talk's quadrants) by default.
    pub regions_per_axis: u32,
    /// How sampling is steered.
    pub policy: Policy,
    /// How much error to leave, above 0: 0.002 by default; smaller is cleaner.
    ///
    /// For policies that stop, the region error at which a region is complete (Dammertz et al. 2010): half of it takes
    /// about four times the samples. [`Policy::Quietus`] deals counts in inverse proportion to it: half of it takes
    /// twice the samples, and the noise falls by the root of two. Both mean about the same in a picture that ends with 64
    /// samples per pixel. How clean that looks depends on the scene: a picture that is too noisy can
    /// [go on](crate::AdaptiveSampling::resumed) with a smaller target.
    pub target_error: f64,
    /// Samples, over all replicates, below which a pixel is always sampled: 16 by default.
    pub min_samples: u32,
    /// Samples, over all replicates, at which a pixel is never sampled: 4096 by default.
    pub max_samples: u32,
    /// Sizes of the passes. Each is rounded up to a multiple of `replicates`, so that these stay equal.
    pub schedule: PassSchedule,
    /// Independent estimates per pixel, 1..=255: 2 (Dammertz' two halves) by default. The error needs two.
    pub replicates: u32,
    /// How pixels come to their minimum: [`Approach::Whole`] by default.
    pub approach: Approach,
    /// Whether pixels that go by their own count ([`Policy::Quietus`]) do so in steps of an eighth: they end closer to what they
    /// were to have, after more passes. No by default: a quarter and more.
    pub fine_steps: bool,
    /// Locks per region for [`Checks::StripedLocks`], a power of two: 64 by default. From 8 on, neighbouring
    /// tiles use different ones.
    pub stripes: u32,
    /// How visits and updates wait for each other.
    pub mode: Mode,
    /// How tiles are checked.
    pub checks: Checks,
    /// How trees are rebuilt.
    pub rebuild: Rebuild,
}

/// Largest frame, in pixels: with two replicates its counts and errors take 26 GB.
pub const MAX_FRAME_PIXELS: u64 = 1 << 30;

impl Settings {
    /// The defaults for a frame of `width` x `height` pixels.
    pub fn new(width: u32, height: u32) -> Self {
        Self {
            width,
            height,
            crop: None,
            frame_area: None,
            regions_per_axis: 2,
            policy: Policy::default(),
            target_error: 0.002,
            min_samples: 16,
            max_samples: 4096,
            schedule: PassSchedule::default(),
            replicates: 2,
            approach: Approach::default(),
            fine_steps: false,
            stripes: 64,
            mode: Mode::default(),
            checks: Checks::default(),
            rebuild: Rebuild::default(),
        }
    }

    /// The pixels to sample, in the full frame.
    pub fn window(&self) -> PixelRect {
        self.crop.unwrap_or(PixelRect::new(0, 0, self.width, self.height))
    }

    /// The tiles of the window.
    pub(crate) fn grid(&self) -> TileGrid {
        TileGrid::new(self.window().width(), self.window().height())
    }

    /// How counts grow.
    pub fn pass_counts(&self) -> PassCounts {
        PassCounts {
            schedule: self.schedule,
            replicates: self.replicates,
            min_samples: self.min_samples,
            max_samples: self.max_samples,
            lag: self.mode.slots(),
            approach: self.approach,
            fine_steps: self.fine_steps,
        }
    }

    pub(crate) fn validate(&self) -> Result<(), SettingsError> {
        use SettingsError as E;
        let Self { width, height, .. } = *self;
        let check = |ok, error| if ok { Ok(()) } else { Err(error) };
        let pixels = u64::from(width) * u64::from(height);
        check(pixels > 0 && pixels <= MAX_FRAME_PIXELS, E::FrameSize { width, height })?;
        let window = self.window();
        let frame = PixelRect::new(0, 0, width, height);
        let inside = !window.is_empty() && frame.contains_rect(&window);
        check(inside, E::Crop { crop: window, width, height })?;
        let area = self.frame_area.unwrap_or(1.0);
        check(area.is_finite() && area > 0.0, E::FrameArea(area))?;
        check((1..=256).contains(&self.regions_per_axis), E::Regions(self.regions_per_axis))?;
        let target = self.target_error;
        check(target.is_finite() && target > 0.0, E::TargetError(target))?;
        let (min, max) = (self.min_samples, self.max_samples);
        check(min <= max && max > 0, E::SampleLimits { min, max })?;
        check((1..=255).contains(&self.replicates), E::Replicates(self.replicates))?;
        let steered = self.policy != Policy::Uniform;
        check(self.replicates >= 2 || !steered, E::NoSecondEstimate(self.policy))?;
        check(self.stripes.is_power_of_two(), E::Stripes(self.stripes))?;
        let lag_ok = !matches!(self.mode, Mode::Deterministic { lag } if !(1..=2).contains(&lag));
        check(lag_ok, E::Lag(self.mode.slots()))?;
        let ordered = matches!(self.mode, Mode::Deterministic { .. });
        check(ordered || self.policy != Policy::Unbiased, E::NoOrder(self.policy))?;
        let spreads = matches!(self.policy, Policy::Quietus | Policy::Uniform);
        check(spreads || self.approach == Approach::Whole, E::NoSpread(self.policy))
    }
}

/// Why settings were refused.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum SettingsError {
    /// The frame is empty or larger than [`MAX_FRAME_PIXELS`].
    FrameSize {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
    },
    /// The crop window is empty or leaves the frame.
    Crop {
        /// The window asked for.
        crop: PixelRect,
        /// Width of the frame.
        width: u32,
        /// Height of the frame.
        height: u32,
    },
    /// The frame area is not a positive number.
    FrameArea(f64),
    /// Regions per axis are not in 1..=256.
    Regions(u32),
    /// The target error is not a positive number.
    TargetError(f64),
    /// The sample limits contradict each other.
    SampleLimits {
        /// Least samples asked for.
        min: u32,
        /// Most samples asked for.
        max: u32,
    },
    /// Replicates are not in 1..=255.
    Replicates(u32),
    /// A policy that looks at errors has but one replicate.
    NoSecondEstimate(Policy),
    /// The number of stripes is not a power of two.
    Stripes(u32),
    /// The lag is neither 1 nor 2.
    Lag(u32),
    /// A policy that must know how many samples each error is made of runs free.
    NoOrder(Policy),
    /// A policy whose pixels go by the size of passes was to spread their first samples.
    NoSpread(Policy),
    /// A policy that decides but once was to go on from an earlier sampling.
    NoStart(Policy),
    /// A start is of another window.
    StartSize {
        /// Pixels of all tiles of the window.
        expected: usize,
        /// Numbers of samples, and errors, in the start.
        found: [usize; 2],
    },
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FrameSize { width, height } => {
                write!(f, "a frame has between 1 and {MAX_FRAME_PIXELS} pixels, not {width}x{height}")
            }
            Self::Crop { crop: PixelRect { x0, y0, x1, y1 }, width, height } => write!(
                f,
                "the crop window {x0},{y0},{x1},{y1} must hold a pixel and lie in the frame of {width}x{height}"
            ),
            Self::FrameArea(area) => write!(f, "the frame area must be a positive number, not {area}"),
            Self::Regions(n) => write!(f, "between 1 and 256 regions an axis are possible, not {n}"),
            Self::TargetError(e) => write!(f, "the target error must be a positive number, not {e}"),
            Self::SampleLimits { min, max } => write!(
                f,
                "at most {max} samples per pixel were asked for: that must be at least 1 and not less than \
                 the minimum, {min}"
            ),
            Self::Replicates(n) => write!(f, "a pixel has between 1 and 255 replicates, not {n}"),
            Self::NoSecondEstimate(policy) => {
                write!(f, "the policy {policy:?} compares replicates, so it needs at least 2 of them")
            }
            Self::Stripes(n) => write!(f, "the number of striped locks must be a power of two, not {n}"),
            Self::NoOrder(policy) => write!(
                f,
                "the policy {policy:?} needs errors of known numbers of samples, which only the deterministic mode \
                 has"
            ),
            Self::NoSpread(policy) => write!(
                f,
                "the policy {policy:?} goes by whole passes: only Quietus and Uniform can spread first samples"
            ),
            Self::NoStart(policy) => write!(
                f,
                "the policy {policy:?} decides but once how many samples a pixel gets, so it cannot go on from an \
                 earlier sampling"
            ),
            Self::StartSize { expected, found: [samples, errors] } => write!(
                f,
                "a sampling of this window starts from {expected} numbers of samples and as many errors, not from \
                 {samples} and {errors}"
            ),
            Self::Lag(n) => write!(f, "the lag is 1 or 2 passes, not {n}"),
        }
    }
}

impl std::error::Error for SettingsError {}
