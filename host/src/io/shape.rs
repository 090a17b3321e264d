//! Axes (time, z, y, x) and the check of a reading request.

use crate::error::{Error, Result};
use std::ops::Range;
use std::path::Path;

/// Lengths of the axes (time, z, y, x); a file of rank 3 has depth 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Number of frames (time).
    pub frames: usize,
    /// Number of depth pixels (z).
    pub depth: usize,
    /// Number of rows (y).
    pub height: usize,
    /// Number of columns (x).
    pub width: usize,
}

impl Shape {
    /// The shape of a series in a file of these dimensions.
    pub(crate) fn of_series(path: &Path, dimensions: &[usize]) -> Result<Self> {
        let (frames, depth, height, width) = match *dimensions {
            [t, y, x] => (t, 1, y, x),
            [t, z, y, x] => (t, z, y, x),
            _ => {
                return Err(Error::file(
                    path,
                    format!(
                        "the array has shape {dimensions:?}; a series needs axes (time, y, x) or (time, z, y, x)"
                    ),
                ));
            }
        };
        if dimensions.contains(&0) {
            return Err(Error::file(
                path,
                format!(
                    "the array is empty (shape {dimensions:?}); every axis needs at least one element"
                ),
            ));
        }
        if byte_count(dimensions, size_of::<num_complex::Complex64>()).is_none() {
            return Err(Error::file(
                path,
                format!("shape {dimensions:?} is larger than any memory"),
            ));
        }
        Ok(Self { frames, depth, height, width })
    }

    /// Refuse a request outside the series or a buffer that does not fit it.
    pub(crate) fn check_request(
        self,
        frame: usize,
        depth: usize,
        rows: &Range<usize>,
        buffer: usize,
    ) -> Result<()> {
        let inside = frame < self.frames
            && depth < self.depth
            && rows.start <= rows.end
            && rows.end <= self.height;
        if !inside {
            return Err(Error::failed(format!(
                "frame {frame}, depth {depth}, rows {rows:?} lie outside the series of {self}"
            )));
        }
        if buffer != rows.len() * self.width {
            return Err(Error::failed(format!(
                "a buffer of {buffer} pixels does not fit rows {rows:?} of width {}",
                self.width
            )));
        }
        Ok(())
    }

    /// Elements before the first of row `row`, in C order.
    pub(crate) fn offset_of_row(self, frame: usize, depth: usize, row: usize) -> usize {
        ((frame * self.depth + depth) * self.height + row) * self.width
    }
}

impl std::fmt::Display for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { frames, depth, height, width } = self;
        write!(f, "{frames} frames, depth {depth}, {height} rows of {width} pixels")
    }
}

/// Bytes of an array, unless they are more than memory can ever address.
pub(crate) fn byte_count(dimensions: &[usize], bytes_per_element: usize) -> Option<usize> {
    dimensions
        .iter()
        .try_fold(bytes_per_element, |product, &n| product.checked_mul(n))
        .filter(|&bytes| isize::try_from(bytes).is_ok())
}
