//! An array of images that grows by one image at a time, under its final name.
//!
//! The group is there with an array of no image before the first one comes. Each image is a chunk of its own, written
//! before the array's metadata count it; the metadata are replaced in one step. So a reader finds whole images at any
//! time, and all that it finds.

use super::one_line;
use super::writer::{Compression, GroupWriter, Layout, Report};
use crate::error::{Error, Result};
use crate::io::Attributes;
use crate::io::staged::{StagedFile, behind_links};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zarrs::array::{Array, ArraySubset, CodecOptions};
use zarrs::filesystem::FilesystemStore;

/// The array's name.
const NAME: &str = "phase_rad";

/// float32 images (time, y, x), one after the other.
pub(crate) struct ImageAppender {
    path: PathBuf,
    array: Array<FilesystemStore>,
    images: u64,
    height: usize,
    width: usize,
}

impl ImageAppender {
    /// Make the group with an array of no image, in the place of an earlier one.
    pub(crate) fn create(
        path: &Path,
        height: usize,
        width: usize,
        attributes: Attributes,
    ) -> Result<Self> {
        let image = [1, height, width];
        let layout = Layout {
            axes: &["time", "y", "x"],
            shape: &[0, height, width],
            chunk: &image,
            shard: None,
            compression: Compression::None,
        };
        let group = GroupWriter::create(path, attributes, (height * width * 4) as u64)?;
        group.array::<f32>(NAME, &layout)?;
        group.finish()?;
        let path = behind_links(path);
        let cannot = |what: String| Error::file(&path, format!("cannot hold a Zarr store: {what}"));
        let store = FilesystemStore::new(&path).map_err(|error| cannot(one_line(&error)))?;
        let array = Array::open(Arc::new(store), &format!("/{NAME}"))
            .map_err(|error| cannot(one_line(&error)))?;
        Ok(Self { path, array, images: 0, height, width })
    }

    /// Append an image, (y, x).
    pub(crate) fn push(&mut self, image: &[f32]) -> Result<()> {
        let (height, width) = (self.height as u64, self.width as u64);
        let box_of_image = [self.images..self.images + 1, 0..height, 0..width];
        let report = Report { target: self.path.clone(), bytes: size_of_val(image) as u64 };
        self.images += 1;
        self.array
            .set_shape(vec![self.images, height, width])
            .map_err(|error| Error::file(&self.path, one_line(&error)))?;
        let options = CodecOptions::default().with_concurrent_target(1);
        self.array
            .store_array_subset_opt(&ArraySubset::new_with_ranges(&box_of_image), image, &options)
            .map_err(|error| report.array(&error))?;
        self.write_metadata()
    }

    fn write_metadata(&self) -> Result<()> {
        let text = serde_json::to_vec_pretty(self.array.metadata())
            .map_err(|error| Error::file(&self.path, error))?;
        let file = self.path.join(NAME).join("zarr.json");
        let staged = StagedFile::create(&file, text.len() as u64)?;
        staged.write_at(&text, 0)?;
        staged.publish()
    }
}
