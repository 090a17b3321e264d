//! Raw camera images: what the reconstruction reads.

use super::npy;
use super::photron::{self, PhotronImages};
use crate::allocate::zeros;
use crate::error::{Error, Result};
use std::ops::Range;
use std::path::Path;

/// Counts that [`visit_images`] holds in memory: 8 MiB, or one image where that is larger.
const BLOCK: usize = 1 << 22;

/// Layout of raw images, row-major counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawFormat {
    /// Number of images.
    pub images: usize,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// Significant bits: a saturated pixel counts 2^bits - 1.
    pub bits: u32,
    /// Images per second, where the file knows it.
    pub rate_hz: Option<f64>,
}

impl RawFormat {
    /// Refuse a request outside the images or a buffer that does not fit it.
    pub(super) fn check_request(
        &self,
        images: &Range<usize>,
        rows: &Range<usize>,
        buffer: usize,
    ) -> Result<()> {
        let inside = images.start <= images.end
            && images.end <= self.images
            && rows.start <= rows.end
            && rows.end <= self.height;
        if !inside {
            return Err(Error::failed(format!(
                "rows {rows:?} of images {images:?} lie outside {} images of {} rows",
                self.images, self.height
            )));
        }
        if buffer != images.len() * rows.len() * self.width {
            return Err(Error::failed(format!(
                "a buffer of {buffer} pixels does not fit rows {rows:?} of images {images:?} of width {}",
                self.width
            )));
        }
        Ok(())
    }
}

/// Raw images on disk, read piece by piece and from several threads.
pub trait RawImages: Send + Sync {
    /// Their layout.
    fn format(&self) -> RawFormat;

    /// Decode `rows` of `images` into `out`, axes (image, row, x), on the calling thread.
    ///
    /// # Errors
    /// When the request lies outside the recording, `out` does not fit it, or the file cannot be
    /// read or has shrunk.
    fn read(&self, images: Range<usize>, rows: Range<usize>, out: &mut [u16]) -> Result<()>;
}

/// Open raw images: a camera recording by its header, `.cih` or `.cihx`, or by its `.mraw` with a
/// header of the same name beside it; or an `.npy` file of uint8 or uint16, axes (image, y, x).
///
/// # Errors
/// When a file is missing, damaged or of another kind, or when the header and the size of the
/// images disagree.
pub fn open_raw(path: &Path) -> Result<Box<dyn RawImages>> {
    if photron::is_recording(path) {
        return Ok(Box::new(PhotronImages::open(path)?));
    }
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        return npy::open_images(path);
    }
    Err(Error::file(path, "unknown kind of recording: give its .cihx, .cih or .mraw, or an .npy"))
}

/// Show all images in order to `visit`, some whole ones at a time.
///
/// # Errors
/// When they cannot be read, one does not fit in memory, or `visit` fails.
pub fn visit_images(
    raw: &dyn RawImages,
    mut visit: impl FnMut(&[u16]) -> Result<()>,
) -> Result<()> {
    let RawFormat { images, height, width, .. } = raw.format();
    let per_image = height * width;
    let at_once = (BLOCK / per_image.max(1)).clamp(1, images.max(1));
    let mut counts = zeros(at_once * per_image, "raw images")?;
    for first in (0..images).step_by(at_once) {
        let last = (first + at_once).min(images);
        let block = &mut counts[..(last - first) * per_image];
        raw.read(first..last, 0..height, block)?;
        visit(block)?;
    }
    Ok(())
}
