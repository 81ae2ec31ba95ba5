//! Plots as SVG, and heat maps as PNG.

use std::io::Cursor;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use plotters::prelude::*;

use crate::{EvalError, Method};

/// A line of a plot: points of x, y and the ends of y's interval.
pub(crate) struct Line {
    pub method: Method,
    pub points: Vec<(f64, [f64; 3])>,
}

/// Size of a plot in pixels.
const SIZE: (u32, u32) = (560, 400);

/// A colour for each method, told apart by most eyes (Okabe and Ito 2008).
pub(crate) fn color(method: Method) -> RGBColor {
    match method {
        Method::Uniform => RGBColor(0, 0, 0),
        Method::Tile => RGBColor(230, 159, 0),
        Method::Dammertz => RGBColor(86, 180, 233),
        Method::Pixel => RGBColor(0, 158, 115),
        Method::Talk => RGBColor(204, 121, 167),
        Method::FreeRunning => RGBColor(0, 114, 178),
        Method::Quietus => RGBColor(213, 94, 0),
        Method::Unbiased => RGBColor(128, 128, 128),
    }
}

/// An SVG with both axes logarithmic, labelled x and y; what is not positive is left out.
pub(crate) fn log_plot(title: &str, labels: [&str; 2], lines: &[Line]) -> Result<String, EvalError> {
    let mut svg = String::new();
    draw(&mut svg, title, labels, lines)
        .map_err(|e| EvalError::Request(format!("cannot draw the plot \"{title}\": {e}")))?;
    Ok(svg)
}

fn draw(
    svg: &mut String,
    title: &str,
    [x_label, y_label]: [&str; 2],
    lines: &[Line],
) -> Result<(), Box<dyn std::error::Error>> {
    let positive = |(x, y): &(f64, [f64; 3])| (*x > 0.0 && y[0] > 0.0).then_some((*x, *y));
    let all: Vec<_> = lines.iter().flat_map(|line| line.points.iter().filter_map(positive)).collect();
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        if low < high { low / 1.15..high * 1.15 } else { 0.1..10.0 }
    };
    let xs = range(&mut all.iter().map(|p| p.0));
    let ys = range(&mut all.iter().map(|p| p.1[0]));
    let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(64)
        .build_cartesian_2d(xs.log_scale(), ys.clone().log_scale())?;
    chart.configure_mesh().x_desc(x_label).y_desc(y_label).light_line_style(WHITE).draw()?;
    for line in lines {
        let color = color(line.method);
        let points: Vec<_> = line.points.iter().filter_map(positive).collect();
        chart
            .draw_series(LineSeries::new(points.iter().map(|p| (p.0, p.1[0])), color.stroke_width(2)))?
            .label(line.method.name())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], color.stroke_width(2)));
        chart.draw_series(points.iter().map(|p| Circle::new((p.0, p.1[0]), 3, color.filled())))?;
        let bars = points.iter().filter(|p| p.1[1] > 0.0 && p.1[2].is_finite());
        chart.draw_series(bars.map(|&(x, [_, low, high])| {
            let ends = [low.clamp(ys.start, ys.end), high.clamp(ys.start, ys.end)];
            PathElement::new(ends.map(|y| (x, y)), color.mix(0.5))
        }))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .draw()?;
    root.present()?;
    Ok(())
}

/// A PNG of 8-bit RGB pixels, row by row, each drawn as a square of `zoom` pixels.
pub(crate) fn png(width: u32, pixels: &[[u8; 3]], zoom: u32) -> Result<Vec<u8>, EvalError> {
    let height = pixels.len() as u32 / width;
    let (w, h) = (width * zoom, height * zoom);
    let at = |i: u32| pixels[((i / w / zoom) * width + (i % w) / zoom) as usize];
    let bytes: Vec<u8> = (0..w * h).flat_map(at).collect();
    let mut png = Cursor::new(Vec::new());
    PngEncoder::new(&mut png)
        .write_image(&bytes, w, h, ExtendedColorType::Rgb8)
        .map_err(|e| EvalError::Request(format!("cannot encode a heat map: {e}")))?;
    Ok(png.into_inner())
}

/// Black over purple and orange to pale yellow, for 0..=1: brightness rises evenly.
pub fn heat(value: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] = [
        [0.0, 0.0, 4.0],
        [87.0, 16.0, 110.0],
        [188.0, 55.0, 84.0],
        [249.0, 142.0, 9.0],
        [252.0, 255.0, 164.0],
    ];
    let place = value.clamp(0.0, 1.0) * 4.0;
    let stop = (place as usize).min(3);
    let t = place - stop as f64;
    [0, 1, 2].map(|c| (STOPS[stop][c] + t * (STOPS[stop + 1][c] - STOPS[stop][c])).round() as u8)
}
