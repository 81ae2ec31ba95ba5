//! Placing cameras: looking at a point, and framing a scene that has no camera of its own.

use glam::{Affine3A, Mat3, Vec3};
use quietus_trace::desc::Camera;

/// Camera space to world for a camera at `eye` that looks at `target`, +y up as far as that goes.
pub(crate) fn look_at(eye: Vec3, target: Vec3) -> Affine3A {
    let back = (eye - target).normalize();
    // Looking straight up or down leaves the roll open: -z is then the top of the picture.
    let right = Vec3::Y.cross(back).try_normalize().unwrap_or(Vec3::X);
    Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), eye)
}

/// Vertical angle of view of [`frame`]'s cameras: that of a 50 mm lens on 24 mm of film, which draws things
/// without visible distortion.
const FRAMING_FOV_Y: f32 = 0.471;

/// A camera that shows the whole box `[low, high]` in a picture at least as wide as high: from the front (+z),
/// a third of the way round to the right and a little from above.
pub(crate) fn frame([low, high]: [Vec3; 2]) -> Camera {
    let center = 0.5 * (low + high);
    // Only degenerate boxes are smaller; they get a camera that stands a little off.
    let radius = (0.5 * (high - low).length()).max(1e-6 * center.abs().max_element()).max(1e-6);
    let distance = radius / (0.5 * FRAMING_FOV_Y).sin();
    let eye = center + distance * Vec3::new(0.5, 0.3, 0.8).normalize();
    Camera {
        name: "framing".to_owned(),
        to_world: look_at(eye, center),
        fov_y: FRAMING_FOV_Y,
        aspect: None,
        lens_radius: 0.0,
        focus_distance: distance,
    }
}
