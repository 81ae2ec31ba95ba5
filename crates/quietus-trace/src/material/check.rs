//! Looks for numbers and indices of materials that cannot be drawn.

use super::{
    MaterialError,
    params::{Param, each_param},
};
use crate::desc::{self, Alpha, Coat, ColorParam, MaterialId, Metal, ScalarParam, Surface, TextureId};

/// Mixtures of mixtures may go this deep.
const MAX_MIX_DEPTH: u32 = 32;

/// Checks all materials against each other and the number of textures there are.
pub(super) fn materials(materials: &[desc::Material], textures: usize) -> Result<(), MaterialError> {
    for material in materials {
        Check { material, materials, textures }.all()?;
    }
    Ok(())
}

/// Checks one material.
struct Check<'a> {
    material: &'a desc::Material,
    materials: &'a [desc::Material],
    textures: usize,
}

impl Check<'_> {
    fn all(&self) -> Result<(), MaterialError> {
        let m = self.material;
        let mut result = Ok(());
        each_param(m, |field, param| {
            if result.is_ok() {
                result = match param {
                    Param::Color(p) => self.color(field, p),
                    Param::Scalar(p) => self.scalar(field, p),
                    Param::Normals(map) => self.normals(field, map),
                };
            }
        });
        result?;
        self.coverage(&m.alpha)?;
        match &m.surface {
            Surface::Conductor { metal, .. } => self.metal(metal),
            Surface::Dielectric { ior, .. } | Surface::ThinDielectric { ior } => self.ior("ior", *ior),
            Surface::Glass(glass) => {
                glass.ior.to_array().into_iter().try_for_each(|ior| self.ior("ior", ior))?;
                self.film(&glass.film)
            }
            Surface::CoatedDiffuse { coat, .. } => self.coat(coat),
            Surface::CoatedConductor { metal, coat, .. } => self.metal(metal).and(self.coat(coat)),
            Surface::Subsurface(s) => {
                self.ior("ior", s.ior).and(self.range("asymmetry", s.g.abs() < 1.0, "between -1 and 1", s.g))
            }
            Surface::Measured(m) => self.measured(m),
            Surface::Hair(hair) => self.hair(hair),
            Surface::Mix { .. } => self.mix(m, 0),
            Surface::MetalRough(m) => self.metal_rough(m),
            Surface::Diffuse { .. } | Surface::DiffuseTransmission { .. } | Surface::Interface => Ok(()),
        }
    }

    fn coverage(&self, alpha: &Alpha) -> Result<(), MaterialError> {
        match alpha {
            Alpha::Opaque | Alpha::Unseen => Ok(()),
            Alpha::Mask { value, cutoff } => {
                self.scalar("alpha", value)?;
                self.range("alpha cutoff", cutoff.is_finite(), "finite", cutoff)
            }
            Alpha::Blend { value } => self.scalar("alpha", value),
        }
    }

    fn ior(&self, field: &'static str, ior: f32) -> Result<(), MaterialError> {
        self.range(field, ior.is_finite() && ior > 0.0, "finite and above 0", ior)
    }

    fn metal(&self, metal: &Metal) -> Result<(), MaterialError> {
        let Metal::Index { eta, k } = metal else { return Ok(()) };
        let sound = eta.is_finite() && k.is_finite() && eta.min_element() > 0.0 && k.min_element() >= 0.0;
        let expected = "finite, real part above 0, imaginary at least 0";
        self.range("index of refraction", sound, expected, format!("{eta} + i {k}"))
    }

    fn coat(&self, coat: &Coat) -> Result<(), MaterialError> {
        self.ior("coat ior", coat.ior)?;
        let thickness = coat.thickness.factor;
        self.range("coat thickness", thickness >= 0.0, "at least 0", thickness)?;
        let g = coat.g.factor;
        self.range("asymmetry below the coat", g.abs() < 1.0, "between -1 and 1", g)
    }

    fn measured(&self, m: &desc::Measured) -> Result<(), MaterialError> {
        let views = m.azimuths.len() * m.polar_angles.len();
        for angles in [&m.azimuths, &m.polar_angles] {
            let sound = !angles.is_empty() && angles.is_sorted() && angles.iter().all(|a| a.is_finite());
            self.range("angles of view", sound, "one or more, ascending", format!("{angles:?}"))?;
        }
        let number = |value: &f32| value.is_finite() && *value >= 0.0;
        self.sheets("facets", &m.facets, 1, number)?;
        self.sheets("area of facets", &m.area, 1, number)?;
        self.sheets("visible facets", &m.visible, views, number)?;
        self.sheets("luminance", &m.luminance, views, number)?;
        self.sheets("colours", &m.colors, views, |color| color.is_finite())?;
        for (field, sheets) in [("visible facets", &m.visible), ("luminance", &m.luminance)] {
            let size = sheets.size[0] as usize * sheets.size[1] as usize;
            // Bilinear: all but nothing is something.
            let drawn =
                sheets.values.chunks_exact(size).all(|sheet| sheet.iter().any(|v| *v > f32::MIN_POSITIVE));
            self.range(field, drawn, "above 0 somewhere for each direction of view", "0")?;
        }
        Ok(())
    }

    fn sheets<T>(
        &self,
        field: &'static str,
        sheets: &desc::Sheets<T>,
        count: usize,
        sound: impl Fn(&T) -> bool,
    ) -> Result<(), MaterialError> {
        let [width, height] = sheets.size;
        let size = sheets.size.iter().all(|n| (2..1 << 16).contains(n));
        self.range(field, size, "of 2x2 samples or more", format!("{width}x{height}"))?;
        let expected = (width as usize * height as usize).saturating_mul(count);
        let found = sheets.values.len();
        self.range(field, found == expected, "one value per sample and direction of view", found)?;
        self.range(field, sheets.values.iter().all(sound), "finite numbers of at least 0", "something else")
    }

    fn hair(&self, hair: &desc::Hair) -> Result<(), MaterialError> {
        let ior = hair.ior;
        self.range("ior", ior.is_finite() && ior >= 1.0, "finite and at least 1", ior)?;
        let tilt = hair.alpha.to_degrees();
        self.range("tilt of the scales", tilt.abs() <= 45.0, "an angle of at most 45 degrees", tilt)
    }

    /// The parts of a mixture: that they exist, end, and claim nothing that the mixture itself must say.
    fn mix(&self, material: &desc::Material, depth: u32) -> Result<(), MaterialError> {
        let Surface::Mix { materials, .. } = &material.surface else { return Ok(()) };
        self.range("mixture", depth < MAX_MIX_DEPTH, "free of itself, and not deeper than 32", depth)?;
        for &MaterialId(id) in materials {
            let Some(part) = self.materials.get(id as usize) else {
                let (material, count) = (self.material.name.clone(), self.materials.len());
                return Err(MaterialError::NoSuchMaterial { material, part: id, count });
            };
            let dark = part.emission.factor == glam::Vec3::ZERO;
            self.range("each part of a mixture", dark, "without emission of its own", &part.name)?;
            let lit = !matches!(&part.surface, Surface::MetalRough(m) if m.unlit);
            self.range("each part of a mixture", lit, "lit", &part.name)?;
            self.mix(part, depth + 1)?;
        }
        Ok(())
    }

    fn metal_rough(&self, m: &desc::MetalRough) -> Result<(), MaterialError> {
        let desc::Anisotropy { strength, rotation, .. } = m.anisotropy;
        self.range("anisotropy", (0.0..=1.0).contains(&strength), "in 0..1", strength)?;
        self.range("anisotropy's rotation", rotation.is_finite(), "finite", rotation)?;
        self.film(&m.film)?;
        // KHR_materials_ior: at least 1, or 0 for "reflects everything".
        let sound = m.ior.is_finite() && (m.ior >= 1.0 || m.ior == 0.0);
        self.range("ior", sound, "finite and at least 1, or 0", m.ior)
    }

    fn film(&self, film: &desc::ThinFilm) -> Result<(), MaterialError> {
        let sound = film.ior.is_finite() && film.ior >= 1.0;
        self.range("film's ior", sound, "finite and at least 1", film.ior)?;
        for thickness in film.thickness {
            let sound = thickness.is_finite() && thickness >= 0.0;
            self.range("film's thickness", sound, "finite and at least 0", thickness)?;
        }
        Ok(())
    }

    fn normals(&self, field: &'static str, (map, scale): (TextureId, f32)) -> Result<(), MaterialError> {
        self.range(field, scale.is_finite(), "scaled by a finite number", scale)?;
        self.texture(field, Some(map))
    }

    fn color(&self, field: &'static str, p: &ColorParam) -> Result<(), MaterialError> {
        let sound = p.factor.is_finite() && p.factor.min_element() >= 0.0;
        self.range(field, sound, "finite and at least 0", p.factor)?;
        self.texture(field, p.texture)
    }

    fn scalar(&self, field: &'static str, p: &ScalarParam) -> Result<(), MaterialError> {
        self.range(field, p.factor.is_finite(), "finite", p.factor)?;
        let channel = p.texture.map_or(0, |(_, channel)| channel);
        self.range(field, channel < 4, "read from a texture channel in 0..4", channel)?;
        self.texture(field, p.texture.map(|(t, _)| t))
    }

    fn texture(&self, field: &'static str, texture: Option<TextureId>) -> Result<(), MaterialError> {
        match texture {
            Some(TextureId(texture)) if texture as usize >= self.textures => {
                Err(MaterialError::NoSuchTexture {
                    material: self.material.name.clone(),
                    field,
                    texture,
                    count: self.textures,
                })
            }
            _ => Ok(()),
        }
    }

    fn range(
        &self,
        field: &'static str,
        sound: bool,
        expected: &'static str,
        value: impl std::fmt::Display,
    ) -> Result<(), MaterialError> {
        if sound {
            return Ok(());
        }
        let (material, value) = (self.material.name.clone(), value.to_string());
        Err(MaterialError::OutOfRange { material, field, expected, value })
    }
}
