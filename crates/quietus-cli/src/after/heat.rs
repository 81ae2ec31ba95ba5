//! Values of pixels as colours, with a legend in their units.
//!
//! Colours go from black over purple and orange to pale yellow: lightness rises all the way, so that they can be told
//! apart by eyes that do not see all colours, and in print without any.

use font8x8::{BASIC_FONTS, UnicodeFonts};
use quietus_eval::report::heat;

use super::significant;

/// How values spread over the colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// Evenly, from the first to the second.
    Linear(f64, f64),
    /// By their logarithms; both are above 0.
    Logarithmic(f64, f64),
}

impl Scale {
    /// From the smallest to the largest of the values above 0, by logarithms; without any, from 1 to 2.
    pub(super) fn logarithmic(values: &[f32]) -> Self {
        let positive =
            values.iter().filter(|value| **value > 0.0 && value.is_finite()).map(|&value| f64::from(value));
        let (low, high) = positive.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        match low < high {
            true => Self::Logarithmic(low, high),
            false if high > 0.0 => Self::Logarithmic(high, 2.0 * high),
            false => Self::Logarithmic(1.0, 2.0),
        }
    }

    /// Where `value` is on the scale, 0..=1; what is no number is at its beginning.
    fn place(self, value: f64) -> f64 {
        let place = match self {
            Self::Linear(low, high) => (value - low) / (high - low),
            Self::Logarithmic(low, high) => (value.max(low) / low).ln() / (high / low).ln(),
        };
        if place > 0.0 { place.min(1.0) } else { 0.0 }
    }

    /// At most five round values on the scale.
    fn ticks(self) -> Vec<f64> {
        const MOST: usize = 5;
        match self {
            Self::Linear(low, high) => {
                let magnitude = 10.0_f64.powf(((high - low) / MOST as f64).log10().floor());
                let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * magnitude);
                let ticks = |step: f64| -> Vec<f64> {
                    let first = (low / step).ceil() as i64;
                    (first..)
                        .map(|k| k as f64 * step)
                        .take_while(|tick| *tick <= high * (1.0 + 1e-9))
                        .take(MOST + 1)
                        .collect()
                };
                steps.into_iter().map(ticks).find(|ticks| ticks.len() <= MOST).unwrap_or_default()
            }
            Self::Logarithmic(low, high) => {
                let (first, last) = (low.log2().ceil() as i32, high.log2().floor() as i32);
                let step = usize::try_from(last - first).unwrap_or(0) / MOST + 1;
                (first..=last).step_by(step).map(|power| f64::from(power).exp2()).collect()
            }
        }
    }
}

/// A picture of values.
pub(super) struct HeatMap<'a> {
    /// Width and height.
    pub size: [u32; 2],
    /// One value per pixel, row by row from the top.
    pub values: &'a [f32],
    /// What the values are, and in what unit.
    pub title: &'a str,
    /// How they are spread.
    pub scale: Scale,
}

/// Columns and rows of a letter before it is magnified.
const LETTER: usize = 8;
/// Columns of the shortest legend that can be read, in letters.
const LEAST_LETTERS: usize = 24;
const BACKGROUND: [u8; 3] = [24; 3];
const INK: [u8; 3] = [230; 3];

/// Pixels in the making.
struct Canvas {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Canvas {
    fn fill(
        &mut self,
        columns: std::ops::Range<usize>,
        rows: std::ops::Range<usize>,
        color: impl Fn(usize) -> [u8; 3],
    ) {
        for y in rows {
            for x in columns.clone() {
                self.pixels[y * self.width + x] = color(x);
            }
        }
    }

    /// Letters whose upper left corner is at (`x`, `y`), each pixel `zoom` wide. What does not fit is cut off.
    fn text(&mut self, x: usize, y: usize, zoom: usize, text: &str) {
        for (i, letter) in text.chars().enumerate() {
            let rows = BASIC_FONTS.get(letter).unwrap_or_default();
            for (row, column) in (0..LETTER).flat_map(|row| (0..LETTER).map(move |column| (row, column))) {
                let left = x + (i * LETTER + column) * zoom;
                if rows[row] >> column & 1 == 1 && left + zoom <= self.width {
                    let top = y + row * zoom;
                    self.fill(left..left + zoom, top..top + zoom, |_| INK);
                }
            }
        }
    }
}

/// How often letters are magnified: they can be read where the whole picture is seen on a screen.
fn zoom(size: [u32; 2]) -> usize {
    (size[0].max(size[1]) as usize / 700).max(1)
}

impl HeatMap<'_> {
    /// Whether the legend below a picture of this size has room for all of a title.
    pub(super) fn has_room_for(title: &str, size: [u32; 2]) -> bool {
        (title.chars().count() + 2) * LETTER * zoom(size) <= size[0] as usize
    }

    /// Width, height and pixels of the values as colours, and below them the legend.
    pub(super) fn draw(&self) -> ([u32; 2], Vec<[u8; 3]>) {
        let [width, height] = self.size.map(|side| side as usize);
        let zoom = zoom(self.size);
        let line = LETTER * zoom;
        let canvas_width = width.max(LEAST_LETTERS * line);
        let canvas_height = height + 6 * line;
        let mut canvas =
            Canvas { width: canvas_width, pixels: vec![BACKGROUND; canvas_width * canvas_height] };
        for (row, values) in self.values.chunks_exact(width).enumerate() {
            canvas.fill(0..width, row..row + 1, |x| heat(self.scale.place(f64::from(values[x]))));
        }
        self.legend(&mut canvas, height + line / 2, zoom);
        ([canvas_width as u32, canvas_height as u32], canvas.pixels)
    }

    /// Title, colours, ticks with their values.
    fn legend(&self, canvas: &mut Canvas, top: usize, zoom: usize) {
        let line = LETTER * zoom;
        let (left, right) = (line, canvas.width - line);
        let length = right - left;
        canvas.text(left, top, zoom, self.title);
        let bar = top + line + line / 2;
        canvas.fill(left..right, bar..bar + line + line / 2, |x| heat((x - left) as f64 / length as f64));
        for tick in self.scale.ticks() {
            let x = left + (self.scale.place(tick) * (length - 1) as f64) as usize;
            let below = bar + line + line / 2;
            canvas.fill(x..(x + zoom).min(right), below..below + line / 2, |_| INK);
            let label = label(tick);
            let half = label.len() * line / 2;
            let start = x.saturating_sub(half).min(canvas.width.saturating_sub(label.len() * line));
            canvas.text(start, below + line / 2 + zoom, zoom, &label);
        }
    }
}

/// At most three digits that matter, without a row of zeros.
fn label(value: f64) -> String {
    match value.abs() {
        0.0 | 1e-3..1e5 => significant(value, 3),
        _ => format!("{value:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_few_and_inside() {
        assert_eq!(Scale::Linear(0.0, 1.0).ticks(), [0.0, 0.5, 1.0]);
        assert_eq!(Scale::Linear(0.0, 42.0).ticks(), [0.0, 10.0, 20.0, 30.0, 40.0]);
        assert_eq!(Scale::Logarithmic(16.0, 256.0).ticks(), [16.0, 32.0, 64.0, 128.0, 256.0]);
        assert_eq!(Scale::Logarithmic(10.0, 4096.0).ticks(), [16.0, 64.0, 256.0, 1024.0, 4096.0]);
        for i in 1..200 {
            let (low, high) = (0.37 * f64::from(i), 0.37 * f64::from(i) + f64::from(i * i));
            for scale in [Scale::Linear(low, high), Scale::Logarithmic(low, high)] {
                let ticks = scale.ticks();
                assert!(
                    ticks.len() <= 5 && ticks.iter().all(|tick| (low..=high).contains(tick)),
                    "{scale:?} {ticks:?}"
                );
            }
        }
    }

    #[test]
    fn places_rise_from_0_to_1() {
        for scale in [Scale::Linear(1.0, 9.0), Scale::Logarithmic(1.0, 9.0)] {
            assert_eq!((scale.place(1.0), scale.place(9.0)), (0.0, 1.0));
            assert_eq!((scale.place(0.0), scale.place(99.0), scale.place(f64::NAN)), (0.0, 1.0, 0.0));
            assert!(scale.place(3.0) > 0.0 && scale.place(3.0) < 1.0);
        }
        assert_eq!(Scale::logarithmic(&[0.0, 4.0, 64.0, f32::NAN]), Scale::Logarithmic(4.0, 64.0));
        assert_eq!(Scale::logarithmic(&[8.0, 8.0]), Scale::Logarithmic(8.0, 16.0));
        assert_eq!(Scale::logarithmic(&[]), Scale::Logarithmic(1.0, 2.0));
    }

    #[test]
    fn a_map_keeps_its_pixels_and_gets_a_legend() {
        let map = HeatMap {
            size: [3, 2],
            values: &[0.0, 1.0, 0.0, 0.0, 0.0, 0.5],
            title: "error",
            scale: Scale::Linear(0.0, 1.0),
        };
        let ([width, height], pixels) = map.draw();
        assert_eq!((width, height, pixels.len()), (24 * 8, 2 + 48, 24 * 8 * 50));
        assert_eq!((pixels[0], pixels[1], pixels[width as usize + 2]), (heat(0.0), heat(1.0), heat(0.5)));
        assert_eq!(pixels[3], BACKGROUND, "beside a picture that is narrower than its legend");
        assert!(pixels.iter().filter(|pixel| **pixel == INK).count() > 50, "letters");
    }
}
