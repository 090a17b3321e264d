//! Which files belong together, and whether their sizes agree.

use super::header::CameraHeader;
use super::{cih, cihx};
use crate::error::{Error, Result};
use crate::io::staged::cannot_open;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Headers of cameras have some ten thousand bytes.
const LARGEST_HEADER: u64 = 16 << 20;

/// The two kinds of header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum HeaderKind {
    /// Lines of text.
    Cih,
    /// XML inside a container.
    Cihx,
}

impl HeaderKind {
    /// By the extension of a name.
    pub(super) fn of(path: &Path) -> Option<Self> {
        if has_extension(path, "cihx") {
            Some(Self::Cihx)
        } else {
            has_extension(path, "cih").then_some(Self::Cih)
        }
    }

    /// The bytes of a header file.
    pub(super) fn print(self, header: &CameraHeader) -> Vec<u8> {
        match self {
            Self::Cih => cih::print(header),
            Self::Cihx => cihx::print(header),
        }
    }
}

/// The files of one recording.
#[derive(Debug, Clone)]
pub(crate) struct RecordingFiles {
    /// The header.
    pub(crate) header: PathBuf,
    /// Its kind.
    pub(crate) kind: HeaderKind,
    /// The images; they may be missing.
    pub(crate) images: PathBuf,
}

/// Does the name say so?
pub(crate) fn is_recording(path: &Path) -> bool {
    HeaderKind::of(path).is_some() || has_extension(path, "mraw")
}

impl RecordingFiles {
    /// The header of this name and the images beside it, or the images of this name and the header
    /// beside them: the richer one where there are both.
    pub(crate) fn find(path: &Path) -> Result<Self> {
        let (header, images) = if has_extension(path, "mraw") {
            let header = beside(path, "cihx").or_else(|| beside(path, "cih"));
            let missing =
                || Error::file(path, "has no .cihx or .cih header beside it: copy that too");
            (header.ok_or_else(missing)?, path.to_owned())
        } else {
            (path.to_owned(), beside(path, "mraw").unwrap_or_else(|| path.with_extension("mraw")))
        };
        let unknown =
            || Error::file(path, "unknown kind of recording: give its .cih, .cihx or .mraw");
        Ok(Self { kind: HeaderKind::of(&header).ok_or_else(unknown)?, header, images })
    }

    /// Read the header.
    pub(crate) fn read_header(&self) -> Result<CameraHeader> {
        let bytes = read_small(&self.header)?;
        match self.kind {
            HeaderKind::Cih => cih::parse(&self.header, &bytes),
            HeaderKind::Cihx => cihx::parse(&self.header, &bytes),
        }
    }

    /// Refuse images of another size than the header wants.
    pub(crate) fn check_size(&self, header: &CameraHeader, found: u64) -> Result<()> {
        let wanted = header.image_bytes();
        if found == wanted {
            return Ok(());
        }
        let (images, whole) = (header.images, found / header.bytes_per_image());
        let name = self.header.file_name().unwrap_or_default().to_string_lossy();
        Err(Error::file(
            &self.images,
            if found == 0 {
                format!("is empty, {name} wants {images} images: copy it again")
            } else if found < wanted {
                format!(
                    "is cut short: {name} wants {images} images in {wanted} bytes, {found} bytes hold {whole} whole images; copy it again"
                )
            } else {
                format!(
                    "does not belong to {name}, which wants {images} images in {wanted} bytes: it has {found}, room for {whole}; copy both again"
                )
            },
        ))
    }
}

/// A file of this name with another extension, in lower or upper case.
fn beside(path: &Path, extension: &str) -> Option<PathBuf> {
    let spellings = [extension.to_owned(), extension.to_uppercase()];
    spellings.iter().map(|spelling| path.with_extension(spelling)).find(|path| path.exists())
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// All of a file that cannot be large.
fn read_small(path: &Path) -> Result<Vec<u8>> {
    let cannot = |error| cannot_open(path, &error);
    let length = fs::metadata(path).map_err(cannot)?;
    if !length.is_file() {
        return Err(Error::file(path, "is not an ordinary file: give the header of a recording"));
    }
    if length.len() == 0 {
        return Err(Error::file(path, "the header is empty: copy it again"));
    }
    if length.len() > LARGEST_HEADER {
        return Err(Error::file(
            path,
            format!("has {} bytes, too many for a header", length.len()),
        ));
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LARGEST_HEADER).read_to_end(&mut bytes))
        .map_err(cannot)?;
    Ok(bytes)
}
