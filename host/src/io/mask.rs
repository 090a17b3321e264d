//! A region of interest.

use super::{InputKind, kind_of_input, npy, zarr};
use crate::error::{Error, Result};
use std::path::Path;

/// Read a mask of axes (y, x), true inside the region: booleans or integers, from an `.npy` file,
/// a Zarr array, or the array `mask` of a Zarr group.
///
/// # Errors
/// When the file is missing or damaged, of another type or shape, or true nowhere.
pub fn read_mask(path: &Path, height: usize, width: usize) -> Result<Vec<bool>> {
    let (shape, mask) = match kind_of_input(path)? {
        InputKind::Npy => npy::read_flags(path)?,
        InputKind::Zarr => zarr::read_flags(path, "mask")?,
    };
    if shape != [height, width] {
        return Err(Error::file(
            path,
            format!("the mask has shape {shape:?}; the frames need [{height}, {width}] (y, x)"),
        ));
    }
    if !mask.contains(&true) {
        return Err(Error::file(path, "the mask selects no pixel: set some to true"));
    }
    Ok(mask)
}
