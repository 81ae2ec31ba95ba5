//! The random walk between the layers.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::LayeredParams;
use crate::{bsdf::fresnel, frame::Frame, integrator::power_heuristic, sampler::mix64, warp::sin_cos_turns};

/// Steps before roulette may end a walk: the first return from the base carries most of the light.
const ROULETTE_AFTER: u32 = 1;
/// Throughput below which roulette sets in. Ending earlier saves little, since most walks end by then.
const ROULETTE_BELOW: f32 = 0.25;

/// Random estimate of the light that goes from `wi` to `wo` by way of the layers below the coat's surface: BSDF times
/// `wi.z`. Both directions lie on +z's side.
pub(super) fn estimate(p: &LayeredParams, wo: Vec3, wi: Vec3) -> Vec3 {
    let mut rng = Random::new(p.key, wo, wi);
    // The way in, as seen from the camera; the way out is sought from the other end.
    let Some((entered, share, _)) = p.coat.sample_part(wo, true, rng.next_2d()) else { return Vec3::ZERO };
    let exit = p.coat.sample_part(wi, true, rng.next_2d());
    let exit = exit.map(|(w, share, pdf)| Exit { w, value: share / -w.z, pdf });
    let walk = Walk {
        p,
        wi,
        exit,
        w: entered,
        depth_left: p.thickness,
        // Radiance is compressed once: on its way in, not undone, since `wi` is outside again.
        throughput: Vec3::splat(share / (p.coat.ior() * p.coat.ior())),
        sum: Vec3::ZERO,
        rng,
    };
    walk.run() * wi.z
}

/// How light from `wi` gets below the coat's surface.
struct Exit {
    /// Its direction of travel, downwards.
    w: Vec3,
    /// BTDF without any cosine, over the density of the direction.
    value: f32,
    pdf: f32,
}

/// A walk against the light, from `wo`.
struct Walk<'a> {
    p: &'a LayeredParams,
    wi: Vec3,
    exit: Option<Exit>,
    /// Direction of travel.
    w: Vec3,
    /// Distance to the base, in mean free paths.
    depth_left: f32,
    throughput: Vec3,
    /// BSDF found so far, without the cosine.
    sum: Vec3,
    rng: Random,
}

impl Walk<'_> {
    fn run(mut self) -> Vec3 {
        for depth in 0..self.p.max_depth {
            if !self.survives(depth) {
                break;
            }
            let goes_on = match self.advance() {
                Advance::Scattered => self.scatter(),
                Advance::Arrived if self.w.z < 0.0 => self.at_base(),
                Advance::Arrived => self.at_coat(),
            };
            if !goes_on {
                break;
            }
        }
        self.sum
    }

    fn survives(&mut self, depth: u32) -> bool {
        let ior = self.p.coat.ior();
        // The compression of radiance says nothing about how much light is left.
        let carried = self.throughput.max_element() * ior * ior;
        if depth <= ROULETTE_AFTER || carried >= ROULETTE_BELOW {
            return carried > 0.0;
        }
        let q = carried / ROULETTE_BELOW;
        self.throughput /= q;
        self.rng.next_1d() < q
    }

    /// Passes the medium, up to where it scatters or to its border.
    fn advance(&mut self) -> Advance {
        let cos = self.w.z.abs();
        let border = if self.w.z < 0.0 { self.depth_left } else { self.p.thickness - self.depth_left };
        if self.p.albedo == Vec3::ZERO {
            self.throughput *= (-border / cos).exp();
        } else {
            let step = -(1.0 - self.rng.next_1d()).ln() * cos;
            if step < border {
                self.depth_left += step * self.w.z.signum();
                return Advance::Scattered;
            }
        }
        self.depth_left = if self.w.z < 0.0 { 0.0 } else { self.p.thickness };
        Advance::Arrived
    }

    /// Leaves through a rough coat towards `wi` in the direction of travel, which was drawn with density `pdf`; `None`
    /// where nothing else can find it.
    fn leave(&mut self, pdf: Option<f32>) {
        if self.p.coat.is_delta() || self.w.z <= 0.0 {
            return;
        }
        // The passage the other way, as energy, is that of radiance this way.
        let (value, exit_pdf) = self.p.coat.eval_part(self.wi, -self.w);
        let weight = pdf.map_or(1.0, |pdf| power_heuristic(pdf, exit_pdf));
        self.sum += self.throughput * (weight * value / self.w.z * self.pass_out(self.w));
    }

    /// Share of light that passes upwards from here to the coat, in direction `w`.
    fn pass_out(&self, w: Vec3) -> f32 {
        (-(self.p.thickness - self.depth_left) / w.z.abs()).exp()
    }

    fn scatter(&mut self) -> bool {
        self.throughput *= self.p.albedo;
        if let Some(exit) = &self.exit {
            let p = henyey_greenstein(self.p.g, self.w.dot(-exit.w));
            let weight = if self.p.coat.is_delta() { 1.0 } else { power_heuristic(exit.pdf, p) };
            let found = if self.p.coat.is_delta() && self.p.base.is_delta() {
                self.between_mirrors(exit, p)
            } else {
                Vec3::splat(p * weight * self.pass_out(exit.w))
            };
            self.sum += self.throughput * found * exit.value;
        }
        let (w, pdf) = sample_henyey_greenstein(self.p.g, self.w, self.rng.next_2d());
        self.w = w;
        self.leave(Some(pdf));
        self.w.z != 0.0
    }

    /// Share of light scattered here that leaves by `exit` on one of the ways that no random direction finds: straight
    /// up, with density `up`, or down and back from a mirror, and from there on any number of times between the two
    /// mirrors.
    fn between_mirrors(&self, exit: &Exit, up: f32) -> Vec3 {
        let cos = -exit.w.z;
        let down = henyey_greenstein(self.p.g, self.w.dot(Vec3::new(-exit.w.x, -exit.w.y, exit.w.z)));
        let pass = |distance: f32| (-distance / cos).exp();
        let base = self.p.base.reflectance(cos);
        let (coat, _) = fresnel::dielectric(cos, 1.0 / self.p.coat.ior());
        let once = up * self.pass_out(exit.w) + down * base * pass(self.depth_left + self.p.thickness);
        once / (1.0 - coat * base * pass(2.0 * self.p.thickness))
    }

    fn at_base(&mut self) -> bool {
        let wo = -self.w;
        let base = &self.p.base;
        if let Some(exit) = &self.exit
            && !base.is_delta()
        {
            let (value, pdf) = base.eval_pdf(wo, -exit.w);
            let weight = if self.p.coat.is_delta() { 1.0 } else { power_heuristic(exit.pdf, pdf) };
            self.sum += self.throughput * value * (weight * exit.value * self.pass_out(exit.w));
        }
        let Some(s) = base.sample(wo, self.rng.next_2d()) else { return false };
        self.throughput *= s.weight;
        self.w = s.wi;
        self.leave((!s.delta).then_some(s.pdf));
        true
    }

    fn at_coat(&mut self) -> bool {
        let Some((w, share, _)) = self.p.coat.sample_part(-self.w, false, self.rng.next_2d()) else {
            return false;
        };
        self.throughput *= share;
        self.w = w;
        true
    }
}

/// What a step ends with.
enum Advance {
    Scattered,
    Arrived,
}

/// Density per steradian of going on at cosine `cos` to the direction of travel (Henyey and Greenstein 1941).
fn henyey_greenstein(g: f32, cos: f32) -> f32 {
    let d = 1.0 + g * g - 2.0 * g * cos;
    0.25 * FRAC_1_PI * (1.0 - g * g) / (d * d.sqrt())
}

/// A direction of travel after `w`, and its density.
fn sample_henyey_greenstein(g: f32, w: Vec3, u: Vec2) -> (Vec3, f32) {
    let cos = if g.abs() < 1e-3 {
        // The inverse below would divide rounding by rounding.
        1.0 - 2.0 * u.x
    } else {
        let root = (1.0 - g * g) / (1.0 - g + 2.0 * g * u.x);
        (1.0 + g * g - root * root) / (2.0 * g)
    };
    let cos = cos.clamp(-1.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt();
    let (y, x) = sin_cos_turns(u.y);
    let local = Vec3::new(sin * x, sin * y, cos);
    (Frame::from_normal(w).to_world(local).normalize(), henyey_greenstein(g, cos))
}

/// Numbers hashed from both directions (SplitMix64: Steele, Lea and Flood 2014, "Fast Splittable Pseudorandom Number
/// Generators").
struct Random(u64);

impl Random {
    fn new(key: u64, wo: Vec3, wi: Vec3) -> Self {
        let bits = |w: Vec3| u64::from(w.x.to_bits()) << 32 | u64::from(w.y.to_bits());
        Self(mix64(mix64(key ^ bits(wo)).wrapping_add(bits(wi))))
    }

    /// Uniform in `[0, 1)`.
    fn next_1d(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 40) as f32 / 16_777_216.0
    }

    fn next_2d(&mut self) -> Vec2 {
        Vec2::new(self.next_1d(), self.next_1d())
    }
}
