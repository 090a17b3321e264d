//! Files in and files out, one file of this folder per idea.
//!
//! | file | what it holds |
//! |---|---|
//! | `shape` | axes (time, z, y, x) and the check of a reading request |
//! | `format` | the format that a file name asks for |
//! | `element` | the five number types of the written files |
//! | `staged` | results appear under their final name whole, or not at all |
//! | `npy` | NumPy files, by positioned reads and writes |
//! | `zarr` | Zarr v3 groups |
//! | `mask` | a region of interest |
//! | `volume` | one complex volume, slab by slab |
//! | `image` | phase images, strip by strip |
//! | `field` | complex frames, one after the other |
//! | `curve` | one phase per frame |
//! | `unfinished` | a Zarr folder that outlives an interruption |
//! | `volumes` | reconstructed volumes, sweep by sweep |
//! | `raw` | raw camera images, whatever file they lie in |
//! | `photron` | recordings of Photron cameras |
//! | `mapped` | windows of large files, mapped into memory |
//! | `times` | acquisition times from a file of their own |
//! | `arriving` | frames as they come |
//! | `newest` | results that are written frame by frame |
//! | `recordings` | several recordings of one scene, as one series |
//! | `describe` | what `phasewalk info` prints |
//!
//! Arrays are stored in C order with axes (time, z, y, x); times are in seconds, phases in radians.

mod arriving;
mod curve;
mod describe;
mod element;
mod field;
mod flush;
mod format;
mod image;
mod mapped;
mod mask;
mod newest;
pub mod npy;
pub mod photron;
mod raw;
mod recordings;
mod shape;
mod staged;
mod times;
mod unfinished;
mod volume;
mod volumes;
mod zarr;

pub use arriving::{Arrival, ArrivingFrames, FrameFormat, PIPE_FORMAT, open_arriving};
pub(crate) use curve::Columns;
pub use curve::{CurveRow, write_curve};
pub use describe::{ArrayDescription, Description, describe};
pub(crate) use element::Element;
pub use field::{FieldLayout, FieldWriter, Truth};
pub use format::Format;
pub use image::{ImageLayout, ImageWriter};
pub use mask::{read_mask, without_rim};
pub use newest::{CurveFile, ImageFile};
pub use raw::{RawFormat, RawImages, open_raw, visit_images};
pub use recordings::Recordings;
pub use shape::Shape;
pub use staged::write_atomic;
pub(crate) use staged::{StagedFile, StagedFolder};
pub use times::{Timed, check_times, read_times, times_beside};
pub use unfinished::Unfinished;
pub use volume::VolumeWriter;
pub use volumes::{Companions, VolumesLayout, VolumesWriter};
pub(crate) use zarr::GroupWriter;

use crate::error::{Error, Result};
use num_complex::Complex32;
use std::ops::Range;
use std::path::Path;

/// Attributes of a result: wavelength, seed, software version, method, parameters.
pub type Attributes = serde_json::Map<String, serde_json::Value>;

/// A series of complex frames on disk, read piece by piece and from several threads.
pub trait Series: Send + Sync {
    /// Lengths of the axes.
    fn shape(&self) -> Shape;

    /// Read `rows` of frame `frame` at depth `depth` into `out`, row after row.
    ///
    /// # Errors
    /// When the request lies outside the series, `out` does not have `rows * width` elements, or
    /// the file cannot be read.
    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()>;

    /// Acquisition times in seconds, where they are known (Zarr coordinate `time_s`).
    fn times_s(&self) -> Option<&[f64]> {
        None
    }

    /// Which frames can be used, one flag per frame, where the file knows (Zarr array `sweep_ok`).
    fn sweep_ok(&self) -> Option<&[bool]> {
        None
    }

    /// What the file says beside the field (attribute of the Zarr array, else of its group).
    fn attribute(&self, _name: &str) -> Option<&serde_json::Value> {
        None
    }

    /// Wavelength, where the file knows it (Zarr attribute `wavelength_nm`).
    fn wavelength_nm(&self) -> Option<f64> {
        self.attribute("wavelength_nm").and_then(serde_json::Value::as_f64)
    }
}

/// Open a complex series: an `.npy` file, a Zarr group holding `field`, or a Zarr array.
///
/// # Errors
/// When `path` does not exist, is of another kind, or is damaged.
pub fn open_series(path: &Path) -> Result<Box<dyn Series>> {
    match kind_of_input(path)? {
        InputKind::Npy => npy::open_series(path),
        InputKind::Zarr => Ok(Box::new(zarr::ZarrSeries::open(path)?)),
    }
}

/// The two formats that hold arrays.
enum InputKind {
    Npy,
    Zarr,
}

/// A Zarr array inside a group carries no extension: any other folder is taken for Zarr.
fn kind_of_input(path: &Path) -> Result<InputKind> {
    let metadata = std::fs::metadata(path).map_err(|error| staged::cannot_open(path, &error))?;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("npy") => Ok(InputKind::Npy),
        _ if metadata.is_dir() => Ok(InputKind::Zarr),
        Some("zarr") => Err(Error::file(path, "a Zarr store is a folder, this is a file")),
        _ => Err(Error::file(path, "unknown kind of file: give an .npy file or a .zarr folder")),
    }
}

#[cfg(test)]
mod tests;
