//! The surface of things that light enters and wanders in: skin, wax, milk, marble.
//!
//! From outside it is glass. What happens below is a walk through a medium (see `integrator::subsurface`), and light that
//! comes up again after it has been scattered leaves in all directions, by the lobe with which separable models
//! leave (Jensen, Marschner, Levoy, Hanrahan 2001, "A Practical Model for Subsurface Light Transport", equation 5):
//! what refraction does to light that arrives evenly from below. So light sampling helps where smooth glass would
//! hide every lamp. Light that comes up without having been scattered is refracted as by glass.

mod table;

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

pub(crate) use table::SubsurfaceTable;
#[cfg(test)]
pub(crate) use table::WALKS;

use super::{BsdfSample, Dielectric, fresnel};
use crate::warp;

/// Where a path comes from that arrives at such a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Below {
    /// From outside.
    No,
    /// From below, where it has not been scattered since it entered.
    Straight,
    /// From below, where it has been scattered. It will leave: reflection back is the walk's own business.
    Scattered,
}

/// One point of such a surface, for paths that come from a given side, whatever the sign of `wo.z`.
#[derive(Clone, Copy, Debug)]
pub struct Subsurface {
    surface: Dielectric,
    /// Share of evenly arriving light that enters from outside.
    entering: f32,
    color: Vec3,
    below: Below,
}

impl Subsurface {
    /// With the surface as glass, the share of even light from outside that enters, and the colour that stands for it.
    pub(crate) fn new(surface: Dielectric, entering: f32, color: Vec3) -> Self {
        Self { surface, entering, color, below: Below::No }
    }

    /// The same for paths that come from there.
    #[inline]
    pub fn seen_from(self, below: Below) -> Self {
        Self { below, ..self }
    }

    /// What makes the medium lie below z = 0, to be multiplied into all z.
    #[inline]
    fn side(&self, wo: Vec3) -> Vec3 {
        let outward = if self.below == Below::No { wo.z } else { -wo.z };
        Vec3::new(1.0, 1.0, 1f32.copysign(outward))
    }

    #[inline]
    pub(super) fn is_delta(&self) -> bool {
        self.below != Below::Scattered && self.surface.is_delta()
    }

    pub(super) fn albedo(&self) -> Vec3 {
        self.color
    }

    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let side = self.side(wo);
        if self.below != Below::Scattered {
            return self.surface.eval_pdf(wo * side, wi * side);
        }
        let cosine = wi.z * side.z;
        if cosine <= 0.0 || wo.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let pdf = cosine * FRAC_1_PI;
        (Vec3::splat(self.leaving(cosine) * pdf), pdf)
    }

    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let side = self.side(wo);
        if self.below != Below::Scattered {
            let sample = self.surface.sample(wo * side, u_lobe, u)?;
            return Some(BsdfSample { wi: sample.wi * side, ..sample });
        }
        let wi = warp::cosine_hemisphere(u);
        if wi.z <= 0.0 || wo.z == 0.0 {
            return None;
        }
        let weight = Vec3::splat(self.leaving(wi.z));
        let (pdf, eta) = (wi.z * FRAC_1_PI, self.surface.ior().recip());
        Some(BsdfSample { wi: wi * side, weight, pdf, delta: false, transmission: true, eta })
    }

    /// The lobe of light that leaves, over that of Lambert: shares sum up to 1, times the squared index that radiance
    /// has lost on its way in.
    #[inline]
    fn leaving(&self, cosine: f32) -> f32 {
        let (reflected, _) = fresnel::dielectric(cosine, self.surface.ior());
        let ior = self.surface.ior();
        (1.0 - reflected) / self.entering * ior * ior
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Mean, Rng, Suite, chi_square_directions};

    /// Light that leaves goes where its density says, loses nothing, and leaves on the side that the path is not on.
    #[test]
    fn what_leaves_is_drawn_by_its_density() {
        let mut suite = Suite::new(2 * 3);
        for ior in [1.0, 1.33, 1.6] {
            let table = SubsurfaceTable::new(ior, 0.0);
            let surface = Dielectric::new(ior, None, Vec3::ONE);
            let leaving = Subsurface::new(surface, table.entering, Vec3::ONE).seen_from(Below::Scattered);
            for wo in [Vec3::new(0.6, 0.0, -0.8), Vec3::new(0.6, 0.0, 0.8)] {
                let draw = |rng: &mut Rng| {
                    let sample = leaving.sample(wo, rng.next_1d(), rng.next_2d())?;
                    let (value, pdf) = leaving.eval_pdf(wo, sample.wi);
                    assert!(sample.wi.z * wo.z < 0.0 && (sample.pdf / pdf - 1.0).abs() < 1e-5);
                    assert!((sample.weight * pdf - value).abs().max_element() < 1e-5 * value.x);
                    Some(sample)
                };
                let p = chi_square_directions(
                    7,
                    200_000,
                    |rng| draw(rng).map(|sample| sample.wi),
                    |wi| leaving.eval_pdf(wo, wi).1,
                );
                if wo.z < 0.0 {
                    suite.judge(p, format_args!("directions at {ior}"));
                    let mut rng = Rng::new(11);
                    let share = Mean::of(100_000, || {
                        draw(&mut rng).map_or(0.0, |s| f64::from(s.weight.x / (ior * ior)))
                    });
                    suite.judge(share.p_equals(1.0), format_args!("energy at {ior}"));
                }
            }
        }
    }
}
