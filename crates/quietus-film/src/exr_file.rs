//! OpenEXR: every quantity of a picture as 32-bit channels of one layer, with its settings.

use std::io::Cursor;
use std::path::Path;

use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatImage, FlatSamples, Image, Layer, LayerAttributes, ReadChannels,
    ReadLayers, SmallVec, Vec2, WritableImage,
};

use crate::layout::{Layout, Window};
use crate::output::{OutputError, write_atomically};
use crate::picture::Picture;

/// Names and values kept in the file beside the pixels; names get the prefix `quietus.`.
pub type Metadata = Vec<(String, String)>;

/// Marks our own attributes.
const PREFIX: &str = "quietus.";

/// Writes all quantities of `picture`, in linear Rec.709: `R G B A`, `samples` (unsigned integers), `error`,
/// `albedo.{R,G,B}`, `normal.{X,Y,Z}`, `depth.Z`, all lossless. The display window is the full frame, the data
/// window the part that was rendered.
///
/// # Errors
/// When the file cannot be written; `path` is then as it was.
pub fn write_exr(path: &Path, picture: &Picture, metadata: &Metadata) -> Result<(), OutputError> {
    let Window { x0, y0, .. } = picture.window;
    let place = Place {
        display: [0, 0, i64::from(picture.frame[0]), i64::from(picture.frame[1])],
        corner: [x0 as i32, y0 as i32],
        size: [picture.window.width(), picture.window.height()],
    };
    write_layer(path, place, channels(picture), metadata)
}

/// Where a layer lies.
pub(crate) struct Place {
    /// The display window: left, top, width, height.
    pub display: [i64; 4],
    /// Upper left corner of the data window.
    pub corner: [i32; 2],
    /// Its size.
    pub size: [u32; 2],
}

/// Writes a file of one layer in Rec.709.
pub(crate) fn write_layer(
    path: &Path,
    place: Place,
    channels: AnyChannels<FlatSamples>,
    metadata: &Metadata,
) -> Result<(), OutputError> {
    let mut attributes = LayerAttributes {
        layer_position: Vec2(place.corner[0], place.corner[1]),
        software_name: Some(text(concat!("quietus ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    for (name, value) in metadata {
        attributes.other.insert(text(&format!("{PREFIX}{name}")), AttributeValue::Text(text(value)));
    }
    let size = Vec2(place.size[0] as usize, place.size[1] as usize);
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    let [left, top, width, height] = place.display;
    image.attributes.display_window =
        IntegerBounds::new(Vec2(left as i32, top as i32), Vec2(width as usize, height as usize));
    image.attributes.chromaticities = Some(REC_709);
    write_atomically(path, |writer| {
        image.write().to_buffered(writer).map_err(|error| format_error(path, &error))
    })
}

/// Rec.709 primaries and D65, written out: without them a reader has to assume.
const REC_709: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

fn channels(picture: &Picture) -> AnyChannels<FlatSamples> {
    let float = |name: &str, values: Vec<f32>| AnyChannel::new(text(name), FlatSamples::F32(values));
    let mut list = SmallVec::new();
    for (i, name) in ["R", "G", "B", "A"].iter().enumerate() {
        list.push(float(name, picture.beauty.iter().map(|p| p[i]).collect()));
    }
    for (i, name) in ["albedo.R", "albedo.G", "albedo.B"].iter().enumerate() {
        list.push(float(name, picture.albedo.iter().map(|p| p[i]).collect()));
    }
    for (i, name) in ["normal.X", "normal.Y", "normal.Z"].iter().enumerate() {
        list.push(float(name, picture.normal.iter().map(|p| p[i]).collect()));
    }
    list.push(float("depth.Z", picture.depth.clone()));
    list.push(float("error", picture.error.clone()));
    list.push(AnyChannel::new(text("samples"), FlatSamples::U32(picture.samples.clone())));
    AnyChannels::sort(list)
}

/// Attribute text may hold any bytes; ours are UTF-8.
pub(crate) fn text(value: &str) -> Text {
    Text::from_bytes_unchecked(SmallVec::from_slice(value.as_bytes()))
}

pub(crate) fn string(text: &Text) -> String {
    String::from_utf8_lossy(text.bytes()).into_owned()
}

fn format_error(path: &Path, error: &exr::error::Error) -> OutputError {
    match error {
        exr::error::Error::Io(source) => {
            // `io::Error` cannot be cloned.
            let source = std::io::Error::new(source.kind(), source.to_string());
            OutputError::Write { path: path.to_owned(), source }
        }
        other => OutputError::Format { path: path.to_owned(), message: other.to_string() },
    }
}

/// Most memory that the samples of a file may take, in bytes: its header alone could ask for more than there is.
const MAX_BYTES: u64 = 1 << 34;

/// Reads any EXR with flat layers and at most [`MAX_BYTES`] of samples.
pub(crate) fn read_flat(path: &Path) -> Result<FlatImage, OutputError> {
    let bytes = std::fs::read(path).map_err(|source| OutputError::Read { path: path.to_owned(), source })?;
    let wrong = |message: String| OutputError::Format { path: path.to_owned(), message };
    let unreadable = |error: exr::error::Error| wrong(format!("not a readable OpenEXR file: {error}"));
    let meta = exr::meta::MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(unreadable)?;
    let needed = meta.headers.iter().map(|header| {
        // No sample has more than four bytes, every channel is kept as if it were not subsampled, and a tile may be
        // larger than the picture.
        let bytes = |size: Vec2<usize>| {
            let texels = (size.x() as u64).saturating_mul(size.y() as u64);
            texels.saturating_mul(4 * header.channels.list.len() as u64)
        };
        bytes(header.layer_size).saturating_add(bytes(header.max_block_pixel_size()))
    });
    let needed = needed.fold(0, u64::saturating_add);
    if needed > MAX_BYTES {
        return Err(wrong(format!("needs {needed} bytes of memory, expected at most {MAX_BYTES}")));
    }
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(unreadable)
}

/// One channel of an EXR file with the range of its values.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrChannel {
    /// Its name.
    pub name: String,
    /// `f16`, `f32` or `u32`.
    pub kind: &'static str,
    /// Smallest finite value.
    pub min: f32,
    /// Mean of the finite values.
    pub mean: f64,
    /// Largest finite value.
    pub max: f32,
    /// Values that are not finite.
    pub nonfinite: usize,
}

/// One layer of an EXR file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrLayer {
    /// Its name, where it has one.
    pub name: Option<String>,
    /// Its data window: left, top, width, height.
    pub window: [i64; 4],
    /// Its channels in file order.
    pub channels: Vec<ExrChannel>,
    /// Its text attributes, the ones of this program without their prefix, sorted by name.
    pub metadata: Metadata,
}

/// What is in an EXR file.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrInfo {
    /// The display window: left, top, width, height.
    pub frame: [i64; 4],
    /// Its layers.
    pub layers: Vec<ExrLayer>,
}

/// Says what is in the EXR file at `path`.
///
/// # Errors
/// When it is missing or not an EXR file with flat layers.
pub fn read_exr_info(path: &Path) -> Result<ExrInfo, OutputError> {
    let image = read_flat(path)?;
    let bounds = |position: Vec2<i32>, size: Vec2<usize>| {
        [i64::from(position.0), i64::from(position.1), size.0 as i64, size.1 as i64]
    };
    let layers = image.layer_data.iter().map(|layer| ExrLayer {
        name: layer.attributes.layer_name.as_ref().map(string),
        window: bounds(layer.attributes.layer_position, layer.size),
        channels: layer.channel_data.list.iter().map(channel_info).collect(),
        metadata: metadata(layer),
    });
    let window = image.attributes.display_window;
    Ok(ExrInfo { frame: bounds(window.position, window.size), layers: layers.collect() })
}

pub(crate) fn metadata<C>(layer: &Layer<C>) -> Metadata {
    let texts = layer.attributes.other.iter().filter_map(|(name, value)| match value {
        AttributeValue::Text(value) => {
            let name = string(name);
            Some((name.strip_prefix(PREFIX).unwrap_or(&name).to_owned(), string(value)))
        }
        _ => None,
    });
    let mut metadata: Metadata = texts.collect();
    metadata.sort();
    metadata
}

fn channel_info(channel: &AnyChannel<FlatSamples>) -> ExrChannel {
    let kind = match channel.sample_data {
        FlatSamples::F16(_) => "f16",
        FlatSamples::F32(_) => "f32",
        FlatSamples::U32(_) => "u32",
    };
    let (mut min, mut max, mut sum, mut finite) = (f32::INFINITY, f32::NEG_INFINITY, 0.0, 0);
    for value in channel.sample_data.values_as_f32().filter(|value| value.is_finite()) {
        (min, max) = (min.min(value), max.max(value));
        sum += f64::from(value);
        finite += 1;
    }
    let name = string(&channel.name);
    let nonfinite = channel.sample_data.len() - finite;
    ExrChannel { name, kind, min, mean: sum / finite.max(1) as f64, max, nonfinite }
}

/// Reads a picture that [`write_exr`] wrote, with its metadata sorted by name.
///
/// # Errors
/// When the file is missing, is no EXR file, or lacks one of the channels.
pub fn read_exr(path: &Path) -> Result<(Picture, Metadata), OutputError> {
    let image = read_flat(path)?;
    let wrong = |message: String| OutputError::Format { path: path.to_owned(), message };
    let [layer] = image.layer_data.as_slice() else {
        return Err(wrong(format!("expected one layer, found {}", image.layer_data.len())));
    };
    let (frame, window) = windows(&image, layer).ok_or_else(|| wrong("windows out of range".into()))?;
    let find = |name: &str| {
        let found = layer.channel_data.list.iter().find(|channel| channel.name == *name);
        found.map(|c| &c.sample_data).ok_or_else(|| wrong(format!("lacks the channel `{name}`")))
    };
    let float = |name: &str| match find(name)? {
        FlatSamples::F32(values) => Ok(values.clone()),
        _ => Err(wrong(format!("the channel `{name}` does not hold 32-bit floats"))),
    };
    let FlatSamples::U32(samples) = find("samples")? else {
        return Err(wrong("the channel `samples` does not hold unsigned integers".into()));
    };
    let picture = Picture {
        frame,
        window,
        beauty: zip(["R", "G", "B", "A"], float)?,
        samples: samples.clone(),
        error: float("error")?,
        albedo: zip(["albedo.R", "albedo.G", "albedo.B"], float)?,
        normal: zip(["normal.X", "normal.Y", "normal.Z"], float)?,
        depth: float("depth.Z")?,
    };
    Ok((picture, metadata(layer)))
}

fn windows<C>(image: &FlatImage, layer: &Layer<C>) -> Option<([u32; 2], Window)> {
    let side = |size: usize| u32::try_from(size).ok();
    let frame =
        [side(image.attributes.display_window.size.0)?, side(image.attributes.display_window.size.1)?];
    let x0 = u32::try_from(layer.attributes.layer_position.0).ok()?;
    let y0 = u32::try_from(layer.attributes.layer_position.1).ok()?;
    let window =
        Window { x0, y0, x1: x0.checked_add(side(layer.size.0)?)?, y1: y0.checked_add(side(layer.size.1)?)? };
    Layout::new(frame, window, 1).ok().map(|_| (frame, window))
}

/// Channels side by side into pixels.
fn zip<const N: usize>(
    names: [&str; N],
    read: impl Fn(&str) -> Result<Vec<f32>, OutputError>,
) -> Result<Vec<[f32; N]>, OutputError> {
    let planes = names.iter().map(|name| read(name)).collect::<Result<Vec<_>, _>>()?;
    Ok((0..planes[0].len()).map(|i| std::array::from_fn(|c| planes[c][i])).collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sample_picture(window: Window, frame: [u32; 2]) -> Picture {
        let mut picture = Picture::empty(frame, window);
        for i in 0..window.pixels() {
            let v = |n: u32| ((i as u32 * 31 + n) as f32 * 0.37).sin() * 10.0_f32.powi(n as i32 % 7 - 3);
            picture.beauty[i] = [v(0), v(1), v(2), v(3)];
            picture.samples[i] = u32::MAX - i as u32;
            picture.error[i] = v(4);
            picture.albedo[i] = [v(5), v(6), v(7)];
            picture.normal[i] = [v(8), v(9), v(10)];
            picture.depth[i] = v(11);
        }
        picture
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn what_is_written_is_read_back_bit_for_bit(
            x0 in 0..40_u32, y0 in 0..40_u32, w in 1..70_u32, h in 1..40_u32, right in 0..9_u32,
        ) {
            let window = Window { x0, y0, x1: x0 + w, y1: y0 + h };
            let picture = sample_picture(window, [window.x1 + right, window.y1]);
            let metadata = vec![
                ("scene".to_owned(), "Kästchen.glb".to_owned()),
                ("seed".to_owned(), u64::MAX.to_string()),
            ];
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.exr");
            write_exr(&path, &picture, &metadata).unwrap();
            prop_assert_eq!(read_exr(&path).unwrap(), (picture, metadata));
        }
    }

    /// A header that asks for a terabyte is refused by its word alone.
    #[test]
    fn absurd_sizes_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let window = Window { x0: 0, y0: 0, x1: 4, y1: 4 };
        write_exr(&path, &sample_picture(window, [4, 4]), &Metadata::new()).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        let name = b"dataWindow\0box2i\0\x10\0\0\0";
        let at = bytes.windows(name.len()).position(|part| part == name).unwrap() + name.len();
        for side in [8, 12] {
            bytes[at + side..][..4].copy_from_slice(&((1 << 18) - 1_i32).to_le_bytes());
        }
        std::fs::write(&path, bytes).unwrap();
        let message = read_exr_info(&path).unwrap_err().to_string();
        assert!(message.contains("bytes of memory, expected at most 17179869184"), "{message}");
    }

    #[test]
    fn info_tells_windows_channels_and_settings() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let mut picture = Picture::empty([30, 20], Window { x0: 5, y0: 6, x1: 9, y1: 8 });
        picture.depth[3] = 8.0;
        picture.error[2] = f32::INFINITY;
        write_exr(&path, &picture, &vec![("seed".into(), "7".into())]).unwrap();
        let info = read_exr_info(&path).unwrap();
        assert_eq!(info.frame, [0, 0, 30, 20]);
        let layer = &info.layers[0];
        assert_eq!(layer.window, [5, 6, 4, 2]);
        let names: Vec<_> = layer.channels.iter().map(|c| c.name.as_str()).collect();
        let expected = [
            "A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "depth.Z", "error", "normal.X",
            "normal.Y", "normal.Z", "samples",
        ];
        assert_eq!(names, expected);
        assert_eq!(layer.metadata, [("seed".to_owned(), "7".to_owned())]);
        let depth = &layer.channels[7];
        assert_eq!((depth.min, depth.mean, depth.max), (0.0, 1.0, 8.0));
        assert_eq!(layer.channels[8].nonfinite, 1);
        assert_eq!(layer.channels[12].kind, "u32");
    }

    #[test]
    fn truncated_and_foreign_files_are_errors_that_name_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.exr");
        let window = Window { x0: 0, y0: 0, x1: 64, y1: 64 };
        write_exr(&path, &sample_picture(window, [64, 64]), &Metadata::new()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in [0, 3, 8, 100, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = read_exr_info(&path).unwrap_err().to_string();
            assert!(error.contains("a.exr: not a readable OpenEXR file"), "{length}: {error}");
        }
        std::fs::remove_file(&path).unwrap();
        assert!(read_exr(&path).unwrap_err().to_string().contains("a.exr: no such file"));
    }
}
