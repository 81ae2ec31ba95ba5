//! What the stop of a realistic camera lets through: a picture, or one of the forms that pbrt knows by name. All are as
//! bright as a round opening on the whole.

use std::f64::consts::PI;

use glam::DVec2;
use quietus_trace::desc::Aperture;

use super::fault::{Context, Fault, Result};
use super::images::linear;
use super::params::Params;
use crate::image::{self, Encoding};

/// Columns and rows of the forms that have names.
const SIDE: u32 = 256;

/// The opening that `aperture` asks for; none where it is round.
pub(super) fn read(params: &Params, context: &Context) -> Result<Option<Aperture>> {
    let Some(name) = params.string("aperture")? else { return Ok(None) };
    let place = params.place_of("aperture");
    let (size, weights) = match name {
        "" => return Ok(None),
        "gaussian" => shape(|place| ((-place.length_squared()).exp() - (-1.0_f64).exp()).max(0.0)),
        "square" => shape(|_| 1.0),
        "pentagon" => polygon(&corners(5, |_| 0.8, 0.5 * PI)),
        // As long as the points of a pentagram are.
        "star" => {
            let inner = (0.4 * PI).cos() / (0.2 * PI).cos();
            polygon(&corners(10, |i| if i % 2 == 0 { inner } else { 1.0 }, 0.0))
        }
        file => {
            let mut files = image::Images::default();
            files.request(context.resolve(file), Encoding::Srgb, &context.full_words(place));
            let images = files.load()?;
            let image = &images[0];
            let mean = |[r, g, b, _]: [f32; 4]| f64::from(r + g + b) / 3.0;
            let weights = linear(image.texels.clone()).into_iter().map(mean).collect();
            ([image.width, image.height], weights)
        }
    };
    let sum: f64 = weights.iter().sum();
    if !(sum > 0.0 && sum.is_finite() && weights.iter().all(|weight| *weight >= 0.0)) {
        return Err(Fault::invalid(place, "\"aperture\" lets no light through"));
    }
    let scale = 0.25 * PI * weights.len() as f64 / sum;
    let weights = weights.into_iter().map(|weight| (scale * weight) as f32).collect();
    Ok(Some(Aperture { size, weights }))
}

/// Columns and rows, and the values of `weight` in the middles of texels, whose places are in -1..1, row by row from -1.
fn shape(weight: impl Fn(DVec2) -> f64) -> ([u32; 2], Vec<f64>) {
    let place = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(SIDE) - 1.0;
    let texels = (0..SIDE * SIDE).map(|i| weight(DVec2::new(place(i % SIDE), place(i / SIDE))));
    ([SIDE; 2], texels.collect())
}

/// What lies inside of a polygon: where a ray to one side crosses its edges an odd number of times.
fn polygon(corners: &[DVec2]) -> ([u32; 2], Vec<f64>) {
    shape(|place| {
        let mut inside = false;
        let mut last = corners[corners.len() - 1];
        for &corner in corners {
            let crosses = (corner.y > place.y) != (last.y > place.y);
            let at = (last.x - corner.x) * (place.y - corner.y) / (last.y - corner.y) + corner.x;
            inside ^= crosses && place.x < at;
            last = corner;
        }
        f64::from(u8::from(inside))
    })
}

/// Corners around the middle, the first one at `angle`.
fn corners(count: usize, radius: impl Fn(usize) -> f64, angle: f64) -> Vec<DVec2> {
    let step = 2.0 * PI / count as f64;
    (0..count).map(|i| radius(i) * DVec2::from_angle(angle + step * i as f64)).collect()
}
