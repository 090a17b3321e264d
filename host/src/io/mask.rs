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

/// The mask, (y, x), without the pixels that have one outside of it at most `rim` rows and columns away. The image's own
/// edge is none of the mask's.
#[must_use]
pub fn without_rim(mask: &[bool], width: usize, rim: usize) -> Vec<bool> {
    let height = mask.len() / width.max(1);
    let inside = |place: usize| {
        let (y, x) = (place / width, place % width);
        let columns = x.saturating_sub(rim)..(x + rim + 1).min(width);
        let mut rows = y.saturating_sub(rim)..(y + rim + 1).min(height);
        rows.all(|row| mask[row * width..][columns.clone()].iter().all(|&m| m))
    };
    (0..mask.len()).map(inside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_is_taken_off_but_for_the_images_edge() {
        let picture = ["#####.", "####..", "####..", "####..", "......"];
        let mask: Vec<bool> =
            picture.iter().flat_map(|row| row.chars().map(|c| c == '#')).collect();
        let words = |mask: &[bool]| -> Vec<String> {
            let row = |row: &[bool]| row.iter().map(|&m| if m { '#' } else { '.' }).collect();
            mask.chunks_exact(6).map(row).collect()
        };
        assert_eq!(words(&without_rim(&mask, 6, 0)), picture);
        let inner = ["###...", "###...", "###...", "......", "......"];
        assert_eq!(words(&without_rim(&mask, 6, 1)), inner);
        assert!(!without_rim(&mask, 6, 4).contains(&true));
    }
}
