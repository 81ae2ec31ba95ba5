//! What a render is asked to do.

use std::num::NonZeroUsize;
use std::time::Duration;

use quietus_film::Window;

/// How samples are spread over the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sampling {
    /// The talk's tree with exact masks; the picture does not depend on threads.
    #[default]
    Quietus,
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
    /// Region error asked for, in the library's units, above 0.
    pub target_error: f64,
    /// Samples every pixel gets, at least.
    pub min_samples: u32,
    /// Samples no pixel exceeds; with [`Sampling::Uniform`] what every pixel gets.
    pub max_samples: u32,
    /// Stop at the first visit boundary after this time.
    pub time_limit: Option<Duration>,
    /// Threads that render.
    pub threads: NonZeroUsize,
}
