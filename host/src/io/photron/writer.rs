//! Whole recordings.

use super::files::HeaderKind;
use super::header::CameraHeader;
use super::samples::Packing;
use crate::error::{Error, Result};
use crate::io::staged::StagedFile;
use std::path::{Path, PathBuf};

/// Counts that pass through memory at once; a multiple of every group of packed counts.
const BLOCK: usize = 1 << 18;

/// Writes a recording: `F.cihx` or `F.cih`, and `F.mraw` beside it.
///
/// Both take their names in [`finish`](Self::finish), the images first; dropped before that,
/// neither appears.
pub struct PhotronWriter {
    header: CameraHeader,
    header_path: PathBuf,
    images_path: PathBuf,
    header_file: StagedFile,
    images_file: StagedFile,
    images_written: usize,
    bytes: Vec<u8>,
}

impl PhotronWriter {
    /// Begin the files under temporary names. The extension of `path`, `.cih` or `.cihx`, chooses
    /// the kind of header.
    ///
    /// # Errors
    /// When the header's numbers cannot be, the extension is another, a header of the other kind
    /// lies there, or the folder cannot be written to.
    pub fn create(path: &Path, header: CameraHeader) -> Result<Self> {
        let kind = HeaderKind::of(path).ok_or_else(|| {
            let shown = path.display();
            Error::usage(format!("{shown}: a recording is named by its header: give .cihx or .cih"))
        })?;
        header.check(path)?;
        refuse_other_header(path, kind)?;
        if header.packing == Packing::Bits10 {
            return Err(Error::file(path, "images of 10 bits are read only: write 12 or 16"));
        }
        let images_path = path.with_extension("mraw");
        let text = kind.print(&header);
        let header_file = StagedFile::create(path, text.len() as u64)?;
        header_file.write_at(&text, 0)?;
        Ok(Self {
            images_file: StagedFile::create(&images_path, header.image_bytes())?.flushed(),
            header_file,
            header_path: path.to_owned(),
            images_path,
            header,
            images_written: 0,
            bytes: Vec::new(),
        })
    }

    /// Append one or more whole images, row-major counts.
    ///
    /// # Errors
    /// When they are no whole images or more than the header says, a count needs more bits than
    /// it has, or the disk is full.
    pub fn push(&mut self, images: &[u16]) -> Result<()> {
        let per_image = self.header.counts_per_image();
        if !images.len().is_multiple_of(per_image) {
            let pixels = images.len();
            return Err(self.refuse(format!("{pixels} counts are no whole images of {per_image}")));
        }
        let after = self.images_written + images.len() / per_image;
        if after > self.header.images {
            let wanted = self.header.images;
            return Err(self.refuse(format!("{after} images where the header says {wanted}")));
        }
        self.check_counts(images)?;
        let (packing, shift) = (self.header.packing, self.header.shift());
        let mut position = self.images_written as u64 * self.header.bytes_per_image();
        for block in images.chunks(BLOCK) {
            self.bytes.resize(packing.bytes_of(block.len()), 0);
            packing.pack(block, shift, &mut self.bytes);
            self.images_file.write_at(&self.bytes, position)?;
            position += self.bytes.len() as u64;
        }
        self.images_written = after;
        Ok(())
    }

    /// Give the files their final names, which are returned: header, images.
    ///
    /// # Errors
    /// When images are missing, or the disk is full.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let (written, wanted) = (self.images_written, self.header.images);
        if written != wanted {
            return Err(self.refuse(format!("{written} of {wanted} images were written")));
        }
        // Whoever opens the header finds its images.
        self.images_file.finish()?;
        self.header_file.finish()?;
        Ok(vec![self.header_path, self.images_path])
    }

    fn check_counts(&self, images: &[u16]) -> Result<()> {
        let bits = self.header.significant_bits();
        let all = images.iter().fold(0, |all, count| all | count);
        if u32::from(all) < 1 << bits {
            return Ok(());
        }
        let highest = images.iter().max().copied().unwrap_or(0);
        Err(self.refuse(format!("a count of {highest} does not fit {bits} bits")))
    }

    fn refuse(&self, what: String) -> Error {
        Error::file(&self.images_path, what)
    }
}

/// It would describe the new images as if they were its own.
fn refuse_other_header(path: &Path, kind: HeaderKind) -> Result<()> {
    let other = path.with_extension(match kind {
        HeaderKind::Cih => "cihx",
        HeaderKind::Cihx => "cih",
    });
    if other.exists() {
        return Err(Error::file(
            &other,
            "is the header of another recording of this name: remove it or choose another name",
        ));
    }
    Ok(())
}
