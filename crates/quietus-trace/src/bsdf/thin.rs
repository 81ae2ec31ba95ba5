//! Surfaces without an inside: panes, leaves, paper.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use super::{BsdfSample, fresnel};
use crate::warp;

/// A pane of glass: two smooth interfaces so close together that light leaves where it came in, straight on or
/// mirrored, after any number of reflections between them.
#[derive(Clone, Copy, Debug)]
pub struct ThinDielectric {
    /// Index of refraction of the glass over the one around it.
    pub ior: f32,
}

/// Lambert on both sides, and through.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseTransmission {
    /// Share of light reflected.
    pub reflectance: Vec3,
    /// Share of light transmitted.
    pub transmittance: Vec3,
}

impl ThinDielectric {
    /// Share of light reflected at cosine `cos >= 0`: the geometric series `r + t^2 r (1 + r^2 + r^4 + ...)` with the
    /// reflectance `r` of one interface and `t = 1 - r` sums up to this.
    #[inline]
    pub(super) fn reflectance(&self, cos: f32) -> f32 {
        let (r, _) = fresnel::dielectric(cos, self.ior);
        2.0 * r / (1.0 + r)
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32) -> Option<BsdfSample> {
        if wo.z == 0.0 {
            return None;
        }
        let reflected = self.reflectance(wo.z.abs());
        let transmission = u_lobe >= reflected;
        let (wi, pdf) =
            if transmission { (-wo, 1.0 - reflected) } else { (Vec3::new(-wo.x, -wo.y, wo.z), reflected) };
        Some(BsdfSample { wi, weight: Vec3::ONE, pdf, delta: true, transmission, eta: 1.0 })
    }
}

impl DiffuseTransmission {
    /// Probability of reflection.
    #[inline]
    fn share_reflected(&self) -> f32 {
        let (r, t) = (self.reflectance.max_element(), self.transmittance.max_element());
        // Where nothing is scattered the weight is 0 either way.
        if r + t > 0.0 { r / (r + t) } else { 1.0 }
    }

    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wo.z * wi.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let cosine = wi.z.abs() * FRAC_1_PI;
        let share = self.share_reflected();
        if wo.z * wi.z > 0.0 {
            (self.reflectance * cosine, share * cosine)
        } else {
            (self.transmittance * cosine, (1.0 - share) * cosine)
        }
    }

    #[inline]
    pub(super) fn sample(&self, wo: Vec3, u_lobe: f32, u: Vec2) -> Option<BsdfSample> {
        let mut wi = warp::cosine_hemisphere(u);
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        let share = self.share_reflected();
        let transmission = u_lobe >= share;
        let (color, share) =
            if transmission { (self.transmittance, 1.0 - share) } else { (self.reflectance, share) };
        let pdf = share * wi.z * FRAC_1_PI;
        wi.z = wi.z.copysign(if transmission { -wo.z } else { wo.z });
        Some(BsdfSample { wi, weight: color / share, pdf, delta: false, transmission, eta: 1.0 })
    }
}
