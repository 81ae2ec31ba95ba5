//! Several skies in one: their pictures are looked up in all directions and added.

use std::sync::Arc;

use glam::{Mat3, Vec3};
use quietus_trace::desc::{Environment, EnvironmentLayout, Image, Texels};
use rayon::prelude::*;

/// The sum of `skies` and of `constant` from everywhere, as a map of latitude and longitude whose texels are as fine as
/// those of the finest of them.
pub(super) fn added(skies: &[Environment], constant: Vec3) -> Environment {
    let height =
        skies.iter().filter_map(|sky| sky.image.as_ref()).map(|image| image.height).max().unwrap_or(1);
    let width = 2 * height;
    let views: Vec<_> = skies.iter().map(Environment::view).collect();
    let row = |y: u32| {
        let theta = std::f32::consts::PI * (y as f32 + 0.5) / height as f32;
        (0..width).map(move |x| (theta, std::f32::consts::TAU * (x as f32 + 0.5) / width as f32))
    };
    let texel = |(theta, turn): (f32, f32)| {
        // Row 0 looks up, +y; the middle column along -z, columns run towards +x.
        let (sine, cosine) = theta.sin_cos();
        let direction = Vec3::new(-sine * turn.sin(), cosine, sine * turn.cos());
        let light: Vec3 = views.iter().map(|view| view(direction)).sum();
        (light + constant).extend(1.0).to_array()
    };
    let rows: Vec<Vec<[f32; 4]>> = (0..height).into_par_iter().map(|y| row(y).map(texel).collect()).collect();
    let texels = Texels::Float(rows.concat());
    let name = "several skies".to_owned();
    Environment {
        image: Some(Arc::new(Image { name, width, height, texels })),
        layout: EnvironmentLayout::LatLong,
        scale: Vec3::ONE,
        to_world: Mat3::IDENTITY,
        portal: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(width: u32, height: u32, layout: EnvironmentLayout, to_world: Mat3) -> Environment {
        let texel = |i: u32| [(i % 7) as f32, (i % 5) as f32, (i % 3) as f32, 1.0];
        let texels = Texels::Float((0..width * height).map(texel).collect());
        let image = Image { name: String::new(), width, height, texels };
        Environment { image: Some(Arc::new(image)), layout, scale: Vec3::splat(0.5), to_world, portal: None }
    }

    /// In the middle of its texels the sum shows what its parts show there.
    #[test]
    fn skies_add_up() {
        let turned = Mat3::from_rotation_x(0.7) * Mat3::from_rotation_y(-1.3);
        let skies = [
            sky(16, 8, EnvironmentLayout::LatLong, turned),
            sky(12, 12, EnvironmentLayout::EqualArea, Mat3::from_rotation_z(0.4)),
        ];
        let constant = Vec3::new(0.1, 0.2, 0.3);
        let sum = added(&skies, constant);
        assert_eq!(sum.image.as_ref().map(|image| (image.width, image.height)), Some((24, 12)));
        let (view, parts) = (sum.view(), [skies[0].view(), skies[1].view()]);
        for i in 0..24 * 12 {
            let theta = std::f32::consts::PI * ((i / 24) as f32 + 0.5) / 12.0;
            let phi = std::f32::consts::TAU * ((i % 24) as f32 + 0.5) / 24.0;
            let direction = Vec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
            let expected = parts[0](direction) + parts[1](direction) + constant;
            assert!((view(direction) - expected).abs().max_element() < 1e-2, "{direction}");
        }
    }
}
