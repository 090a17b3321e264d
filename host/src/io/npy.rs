//! NumPy files (`.npy`), read and written by position so that strips of huge files fit in memory.
//!
//! | file | what it holds |
//! |---|---|
//! | `header` | type, shape and order of the array in a file, and whether the file is whole |
//! | `series` | complex frames, read row by row |
//! | `images` | raw images of unsigned integers |
//! | `array` | small real arrays, read whole |
//! | `spectra` | recorded spectra, read B-scan by B-scan |
//! | `writer` | arrays of known shape, written in pieces |

mod array;
mod header;
mod images;
mod series;
mod spectra;
mod writer;

pub(crate) use array::read_flags;
pub use array::{read_f64_1d, read_real};
pub(crate) use header::{Header, NumberType};
pub(crate) use images::open_images;
pub use images::save_images;
pub(crate) use series::{complex_type, decode, open_series};
pub use spectra::SpectraFile;
pub(crate) use writer::NpyWriter;

use std::path::{Path, PathBuf};

/// `F.npy` and `sigma` give `F.sigma.npy`.
pub(crate) fn sibling(path: &Path, what: &str) -> PathBuf {
    path.with_extension(format!("{what}.npy"))
}
