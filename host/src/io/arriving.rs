//! Frames as they come: from a file or a store that another program is still writing, or through a pipe.
//!
//! | file | what it holds |
//! |---|---|
//! | `pipe` | raw frames behind a line of JSON |
//! | `npy` | an `.npy` file that grows |
//! | `zarr` | a Zarr array that grows |

mod npy;
mod pipe;
mod zarr;

use super::{InputKind, Shape, kind_of_input, photron};
use crate::error::{Error, Result};
use num_complex::Complex32;
use std::path::Path;

/// What all frames of a source have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameFormat {
    /// Rows of a frame.
    pub height: usize,
    /// Columns of a frame.
    pub width: usize,
    /// Time from frame to frame in seconds, where the source knows it.
    pub interval_s: Option<f64>,
    /// Wavelength, where the source knows it.
    pub wavelength_nm: Option<f64>,
}

impl FrameFormat {
    /// Pixels of a frame.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.height * self.width
    }

    /// That of a series of frames without depths; its number of frames does not count.
    fn of_series(path: &Path, dimensions: &[usize]) -> Result<Self> {
        let [_, height, width] = *dimensions else {
            return Err(Error::file(
                path,
                format!(
                    "the array has shape {dimensions:?}; frames of one depth are watched: axes (time, y, x)"
                ),
            ));
        };
        Shape::of_series(path, &[1, height, width])?;
        Ok(Self { height, width, interval_s: None, wavelength_nm: None })
    }

    /// Refuse frames of another size than before.
    fn check_same(&self, path: &Path, now: &Self) -> Result<()> {
        if (self.height, self.width) == (now.height, now.width) {
            return Ok(());
        }
        Err(Error::file(
            path,
            format!(
                "the frames have changed from {} x {} to {} x {} pixels: begin again",
                self.width, self.height, now.width, now.height
            ),
        ))
    }
}

/// What a source has when it is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The next frame.
    Frame,
    /// Nothing new, but more may come.
    Nothing,
    /// The last frame has come.
    End,
}

/// Frames that arrive one after the other. Asking does not wait for long.
pub trait ArrivingFrames {
    /// Of all frames.
    fn format(&self) -> FrameFormat;

    /// Put the next frame into `frame`, row after row, if it is there.
    ///
    /// # Errors
    /// When the source cannot be read, has shrunk, holds frames of another size, or ends within a frame.
    fn next(&mut self, frame: &mut [Complex32]) -> Result<Arrival>;

    /// Refuse a frame that has begun to arrive and will never be whole, now that nothing more is waited for.
    ///
    /// # Errors
    /// When there is one: how many of its bytes are there.
    fn check_whole(&self) -> Result<()>;
}

/// Open the source called `path`: `-` is standard input (see [`PIPE_FORMAT`]), else a growing `.npy` file or Zarr
/// array of axes (time, y, x).
///
/// # Errors
/// When it does not exist, is of another kind, or is damaged.
pub fn open_arriving(path: &Path) -> Result<Box<dyn ArrivingFrames>> {
    if path == Path::new("-") {
        return Ok(Box::new(pipe::PipedFrames::open(std::io::stdin())?));
    }
    if photron::is_recording(path) {
        return Err(Error::file(
            path,
            "is a camera recording; watched are complex frames: reconstruct it first",
        ));
    }
    match kind_of_input(path)? {
        InputKind::Npy => Ok(Box::new(npy::GrowingNpy::open(path)?)),
        InputKind::Zarr => Ok(Box::new(zarr::GrowingZarr::open(path)?)),
    }
}

pub use pipe::PIPE_FORMAT;
