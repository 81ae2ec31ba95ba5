//! How far light flies before it scatters.
//!
//! With coefficients that differ by colour no distance is right for all channels. One channel is chosen in proportion
//! to what the path carries in it, a distance is drawn from that channel's exponential, and the path is weighted as
//! if all channels had drawn it: the balance heuristic for one sample (Veach 1997, section 9.2.4; Wilkie et al. 2014,
//! "Hero Wavelength Spectral Sampling"). So the sum over channels keeps its value where light passes, whatever the
//! distance.
//!
//! A flight may cross several media: one channel and one optical depth serve for all of them. In a medium that only
//! absorbs nothing is drawn: the light is weakened by what is absorbed.

use glam::Vec3;

use super::Medium;

/// What light has lived through since it last scattered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// For each channel the probability of being chosen, and of having come so far if it is.
    survival: Vec3,
    /// Share of light that has come so far.
    transmittance: Vec3,
    /// Estimate of the same for media that vary, times how much more likely the flight was than this.
    estimate: Vec3,
    /// About the probability, per channel, of having come so far through those that vary.
    expected: Vec3,
}

impl Passage {
    /// The start of light that carries this much per channel. Where that is black or not finite all channels are
    /// alike.
    #[inline]
    pub(crate) fn new(carried: Vec3) -> Self {
        let survival = shares(carried);
        Self { survival, transmittance: Vec3::ONE, estimate: Vec3::ONE, expected: Vec3::ONE }
    }

    /// Passes through a medium for `distance`, which may be infinite.
    #[inline]
    pub(crate) fn pass(&mut self, medium: &Medium, distance: f32) {
        let passed = medium.transmittance(distance);
        self.transmittance *= passed;
        if medium.scatters {
            self.survival *= passed;
        }
    }

    /// Multiplies in what an encounter with a medium that varies has left.
    #[inline]
    pub(super) fn encounter(&mut self, left: Vec3) {
        self.estimate *= left;
    }

    /// Takes note of having passed a medium that varies, of about this optical thickness.
    #[inline]
    pub(super) fn expect(&mut self, medium: &Medium, thickness: Vec3) {
        if medium.scatters {
            self.expected *= (-thickness).map(f32::exp);
        }
    }

    /// Whether nothing is left.
    #[inline]
    pub(super) fn is_dark(&self) -> bool {
        // Also where it has become so large that something has overflowed.
        !(self.estimate.max_element() > 0.0 && self.estimate.is_finite())
    }

    /// About how the light that is left is spread over the channels; sums up to 1.
    #[inline]
    pub(super) fn share(&self) -> Vec3 {
        let share = self.survival * self.estimate;
        let total = share.element_sum();
        if total > 0.0 && total.is_finite() { share / total } else { Vec3::splat(1.0 / 3.0) }
    }

    /// Share of light that has come so far.
    #[inline]
    pub(crate) fn transmittance(&self) -> Vec3 {
        self.transmittance * self.estimate
    }

    /// The probability that a flight comes so far. Through media that vary it is only about that, but the same
    /// whoever asks.
    #[inline]
    pub(crate) fn probability(&self) -> f32 {
        (self.survival * self.expected).element_sum()
    }

    /// What a flight that has come so far is to be multiplied by.
    #[inline]
    pub(crate) fn weight(&self) -> Vec3 {
        let probability = self.survival.element_sum();
        if probability > 0.0 { self.transmittance * self.estimate / probability } else { Vec3::ZERO }
    }
}

/// Parts of a whole. Where that is nothing or not finite all are alike.
#[inline(always)]
fn shares(parts: Vec3) -> Vec3 {
    let total = parts.element_sum();
    let sound = total > 0.0 && total.is_finite();
    if sound { parts / total } else { Vec3::splat(1.0 / 3.0) }
}

/// Which share `u` in `[0, 1)` falls into, and how far into it.
#[inline(always)]
fn choose(share: Vec3, u: f32) -> (usize, f32) {
    let (channel, rest) = if u < share.x {
        (0, u)
    } else if u < share.x + share.y || share.z <= 0.0 {
        (1, u - share.x)
    } else {
        (2, u - share.x - share.y)
    };
    // Rounding may end in a channel without a share, to which any number is as good as another.
    let u = (rest / share[channel]).clamp(0.0, 1.0 - f32::EPSILON / 2.0);
    (channel, if u.is_nan() { 0.5 } else { u })
}

/// A flight under way: from where light last scattered through all borders up to where it scatters next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flight {
    pub(crate) passage: Passage,
    /// The channel that draws.
    channel: usize,
    /// Optical depth that is left: in that channel, or in the majorants of a medium that varies.
    pub(super) depth: f32,
}

/// Light scatters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scattered {
    /// How far from where it entered the medium.
    pub(crate) distance: f32,
    /// What the path is to be multiplied by, for all of the flight.
    pub(crate) weight: Vec3,
}

impl Flight {
    /// A flight of light that carries this much per channel, for `u` in `[0, 1)`.
    #[inline]
    pub(crate) fn new(carried: Vec3, u: f32) -> Self {
        let passage = Passage::new(carried);
        let (channel, u) = choose(passage.survival, u);
        Self { passage, channel, depth: -(-u).ln_1p() }
    }

    /// The same with a number of its own for the channel, which lives on: see [`Self::channel_number`]. Returns what is left
    /// of it.
    #[inline]
    pub(crate) fn in_channel(carried: Vec3, u_channel: f32, u: f32) -> (Self, f32) {
        let passage = Passage::new(carried);
        let (channel, left) = choose(passage.survival, u_channel);
        (Self { passage, channel, depth: -(-u).ln_1p() }, left)
    }

    /// The number in `[0, 1)` for the channel of the next flight, from what was `left` of that of this one: uniform whatever the
    /// path has become, and in the same channel as long as light loses as much in all of them.
    ///
    /// Paths as this one come from the channels in proportion to the chance that each makes them. The number is put back
    /// among these as it was taken. So samples that are well spread over channels stay so for all of a walk.
    #[inline]
    pub(crate) fn channel_number(&self, medium: &Medium, scattered: Option<f32>, left: f32) -> f32 {
        let chances = match scattered {
            Some(distance) => medium.transmittance(distance) * medium.extinction,
            None => Vec3::ONE,
        };
        let share = shares(self.passage.survival * chances);
        let before = match self.channel {
            0 => 0.0,
            1 => share.x,
            _ => share.x + share.y,
        };
        (before + left * share[self.channel]).min(1.0 - f32::EPSILON / 2.0)
    }

    /// How far it goes in a medium that is the same everywhere until it is scattered.
    #[inline(always)]
    pub(crate) fn free(&self, medium: &Medium) -> f32 {
        let sigma = medium.extinction[self.channel];
        if medium.scatters && sigma > 0.0 { self.depth / sigma } else { f32::INFINITY }
    }

    /// Flies up to `distance` (which may be infinite) through a medium, unless light scatters before.
    #[inline]
    pub(crate) fn fly(&mut self, medium: &Medium, distance: f32) -> Option<Scattered> {
        if !medium.scatters {
            self.passage.pass(medium, distance);
            return None;
        }
        let sigma = medium.extinction[self.channel];
        let free = self.free(medium);
        if free < distance {
            let passed = medium.transmittance(free);
            let density = (self.passage.survival * passed).dot(medium.extinction);
            let weight = self.passage.transmittance() * passed * medium.scattering / density;
            // Underflow: so little light that nobody will miss it.
            let weight = if weight.is_finite() { weight } else { Vec3::ZERO };
            return Some(Scattered { distance: free, weight });
        }
        self.depth -= sigma * distance.min(f32::MAX);
        self.passage.pass(medium, distance);
        None
    }
}
