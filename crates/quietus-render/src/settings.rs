//! What a render is asked to do.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use quietus::{Checks, Mode, PixelRect, Policy, Rebuild};
use quietus_film::{Layout, LayoutError, Window};

use crate::noise::OfAovs;
use crate::pixel_errors::REPLICATES;
use crate::weights::Weights;

/// How samples are spread over the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sampling {
    /// A quota of samples for each pixel, by the noise that a tree pools; the picture does not depend on threads.
    #[default]
    Quietus,
    /// Counts from pilots of other pixels only: every pixel's mean is unbiased.
    Unbiased,
    /// The talk's tree, drawing bounding rectangles; the picture does not depend on threads.
    Talk,
    /// The talk's tree as published: it is consulted and rebuilt whenever threads get there.
    FreeRunning,
    /// Each tile stops for good on its own error.
    Tile,
    /// Dammertz et al. 2010: blocks that are split and discarded.
    Dammertz,
    /// Each pixel stops on its own error unless a neighbour goes on.
    Pixel,
    /// The same number of samples everywhere.
    Uniform,
}

impl Sampling {
    /// Whether it builds trees that can be drawn.
    pub fn has_tree(self) -> bool {
        matches!(self, Self::Quietus | Self::Talk | Self::FreeRunning)
    }

    /// Regions along each axis of the picture that it goes with best. Counts without bias are decided once, so that there is
    /// no tree to rebuild in parts, and the more pilots decide together, the less is left to chance.
    pub fn regions_per_axis(self) -> u32 {
        match self {
            Self::Unbiased => 1,
            _ => quietus::Settings::new(1, 1).regions_per_axis,
        }
    }

    fn policy(self) -> Policy {
        match self {
            Self::Quietus => Policy::Quietus,
            Self::Unbiased => Policy::Unbiased,
            Self::Talk | Self::FreeRunning => Policy::Talk,
            Self::Tile => Policy::Tile,
            Self::Dammertz => Policy::Dammertz,
            Self::Pixel => Policy::Pixel,
            Self::Uniform => Policy::Uniform,
        }
    }
}

/// When a picture is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Goal {
    /// When its noise ([`crate::noise::Noise`]) is that share of white, above 0: 0.01 for 1 %. Only with
    /// [`Sampling::Quietus`] and [`Sampling::Uniform`].
    Noise(f64),
    /// When the policy says so at this region error, in the library's units, above 0. Uniform sampling has none, and
    /// goes to [`RenderSettings::max_samples`].
    TargetError(f64),
    /// Never: it is to be as good as [`RenderSettings::time_limit`] allows, and [`RenderSettings::max_samples`]. Only
    /// with [`Sampling::Quietus`] and [`Sampling::Uniform`].
    Limits,
}

/// Settings of one render.
#[derive(Clone, Debug)]
pub struct RenderSettings {
    /// Width and height of the full frame in pixels.
    pub frame: [u32; 2],
    /// The part to draw. Samples and the meaning of the target error are those of the full frame.
    pub window: Window,
    /// How samples are spread.
    pub sampling: Sampling,
    /// When it is good enough.
    pub goal: Goal,
    /// Samples every pixel gets, at least.
    pub min_samples: u32,
    /// Samples no pixel exceeds; with [`Sampling::Uniform`] what every pixel gets.
    pub max_samples: u32,
    /// Ends the render after this time in any case. For the goals [`Goal::Noise`] and [`Goal::Limits`] samples are dealt
    /// so that the picture is finished by then.
    pub time_limit: Option<Duration>,
    /// Threads that render.
    pub threads: NonZeroUsize,
    /// Which machinery does it.
    pub machinery: Machinery,
    /// The noise of alpha, albedo and normal that is asked for besides; only with [`Goal::Noise`].
    pub aov_noise: OfAovs<f64>,
    /// Where error matters more; only with [`Sampling::Quietus`] and [`Sampling::Uniform`].
    pub weights: Option<Arc<Weights>>,
}

/// Ways to do the same. The picture depends on the first two alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Machinery {
    /// How many passes the tree that is consulted lags behind, 1 or 2; without meaning when free-running.
    pub lag: u32,
    /// Regions along each axis, each with its own tree: the talk has 2. See [`Sampling::regions_per_axis`].
    pub regions_per_axis: u32,
    /// How tiles are checked against trees.
    pub checks: Checks,
    /// How trees are rebuilt.
    pub rebuild: Rebuild,
}

impl Default for Machinery {
    fn default() -> Self {
        let library = quietus::Settings::new(1, 1);
        Self {
            lag: 2,
            regions_per_axis: Sampling::default().regions_per_axis(),
            checks: library.checks,
            rebuild: library.rebuild,
        }
    }
}

impl Sampling {
    /// Whether it can be told in advance what more samples will bring, so that noise and time can be asked for.
    pub fn can_forecast(self) -> bool {
        matches!(self, Self::Quietus | Self::Uniform)
    }
}

impl RenderSettings {
    /// How the film is laid out.
    ///
    /// # Errors
    /// When frame or window are out of range.
    pub fn layout(&self) -> Result<Layout, LayoutError> {
        Layout::new(self.frame, self.window, REPLICATES)
    }

    /// The same in the library's terms, for pixels of `replicates` replicates, to a region error of `target_error`.
    pub(crate) fn library(&self, replicates: u32, target_error: f64) -> quietus::Settings {
        let Window { x0, y0, x1, y1 } = self.window;
        let uniform = self.sampling == Sampling::Uniform;
        quietus::Settings {
            crop: Some(PixelRect::new(x0, y0, x1, y1)),
            regions_per_axis: self.machinery.regions_per_axis,
            policy: self.sampling.policy(),
            target_error,
            // Uniform sampling ends at the maximum and asks nobody before.
            min_samples: if uniform { self.max_samples } else { self.min_samples },
            max_samples: self.max_samples,
            replicates,
            mode: match self.sampling {
                Sampling::FreeRunning => Mode::FreeRunning,
                _ => Mode::Deterministic { lag: self.machinery.lag },
            },
            checks: self.machinery.checks,
            rebuild: self.machinery.rebuild,
            ..quietus::Settings::new(self.frame[0], self.frame[1])
        }
    }
}
