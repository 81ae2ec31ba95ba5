//! References: uniform sampling with many samples from seeds of their own, with the variance of each pixel.

use std::path::Path;

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers,
    SmallVec, Vec2, WritableImage,
};
use quietus_trace::tile::{PixelWork, Sample, SampleSink, render_tile};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{EvalError, Look, Picture, Subject, bank::fingerprint, files::write_atomically, packed};

/// First seed of references by default, far from those of banks: no sample is used on both sides.
pub const REFERENCE_SEED: u64 = 1 << 32;

/// What a reference is made of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ReferenceSpec {
    /// Name of the scene.
    pub scene: String,
    /// How it is looked at.
    pub look: Look,
    /// Independent estimates of each pixel, at least 2; their differences give the variance.
    pub streams: u32,
    /// Samples in each.
    pub samples: u32,
    /// Seed of the first.
    pub seed: u64,
}

/// The best estimate of a picture there is, and how good it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// What it is made of.
    pub spec: ReferenceSpec,
    /// Hash of a few samples: another one is another scene, or another tracer.
    pub fingerprint: u64,
    /// The mean.
    pub mean: Picture,
    /// Variance of the mean in each channel, estimated from the independent streams.
    pub variance: Vec<[f32; 3]>,
    /// Variance of a single sample in each channel.
    pub sample_variance: Vec<[f32; 3]>,
}

impl Reference {
    /// Refuses a black picture: errors and biases are measured relative to what there is.
    ///
    /// # Errors
    /// [`EvalError::Dark`].
    pub fn expect_light(&self) -> Result<(), EvalError> {
        match self.mean.rgb.iter().any(|rgb| *rgb != [0.0; 3]) {
            true => Ok(()),
            false => Err(EvalError::Dark { scene: self.spec.scene.clone() }),
        }
    }

    /// Draws it on all threads of rayon's pool.
    ///
    /// # Errors
    /// Where the scene cannot be drawn, or `spec` makes no sense.
    pub fn render(subject: &Subject, spec: &ReferenceSpec) -> Result<Self, EvalError> {
        if spec.streams < 2 || spec.samples == 0 || spec.look.width == 0 || spec.look.height == 0 {
            let message = format!(
                "a reference of {} streams of {} samples and {}x{} pixels: expected at least 2, 1 and 1x1",
                spec.streams, spec.samples, spec.look.width, spec.look.height
            );
            return Err(EvalError::Request(message));
        }
        let seeds = (0..u64::from(spec.streams)).map(|k| spec.seed.wrapping_add(k));
        let views = seeds.map(|seed| subject.view(&spec.look, seed)).collect::<Result<Vec<_>, _>>()?;
        let pixels: Vec<Moments> = (0..spec.look.pixels() as u32)
            .into_par_iter()
            .map(|pixel| {
                let (x, y) = (pixel % spec.look.width, pixel / spec.look.width);
                let work = PixelWork { x, y, pixel: 0, replicate: 0, first: 0, count: spec.samples };
                let streams = views.iter().map(|view| {
                    let mut sums = Sums::default();
                    render_tile(&subject.scene, view, &[work], &mut sums);
                    sums
                });
                moments(streams)
            })
            .collect();
        let mut mean = Picture::black(spec.look.width, spec.look.height);
        mean.rgb = pixels.iter().map(|m| m.mean).collect();
        Ok(Self {
            spec: spec.clone(),
            fingerprint: fingerprint(subject, &spec.look, spec.seed)?,
            mean,
            variance: pixels.iter().map(|m| m.variance).collect(),
            sample_variance: pixels.iter().map(|m| m.sample_variance).collect(),
        })
    }

    /// Reads the reference of `spec` at `path`, or draws it and keeps it there, also where the tracer draws
    /// the scene differently today. `drawing` is called where it is drawn.
    ///
    /// # Errors
    /// Where the scene cannot be drawn, or the file cannot be written.
    pub fn open_or_render(
        subject: &Subject,
        spec: &ReferenceSpec,
        path: &Path,
        drawing: impl FnOnce(),
    ) -> Result<Self, EvalError> {
        if let Ok(reference) = Self::open(path)
            && reference.spec == *spec
            && reference.fingerprint == fingerprint(subject, &spec.look, spec.seed)?
        {
            return Ok(reference);
        }
        drawing();
        let reference = Self::render(subject, spec)?;
        reference.write(path)?;
        Ok(reference)
    }

    /// Writes it as EXR: `R G B`, `variance.{R,G,B}` of the mean, `sample_variance.{R,G,B}`.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), EvalError> {
        let mut list = SmallVec::new();
        for (prefix, values) in self.planes() {
            for (channel, name) in ["R", "G", "B"].iter().enumerate() {
                let values = values.iter().map(|v| v[channel]).collect();
                list.push(AnyChannel::new(text(&format!("{prefix}{name}")), FlatSamples::F32(values)));
            }
        }
        let mut attributes = LayerAttributes::default();
        let spec = serde_json::to_string(&(&self.spec, self.fingerprint))
            .map_err(|e| EvalError::format(path, format!("cannot describe the reference: {e}")))?;
        attributes.other.insert(text(ATTRIBUTE), AttributeValue::Text(text(&spec)));
        let size = Vec2(self.mean.width as usize, self.mean.height as usize);
        let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
        write_atomically(path, |out| {
            let image = Image::from_layer(layer);
            // The writer must seek: a file in memory is small enough.
            let mut bytes = std::io::Cursor::new(Vec::new());
            image.write().to_buffered(&mut bytes).map_err(|e| EvalError::format(path, e.to_string()))?;
            std::io::Write::write_all(out, bytes.get_ref()).map_err(EvalError::io(path))
        })
    }

    fn planes(&self) -> [(&'static str, &[[f32; 3]]); 3] {
        [("", &self.mean.rgb), ("variance.", &self.variance), ("sample_variance.", &self.sample_variance)]
    }

    /// Reads what [`Self::write`] wrote.
    ///
    /// # Errors
    /// Where the file cannot be read, or is no reference.
    pub fn open(path: &Path) -> Result<Self, EvalError> {
        let bytes = std::fs::read(path).map_err(EvalError::io(path))?;
        Self::from_bytes(path, bytes)
    }

    fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Self, EvalError> {
        let bad = |message: String| EvalError::format(path, message);
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(std::io::Cursor::new(bytes))
            .map_err(|e| bad(format!("not a readable OpenEXR file: {e}")))?;
        let layer = &image.layer_data;
        let spec = match layer.attributes.other.get(&text(ATTRIBUTE)) {
            Some(AttributeValue::Text(spec)) => String::from_utf8_lossy(spec.bytes()).into_owned(),
            _ => return Err(bad(format!("not a reference: it has no attribute \"{ATTRIBUTE}\""))),
        };
        let (spec, fingerprint): (ReferenceSpec, u64) =
            serde_json::from_str(&spec).map_err(|e| bad(format!("attribute \"{ATTRIBUTE}\": {e}")))?;
        let size = [spec.look.width as usize, spec.look.height as usize];
        if [layer.size.0, layer.size.1] != size {
            return Err(bad(format!("the picture is {:?}, its attribute says {size:?}", layer.size)));
        }
        let plane = |prefix: &str| -> Result<Vec<[f32; 3]>, EvalError> {
            let mut pixels = vec![[0.0; 3]; size[0] * size[1]];
            for (channel, suffix) in ["R", "G", "B"].iter().enumerate() {
                let name = format!("{prefix}{suffix}");
                let found = layer.channel_data.list.iter().find(|c| c.name == text(&name));
                let Some(AnyChannel { sample_data: FlatSamples::F32(values), .. }) = found else {
                    return Err(bad(format!("it has no channel \"{name}\" of 32-bit floats")));
                };
                pixels.iter_mut().zip(values).for_each(|(pixel, &value)| pixel[channel] = value);
            }
            Ok(pixels)
        };
        let mean = Picture { width: spec.look.width, height: spec.look.height, rgb: plane("")? };
        Ok(Self {
            mean,
            variance: plane("variance.")?,
            sample_variance: plane("sample_variance.")?,
            fingerprint,
            spec,
        })
    }

    /// Samples of a pixel.
    pub fn samples_per_pixel(&self) -> u64 {
        u64::from(self.spec.streams) * u64::from(self.spec.samples)
    }
}

/// Holds [`ReferenceSpec`] and fingerprint as JSON.
const ATTRIBUTE: &str = "quietus.reference";

fn text(value: &str) -> Text {
    Text::from_bytes_unchecked(SmallVec::from_slice(value.as_bytes()))
}

/// Sums of one stream of one pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    count: u32,
    sum: [f64; 3],
    squares: [f64; 3],
}

impl SampleSink for Sums {
    fn add(&mut self, _: &PixelWork, _: u32, sample: &Sample) {
        let values = sample.radiance.to_array();
        if !values.iter().all(|v| v.abs() <= packed::MAX_RADIANCE) {
            return;
        }
        self.count += 1;
        for (channel, value) in values.into_iter().enumerate() {
            self.sum[channel] += f64::from(value);
            self.squares[channel] += f64::from(value).powi(2);
        }
    }
}

#[derive(Clone, Copy)]
struct Moments {
    mean: [f32; 3],
    variance: [f32; 3],
    sample_variance: [f32; 3],
}

/// Mean of all samples, variance of the mean from the differences of the streams, and variance of a sample.
fn moments(streams: impl Iterator<Item = Sums>) -> Moments {
    let streams: Vec<Sums> = streams.filter(|s| s.count > 0).collect();
    let n: f64 = streams.iter().map(|s| f64::from(s.count)).sum();
    let s = streams.len() as f64;
    let of = |channel: usize| {
        let mean = streams.iter().map(|s| s.sum[channel]).sum::<f64>() / n;
        let spread =
            streams.iter().map(|s| (s.sum[channel] / f64::from(s.count) - mean).powi(2)).sum::<f64>();
        let square = streams.iter().map(|s| s.squares[channel]).sum::<f64>() / n;
        (mean, spread / (s - 1.0) / s, (square - mean * mean).max(0.0) * n / (n - 1.0))
    };
    let channels = [0, 1, 2].map(of);
    // A pixel whose samples were all rejected is black, and nothing is known of it.
    let f32s = |values: [f64; 3]| values.map(|v| if v.is_finite() { v as f32 } else { 0.0 });
    Moments {
        mean: f32s(channels.map(|c| c.0)),
        variance: f32s(channels.map(|c| c.1)),
        sample_variance: f32s(channels.map(|c| c.2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(streams: u32, samples: u32) -> ReferenceSpec {
        let look = Look { filter: "box".into(), ..Look::new(24, 16) };
        ReferenceSpec { scene: "embedded".into(), look, streams, samples, seed: REFERENCE_SEED }
    }

    #[test]
    fn a_reference_comes_back_as_it_was_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sub").join("r.exr");
        let subject = Subject::embedded().unwrap();
        let reference = Reference::render(&subject, &spec(4, 8)).unwrap();
        reference.write(&path).unwrap();
        assert_eq!(Reference::open(&path).unwrap(), reference);
        let again =
            Reference::open_or_render(&subject, &spec(4, 8), &path, || panic!("it is there")).unwrap();
        assert_eq!(again, reference);
        let stale = Reference { fingerprint: 1, ..reference.clone() };
        stale.write(&path).unwrap();
        let mut drawn = false;
        Reference::open_or_render(&subject, &spec(4, 8), &path, || drawn = true).unwrap();
        assert!(drawn, "another tracer");
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let message = Reference::open(&path).unwrap_err().to_string();
        assert!(message.contains("r.exr: not a readable OpenEXR file"), "{message}");
    }

    #[test]
    fn moments_of_known_streams() {
        let stream = |values: &[f64]| Sums {
            count: values.len() as u32,
            sum: [values.iter().sum(); 3],
            squares: [values.iter().map(|v| v * v).sum(); 3],
        };
        let m = moments([stream(&[1.0, 3.0]), stream(&[5.0, 7.0])].into_iter());
        // Stream means 2 and 6: variance 8 between them, 4 of their mean. All values: mean 4, variance 20 /
        // 3.
        assert_eq!((m.mean[0], m.variance[1]), (4.0, 4.0));
        assert!((m.sample_variance[2] - 20.0 / 3.0).abs() < 1e-6);
    }

    /// The stated variances are the ones by which two references differ: `(a - b)^2 - var_a - var_b` has mean
    /// 0. Pixels are independent, so their mean is tested against its own standard error (z-test, two-sided
    /// at 1e-6).
    #[test]
    fn the_variance_is_honest() {
        let subject = Subject::embedded().unwrap();
        let a = Reference::render(&subject, &spec(16, 8)).unwrap();
        let b = Reference::render(&subject, &ReferenceSpec { seed: 99, ..spec(16, 8) }).unwrap();
        let excess: Vec<f64> = (0..a.variance.len())
            .map(|i| {
                let channels = (0..3).map(|c| {
                    // Weighted, so that bright pixels do not rule.
                    let (x, y) = (f64::from(a.mean.rgb[i][c]), f64::from(b.mean.rgb[i][c]));
                    let variance = f64::from(a.variance[i][c]) + f64::from(b.variance[i][c]);
                    ((x - y).powi(2) - variance) / ((x + y).powi(2) + 0.01)
                });
                channels.sum()
            })
            .collect();
        let n = excess.len() as f64;
        let mean = excess.iter().sum::<f64>() / n;
        let spread = excess.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (n - 1.0);
        let z = mean / (spread / n).sqrt();
        assert!(z.abs() < 4.892, "{z}");
    }
}
