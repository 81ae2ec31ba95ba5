//! The camera, and when its shutter is open.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2};
use quietus_trace::desc::{Camera, FrameAxis, MediumId, Projection};

use super::draft::Entity;
use super::fault::{Context, Fault, Result, unknown};
use super::lens::Lens;
use super::params::Params;
use super::transform::{Moving, Parts, single, uniform_scale};

/// Every type of camera.
const KINDS: [&str; 4] = ["orthographic", "perspective", "realistic", "spherical"];

/// When the shutter opens and closes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shutter {
    pub open: f32,
    pub close: f32,
}

impl Shutter {
    /// Of the camera of the scene.
    pub(super) fn of(camera: Option<&Entity>) -> Result<Self> {
        let Some(Entity { params, .. }) = camera else { return Ok(Self { open: 0.0, close: 1.0 }) };
        let (open, close) = (params.float("shutteropen", 0.0)?, params.float("shutterclose", 1.0)?);
        if close > open {
            return Ok(Self { open, close });
        }
        let message = format!("the shutter opens at {open} and closes at {close}, expected a later time");
        Err(Fault::invalid(params.place_of("shutterclose"), message))
    }
}

/// pbrt's own camera, for scenes without one.
pub(super) fn default(size: [u32; 2]) -> Camera {
    let to_world = single(DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0)));
    let projection = Projection::Perspective { fov: 90_f32.to_radians(), axis: FrameAxis::Shorter };
    let aspect = Some(size[0] as f32 / size[1] as f32);
    Camera { projection, aspect, ..Camera::perspective("camera", to_world, 1.0) }
}

/// Reads a camera; `size` is that of the picture, `lens` what stands for its lenses if it has some.
pub(super) fn read(
    entity: &Entity,
    to_world: Moving,
    medium: Option<MediumId>,
    (size, lens): ([u32; 2], Option<Lens>),
    context: &Context,
) -> Result<Camera> {
    let params = &entity.params;
    let aspect = size[0] as f32 / size[1] as f32;
    let scale = camera_scale(params, to_world, context);
    let mut turned = upright(to_world);
    let (mut lens_radius, mut focus) = thin_lens(params, scale)?;
    let mut screen = Screen::default();
    let mut lenses = None;
    let projection = match &*entity.kind {
        "perspective" => {
            screen = Screen::read(params, aspect)?;
            perspective(params, &screen)?
        }
        "orthographic" => {
            screen = Screen::read(params, aspect)?;
            Projection::Orthographic { extent: 2.0 * screen.extent * scale, axis: screen.axis }
        }
        "spherical" => all_round(params, &mut turned)?,
        "realistic" => {
            let lens = lens.unwrap_or_else(|| unreachable!("realistic cameras have lenses"));
            (lens_radius, focus) = (scale * lens.thin.radius as f32, scale * lens.thin.object as f32);
            lenses = Some(Arc::new(lens.lenses(scale)));
            Projection::Perspective { fov: lens.fov() as f32, axis: FrameAxis::Vertical }
        }
        kind => return Err(Fault::invalid(params.place, unknown("camera", kind, &KINDS))),
    };
    Shutter::of(Some(entity))?;
    params.finish()?;
    // pbrt's cameras look along +z, ours along -z.
    let [start, end] =
        turned.after(Moving::still(DAffine3::from_scale(DVec3::new(1.0, 1.0, -1.0)))).0.map(single);
    Ok(Camera {
        name: "camera".to_owned(),
        to_world: start,
        end_to_world: (!turned.is_still()).then_some(end),
        projection,
        shift: screen.shift,
        pixel_aspect: screen.pixel_aspect,
        lenses,
        aspect: Some(aspect),
        lens_radius,
        focus_distance: focus,
        medium,
    })
}

/// Radius and distance of focus of a lens without thickness.
fn thin_lens(params: &Params, scale: f32) -> Result<(f32, f32)> {
    let radius = params.float_where("lensradius", 0.0, |radius| radius >= 0.0, "at least 0")?;
    let focus = params.float_where("focaldistance", 1e6, |distance| distance > 0.0, "above 0")?;
    Ok((radius * scale, focus * scale))
}

/// A camera that sees every direction; `turned` is its transform, which the mapping may turn.
fn all_round(params: &Params, turned: &mut Moving) -> Result<Projection> {
    let mapping = params.choice("mapping", &["equalarea", "equirectangular"])?;
    params.ignore(&["frameaspectratio", "screenwindow"]);
    if mapping == "equalarea" {
        return Ok(Projection::EqualArea);
    }
    // The middle of the picture looks along -x of the camera's space.
    let axes = DMat3::from_cols(DVec3::NEG_Z, DVec3::Y, DVec3::NEG_X);
    *turned = turned.after(Moving::still(DAffine3::from_mat3(axes)));
    Ok(Projection::Spherical)
}

/// How much longer lengths of the camera's space are in the world.
fn camera_scale(params: &Params, to_world: Moving, context: &Context) -> f32 {
    let scales = to_world.0.map(|transform| uniform_scale(&transform));
    match scales {
        [Some(scale), Some(_)] => scale as f32,
        _ => {
            context.warn(params.place, "a camera that is stretched is only turned");
            1.0
        }
    }
}

/// The transforms without their scale, but with their mirrors.
fn upright(to_world: Moving) -> Moving {
    Moving(to_world.0.map(|transform| {
        let axes = match uniform_scale(&transform) {
            Some(scale) => transform.matrix3 * (1.0 / scale),
            None => {
                let parts = Parts::of(transform);
                let mirror = if parts.scale.determinant() < 0.0 { -1.0 } else { 1.0 };
                DMat3::from_quat(parts.rotation) * DMat3::from_diagonal(DVec3::new(mirror, 1.0, 1.0))
            }
        };
        DAffine3::from_mat3_translation(axes, transform.translation)
    }))
}

/// What part of the plane of the picture the film shows. The field of view spans 1 to both sides of its middle.
#[derive(Clone, Copy, Debug)]
struct Screen {
    /// Half of what is shown along an axis.
    extent: f32,
    axis: FrameAxis,
    /// As in [`Camera::shift`] and [`Camera::pixel_aspect`].
    shift: Vec2,
    pixel_aspect: f32,
}

impl Default for Screen {
    fn default() -> Self {
        Self { extent: 1.0, axis: FrameAxis::Shorter, shift: Vec2::ZERO, pixel_aspect: 1.0 }
    }
}

impl Screen {
    /// `aspect` is the width of the film over its height.
    fn read(params: &Params, aspect: f32) -> Result<Self> {
        let frame = params.float_option("frameaspectratio")?;
        let window = params.floats("screenwindow")?;
        match (window, frame) {
            (&[x0, x1, y0, y1], _) => {
                if !(x0 < x1 && y0 < y1) {
                    let message = "\"screenwindow\" is empty, expected x0 < x1 and y0 < y1";
                    return Err(Fault::invalid(params.place_of("screenwindow"), message));
                }
                let [low, high] = [DVec2::new(x0.into(), y0.into()), DVec2::new(x1.into(), y1.into())];
                let size = high - low;
                Ok(Self {
                    extent: (0.5 * size.y) as f32,
                    axis: FrameAxis::Vertical,
                    shift: (0.5 * (low + high) / size).as_vec2(),
                    pixel_aspect: (size.x / size.y) as f32 / aspect,
                })
            }
            ([], Some(frame)) if frame > 0.0 => {
                let extent = if frame >= 1.0 { 1.0 } else { 1.0 / frame };
                let pixel_aspect = frame / aspect;
                Ok(Self { extent, axis: FrameAxis::Vertical, shift: Vec2::ZERO, pixel_aspect })
            }
            ([], None) => Ok(Self::default()),
            ([], Some(_)) => {
                let message = "\"frameaspectratio\" is not above 0";
                Err(Fault::invalid(params.place_of("frameaspectratio"), message))
            }
            _ => {
                let message =
                    format!("\"screenwindow\" has {} values, expected x0, x1, y0, y1", window.len());
                Err(Fault::invalid(params.place_of("screenwindow"), message))
            }
        }
    }
}

fn perspective(params: &Params, screen: &Screen) -> Result<Projection> {
    let expected = "an angle between 0 and 180";
    let degrees = params.float_where("fov", 90.0, |fov| fov > 0.0 && fov < 180.0, expected)?;
    let fov = 2.0 * (screen.extent * (0.5 * degrees.to_radians()).tan()).atan();
    Ok(Projection::Perspective { fov, axis: screen.axis })
}
