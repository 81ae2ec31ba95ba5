//! What a scene file asks of its picture: said by `quietus info`, and by `quietus render` as far as it is followed.

use quietus_trace::desc::PictureDefaults;
use quietus_trace::filter::{Filter, FilterShape};

/// A setting that a scene asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wish {
    /// Its name in statistics and metadata.
    pub name: &'static str,
    /// In words.
    pub text: String,
}

/// Everything that `picture` asks for.
pub(crate) fn wishes(picture: &PictureDefaults) -> Vec<Wish> {
    let PictureDefaults { size, crop, exposure, samples, max_depth, filter, max_component } = picture;
    let wish = |name, text| Wish { name, text };
    let list = [
        size.map(|[width, height]| wish("size", format!("{width}x{height} pixels"))),
        crop.map(|[x0, x1, y0, y1]| {
            wish("crop", format!("columns {x0} to {x1} and rows {y0} to {y1} of a frame of 1"))
        }),
        samples.map(|samples| wish("max_samples", format!("at most {samples} samples per pixel"))),
        max_depth.map(|depth| wish("max_depth", format!("paths of up to {depth} segments"))),
        filter.map(|filter| wish("filter", format!("filter {}", filter_text(&filter)))),
        exposure.map(|e| match e.x == e.y && e.y == e.z {
            true => wish("exposure", format!("exposure {}", e.x)),
            false => wish("exposure", format!("exposure ({}, {}, {})", e.x, e.y, e.z)),
        }),
        max_component.map(|limit| {
            wish(
                "max_component",
                format!("samples darkened to {limit} (energy is lost; --max-component inf)"),
            )
        }),
    ];
    list.into_iter().flatten().collect()
}

/// A filter with its numbers.
fn filter_text(filter: &Filter) -> String {
    let numbers: Vec<String> = filter_parameters(filter.shape)
        .into_iter()
        .map(|(name, value)| format!("{name} {value}, "))
        .collect();
    let radius = match filter.radius.x == filter.radius.y {
        true => filter.radius.x.to_string(),
        false => format!("{} x {}", filter.radius.x, filter.radius.y),
    };
    format!("{} ({}radius {radius})", filter_name(filter.shape), numbers.concat())
}

/// What `--filter` calls it.
pub(crate) fn filter_name(shape: FilterShape) -> &'static str {
    match shape {
        FilterShape::Box => "box",
        FilterShape::Triangle => "triangle",
        FilterShape::Gaussian { .. } => "gaussian",
        FilterShape::BlackmanHarris => "blackman-harris",
        FilterShape::Mitchell { .. } => "mitchell",
        FilterShape::LanczosSinc { .. } => "lanczos-sinc",
    }
}

/// The numbers that tell filters of one name apart.
pub(crate) fn filter_parameters(shape: FilterShape) -> Vec<(&'static str, f32)> {
    match shape {
        FilterShape::Gaussian { sigma } => vec![("sigma", sigma)],
        FilterShape::Mitchell { b, c } => vec![("b", b), ("c", c)],
        FilterShape::LanczosSinc { tau } => vec![("tau", tau)],
        FilterShape::Box | FilterShape::Triangle | FilterShape::BlackmanHarris => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;
    use glam::{Vec2, Vec3};

    use super::*;
    use crate::args::FilterArg;

    #[test]
    fn filters_are_called_as_on_the_command_line() {
        for arg in FilterArg::value_variants() {
            assert_eq!(filter_name(crate::plan::filter(*arg).shape), crate::report::name(*arg));
        }
    }

    #[test]
    fn wishes_are_said_in_words() {
        assert_eq!(wishes(&PictureDefaults::default()), []);
        let shape = FilterShape::Gaussian { sigma: 0.5 };
        let picture = PictureDefaults {
            size: Some([400, 300]),
            crop: Some([0.0, 0.5, 0.25, 1.0]),
            exposure: Some(Vec3::new(1.0, 2.0, 1.0)),
            samples: Some(16),
            max_depth: Some(6),
            filter: Some(Filter { shape, radius: Vec2::new(1.5, 2.0) }),
            max_component: Some(20.0),
        };
        let texts: Vec<_> = wishes(&picture).into_iter().map(|wish| wish.text).collect();
        let expected = [
            "400x300 pixels",
            "columns 0 to 0.5 and rows 0.25 to 1 of a frame of 1",
            "at most 16 samples per pixel",
            "paths of up to 6 segments",
            "filter gaussian (sigma 0.5, radius 1.5 x 2)",
            "exposure (1, 2, 1)",
            "samples darkened to 20 (energy is lost; --max-component inf)",
        ];
        assert_eq!(texts, expected);
    }
}
