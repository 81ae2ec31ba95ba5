//! The `quietus` program.
fn main() {}
