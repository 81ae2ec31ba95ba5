//! Textures that materials use, and how they are sampled.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{Affine2, Mat2, Vec2};
use quietus_trace::desc::{Image, ImageTexture, Mapping, TexelFilter, Texture, TextureId, Wrap};

use super::document::Document;
use super::image::{Encoding, Pictures};
use super::material::Materials;
use super::schema::{self, TextureInfo};
use crate::error::SceneError;

impl Materials<'_, '_> {
    /// The texture that `info` at `place` refers to; none, with a warning, where it cannot be shown.
    pub(super) fn texture(
        &mut self,
        info: Option<&TextureInfo>,
        encoding: Encoding,
        place: &str,
    ) -> Result<Option<TextureId>, SceneError> {
        let Some(info) = info else { return Ok(None) };
        let document = self.document;
        let source =
            document.get(&document.root.textures, info.index, "textures", &format!("{place}.index"))?;
        let own = format!("textures[{}]", info.index);
        let schema::TextureExtensions { basisu, webp } = &source.extensions;
        let image = webp.as_ref().or(basisu.as_ref()).map(|other| other.source).or(source.source);
        let Some(image) = image else {
            document.warn(&own, "has no PNG, JPEG, WebP or KTX2 source: materials are drawn without it");
            return Ok(None);
        };
        let transform = info.extensions.transform.as_ref();
        let uv_set = transform.and_then(|transform| transform.tex_coord).unwrap_or(info.tex_coord);
        let Some(uv_set) = self.slot(uv_set) else {
            let message = format!("uses TEXCOORD_{uv_set}, the third set of its material: it is left out");
            document.warn(place, message);
            return Ok(None);
        };
        let matrix = transform.map_or(Affine2::IDENTITY, affine);
        if !matrix.is_finite() {
            let place = format!("{place}.extensions.KHR_texture_transform");
            return Err(document.invalid(&place, "expected finite numbers"));
        }
        let key = (info.index, encoding, uv_set, matrix.to_cols_array().map(f32::to_bits));
        if let Some(&id) = self.texture_ids.get(&key) {
            return Ok(Some(id));
        }
        let (wrap, filter) = sampler(document, source.sampler, &own)?;
        let mapping = Mapping::Uv { set: uv_set, transform: matrix };
        let decoded = self.pictures.decoded(image, encoding);
        let is_to_come = decoded.is_none();
        let picture = decoded.unwrap_or_else(|| Arc::clone(&self.to_come));
        let texture = ImageTexture { image: picture, wrap, filter, mapping, invert: false };
        let id = self.push_texture(Texture::Image(texture));
        if is_to_come {
            self.pictures.ask(document, (image, &format!("{own}.source")), encoding, id)?;
        }
        self.texture_ids.insert(key, id);
        Ok(Some(id))
    }

    /// Decodes the pictures of all textures, and gives them.
    pub(super) fn load_pictures(&mut self) -> Result<HashMap<(usize, Encoding), Arc<Image>>, SceneError> {
        std::mem::replace(&mut self.pictures, Pictures::new(HashMap::new())).load(&mut self.textures)
    }

    pub(super) fn push_texture(&mut self, texture: Texture) -> TextureId {
        self.textures.push(texture);
        TextureId(self.textures.len() as u32 - 1)
    }
}

/// Translation after rotation after scale, as KHR_texture_transform says; the rotation is counter-clockwise as
/// seen, with v pointing down.
fn affine(transform: &schema::TextureTransform) -> Affine2 {
    let rotation = Mat2::from_angle(-transform.rotation);
    let scale = Mat2::from_diagonal(Vec2::from_array(transform.scale));
    Affine2::from_mat2_translation(rotation * scale, Vec2::from_array(transform.offset))
}

fn sampler(
    document: &Document<'_>,
    index: Option<usize>,
    place: &str,
) -> Result<([Wrap; 2], TexelFilter), SceneError> {
    let Some(index) = index else { return Ok(Default::default()) };
    let sampler = document.get(&document.root.samplers, index, "samplers", &format!("{place}.sampler"))?;
    let wrap = |code: Option<u32>, name: &str| match code {
        None | Some(10497) => Ok(Wrap::Repeat),
        Some(33071) => Ok(Wrap::Clamp),
        Some(33648) => Ok(Wrap::Mirror),
        Some(code) => {
            let message = format!("is {code}, expected 10497, 33071 or 33648");
            Err(document.invalid(&format!("samplers[{index}].{name}"), message))
        }
    };
    let filter = match sampler.mag_filter {
        None | Some(9729) => TexelFilter::Linear,
        Some(9728) => TexelFilter::Nearest,
        Some(code) => {
            let message = format!("is {code}, expected 9728 or 9729");
            return Err(document.invalid(&format!("samplers[{index}].magFilter"), message));
        }
    };
    Ok(([wrap(sampler.wrap_s, "wrapS")?, wrap(sampler.wrap_t, "wrapT")?], filter))
}
