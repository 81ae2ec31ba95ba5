//! Reports: a table for the terminal, JSON (see [`crate::compare::Comparison`]), and a self-contained HTML
//! page with plots and heat maps.

pub mod goals;
mod html;
mod plot;
mod table;

pub use html::{Scene, html};
pub use plot::heat;
pub use table::{DEFAULT_MEASURE, equivalence_table, table};
