//! One complex volume in a Zarr group, written slab by slab.

use super::Attributes;
use super::shape::byte_count;
use super::zarr::{ArrayWriter, Compression, GroupWriter, Layout};
use crate::error::{Error, Result};
use num_complex::Complex32;
use std::path::{Path, PathBuf};

/// Rows of a slab, and of a chunk.
const ROWS: usize = 32;
/// Depths of a chunk.
const DEPTHS: usize = 32;

/// A group with `field` (time 1, z, y, x) on its way to its final name.
pub struct VolumeWriter {
    group: GroupWriter,
    field: ArrayWriter<Complex32>,
    /// Lengths of the axes (z, y, x).
    shape: [usize; 3],
}

impl VolumeWriter {
    /// Begin a group for a volume of these lengths (z, y, x).
    ///
    /// # Errors
    /// When the folder cannot be written to, or holds something else.
    pub fn create(path: &Path, shape: [usize; 3], attributes: Attributes) -> Result<Self> {
        let bytes = byte_count(&shape, size_of::<Complex32>())
            .ok_or_else(|| Error::file(path, format!("a volume {shape:?} fits on no disk")))?;
        let group = GroupWriter::create(path, attributes, bytes as u64)?;
        let [depths, rows, columns] = shape;
        let layout = Layout {
            axes: &["time", "z", "y", "x"],
            shape: &[1, depths, rows, columns],
            chunk: &[1, DEPTHS.min(depths), ROWS.min(rows), columns],
            shard: None,
            compression: Compression::None,
        };
        Ok(Self { field: group.array("field", &layout)?, group, shape })
    }

    /// The rows of the slabs in which a volume of `rows` rows is written.
    pub fn slabs(rows: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        (0..rows).step_by(ROWS).map(move |first| first..(first + ROWS).min(rows))
    }

    /// Write one of [`VolumeWriter::slabs`], axes (z, y, x).
    ///
    /// # Errors
    /// When the disk is full.
    pub fn write_slab(&self, rows: std::ops::Range<usize>, slab: &[Complex32]) -> Result<()> {
        let [depths, _, columns] = self.shape;
        self.field.write(&[0, 0, rows.start, 0], &[1, depths, rows.len(), columns], slab)
    }

    /// Write a small array of numbers beside the field.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn write_numbers(&self, name: &str, axis: &str, numbers: &[f64]) -> Result<()> {
        self.group.write_whole(name, &[axis], &[numbers.len()], numbers)
    }

    /// Give the group its final name, which is returned.
    ///
    /// # Errors
    /// When the folder has been taken meanwhile.
    pub fn finish(self) -> Result<PathBuf> {
        self.group.finish()
    }
}
