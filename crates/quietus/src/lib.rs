//! A dynamically-updating hierarchical stopping condition for Monte Carlo renderers.
#![forbid(unsafe_code)]

pub mod active_mask;
pub mod error_metric;
mod error_plane;
pub mod inspect;
pub mod morton;
mod pass_schedule;
mod pixel_rect;
pub mod policy;
mod quadrants;
mod region_error;
pub mod region_tree;
pub mod summed_area;
mod sync;
mod tile;

pub use error_metric::{DammertzMetric, ErrorMetric, PixelError, ReplicateMean};
pub use error_plane::ErrorPlane;
pub use pass_schedule::{PassSchedule, replicate_share};
pub use pixel_rect::{Area, Axis, PixelRect};
pub use policy::Policy;
pub use quadrants::Regions;
pub use region_error::region_error;
pub use region_tree::RegionTree;
pub use tile::{TILE_PIXELS, TILE_SIZE, TileGrid};
