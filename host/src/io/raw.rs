//! Raw camera images: what the reconstruction reads.

use super::photron::{self, PhotronImages};
use crate::error::{Error, Result};
use std::ops::Range;
use std::path::Path;

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

/// Open a camera recording by its header, `.cih` or `.cihx`, or by its `.mraw` with a header of
/// the same name beside it.
///
/// # Errors
/// When a file is missing, damaged or of another kind, or when the header and the size of the
/// images disagree.
pub fn open_raw(path: &Path) -> Result<Box<dyn RawImages>> {
    if photron::is_recording(path) {
        return Ok(Box::new(PhotronImages::open(path)?));
    }
    Err(Error::file(path, "unknown kind of recording: give its .cih, .cihx or .mraw file"))
}
