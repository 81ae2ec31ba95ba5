//! Moving a camera by hand: around a point, sideways, and nearer.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Mat3A, Quat, Vec3};
use quietus_trace::desc::{Camera, FrameAxis, Projection};
use serde::Deserialize;

/// A move of the hand, in shares of the picture's height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Motion {
    /// Around the pivot: to the right and down. The whole height is half a turn.
    pub orbit: [f32; 2],
    /// With what is seen at the pivot: to the right and down.
    pub pan: [f32; 2],
    /// Nearer to the pivot, by this power of two.
    pub dolly: f32,
}

/// Turns and ways of one motion beyond this say that something else than a hand moved.
const MOST: f32 = 16.0;

/// How near to straight up or down an orbit goes, in radians: beyond, left and right would change places.
const FROM_POLE: f32 = 0.02;

/// The camera after a move around the point at `distance` before it, which may change, too. `None` where the motion
/// makes no sense.
pub fn moved(camera: &Camera, distance: &mut f32, motion: &Motion) -> Option<Camera> {
    let Motion { orbit, pan, dolly } = *motion;
    let parts = [orbit[0], orbit[1], pan[0], pan[1], dolly];
    let makes_sense = parts.iter().all(|part| part.abs() <= MOST);
    let is_somewhere = *distance > 0.0 && distance.is_finite();
    if !makes_sense || !is_somewhere {
        return None;
    }
    let axes = camera.to_world.matrix3;
    let eye = Vec3::from(camera.to_world.translation);
    let pivot = eye - Vec3::from(axes.z_axis) * *distance;
    let turned = turn(axes, orbit);
    let nearer = 2.0_f32.powf(-dolly);
    let height = picture_height(camera, *distance);
    *distance *= nearer;
    let shift = Vec3::from(turned.x_axis) * -pan[0] + Vec3::from(turned.y_axis) * pan[1];
    let eye = pivot + shift * height + Vec3::from(turned.z_axis) * *distance;
    let to_world = Affine3A::from_mat3_translation(turned.into(), eye);
    let projection = match camera.projection {
        Projection::Orthographic { extent, axis } => {
            Projection::Orthographic { extent: extent * nearer, axis }
        }
        other => other,
    };
    let focus_distance = camera.focus_distance * nearer;
    let camera = Camera { to_world, end_to_world: None, projection, focus_distance, ..camera.clone() };
    (to_world.is_finite() && *distance > 0.0).then_some(camera)
}

/// Turns camera axes around the world's y and their own x, without passing over a pole.
fn turn(axes: Mat3A, [right, down]: [f32; 2]) -> Mat3A {
    let yaw = Quat::from_rotation_y(-right * std::f32::consts::PI);
    // Elevation of the eye over the pivot; dragging down lifts it.
    let elevation = axes.z_axis.y.clamp(-1.0, 1.0).asin();
    let limit = FRAC_PI_2 - FROM_POLE;
    let lifted = (elevation + down * std::f32::consts::PI)
        .clamp(-limit.max(elevation.abs()), limit.max(elevation.abs()));
    let pitch = Quat::from_axis_angle(Vec3::from(axes.x_axis), elevation - lifted);
    let turned = Mat3A::from_quat(yaw) * Mat3A::from_quat(pitch) * axes;
    // Many small turns must not add up to a skew.
    let z = turned.z_axis.normalize();
    let x = (turned.x_axis - z * turned.x_axis.dot(z)).normalize();
    let side = if axes.determinant() < 0.0 { -1.0 } else { 1.0 };
    Mat3A::from_cols(x, z.cross(x) * side, z)
}

/// Height of what the picture shows at `distance`, in the world; roughly, where the picture is higher than wide.
fn picture_height(camera: &Camera, distance: f32) -> f32 {
    let aspect = camera.aspect.filter(|aspect| *aspect > 0.0).unwrap_or(1.0);
    let whole = |side: f32, axis| match axis {
        FrameAxis::Vertical => side,
        FrameAxis::Shorter => side / aspect.min(1.0),
    };
    match camera.projection {
        Projection::Perspective { fov, axis } => whole(2.0 * distance * (0.5 * fov).tan(), axis),
        Projection::Orthographic { extent, axis } => whole(extent, axis),
        Projection::Spherical | Projection::EqualArea => std::f32::consts::PI * distance,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::perspective("", Affine3A::from_translation(Vec3::new(0.0, 0.0, 5.0)), FRAC_PI_2)
    }

    /// Where the pivot is in the camera's own axes.
    fn seen(camera: &Camera, pivot: Vec3) -> Vec3 {
        camera.to_world.inverse().transform_point3(pivot)
    }

    #[test]
    fn an_orbit_keeps_its_pivot_in_the_middle_and_at_its_distance() {
        let (mut camera, mut distance) = (camera(), 5.0);
        for step in 0..200 {
            let motion = Motion { orbit: [0.03, 0.02 * (step as f32 * 0.1).sin()], ..Motion::default() };
            camera = moved(&camera, &mut distance, &motion).unwrap();
            assert!(seen(&camera, Vec3::ZERO).distance(Vec3::new(0.0, 0.0, -5.0)) < 1e-3);
            let m = camera.to_world.matrix3;
            assert!((m.transpose() * m - Mat3A::IDENTITY).abs_diff_eq(Mat3A::ZERO, 1e-5));
            assert!(m.x_axis.y.abs() < 1e-4, "the horizon stays level");
        }
    }

    #[test]
    fn an_orbit_stops_before_the_poles() {
        for down in [3.0, -3.0] {
            let mut distance = 5.0;
            let motion = Motion { orbit: [0.0, down], ..Motion::default() };
            let turned = moved(&camera(), &mut distance, &motion).unwrap();
            let elevation = turned.to_world.matrix3.z_axis.y.asin();
            assert!((elevation.abs() - (FRAC_PI_2 - FROM_POLE)).abs() < 1e-3);
            assert_eq!(elevation > 0.0, down > 0.0);
        }
    }

    #[test]
    fn a_pan_of_the_whole_height_moves_the_pivot_from_the_middle_to_the_height_of_the_picture() {
        let mut distance = 5.0;
        let motion = Motion { pan: [0.0, 0.5], ..Motion::default() };
        let panned = moved(&camera(), &mut distance, &motion).unwrap();
        // A right angle of view sees as high as it is far to each side; down by half the height is the lower edge.
        assert!(seen(&panned, Vec3::ZERO).distance(Vec3::new(0.0, -5.0, -5.0)) < 1e-4);
    }

    #[test]
    fn a_dolly_halves_the_distance() {
        let mut distance = 5.0;
        let motion = Motion { dolly: 1.0, ..Motion::default() };
        let nearer = moved(&camera(), &mut distance, &motion).unwrap();
        assert!(
            (distance - 2.5).abs() < 1e-6
                && seen(&nearer, Vec3::ZERO).distance(Vec3::new(0.0, 0.0, -2.5)) < 1e-5
        );
    }

    #[test]
    fn absurd_motions_are_refused() {
        let mut distance = 5.0;
        for value in [f32::NAN, f32::INFINITY, 1e9] {
            let motion = Motion { pan: [value, 0.0], ..Motion::default() };
            assert!(moved(&camera(), &mut distance, &motion).is_none());
        }
        assert_eq!(distance, 5.0);
    }
}
