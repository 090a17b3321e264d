//! Images of a recording, piece by piece.

use super::files::RecordingFiles;
use super::header::CameraHeader;
use crate::error::Result;
use crate::io::mapped::MappedFile;
use crate::io::raw::{RawFormat, RawImages};
use std::ops::Range;
use std::path::Path;

/// Counts decoded from one window: a few megabytes stay resident per reading thread. A multiple of
/// every group of packed counts.
const WINDOW: usize = 1 << 21;

/// Shorter pieces, a few rows of many images, are copied: mapping and its page faults made pieces of
/// 5 kB five times and of 80 kB one and a half times slower. Whole images are faster mapped, by a
/// tenth or more, as their bytes are not moved twice.
const SHORT_BYTES: usize = 1 << 17;

/// A recording whose header and images agree.
pub struct PhotronImages {
    header: CameraHeader,
    file: MappedFile,
}

impl PhotronImages {
    /// Open a recording by its header or its images.
    ///
    /// # Errors
    /// When a file is missing, damaged or unsupported, or the sizes disagree.
    pub fn open(path: &Path) -> Result<Self> {
        let files = RecordingFiles::find(path)?;
        let header = files.read_header()?;
        let file = files.open_images()?;
        files.check_size(&header, file.bytes())?;
        Ok(Self { header, file })
    }

    /// What the header says.
    #[must_use]
    pub fn header(&self) -> &CameraHeader {
        &self.header
    }

    /// Decode neighbouring counts, from number `first` of the whole file on.
    fn decode(&self, first: usize, out: &mut [u16], copy: &mut Vec<u8>) -> Result<()> {
        let packing = self.header.packing;
        let (group, group_bytes) = packing.group();
        let (before, skip) = (first / group, first % group);
        let position = (before * group_bytes) as u64;
        let bytes = packing.bytes_of(skip + out.len());
        let shift = self.header.shift();
        if bytes < SHORT_BYTES {
            copy.resize(bytes, 0);
            self.file.read(position, copy)?;
            packing.unpack(copy, skip, shift, out);
        } else {
            let window = self.file.map(position..position + bytes as u64)?;
            packing.unpack(&window, skip, shift, out);
        }
        Ok(())
    }
}

impl RawImages for PhotronImages {
    fn format(&self) -> RawFormat {
        RawFormat {
            images: self.header.images,
            height: self.header.height,
            width: self.header.width,
            bits: self.header.significant_bits(),
            rate_hz: self.header.image_rate_hz(),
        }
    }

    fn read(&self, images: Range<usize>, rows: Range<usize>, out: &mut [u16]) -> Result<()> {
        self.format().check_request(&images, &rows, out.len())?;
        let (per_image, width) = (self.header.counts_per_image(), self.header.width);
        // Whole images follow each other without a gap.
        let run = if rows.len() == self.header.height { out.len() } else { rows.len() * width };
        let mut first = images.start * per_image + rows.start * width;
        let mut copy = Vec::new();
        for run in out.chunks_mut(run.max(1)) {
            for (number, piece) in run.chunks_mut(WINDOW).enumerate() {
                self.decode(first + number * WINDOW, piece, &mut copy)?;
            }
            first += per_image;
        }
        Ok(())
    }
}
