//! The policies under comparison, by the names that `quietus render --sampling` has for them.

use quietus::{Mode, Policy, Settings};
use quietus_render::Sampling;
use serde::{Deserialize, Serialize};

/// A way to spread samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The same number of samples everywhere.
    Uniform,
    /// Each 8x8 tile stops on its own error.
    Tile,
    /// Blocks that are split and discarded (Dammertz et al. 2010).
    Dammertz,
    /// Each pixel stops on its own error.
    Pixel,
    /// The talk's tree, drawing bounding rectangles.
    Talk,
    /// The talk's tree, consulted and rebuilt whenever threads get there; here one thread.
    FreeRunning,
    /// The library's own policy.
    Quietus,
    /// Counts from pilots of other pixels only.
    Unbiased,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Uniform,
        Self::Tile,
        Self::Dammertz,
        Self::Pixel,
        Self::Talk,
        Self::FreeRunning,
        Self::Quietus,
        Self::Unbiased,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Tile => "tile",
            Self::Dammertz => "dammertz",
            Self::Pixel => "pixel",
            Self::Talk => "talk",
            Self::FreeRunning => "free-running",
            Self::Quietus => "quietus",
            Self::Unbiased => "unbiased",
        }
    }

    /// `settings` with the policy, mode and regions of this method.
    pub fn apply(self, settings: &Settings) -> Settings {
        let policy = match self {
            Self::Uniform => Policy::Uniform,
            Self::Tile => Policy::Tile,
            Self::Dammertz => Policy::Dammertz,
            Self::Pixel => Policy::Pixel,
            Self::Talk | Self::FreeRunning => Policy::Talk,
            Self::Quietus => Policy::Quietus,
            Self::Unbiased => Policy::Unbiased,
        };
        let mode = if self == Self::FreeRunning { Mode::FreeRunning } else { settings.mode };
        // As renders have it ([`Sampling::regions_per_axis`]).
        let regions_per_axis = match self {
            Self::Unbiased => Sampling::Unbiased.regions_per_axis(),
            _ => settings.regions_per_axis,
        };
        Settings { policy, mode, regions_per_axis, ..settings.clone() }
    }
}
