//! What lies above the diffuse and transmitting parts of the metallic-roughness model: the dielectric's reflection and
//! the clear coat.

use glam::{Vec2, Vec3};

use super::{MetalRoughParams, mean_schlick, mirror, recovered, reflect, reflect_lobe};
use crate::bsdf::{
    albedo_table::{LobeAlbedo, SplitAlbedo},
    film::{Film, FilmParams},
    fresnel::schlick_weight,
    ggx::Ggx,
};
use crate::frame::Frame;

/// F0 of the clear coat: an index of 1.5, as KHR_materials_clearcoat says.
const COAT_F0: f32 = 0.04;
/// The mean cosine of light from all sides: where a film's colour stands for its mean over angles.
pub(super) const MEAN_COSINE: f32 = 2.0 / 3.0;

/// Reflection of the dielectric as one number, its largest channel, so that the layer below keeps its hue.
#[derive(Clone, Copy, Debug)]
pub(super) struct DielectricLayer {
    pub(super) f0: Vec3,
    pub(super) f90: f32,
    pub(super) max_f0: f32,
    pub(super) recovered: f32,
    pub(super) film: Option<Film>,
}

/// A clear coat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coat {
    pub(super) strength: f32,
    /// Its lobe, `None` where perfectly smooth.
    pub(super) ggx: Option<Ggx>,
    /// Its albedo for reflectance 1, by angle.
    pub(super) lobe_albedo: LobeAlbedo,
    /// Its normal's frame in the frame of the base; `None` where they are the same.
    pub(super) frame: Option<Frame>,
}

impl DielectricLayer {
    pub(super) fn new(f0: Vec3, f90: f32, film: FilmParams, mean: SplitAlbedo) -> Self {
        let max_f0 = f0.max_element();
        let film = Film::new(film, f0);
        let mut layer = Self { f0, f90, max_f0, recovered: 0.0, film };
        let mut fresnel = mean_schlick(f0, Vec3::splat(f90));
        if let Some(film) = film {
            fresnel = film.over(fresnel, MEAN_COSINE);
        }
        layer.recovered = recovered(Vec3::splat(fresnel.max_element()), mean).x;
        layer
    }

    /// Reflectance of a facet seen at cosine `cos`.
    #[inline]
    pub(super) fn fresnel(&self, cos: f32) -> Vec3 {
        let plain = self.f0.lerp(Vec3::splat(self.f90), schlick_weight(cos));
        self.film.map_or(plain, |film| film.over(plain, cos))
    }

    /// Share of light that reaches the layer below.
    #[inline]
    pub(super) fn pass(&self, e: SplitAlbedo) -> f32 {
        let plain = e.left(self.max_f0, self.f90, self.recovered);
        self.film.map_or(plain, |film| {
            let filmed = e.left_by(film.albedo_bound(e), self.recovered);
            (plain + (filmed - plain) * film.strength()).max(0.0)
        })
    }

    /// At least the cosine-weighted mean of [`pass`](Self::pass), given that of albedos.
    pub(super) fn mean_pass(&self, mean: SplitAlbedo) -> f32 {
        let plain = mean.left(self.max_f0, self.f90, self.recovered);
        self.film.map_or(plain, |film| {
            let filmed = mean.left_by(film.mean_bound(mean), self.recovered);
            (plain + (filmed - plain) * film.strength()).max(0.0)
        })
    }
}

impl Coat {
    pub(super) fn new(p: &MetalRoughParams) -> Option<Self> {
        if p.clearcoat <= 0.0 {
            return None;
        }
        let frame = (p.clearcoat_normal != Vec3::Z).then(|| Frame::from_normal(p.clearcoat_normal));
        let ggx = Ggx::from_roughness(p.clearcoat_roughness);
        Some(Self { strength: p.clearcoat, ggx, lobe_albedo: LobeAlbedo::new(ggx), frame })
    }

    /// A direction in the coat's own frame.
    #[inline]
    pub(super) fn local(&self, w: Vec3) -> Vec3 {
        self.frame.map_or(w, |f| f.to_local(w))
    }

    /// A direction of the coat's frame in the base's.
    #[inline]
    pub(super) fn to_base(self, w: Vec3) -> Vec3 {
        self.frame.map_or(w, |f| f.to_world(w))
    }

    /// Share of light in direction `w` that passes to the base.
    #[inline]
    pub(super) fn pass(&self, w: Vec3) -> f32 {
        let local = self.local(w);
        // Behind its own horizon the coat reflects nothing.
        if local.z * w.z <= 0.0 {
            return 1.0;
        }
        let e = self.lobe_albedo.at(local);
        let below = e.left(COAT_F0, 1.0, 0.0);
        1.0 - self.strength * (1.0 - below)
    }

    /// Reflectance of a perfectly smooth coat.
    #[inline]
    pub(super) fn reflectance(&self, wo: Vec3) -> f32 {
        self.strength * (COAT_F0 + (1.0 - COAT_F0) * schlick_weight(self.local(wo).z.abs()))
    }

    /// Value and density of its lobe; `None` where it has none to offer.
    #[inline]
    pub(super) fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> Option<(f32, f32)> {
        let ggx = self.ggx?;
        let (local_o, local_i) = (self.local(wo), self.local(wi));
        if local_o.z <= 0.0 || local_i.z <= 0.0 {
            return None;
        }
        let (cos, f, pdf) = reflect_lobe(ggx, local_o, local_i);
        Some((self.strength * (COAT_F0 + (1.0 - COAT_F0) * schlick_weight(cos)) * f, pdf))
    }

    #[inline]
    pub(super) fn sample(self, ggx: Ggx, wo: Vec3, u: Vec2) -> Option<Vec3> {
        let wo = self.local(wo);
        let wi = reflect(wo, ggx.sample_visible(wo, u));
        (wo.z > 0.0 && wi.z > 0.0).then(|| self.to_base(wi))
    }

    /// `wo` mirrored by a perfectly smooth coat.
    pub(super) fn mirrored(self, wo: Vec3) -> Option<Vec3> {
        let local = self.local(wo);
        (local.z > 0.0).then(|| self.to_base(mirror(-local)))
    }
}
