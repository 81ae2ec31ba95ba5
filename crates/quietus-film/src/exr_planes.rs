//! OpenEXR files of any origin: channels by name.

use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Layer, SmallVec};

use crate::exr_file::{Metadata, Place, metadata, read_flat, string, text, write_layer};
use crate::output::OutputError;

/// Any EXR file's channels as floats, those of its first layer that has red, green and blue.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrPlanes {
    /// The display window: left, top, width, height.
    pub display: [i64; 4],
    /// Upper left corner of the data window.
    pub corner: [i32; 2],
    /// Width and height of the data window.
    pub size: [u32; 2],
    /// Names and values, row by row from the top, in file order.
    pub channels: Vec<(String, Vec<f32>)>,
    /// The layer's text attributes, see [`ExrLayer::metadata`](crate::ExrLayer::metadata).
    pub metadata: Metadata,
}

impl ExrPlanes {
    /// The values of a channel.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(n, _)| n == name).map(|(_, values)| values.as_slice())
    }

    /// Pixels of the channels R, G and B.
    pub fn rgb(&self) -> Option<Vec<[f32; 3]>> {
        self.triple(["R", "G", "B"])
    }

    /// Pixels of three channels.
    pub fn triple(&self, names: [&str; 3]) -> Option<Vec<[f32; 3]>> {
        let [r, g, b] = names.map(|name| self.channel(name));
        let ((r, g), b) = r.zip(g).zip(b)?;
        Some(r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect())
    }
}

/// Reads the channels of any EXR file.
///
/// # Errors
/// When it is missing, is no EXR file with flat layers, or no layer has the channels R, G and B.
pub fn read_exr_planes(path: &Path) -> Result<ExrPlanes, OutputError> {
    let image = read_flat(path)?;
    let wrong = |message: &str| OutputError::Format { path: path.to_owned(), message: message.into() };
    let window = image.attributes.display_window;
    let planes = |layer: &Layer<AnyChannels<FlatSamples>>| ExrPlanes {
        display: [
            i64::from(window.position.0),
            i64::from(window.position.1),
            window.size.0 as i64,
            window.size.1 as i64,
        ],
        corner: [layer.attributes.layer_position.0, layer.attributes.layer_position.1],
        size: [layer.size.0 as u32, layer.size.1 as u32],
        channels: (layer.channel_data.list.iter())
            .map(|channel| (string(&channel.name), channel.sample_data.values_as_f32().collect()))
            .collect(),
        metadata: metadata(layer),
    };
    let has_colors = |layer: &&Layer<AnyChannels<FlatSamples>>| {
        ["R", "G", "B"]
            .iter()
            .all(|name| layer.channel_data.list.iter().any(|channel| channel.name == **name))
    };
    let colored = image.layer_data.iter().find(has_colors);
    colored.map(planes).ok_or_else(|| wrong("no layer has the channels `R`, `G` and `B`"))
}

/// Writes planes as they are: `samples` as unsigned integers, all others as 32-bit floats, lossless.
///
/// # Errors
/// When the file cannot be written; `path` is then as it was.
pub fn write_exr_planes(path: &Path, planes: &ExrPlanes) -> Result<(), OutputError> {
    let channels = planes.channels.iter().map(|(name, values)| {
        let samples = match name.as_str() {
            // Rounds back what reading made a float of.
            "samples" => FlatSamples::U32(values.iter().map(|&value| value as u32).collect()),
            _ => FlatSamples::F32(values.clone()),
        };
        AnyChannel::new(text(name), samples)
    });
    let channels = AnyChannels::sort(channels.collect::<SmallVec<_>>());
    let place = Place { display: planes.display, corner: planes.corner, size: planes.size };
    write_layer(path, place, channels, &planes.metadata)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Picture, Window, read_exr, write_exr};

    #[test]
    fn planes_are_read_and_written_as_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let [first, second] = ["a.exr", "b.exr"].map(|name| dir.path().join(name));
        let mut picture = Picture::empty([20, 10], Window { x0: 3, y0: 4, x1: 6, y1: 6 });
        picture.beauty[4] = [0.5, 1.0, 2.0, 0.25];
        picture.samples[4] = 77;
        picture.normal[1] = [0.0, -1.0, 0.0];
        let metadata = vec![("seed".to_owned(), "7".to_owned())];
        write_exr(&first, &picture, &metadata).unwrap();
        let planes = read_exr_planes(&first).unwrap();
        assert_eq!((planes.display, planes.corner, planes.size), ([0, 0, 20, 10], [3, 4], [3, 2]));
        assert_eq!(planes.rgb().unwrap()[4], [0.5, 1.0, 2.0]);
        assert_eq!(planes.triple(["normal.X", "normal.Y", "normal.Z"]).unwrap()[1], [0.0, -1.0, 0.0]);
        assert!(planes.triple(["R", "G", "none"]).is_none());
        write_exr_planes(&second, &planes).unwrap();
        assert_eq!(read_exr(&second).unwrap(), (picture, metadata));
    }
}
