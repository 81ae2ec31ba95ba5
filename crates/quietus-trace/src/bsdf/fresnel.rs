//! Fresnel's equations and Schlick's approximation.

use glam::Vec3;

/// Reflectance of a dielectric for unpolarised light that arrives at cosine `cos_i >= 0`; `eta` is the index
/// behind the surface over the one in front. 1 under total internal reflection. With it comes the cosine of the
/// refracted direction, 0 where there is none.
#[inline]
pub fn dielectric(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Reflectance of a conductor with index `eta + i k` per channel, for unpolarised light at cosine `cos_i >= 0`
/// (Born and Wolf, "Principles of Optics", 14.2; in the form of Lagarde, "Memo on Fresnel equations", 2013).
#[inline]
pub fn conductor(cos_i: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos2 = cos_i * cos_i;
    let sin2 = (1.0 - cos2).max(0.0);
    let t0 = eta * eta - k * k - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let t1 = a2_plus_b2 + cos2;
    let a = (0.5 * (a2_plus_b2 + t0)).max(Vec3::ZERO).map(f32::sqrt);
    let t2 = 2.0 * cos_i * a;
    let perpendicular = (t1 - t2) / (t1 + t2);
    let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
    let t4 = t2 * sin2;
    let parallel = perpendicular * (t3 - t4) / (t3 + t4);
    0.5 * (perpendicular + parallel)
}

/// The weight of F90 in Schlick's approximation ("An Inexpensive BRDF Model for Physically-based Rendering",
/// 1994): `F = F0 + (F90 - F0) * schlick_weight`.
#[inline]
pub fn schlick_weight(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_is_the_textbook_formula() {
        let (f, cos_t) = dielectric(1.0, 1.5);
        assert!((f - 0.04).abs() < 1e-7 && cos_t == 1.0);
        let (n, k) = (Vec3::new(0.2, 1.0, 2.0), Vec3::new(3.0, 0.5, 0.0));
        let expected = ((n - 1.0) * (n - 1.0) + k * k) / ((n + 1.0) * (n + 1.0) + k * k);
        assert!((conductor(1.0, n, k) - expected).abs().max_element() < 1e-6);
    }

    /// From inside glass all light is reflected beyond the critical angle, `sin = 1 / 1.5`; none at Brewster's
    /// angle, `tan = 1.5`, in the parallel polarisation, which leaves half of the other.
    #[test]
    fn critical_and_brewster_angles() {
        let critical = (1.0f32 - 1.0 / 2.25).sqrt();
        assert_eq!(dielectric(critical - 1e-4, 1.0 / 1.5), (1.0, 0.0));
        assert!(dielectric(critical + 1e-4, 1.0 / 1.5).0 < 1.0);
        let brewster = 1.0 / (1.0f32 + 2.25).sqrt();
        let r = (1.0 - 2.25) / (1.0 + 2.25);
        assert!((dielectric(brewster, 1.5).0 - 0.5 * r * r).abs() < 1e-6);
    }

    /// Light takes the same way back: the reflectance from both sides is the same.
    #[test]
    fn reflectance_is_the_same_from_both_sides() {
        for i in 1..=100 {
            let cos = i as f32 / 100.0;
            let (f, cos_t) = dielectric(cos, 1.5);
            let (back, cos_i) = dielectric(cos_t, 1.0 / 1.5);
            // The way back takes the root of a difference from 1, which magnifies rounding at grazing angles.
            let tolerance = 64.0 * f32::EPSILON / cos;
            assert!((f - back).abs() < tolerance && (cos - cos_i).abs() < tolerance, "{cos}: {f}, {back}");
        }
    }

    #[test]
    fn a_conductor_that_absorbs_nothing_is_a_dielectric() {
        for i in 0..=100 {
            let cos = i as f32 / 100.0;
            let f = conductor(cos, Vec3::splat(1.7), Vec3::ZERO);
            assert!((f - dielectric(cos, 1.7).0).abs().max_element() < 1e-5, "{cos}: {f}");
        }
    }
}
