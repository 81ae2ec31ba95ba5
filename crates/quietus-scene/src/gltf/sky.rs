//! The sky over scenes that bring no light.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use quietus_trace::desc::{Environment, EnvironmentLayout, Image, Texels};

/// Mean radiance: bluish, and with a luminance below 1 so that white surfaces stay inside of what a picture can show.
const MEAN: Vec3 = Vec3::new(0.72, 0.80, 0.92);

/// Rows of the picture that stands for the soft sky.
const ROWS: u32 = 64;

/// The same radiance from everywhere.
pub(crate) fn even() -> Environment {
    Environment {
        image: None,
        layout: EnvironmentLayout::LatLong,
        scale: MEAN,
        to_world: Mat3::IDENTITY,
        portal: None,
    }
}

/// Bright above, darker around and below, with the mean of the even one. White things stand out: a diffuse one is brighter
/// than what is behind it at its sides and above, and darker below.
pub(crate) fn soft() -> Environment {
    let texel = |row: u32| {
        let [above, below] = [row, row + 1].map(height_of_edge);
        let value = mean(above, below) as f32;
        [value, value, value, 1.0]
    };
    let image = Image {
        name: "sky".to_owned(),
        width: 1,
        height: ROWS,
        texels: Texels::Float((0..ROWS).map(texel).collect()),
    };
    Environment { image: Some(Arc::new(image)), ..even() }
}

/// The cosine with the zenith at the upper edge of a row.
fn height_of_edge(row: u32) -> f64 {
    (std::f64::consts::PI * f64::from(row) / f64::from(ROWS)).cos()
}

/// Mean, between two heights, of `1 + 0.45 y + 0.25 P2(y)` with Legendre's polynomial P2: over the whole sphere it is 1.
fn mean(above: f64, below: f64) -> f64 {
    let integral = |y: f64| y + 0.45 * y * y / 2.0 + 0.25 * (y * y * y - y) / 2.0;
    (integral(above) - integral(below)) / (above - below)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_soft_sky_has_the_mean_of_the_even_one() {
        let sky = soft();
        let Texels::Float(texels) = &sky.image.as_ref().expect("a picture").texels else {
            panic!("expected floats")
        };
        let share = |row: usize| (height_of_edge(row as u32) - height_of_edge(row as u32 + 1)) / 2.0;
        let sum: f64 = texels.iter().enumerate().map(|(row, texel)| f64::from(texel[0]) * share(row)).sum();
        assert!((sum - 1.0).abs() < f64::from(f32::EPSILON) && sky.scale == even().scale, "{sum}");
        // Brightest in the zenith, darkest somewhere below the horizon.
        let values: Vec<_> = texels.iter().map(|texel| texel[0]).collect();
        let [upper, lower] = [&values[..32], &values[32..]].map(|half| half.iter().copied().reduce(f32::min));
        assert!(upper > lower && values.iter().all(|&value| value <= values[0]), "{values:?}");
    }
}
