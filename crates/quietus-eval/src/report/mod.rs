//! Reports: a table for the terminal, JSON, and a self-contained HTML page with plots and heat maps.

mod table;

pub use table::{DEFAULT_MEASURE, table};
