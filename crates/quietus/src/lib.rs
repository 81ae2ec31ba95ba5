//! A dynamically-updating hierarchical stopping condition for Monte Carlo renderers.
#![forbid(unsafe_code)]

pub mod active_mask;
mod coordinator;
pub mod error_metric;
mod error_plane;
pub mod inspect;
pub mod morton;
mod parking;
mod pass_schedule;
mod pixel_rect;
pub mod policy;
pub mod protocol;
pub mod published_masks;
mod quadrants;
mod region_error;
pub mod region_tree;
mod sample_counts;
pub mod striped_locks;
pub mod summed_area;
mod sync;
mod tile;
pub mod visit_counter;

pub use coordinator::{
    AdaptiveSampling, Checks, MAX_FRAME_PIXELS, PixelWork, RebuildRecord, Settings, SettingsError,
    Statistics, Visit, Worker,
};
pub use error_metric::{DammertzMetric, ErrorMetric, PixelError, ReplicateMean};
pub use error_plane::ErrorPlane;
pub use pass_schedule::{PassSchedule, replicate_share};
pub use pixel_rect::{Area, Axis, PixelRect};
pub use policy::{Policy, Rebuild};
pub use protocol::{Mode, Outcome};
pub use quadrants::Regions;
pub use region_error::region_error;
pub use region_tree::RegionTree;
pub use sample_counts::SampleCounts;
pub use tile::{TILE_PIXELS, TILE_SIZE, TileGrid};
