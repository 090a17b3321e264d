//! Phases of frames as they come, in memory that does not grow.
//!
//! | file | what it holds |
//! |---|---|
//! | `frames` | the loop over what a source delivers |
//! | `first` | what the first usable frame tells: pixels, scale, looks |
//! | `curve` | what every curve of a region can do |
//! | `paper` | the curve by the paper's least squares |
//! | `linked` | the curve by phase linking |
//! | `history` | what the smoothed curve of all frames needs |
//! | `testing` | simulated frames |
//!
//! Images are in [`crate::image`], where the filters are.

mod curve;
mod first;
mod frames;
mod history;
mod linked;
mod paper;
#[cfg(test)]
pub(crate) mod testing;

pub use curve::WatchedCurve;
pub use first::{First, is_usable};
pub use frames::{Ended, Frames};
pub use linked::{LinkedCurve, LinkedSettings};
pub use paper::{LARGEST_LAG, PaperCurve, PaperSettings};
