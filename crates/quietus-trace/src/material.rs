//! Materials of a scene, ready to be evaluated at surface points.

use glam::{Vec2, Vec3, Vec4};

use crate::{
    bsdf::{
        Bsdf, Conductor, Dielectric, Diffuse, DiffuseTransmission, MetalRough, MetalRoughParams,
        ThinDielectric, ggx::Ggx,
    },
    desc::{
        self, Alpha, ColorParam, ImageTexture, Mapping, MaterialId, Metal, Roughness, RoughnessScale,
        ScalarParam, Surface, Texels, Texture, TextureId,
    },
    frame::Frame,
};

pub use crate::texture::SurfacePoint;

/// A metal that is nowhere darker would reflect everything, with an infinite index of refraction.
const MAX_METAL_REFLECTANCE: Vec3 = Vec3::splat(0.9999);

/// A scene's materials and textures, every index checked.
#[derive(Clone, Debug, Default)]
pub struct MaterialTable {
    textures: Vec<Texture>,
    materials: Vec<desc::Material>,
}

/// What is wrong with a scene's materials or textures.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// A material names a texture that is not there.
    #[error("material {material:?}: {field} names texture {texture}, but there are {count}")]
    NoSuchTexture {
        /// The material's name.
        material: String,
        /// Which of its parameters.
        field: &'static str,
        /// The index it gives.
        texture: u32,
        /// How many textures there are.
        count: usize,
    },
    /// A value out of its range.
    #[error("material {material:?}: {field} must be {expected}, but is {value}")]
    OutOfRange {
        /// The material's name.
        material: String,
        /// Which of its parameters.
        field: &'static str,
        /// What was expected.
        expected: &'static str,
        /// What was found.
        value: String,
    },
    /// Something the description can say and the renderer does not draw.
    #[error("material {material:?}: {what} is not supported")]
    Unsupported {
        /// The material's name.
        material: String,
        /// What it asks for.
        what: &'static str,
    },
    /// A texture that cannot be looked up.
    #[error("texture {index} (image {image:?}): {problem}")]
    Texture {
        /// Its index.
        index: usize,
        /// The image's name.
        image: String,
        /// What is wrong.
        problem: String,
    },
}

impl MaterialTable {
    /// Checks the textures and materials of a scene and keeps copies (images stay shared).
    ///
    /// # Errors
    /// Names the first texture or material that cannot be used, and why.
    pub fn compile(textures: &[Texture], materials: &[desc::Material]) -> Result<Self, MaterialError> {
        for (index, texture) in textures.iter().enumerate() {
            check_texture(index, texture)?;
        }
        for material in materials {
            Check { material, textures: textures.len() }.all()?;
        }
        Ok(Self { textures: textures.to_vec(), materials: materials.to_vec() })
    }

    /// How many materials there are: ids below this are valid for every method here, others panic.
    pub fn len(&self) -> usize {
        self.materials.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.materials.is_empty()
    }

    /// Whether anything but coverage may differ with the texture coordinates of a point.
    pub(crate) fn is_textured(&self, id: MaterialId) -> bool {
        let desc::Material { surface, emission, normal_map, .. } = self.material(id);
        let color = |p: &ColorParam| p.texture.is_some();
        let scalar = |p: &ScalarParam| p.texture.is_some();
        let scattering = match surface {
            Surface::Diffuse { reflectance } => color(reflectance),
            Surface::Conductor { metal, roughness: r } => {
                let colored = matches!(metal, Metal::Reflectance(c) if color(c));
                colored || scalar(&r.u) || scalar(&r.v)
            }
            Surface::Dielectric { roughness: r, tint, .. } => scalar(&r.u) || scalar(&r.v) || color(tint),
            Surface::DiffuseTransmission { reflectance, transmittance } => {
                color(reflectance) || color(transmittance)
            }
            Surface::MetalRough(m) => {
                let scalars = [
                    &m.metallic,
                    &m.roughness,
                    &m.specular,
                    &m.transmission,
                    &m.clearcoat,
                    &m.clearcoat_roughness,
                ];
                color(&m.base_color)
                    || color(&m.specular_color)
                    || scalars.into_iter().any(scalar)
                    || m.clearcoat_normal.is_some()
            }
            _ => false,
        };
        scattering || color(emission) || normal_map.is_some()
    }

    /// How the surface scatters at `point`; [`Bsdf::Black`] where it is unlit.
    #[inline(always)]
    pub fn bsdf(&self, id: MaterialId, point: &SurfacePoint) -> Bsdf {
        let color = |p: &ColorParam| p.at(point, &self.textures);
        let unit_color = |p: &ColorParam| color(p).clamp(Vec3::ZERO, Vec3::ONE);
        let unit = |p: &ScalarParam| p.at(point, &self.textures).clamp(0.0, 1.0);
        match &self.material(id).surface {
            Surface::Diffuse { reflectance } => {
                Bsdf::Diffuse(Diffuse { reflectance: unit_color(reflectance) })
            }
            Surface::Conductor { metal, roughness } => {
                let (eta, k) = self.index(metal, point);
                Bsdf::Conductor(Conductor::new(eta, k, self.facets(roughness, point)))
            }
            Surface::Dielectric { ior, roughness, tint } => {
                Bsdf::Dielectric(Dielectric::new(*ior, self.facets(roughness, point), unit_color(tint)))
            }
            Surface::ThinDielectric { ior } => Bsdf::ThinDielectric(ThinDielectric { ior: *ior }),
            Surface::DiffuseTransmission { reflectance, transmittance } => {
                Bsdf::DiffuseTransmission(DiffuseTransmission {
                    reflectance: unit_color(reflectance),
                    transmittance: unit_color(transmittance),
                })
            }
            Surface::MetalRough(m) if m.unlit => Bsdf::Black,
            Surface::MetalRough(m) => Bsdf::MetalRough(MetalRough::new(&MetalRoughParams {
                base_color: (color(&m.base_color) * point.color.truncate()).clamp(Vec3::ZERO, Vec3::ONE),
                metallic: unit(&m.metallic),
                roughness: unit(&m.roughness),
                ior: m.ior,
                specular: unit(&m.specular),
                specular_color: color(&m.specular_color),
                transmission: unit(&m.transmission),
                clearcoat: unit(&m.clearcoat),
                clearcoat_roughness: unit(&m.clearcoat_roughness),
                clearcoat_normal: self.clearcoat_normal(self.material(id), m, point),
            })),
            // Refused by [`Self::compile`].
            _ => Bsdf::Black,
        }
    }

    /// The complex index of refraction of a metal.
    #[inline]
    fn index(&self, metal: &Metal, point: &SurfacePoint) -> (Vec3, Vec3) {
        match metal {
            Metal::Index { eta, k } => (*eta, *k),
            Metal::Reflectance(reflectance) => {
                let r = reflectance.at(point, &self.textures).clamp(Vec3::ZERO, MAX_METAL_REFLECTANCE);
                (Vec3::ONE, 2.0 * (r / (1.0 - r)).map(f32::sqrt))
            }
        }
    }

    /// The microfacets of a rough surface; `None` where it is smooth.
    #[inline]
    fn facets(&self, Roughness { u, v, scale }: &Roughness, point: &SurfacePoint) -> Option<Ggx> {
        let alpha = |p: &ScalarParam| {
            let roughness = p.at(point, &self.textures).max(0.0);
            match scale {
                RoughnessScale::Squared => roughness * roughness,
                RoughnessScale::SquareRoot => roughness.sqrt(),
                RoughnessScale::Alpha => roughness,
            }
        };
        let along = alpha(u);
        let across = if u == v { along } else { alpha(v) };
        Ggx::new(Vec2::new(along, across))
    }

    /// The base colour of an unlit surface, to be shown where the camera sees it directly (or through perfect
    /// mirrors and glass); `None` for lit ones.
    #[inline(always)]
    pub fn unlit_color(&self, id: MaterialId, point: &SurfacePoint) -> Option<Vec3> {
        match &self.material(id).surface {
            Surface::MetalRough(m) if m.unlit => {
                Some(m.base_color.at(point, &self.textures) * point.color.truncate())
            }
            _ => None,
        }
    }

    /// Emitted radiance at `point`, seen from the front (the side the geometric normal points to) or the back.
    #[inline]
    pub fn emission(&self, id: MaterialId, point: &SurfacePoint, front: bool) -> Vec3 {
        let material = self.material(id);
        if material.emission.factor == Vec3::ZERO || !(front || material.emission_two_sided) {
            return Vec3::ZERO;
        }
        material.emission.at(point, &self.textures)
    }

    /// Whether anything of the material can emit: whether its shapes are lights.
    #[inline]
    pub fn emits(&self, id: MaterialId) -> bool {
        self.material(id).emission.factor != Vec3::ZERO
    }

    /// Whether emission differs from place to place.
    pub fn emission_is_textured(&self, id: MaterialId) -> bool {
        self.material(id).emission.texture.is_some()
    }

    /// Whether the back side emits too.
    #[inline]
    pub fn emits_two_sided(&self, id: MaterialId) -> bool {
        self.material(id).emission_two_sided
    }

    /// Mean emitted radiance over the texture's image, to weigh lights against each other before any point on
    /// them is known. Costs a pass over the image: not for the hot path.
    pub fn mean_emission(&self, id: MaterialId) -> Vec3 {
        let ColorParam { factor, texture } = self.material(id).emission;
        let Some(TextureId(texture)) = texture else { return factor };
        let Texture::Image(ImageTexture { image, .. }) = &self.textures[texture as usize] else {
            return factor;
        };
        let sum: Vec4 = (0..image.height)
            .flat_map(|y| (0..image.width).map(move |x| (x, y)))
            .map(|(x, y)| image.texel(x, y))
            .fold(Vec4::ZERO, |sum, texel| sum + texel);
        factor * (sum / (image.width as f32 * image.height as f32)).truncate()
    }

    /// Whether every hit counts: [`alpha`](Self::alpha) is 1 everywhere.
    #[inline]
    pub fn is_opaque(&self, id: MaterialId) -> bool {
        self.material(id).alpha == Alpha::Opaque
    }

    /// Coverage at `point`: the probability of being hit, in 0..1.
    pub fn alpha(&self, id: MaterialId, point: &SurfacePoint) -> f32 {
        let value = |v: &ScalarParam| v.at(point, &self.textures) * point.color.w;
        match &self.material(id).alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask { value: v, cutoff } => f32::from(u8::from(value(v) >= *cutoff)),
            Alpha::Blend { value: v } => value(v).clamp(0.0, 1.0),
        }
    }

    /// Whether the directions of the texture coordinates matter: for normal maps, that of a clear coat too, and
    /// anisotropic roughness.
    #[inline]
    pub fn needs_tangent(&self, id: MaterialId) -> bool {
        let material = self.material(id);
        material.normal_map.is_some()
            || match &material.surface {
                Surface::MetalRough(m) => m.clearcoat_normal.is_some(),
                Surface::Conductor { roughness, .. } | Surface::Dielectric { roughness, .. } => {
                    roughness.u != roughness.v
                }
                _ => false,
            }
    }

    /// The shading frame with the normal map applied: `frame` is the orthonormal frame of the interpolated normal
    /// and the mesh's tangent. It is left-handed where that is (under a mirror), as tangent space is then.
    pub fn shading_frame(&self, id: MaterialId, point: &SurfacePoint, frame: &Frame) -> Frame {
        let Some(map) = self.material(id).normal_map else { return *frame };
        let normal = frame.to_world(self.tangent_normal(map, point)).normalize();
        let mapped = Frame::from_normal_tangent(normal, frame.tangent);
        let handedness = frame.tangent.cross(frame.bitangent).dot(frame.normal).signum();
        Frame { bitangent: mapped.bitangent * handedness, ..mapped }
    }

    /// The normal that a map (texture and scale) gives, of unit length, in tangent space.
    fn tangent_normal(&self, (TextureId(texture), scale): (TextureId, f32), point: &SurfacePoint) -> Vec3 {
        let texel = self.textures[texture as usize].lookup(point).truncate();
        let n = (2.0 * texel - 1.0) * Vec3::new(scale, scale, 1.0);
        // A normal below the surface says nothing that could be drawn: it is laid flat as far as it must.
        n.with_z(n.z.max(1e-3)).normalize_or(Vec3::Z)
    }

    /// The coat's normal in the frame that [`shading_frame`](Self::shading_frame) gives the base. Without a map
    /// of its own the coat lies smoothly over the base's bumps (KHR_materials_clearcoat).
    fn clearcoat_normal(
        &self,
        material: &desc::Material,
        m: &desc::MetalRough,
        point: &SurfacePoint,
    ) -> Vec3 {
        if m.clearcoat.factor == 0.0 || (m.clearcoat_normal.is_none() && material.normal_map.is_none()) {
            return Vec3::Z;
        }
        let coat = m.clearcoat_normal.map_or(Vec3::Z, |map| self.tangent_normal(map, point));
        let base = material.normal_map.map_or(Vec3::Z, |map| self.tangent_normal(map, point));
        Frame::from_normal_tangent(base, Vec3::X).to_local(coat)
    }

    #[inline]
    fn material(&self, MaterialId(id): MaterialId) -> &desc::Material {
        &self.materials[id as usize]
    }
}

/// Finds what cannot be looked up in a texture.
fn check_texture(index: usize, texture: &Texture) -> Result<(), MaterialError> {
    let texture = match texture {
        Texture::Image(texture) => texture,
        Texture::Constant(_) => return Ok(()),
        _ => {
            let problem = "this kind of texture is not supported".to_owned();
            return Err(MaterialError::Texture { index, image: String::new(), problem });
        }
    };
    let image = &texture.image;
    let texels = match &image.texels {
        Texels::Srgb8(t) | Texels::Linear8(t) => t.len(),
        Texels::Float(t) => t.len(),
    };
    let problem = if image.width == 0 || image.height == 0 {
        format!("it is {}x{} texels, at least 1x1 is needed", image.width, image.height)
    } else if u64::from(image.width) * u64::from(image.height) != texels as u64 {
        format!("{}x{} texels were announced, but there are {texels}", image.width, image.height)
    } else if image.width.max(image.height) > 1 << 24 {
        format!("{}x{} texels are more than 2^24 along one side", image.width, image.height)
    } else if texture.invert || texture.wrap.contains(&desc::Wrap::Black) {
        "inverted textures and black borders are not supported".to_owned()
    } else {
        match texture.mapping {
            Mapping::Uv { set, .. } if set > 1 => {
                format!("it uses set {set} of texture coordinates, 0 or 1 was expected")
            }
            Mapping::Uv { transform, .. } if !transform.is_finite() => {
                "its transform is not finite".to_owned()
            }
            Mapping::Uv { .. } => return Ok(()),
            _ => "mappings other than uv are not supported".to_owned(),
        }
    };
    Err(MaterialError::Texture { index, image: image.name.clone(), problem })
}

/// Checks one material against the number of textures there are.
struct Check<'a> {
    material: &'a desc::Material,
    textures: usize,
}

impl Check<'_> {
    fn all(&self) -> Result<(), MaterialError> {
        let m = self.material;
        if m.bump.is_some() {
            return Err(self.unsupported("a bump map"));
        }
        self.color("emission", &m.emission)?;
        self.normal_map("normal map", m.normal_map)?;
        match &m.alpha {
            Alpha::Opaque => {}
            Alpha::Mask { value, cutoff } => {
                self.scalar("alpha", value)?;
                self.range("alpha cutoff", cutoff.is_finite(), "finite", cutoff.to_string())?;
            }
            Alpha::Blend { value } => self.scalar("alpha", value)?,
        }
        match &m.surface {
            Surface::Diffuse { reflectance } => self.color("reflectance", reflectance),
            Surface::Conductor { metal, roughness } => {
                self.metal(metal)?;
                self.roughness(roughness)
            }
            Surface::Dielectric { ior, roughness, tint } => {
                let sound = ior.is_finite() && *ior > 0.0;
                self.range("ior", sound, "finite and above 0", ior.to_string())?;
                self.roughness(roughness)?;
                self.color("tint", tint)
            }
            Surface::ThinDielectric { ior } => {
                let sound = ior.is_finite() && *ior > 0.0;
                self.range("ior", sound, "finite and above 0", ior.to_string())
            }
            Surface::DiffuseTransmission { reflectance, transmittance } => {
                self.color("reflectance", reflectance)?;
                self.color("transmittance", transmittance)
            }
            Surface::MetalRough(m) => self.metal_rough(m),
            _ => Err(self.unsupported("this kind of surface")),
        }
    }

    fn unsupported(&self, what: &'static str) -> MaterialError {
        MaterialError::Unsupported { material: self.material.name.clone(), what }
    }

    fn roughness(&self, roughness: &Roughness) -> Result<(), MaterialError> {
        self.scalar("roughness", &roughness.u)?;
        self.scalar("roughness", &roughness.v)
    }

    fn metal(&self, metal: &Metal) -> Result<(), MaterialError> {
        let (eta, k) = match metal {
            Metal::Reflectance(reflectance) => return self.color("reflectance", reflectance),
            Metal::Index { eta, k } => (eta, k),
        };
        let sound = eta.is_finite() && k.is_finite() && eta.min_element() > 0.0 && k.min_element() >= 0.0;
        let expected = "finite, real part above 0, imaginary at least 0";
        self.range("index of refraction", sound, expected, format!("{eta} + i {k}"))
    }

    fn metal_rough(&self, m: &desc::MetalRough) -> Result<(), MaterialError> {
        if m.anisotropy.strength != 0.0 || m.sheen_color.factor != Vec3::ZERO {
            return Err(self.unsupported("anisotropy or sheen"));
        }
        // KHR_materials_ior: at least 1, or 0 for "reflects everything".
        let sound = m.ior.is_finite() && (m.ior >= 1.0 || m.ior == 0.0);
        self.range("ior", sound, "finite and at least 1, or 0", m.ior.to_string())?;
        self.color("base color", &m.base_color)?;
        self.color("specular color", &m.specular_color)?;
        self.scalar("metallic", &m.metallic)?;
        self.scalar("roughness", &m.roughness)?;
        self.scalar("specular", &m.specular)?;
        self.scalar("transmission", &m.transmission)?;
        self.scalar("clearcoat", &m.clearcoat)?;
        self.scalar("clearcoat roughness", &m.clearcoat_roughness)?;
        self.normal_map("clearcoat normal", m.clearcoat_normal)
    }

    fn normal_map(&self, field: &'static str, map: Option<(TextureId, f32)>) -> Result<(), MaterialError> {
        let scale = map.map_or(1.0, |(_, scale)| scale);
        self.range(field, scale.is_finite(), "scaled by a finite number", scale.to_string())?;
        self.texture(field, map.map(|(t, _)| t))
    }

    fn color(&self, field: &'static str, p: &ColorParam) -> Result<(), MaterialError> {
        let sound = p.factor.is_finite() && p.factor.min_element() >= 0.0;
        self.range(field, sound, "finite and at least 0", p.factor.to_string())?;
        self.texture(field, p.texture)
    }

    fn scalar(&self, field: &'static str, p: &ScalarParam) -> Result<(), MaterialError> {
        self.range(field, p.factor.is_finite(), "finite", p.factor.to_string())?;
        let channel = p.texture.map_or(0, |(_, channel)| channel);
        self.range(field, channel < 4, "read from a texture channel in 0..4", channel.to_string())?;
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
        value: String,
    ) -> Result<(), MaterialError> {
        if sound {
            return Ok(());
        }
        Err(MaterialError::OutOfRange { material: self.material.name.clone(), field, expected, value })
    }
}

#[cfg(test)]
mod tests;
