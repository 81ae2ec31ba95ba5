//! The film: what samples become, and how they reach the disk.
//!
//! A [`Film`] covers a [`Window`] of the full frame with tiles of 8x8 pixels. Each pixel holds R replicates with
//! their own counts, sums and alpha, and one sum of albedo, normal and depth. A thread that renders a tile
//! collects samples in its own [`TileBuffer`], without any lock, and hands them over once per visit with
//! [`Film::commit`]; everybody else copies tiles out under the same lock. [`Film::picture`] assembles a
//! [`Picture`], which [`write_exr`] and [`write_png`] bring to the disk, whole or not at all.

mod buffer;
mod exr_file;
mod exr_planes;
mod film;
mod layout;
mod output;
mod picture;
mod png_file;
mod rejected;
mod tone;

pub use buffer::{TileBuffer, VisitSummary};
pub use exr_file::{ExrChannel, ExrInfo, ExrLayer, Metadata, read_exr, read_exr_info, write_exr};
pub use exr_planes::{ExrPlanes, read_exr_planes, write_exr_planes};
pub use film::{Aovs, Film, FilmState, Replicate, TileCopy};
pub use layout::{Layout, LayoutError, TILE, TILE_PIXELS, Window};
pub use output::{OutputError, OutputFormat, check_writable, remove_unfinished, write_atomically};
pub use picture::Picture;
pub use png_file::{srgb8, write_png, write_rgb_png};
pub use rejected::{RejectedSample, RejectedSamples};
pub use tone::ToneCurve;
