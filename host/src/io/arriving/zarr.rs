//! A Zarr array to which another program appends frames.
//!
//! The shape in the array's metadata says how many frames there are or will be; files of chunks appear as they are
//! written. A frame is there once
//!
//! - the shape counts it, and all chunks (shards) that hold a part of it are files,
//! - none of these files was written to in the last 0.2 s, and
//! - the shape counts a further frame, or was not written in the last 0.2 s either: whoever enlarges the array first
//!   and writes the chunk then has had the time.
//!
//! So frames arrive 0.2 s late, as fast as they are written where a chunk holds one frame; of chunks that hold several
//! they arrive when the writer has gone on to the next chunk, or pauses. What is read is not kept: a chunk may change.

use super::{Arrival, ArrivingFrames, FrameFormat};
use crate::error::{Error, Result};
use crate::io::zarr::{
    ArrayNode, Node, ReadableArray, cannot_read, find_array, holds_doubles, open_array,
    single_threaded,
};
use num_complex::{Complex32, Complex64};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};
use zarrs::array::{ArraySubset, ElementOwned};

/// How long a file must have stood still.
const STILL: Duration = Duration::from_millis(200);

/// A growing array.
pub(super) struct GrowingZarr {
    folder: PathBuf,
    format: FrameFormat,
    is_double: bool,
    array: Arc<ReadableArray>,
    /// Frames that the array has, as it was opened.
    frames: usize,
    /// Frames that have been read.
    read: usize,
}

impl GrowingZarr {
    /// Open the array `field` of a group, or the array at `path` itself; it need not hold a frame yet.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let metadata = ["zarr.json", "field/zarr.json"].map(|name| path.join(name));
        loop {
            if let Some(growing) = unless_written(&metadata, || Self::open_now(path))? {
                return Ok(growing);
            }
            std::thread::sleep(STILL / 20);
        }
    }

    fn open_now(path: &Path) -> Result<Self> {
        let (folder, node) = find_array(path, "field")?;
        let is_double = holds_doubles(&folder, &node)?;
        let format = FrameFormat::of_series(&folder, &node.shape)?;
        let wavelength_nm = node.attributes.get("wavelength_nm").and_then(|nm| nm.as_f64());
        let array = open_array(&folder)?;
        let format = FrameFormat { wavelength_nm, ..format };
        Ok(Self { folder, format, is_double, array, frames: node.shape[0], read: 0 })
    }

    /// Take notice of an array that has been enlarged.
    fn look_again(&mut self) -> Result<()> {
        let read = || {
            let node = Node::read_array(&self.folder)?;
            self.check(&node)?;
            let array = if node.shape[0] == self.frames {
                Arc::clone(&self.array)
            } else {
                open_array(&self.folder)?
            };
            Ok((array, node.shape[0]))
        };
        if let Some((array, frames)) = unless_written(&[self.metadata()], read)? {
            (self.array, self.frames) = (array, frames);
        }
        Ok(())
    }

    fn check(&self, node: &ArrayNode) -> Result<()> {
        let format = FrameFormat::of_series(&self.folder, &node.shape)?;
        self.format.check_same(&self.folder, &format)?;
        if node.shape[0] < self.read {
            let what = format!("has shrunk below the {} frames that were there", self.read);
            return Err(Error::file(&self.folder, what));
        }
        Ok(())
    }

    fn metadata(&self) -> PathBuf {
        self.folder.join("zarr.json")
    }

    /// Files of the chunks that hold a part of the next frame.
    fn chunks(&self) -> Result<Vec<PathBuf>> {
        let lengths = self
            .array
            .chunk_shape_usize(&[0; 3])
            .map_err(|error| cannot_read(&self.folder, &error))?;
        let FrameFormat { height, width, .. } = self.format;
        let (rows, columns) = (height.div_ceil(lengths[1]), width.div_ceil(lengths[2]));
        let time = (self.read / lengths[0]) as u64;
        let at = |n: usize| [time, (n / columns) as u64, (n % columns) as u64];
        let file = |n| self.folder.join(self.array.chunk_key(&at(n)).as_str());
        Ok((0..rows * columns).map(file).collect())
    }

    /// Are the next frame and what counts it there, in files that stand still?
    fn is_next_there(&self, chunks: &[PathBuf]) -> bool {
        let now = SystemTime::now();
        let settled = self.read + 1 < self.frames || is_still(&self.metadata(), now);
        settled && chunks.iter().all(|chunk| is_still(chunk, now))
    }

    fn read_next(&self) -> Result<Vec<Complex32>> {
        if !self.is_double {
            return self.retrieve();
        }
        let narrow = |u: Complex64| Complex32::new(u.re as f32, u.im as f32);
        Ok(self.retrieve()?.into_iter().map(narrow).collect())
    }

    fn retrieve<T: ElementOwned>(&self) -> Result<Vec<T>> {
        let FrameFormat { height, width, .. } = self.format;
        let time = self.read as u64..self.read as u64 + 1;
        let frame = ArraySubset::new_with_ranges(&[time, 0..height as u64, 0..width as u64]);
        self.array
            .retrieve_array_subset_opt(&frame, &single_threaded())
            .map_err(|error| cannot_read(&self.folder, &error))
    }
}

impl ArrivingFrames for GrowingZarr {
    fn format(&self) -> FrameFormat {
        self.format
    }

    fn next(&mut self, frame: &mut [Complex32]) -> Result<Arrival> {
        if self.read + 1 >= self.frames {
            self.look_again()?;
        }
        let chunks = self.chunks()?;
        if self.read >= self.frames || !self.is_next_there(&chunks) {
            return Ok(Arrival::Nothing);
        }
        let Some(next) = unless_written(&chunks, || self.read_next())? else {
            return Ok(Arrival::Nothing);
        };
        frame.copy_from_slice(&next);
        self.read += 1;
        Ok(Arrival::Frame)
    }

    fn check_whole(&self) -> Result<()> {
        let chunks = self.chunks()?;
        let there = chunks.iter().filter(|chunk| chunk.is_file()).count();
        if self.read >= self.frames || there == 0 || there == chunks.len() {
            return Ok(());
        }
        let (frame, all) = (self.read, chunks.len());
        let what = format!("frame {frame} is cut short: {there} of its {all} chunks are there");
        Err(Error::file(&self.folder, what))
    }
}

/// Is the file there, and had it stood still at that time? One that was written to later had not.
fn is_still(path: &Path, at: SystemTime) -> bool {
    let modified = std::fs::metadata(path).and_then(|metadata| metadata.modified());
    modified.is_ok_and(|then| at.duration_since(then).is_ok_and(|age| age >= STILL))
}

/// What `read` finds; nothing where it fails because one of the files is just being written.
fn unless_written<T>(files: &[PathBuf], read: impl FnOnce() -> Result<T>) -> Result<Option<T>> {
    let begun = SystemTime::now();
    let is_written = |file: &PathBuf| file.exists() && !is_still(file, begun);
    match read() {
        Err(_) if files.iter().any(is_written) => Ok(None),
        found => found.map(Some),
    }
}
