//! All parameters of a material that a texture may drive, each by its name.

use crate::desc::{
    self, Coat, ColorParam, HairColor, Interior, Metal, Roughness, ScalarParam, Surface, TextureId,
};

/// One parameter.
#[derive(Clone, Copy)]
pub(super) enum Param<'a> {
    Color(&'a ColorParam),
    Scalar(&'a ScalarParam),
    /// A normal map with its scale.
    Normals((TextureId, f32)),
}

impl Param<'_> {
    pub(super) fn is_textured(self) -> bool {
        match self {
            Self::Color(p) => p.texture.is_some(),
            Self::Scalar(p) => p.texture.is_some(),
            Self::Normals(_) => true,
        }
    }
}

/// Calls `f` with each parameter of `material` but its coverage.
pub(super) fn each_param(material: &desc::Material, mut f: impl FnMut(&'static str, Param<'_>)) {
    f("emission", Param::Color(&material.emission));
    if let Some(map) = material.normal_map {
        f("normal map", Param::Normals(map));
    }
    if let Some(height) = &material.bump {
        f("bump map", Param::Scalar(height));
    }
    surface(&material.surface, &mut f);
}

fn surface(surface: &Surface, f: &mut impl FnMut(&'static str, Param<'_>)) {
    match surface {
        Surface::Diffuse { reflectance } => f("reflectance", Param::Color(reflectance)),
        Surface::Conductor { metal, roughness } => {
            self::metal(metal, f);
            self::roughness("roughness", roughness, f);
        }
        Surface::Dielectric { roughness, tint, .. } => {
            self::roughness("roughness", roughness, f);
            f("tint", Param::Color(tint));
        }
        Surface::Glass(glass) => {
            roughness("roughness", &glass.roughness, f);
            f("tint", Param::Color(&glass.tint));
            film(&glass.film, f);
        }
        Surface::CoatedDiffuse { reflectance, coat } => {
            f("reflectance", Param::Color(reflectance));
            self::coat(coat, f);
        }
        Surface::CoatedConductor { metal, roughness, coat } => {
            self::metal(metal, f);
            self::roughness("roughness", roughness, f);
            self::coat(coat, f);
        }
        Surface::DiffuseTransmission { reflectance, transmittance } => {
            f("reflectance", Param::Color(reflectance));
            f("transmittance", Param::Color(transmittance));
        }
        Surface::Subsurface(s) => subsurface(s, f),
        Surface::Hair(hair) => self::hair(hair, f),
        Surface::Mix { amount, .. } => f("amount", Param::Scalar(amount)),
        Surface::MetalRough(m) => metal_rough(m, f),
        Surface::ThinDielectric { .. } | Surface::Measured(_) | Surface::Interface => {}
    }
}

fn metal(metal: &Metal, f: &mut impl FnMut(&'static str, Param<'_>)) {
    if let Metal::Reflectance(reflectance) = metal {
        f("reflectance", Param::Color(reflectance));
    }
}

fn roughness(name: &'static str, r: &Roughness, f: &mut impl FnMut(&'static str, Param<'_>)) {
    f(name, Param::Scalar(&r.u));
    f(name, Param::Scalar(&r.v));
}

fn coat(coat: &Coat, f: &mut impl FnMut(&'static str, Param<'_>)) {
    roughness("coat roughness", &coat.roughness, f);
    f("coat thickness", Param::Scalar(&coat.thickness));
    f("albedo below the coat", Param::Color(&coat.albedo));
    f("asymmetry below the coat", Param::Scalar(&coat.g));
}

fn subsurface(s: &desc::Subsurface, f: &mut impl FnMut(&'static str, Param<'_>)) {
    roughness("roughness", &s.roughness, f);
    let [(first, a), (second, b)] = match &s.interior {
        Interior::Coefficients { absorption, scattering } => {
            [("absorption", absorption), ("scattering", scattering)]
        }
        Interior::Reflectance { reflectance, mean_free_path } => {
            [("reflectance", reflectance), ("mean free path", mean_free_path)]
        }
    };
    f(first, Param::Color(a));
    f(second, Param::Color(b));
}

fn hair(hair: &desc::Hair, f: &mut impl FnMut(&'static str, Param<'_>)) {
    match &hair.color {
        HairColor::Absorption(c) => f("absorption", Param::Color(c)),
        HairColor::Reflectance(c) => f("reflectance", Param::Color(c)),
        HairColor::Pigments { eumelanin, pheomelanin } => {
            f("eumelanin", Param::Scalar(eumelanin));
            f("pheomelanin", Param::Scalar(pheomelanin));
        }
    }
    f("beta_m", Param::Scalar(&hair.beta_m));
    f("beta_n", Param::Scalar(&hair.beta_n));
}

fn metal_rough(m: &desc::MetalRough, f: &mut impl FnMut(&'static str, Param<'_>)) {
    f("base color", Param::Color(&m.base_color));
    f("specular color", Param::Color(&m.specular_color));
    f("sheen color", Param::Color(&m.sheen_color));
    f("metallic", Param::Scalar(&m.metallic));
    f("roughness", Param::Scalar(&m.roughness));
    f("specular", Param::Scalar(&m.specular));
    f("transmission", Param::Scalar(&m.transmission));
    f("diffuse transmission", Param::Scalar(&m.diffuse_transmission));
    f("diffuse transmission color", Param::Color(&m.diffuse_transmission_color));
    film(&m.film, f);
    f("clearcoat", Param::Scalar(&m.clearcoat));
    f("clearcoat roughness", Param::Scalar(&m.clearcoat_roughness));
    f("sheen roughness", Param::Scalar(&m.sheen_roughness));
    if let Some(map) = m.clearcoat_normal {
        f("clearcoat normal", Param::Normals(map));
    }
    if let Some(texture) = m.anisotropy.texture {
        f("anisotropy", Param::Normals((texture, 1.0)));
    }
}

fn film(film: &desc::ThinFilm, f: &mut impl FnMut(&'static str, Param<'_>)) {
    f("film", Param::Scalar(&film.strength));
    f("film's thickness", Param::Scalar(&film.place));
}
