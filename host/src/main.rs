//! The `phasewalk` program.
fn main() {}
