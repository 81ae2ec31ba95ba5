//! Materials and textures in Mitsuba's terms.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glam::{Affine2, Mat4, Vec3, Vec4};
use quietus_trace::desc::{
    Alpha, Coat, ColorParam, Image, ImageTexture, Mapping, Material, MaterialId, Metal, MetalRough,
    Roughness, RoughnessScale, ScalarParam, SceneDesc, Surface, Texture, TextureId, Wrap,
};
use serde_json::{Value, json};

/// Materials written so far; each once, however many shapes have it.
pub(crate) struct Materials<'a> {
    scene: &'a SceneDesc,
    folder: &'a Path,
    written: BTreeMap<String, Value>,
    notes: BTreeSet<String>,
}

/// A colour in linear Rec.709.
pub(crate) fn rgb(color: Vec3) -> Value {
    json!({"type": "rgb", "value": color.to_array()})
}

impl<'a> Materials<'a> {
    pub(crate) fn new(scene: &'a SceneDesc, folder: &'a Path) -> Self {
        Self { scene, folder, written: BTreeMap::new(), notes: BTreeSet::new() }
    }

    /// A reference to a material, which is written if it has not been.
    pub(crate) fn reference(&mut self, id: MaterialId) -> Result<Value> {
        let key = format!("material-{:06}", id.0);
        if !self.written.contains_key(&key) {
            let scene = self.scene;
            let mut value = self.material(&scene.materials[id.0 as usize])?;
            value["id"] = json!(key);
            self.written.insert(key.clone(), value);
        }
        Ok(json!({"type": "ref", "id": key}))
    }

    /// All materials by name, and what was replaced.
    pub(crate) fn finish(self) -> (BTreeMap<String, Value>, BTreeSet<String>) {
        (self.written, self.notes)
    }

    fn note(&mut self, what: &str) {
        self.notes.insert(what.to_owned());
    }

    fn material(&mut self, material: &Material) -> Result<Value> {
        let mut value = self.surface(&material.surface)?;
        if material.normal_map.is_some() || material.bump.is_some() {
            self.note("normal and bump maps are left out");
        }
        let opacity = match &material.alpha {
            Alpha::Opaque => return Ok(value),
            Alpha::Mask { value, .. } | Alpha::Blend { value } => *value,
            Alpha::Unseen => {
                self.note("lights that are not seen are seen");
                return Ok(value);
            }
        };
        if matches!(material.alpha, Alpha::Mask { .. }) {
            self.note("alpha masks are blended");
        }
        value = json!({"type": "mask", "opacity": self.scalar(&opacity)?, "bsdf": value});
        Ok(value)
    }

    fn surface(&mut self, surface: &Surface) -> Result<Value> {
        Ok(match surface {
            Surface::Diffuse { reflectance } => {
                two_sided(json!({"type": "diffuse", "reflectance": self.color(reflectance)?}))
            }
            Surface::Conductor { metal, roughness } => self.conductor(metal, roughness)?,
            Surface::Dielectric { ior, roughness, tint } => self.glass(*ior, roughness, tint)?,
            Surface::Glass(glass) => {
                self.note("films, dispersion and multiple scattering of glass are left out");
                self.glass(glass.ior.y, &glass.roughness, &glass.tint)?
            }
            Surface::ThinDielectric { ior } => {
                json!({"type": "thindielectric", "int_ior": ior, "ext_ior": 1.0})
            }
            Surface::CoatedDiffuse { reflectance, coat } => self.plastic(reflectance, coat)?,
            Surface::CoatedConductor { metal, roughness, .. } => {
                self.note("coats of metals are left out");
                self.conductor(metal, roughness)?
            }
            Surface::DiffuseTransmission { reflectance, .. } => {
                self.note("diffuse transmission is left out");
                two_sided(json!({"type": "diffuse", "reflectance": self.color(reflectance)?}))
            }
            Surface::Mix { materials, amount } => {
                let [first, second] = [self.reference(materials[0])?, self.reference(materials[1])?];
                json!({"type": "blendbsdf", "weight": self.scalar(amount)?, "first": first, "second": second})
            }
            Surface::Interface => json!({"type": "null"}),
            Surface::Subsurface(_) | Surface::Measured(_) => {
                self.note("measured surfaces and those that light wanders below are drawn diffuse");
                two_sided(json!({"type": "diffuse", "reflectance": rgb(Vec3::splat(0.5))}))
            }
            Surface::Hair(_) => {
                self.note("hair is drawn diffuse");
                two_sided(json!({"type": "diffuse", "reflectance": rgb(Vec3::splat(0.3))}))
            }
            Surface::MetalRough(m) => self.principled(m)?,
        })
    }

    fn glass(&mut self, ior: f32, roughness: &Roughness, tint: &ColorParam) -> Result<Value> {
        let tint = self.color(tint)?;
        let mut value =
            json!({"type": "dielectric", "int_ior": ior, "ext_ior": 1.0, "specular_transmittance": tint});
        self.roughen(&mut value, roughness, "roughdielectric")?;
        Ok(value)
    }

    fn conductor(&mut self, metal: &Metal, roughness: &Roughness) -> Result<Value> {
        let (eta, k) = match metal {
            Metal::Index { eta, k } => (*eta, *k),
            Metal::Reflectance(color) => {
                if color.texture.is_some() {
                    self.note("textures of metals are left out");
                }
                let r = color.factor.clamp(Vec3::ZERO, Vec3::splat(0.9999));
                (Vec3::ONE, 2.0 * r.map(f32::sqrt) / (Vec3::ONE - r).map(f32::sqrt))
            }
        };
        let mut value = json!({"type": "conductor", "eta": rgb(eta), "k": rgb(k)});
        self.roughen(&mut value, roughness, "roughconductor")?;
        Ok(two_sided(value))
    }

    /// Gives `value` the alphas of `roughness`; `rough` is what it is called then.
    fn roughen(&mut self, value: &mut Value, roughness: &Roughness, rough: &str) -> Result<()> {
        if roughness.u.factor == 0.0 && roughness.v.factor == 0.0 {
            return Ok(());
        }
        if roughness.u.texture.is_some() || roughness.v.texture.is_some() {
            self.note("textures of roughness are left out");
        }
        value["type"] = json!(rough);
        value["distribution"] = json!("ggx");
        value["alpha_u"] = json!(alpha(roughness.scale, roughness.u.factor));
        value["alpha_v"] = json!(alpha(roughness.scale, roughness.v.factor));
        Ok(())
    }

    fn plastic(&mut self, reflectance: &ColorParam, coat: &Coat) -> Result<Value> {
        self.note("coated diffuse surfaces are Mitsuba's plastic");
        let mut value = json!({
            "type": "plastic",
            "diffuse_reflectance": self.color(reflectance)?,
            "int_ior": coat.ior,
            "ext_ior": 1.0,
            "nonlinear": true,
        });
        let roughness = coat.roughness;
        if roughness.u.factor > 0.0 {
            value["type"] = json!("roughplastic");
            value["distribution"] = json!("ggx");
            value["alpha"] = json!(alpha(roughness.scale, roughness.u.factor));
        }
        Ok(two_sided(value))
    }

    fn principled(&mut self, m: &MetalRough) -> Result<Value> {
        self.note("glTF materials are Mitsuba's principled");
        Ok(two_sided(json!({
            "type": "principled",
            "base_color": self.color(&m.base_color)?,
            "metallic": self.scalar(&m.metallic)?,
            "roughness": self.scalar(&m.roughness)?,
            "specular": 0.5,
            "clearcoat": self.scalar(&m.clearcoat)?,
        })))
    }

    fn color(&mut self, parameter: &ColorParam) -> Result<Value> {
        match parameter.texture {
            None => Ok(rgb(parameter.factor)),
            Some(texture) => self.texture(texture, parameter.factor),
        }
    }

    fn scalar(&mut self, parameter: &ScalarParam) -> Result<Value> {
        let Some((TextureId(texture), channel)) = parameter.texture else {
            return Ok(json!(parameter.factor));
        };
        let Texture::Image(texture) = &self.scene.textures[texture as usize] else {
            self.note("numbers driven by a texture that is no image are taken as constant");
            return Ok(json!(parameter.factor));
        };
        let file = format!("{}-channel-{channel}.exr", image_name(&texture.image));
        let path = self.folder.join(&file);
        let value = |texel: Vec4| Vec3::splat(parameter.factor * texel[usize::from(channel)]);
        write_texels(&texture.image, value, &path)?;
        Ok(bitmap(texture, &file))
    }

    fn texture(&mut self, TextureId(id): TextureId, factor: Vec3) -> Result<Value> {
        let scene = self.scene;
        match &scene.textures[id as usize] {
            Texture::Image(texture) => {
                let file = format!("{}-{}.exr", image_name(&texture.image), name_of(factor));
                write_exr(&texture.image, factor, &self.folder.join(&file))?;
                Ok(bitmap(texture, &file))
            }
            Texture::Constant(value) => Ok(rgb(value.truncate() * factor)),
            Texture::Checkerboard { mapping: Mapping::Uv { transform, .. }, colors } => {
                // Mitsuba's board has two cells in a unit.
                let to_uv = Affine2::from_scale(glam::Vec2::splat(0.5)) * *transform;
                let [even, odd] = [self.color(&colors[0])?, self.color(&colors[1])?];
                Ok(json!({"type": "checkerboard", "color0": even, "color1": odd, "to_uv": matrix2(&to_uv)}))
            }
            _ => {
                self.note("textures that are no images and no checkerboards are taken as constant");
                Ok(rgb(factor))
            }
        }
    }
}

fn two_sided(bsdf: Value) -> Value {
    json!({"type": "twosided", "bsdf": bsdf})
}

fn alpha(scale: RoughnessScale, roughness: f32) -> f32 {
    match scale {
        RoughnessScale::Squared => roughness * roughness,
        RoughnessScale::SquareRoot => roughness.sqrt(),
        RoughnessScale::Alpha => roughness,
    }
    .max(1e-3)
}

fn bitmap(texture: &ImageTexture, file: &str) -> Value {
    let Mapping::Uv { transform, .. } = texture.mapping else {
        return json!({"type": "bitmap", "filename": file, "raw": true});
    };
    let wrap = match texture.wrap[0] {
        Wrap::Repeat => "repeat",
        Wrap::Mirror => "mirror",
        Wrap::Clamp | Wrap::Black | Wrap::Octahedral => "clamp",
    };
    json!({"type": "bitmap", "filename": file, "raw": true, "wrap_mode": wrap, "to_uv": matrix2(&transform)})
}

fn matrix2(transform: &Affine2) -> Value {
    let mut matrix = Mat4::IDENTITY;
    let [x, y, t] = [transform.matrix2.x_axis, transform.matrix2.y_axis, transform.translation];
    // Mitsuba takes the upper left 3x3 of it: a transform of the plane.
    matrix.x_axis = Vec4::new(x.x, x.y, 0.0, 0.0);
    matrix.y_axis = Vec4::new(y.x, y.y, 0.0, 0.0);
    matrix.z_axis = Vec4::new(t.x, t.y, 1.0, 0.0);
    json!({"matrix": matrix.transpose().to_cols_array()})
}

/// A file name for an image: unique for each, as two may have the same name.
fn image_name(image: &Image) -> String {
    format!("texture-{:x}", std::ptr::from_ref(image) as usize)
}

fn name_of(factor: Vec3) -> String {
    factor.to_array().map(|f| format!("{:08x}", f.to_bits())).join("-")
}

/// The colours of `image` times `factor`.
pub(crate) fn write_exr(image: &Image, factor: Vec3, path: &Path) -> Result<()> {
    write_texels(image, |texel| texel.truncate() * factor, path)
}

fn write_texels(image: &Image, value: impl Fn(Vec4) -> Vec3 + Sync, path: &Path) -> Result<()> {
    if path.exists() {
        return Ok(());
    }
    let (width, height) = (image.width as usize, image.height as usize);
    let pixel = |x: usize, y: usize| {
        let color = value(image.texel(x as u32, y as u32));
        (color.x, color.y, color.z)
    };
    exr::prelude::write_rgb_file(path, width, height, pixel)
        .with_context(|| format!("cannot write {}", PathBuf::from(path).display()))
}
