//! Lights without extent that send a picture: into all directions (goniometric diagrams) or through a window
//! (projectors).

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::bounds::LightBounds;
use super::layout::equal_area_place;
use super::luminance;
use crate::bvh::Bounds;
use crate::desc::{Image, PictureSpread, Texels};
use crate::texture::srgb_to_linear;

/// Widens a projector's cone, in radians: more than cosines are rounded by.
const MARGIN: f32 = 1e-3;

/// A picture that shines from a point, ready to be sampled.
#[derive(Clone, Debug)]
pub(crate) struct PictureLight {
    pub(super) position: Vec3,
    from_world: Mat3,
    intensity: Vec3,
    image: Arc<Image>,
    spread: PictureSpread,
    /// Luminance of the power it sends out.
    pub(super) power: f32,
}

impl PictureLight {
    /// Compiles a light whose numbers have been checked.
    pub(super) fn new(
        position: Vec3,
        from_world: Mat3,
        intensity: Vec3,
        image: &Arc<Image>,
        spread: PictureSpread,
    ) -> Self {
        let power = spread.power(image, |rgb| luminance(rgb * intensity));
        Self { position, from_world, intensity, image: Arc::clone(image), spread, power }
    }

    /// Radiant intensity towards `direction`, of any length.
    #[inline]
    pub(super) fn intensity(&self, direction: Vec3) -> Vec3 {
        let local = self.from_world * direction;
        let place = match self.spread {
            PictureSpread::AllAround => equal_area_place(local.normalize_or(Vec3::Z)),
            PictureSpread::Window { half } => {
                // Also where it is not a number.
                let place = local.truncate() / (local.z * half);
                if !(local.z > 0.0 && place.abs().max_element() <= 1.0) {
                    return Vec3::ZERO;
                }
                0.5 * (place + 1.0)
            }
        };
        let size = [self.image.width, self.image.height];
        let at = |c: f32, n: u32| ((c * n as f32) as u32).min(n - 1);
        self.intensity * color(&self.image, at(place.x, size[0]), at(place.y, size[1]))
    }

    /// Where it stands and shines to.
    pub(super) fn bounds(&self) -> LightBounds {
        let bounds = Bounds { min: self.position, max: self.position };
        let all = LightBounds::omnidirectional(bounds, self.power);
        let PictureSpread::Window { half } = self.spread else { return all };
        let to_world = self.from_world.inverse();
        let axis = (to_world * Vec3::Z).normalize();
        let corners = [Vec2::ONE, Vec2::NEG_ONE, Vec2::new(1.0, -1.0), Vec2::new(-1.0, 1.0)];
        let widest = corners.map(|corner| (to_world * (corner * half).extend(1.0)).angle_between(axis));
        let theta_o = widest.into_iter().fold(0.0, f32::max);
        LightBounds { axis, theta_o, theta_e: MARGIN, ..all }
    }
}

impl PictureSpread {
    /// Power sent out through `image`, of what `measure` says of a texel's intensity.
    pub fn power(&self, image: &Image, measure: impl Fn(Vec3) -> f32) -> f32 {
        let [width, height] = [image.width, image.height];
        // Solid angle of a texel times the number of texels.
        let stretch = |x: u32, y: u32| match self {
            Self::AllAround => 2.0 * TAU,
            Self::Window { half } => {
                let middle = Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                let place = (2.0 * middle - 1.0) * *half;
                4.0 * half.x * half.y / (1.0 + place.length_squared()).powf(1.5)
            }
        };
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let sum: f64 = texels.map(|(x, y)| f64::from(measure(color(image, x, y)) * stretch(x, y))).sum();
        (sum / (f64::from(width) * f64::from(height))) as f32
    }
}

/// Linear RGB of a texel.
fn color(image: &Image, x: u32, y: u32) -> Vec3 {
    let index = y as usize * image.width as usize + x as usize;
    let unit = |[r, g, b, _]: [u8; 4]| Vec3::new(f32::from(r), f32::from(g), f32::from(b)) / 255.0;
    match &image.texels {
        Texels::Float(texels) => Vec3::from_slice(&texels[index][..3]),
        Texels::Linear8(texels) => unit(texels[index]),
        Texels::Srgb8(texels) => unit(texels[index]).map(srgb_to_linear),
    }
}
