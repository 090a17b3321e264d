//! Which files belong together, and whether their sizes agree.

use super::header::CameraHeader;
use super::{cih, cihx};
use crate::error::{Error, Result};
use crate::io::mapped::MappedFile;
use crate::io::staged::cannot_open;
use std::borrow::Cow;
use std::cmp::Ordering;
use std::fmt;
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
        fs::metadata(path).map_err(|error| cannot_open(path, &error))?;
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

    /// Open the images.
    pub(crate) fn open_images(&self) -> Result<MappedFile> {
        if self.images.exists() {
            return MappedFile::open(&self.images);
        }
        let name = self.header_name();
        Err(Error::file(&self.images, format!("the images of {name} are missing: copy them too")))
    }

    /// Refuse images of another size than the header wants.
    pub(crate) fn check_size(&self, header: &CameraHeader, found: u64) -> Result<()> {
        let state = ImagesState::of(header, Some(found));
        if state == ImagesState::Whole {
            return Ok(());
        }
        let name = self.header_name();
        let wanted = header.image_bytes();
        Err(Error::file(
            &self.images,
            format!(
                "{state} ({found} bytes; {name} wants {wanted}): copy both files again, or correct the header"
            ),
        ))
    }

    fn header_name(&self) -> Cow<'_, str> {
        self.header.file_name().unwrap_or_default().to_string_lossy()
    }
}

/// Whether the images are as many as the header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ImagesState {
    Whole,
    Missing,
    Empty { images: usize },
    CutShort { whole: u64, images: usize },
    TooLong { whole: u64, images: usize },
}

impl ImagesState {
    /// From the size of the images' file, if it is there.
    pub(crate) fn of(header: &CameraHeader, found: Option<u64>) -> Self {
        let images = header.images;
        let Some(found) = found else { return Self::Missing };
        let whole = found / header.bytes_per_image();
        match found.cmp(&header.image_bytes()) {
            Ordering::Equal => Self::Whole,
            Ordering::Less if found == 0 => Self::Empty { images },
            Ordering::Less => Self::CutShort { whole, images },
            Ordering::Greater => Self::TooLong { whole, images },
        }
    }
}

impl fmt::Display for ImagesState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => write!(f, "whole"),
            Self::Missing => write!(f, "missing"),
            Self::Empty { images } => write!(f, "empty: none of {images} images"),
            Self::CutShort { whole, images } => {
                write!(f, "cut short: {whole} whole images of {images}")
            }
            Self::TooLong { whole, images } => {
                write!(f, "too long: room for {whole} images, the header says {images}")
            }
        }
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
    let metadata = fs::metadata(path).map_err(cannot)?;
    if !metadata.is_file() {
        return Err(Error::file(path, "is not an ordinary file: give the header of a recording"));
    }
    if metadata.len() == 0 {
        return Err(Error::file(path, "the header is empty: copy it again"));
    }
    if metadata.len() > LARGEST_HEADER {
        return Err(Error::file(
            path,
            format!("has {} bytes, too many for a header", metadata.len()),
        ));
    }
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LARGEST_HEADER).read_to_end(&mut bytes))
        .map_err(cannot)?;
    Ok(bytes)
}
