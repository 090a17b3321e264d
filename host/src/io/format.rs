//! The format that a file name asks for.

use crate::error::{Error, Result};
use std::path::Path;

/// Format of a result, chosen by the extension of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `.npy`: one NumPy array, further arrays in files beside it.
    Npy,
    /// `.zarr`: a Zarr v3 group with coordinates and provenance.
    Zarr,
    /// `.csv`: a table, for curves only.
    Csv,
}

impl Format {
    /// The format that the extension of `path` names, in upper or lower case.
    ///
    /// # Errors
    /// [`Error::Usage`] with the possible extensions when there is none or an unknown one.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("npy") => Ok(Self::Npy),
            Some("zarr") => Ok(Self::Zarr),
            Some("csv") => Ok(Self::Csv),
            _ => Err(Error::usage(format!(
                "{}: the extension of an output chooses its format: give .npy or .zarr, for curves also .csv",
                path.display()
            ))),
        }
    }
}

/// The refusal of a table where images are written.
pub(crate) fn not_a_table(path: &Path) -> Error {
    Error::usage(format!("{}: images do not fit a table: give .npy or .zarr", path.display()))
}
