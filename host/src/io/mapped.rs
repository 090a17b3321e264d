//! Windows of a large file, mapped into memory and let go again.
//!
//! `unsafe` is here for one reason: mapped bytes are the file's, and reading a page that lies behind
//! the end of the file kills the process. So every window is compared with the size that the file
//! has just before it is mapped, the mapping is private, read-only and short-lived, and its bytes
//! are only ever copied out as numbers, of which every bit pattern is valid.

use super::staged::cannot_open;
use crate::error::{Error, Result};
use memmap2::{Mmap, MmapOptions};
use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

/// A file that is read in windows.
#[derive(Debug)]
pub(crate) struct MappedFile {
    file: File,
    path: PathBuf,
    bytes: u64,
}

impl MappedFile {
    /// Open an ordinary file.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| cannot_open(path, &error))?;
        let metadata = file.metadata().map_err(|error| cannot_open(path, &error))?;
        if !metadata.is_file() {
            return Err(Error::file(
                path,
                "is not an ordinary file: give the file with the images",
            ));
        }
        Ok(Self { file, path: path.to_owned(), bytes: metadata.len() })
    }

    /// Bytes it had when it was opened.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Map a window.
    pub(crate) fn map(&self, window: Range<u64>) -> Result<Mmap> {
        let now = self.file.metadata().map_err(|error| cannot_open(&self.path, &error))?.len();
        if now < window.end {
            return Err(self.shrunk(now));
        }
        let mut options = MmapOptions::new();
        options.offset(window.start).len((window.end - window.start) as usize);
        // SAFETY: the window lies inside the file as it is now; that nobody shortens it in the
        // next milliseconds is what every reader of a mapped file relies on.
        let mapped = unsafe { options.map(&self.file) };
        mapped.map_err(|error| Error::file(&self.path, format!("cannot be mapped: {error}")))
    }

    /// Copy bytes without mapping them.
    pub(crate) fn read(&self, position: u64, out: &mut [u8]) -> Result<()> {
        self.file.read_exact_at(out, position).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                self.shrunk(self.file.metadata().map_or(0, |metadata| metadata.len()))
            }
            _ => Error::file(&self.path, format!("cannot be read: {error}")),
        })
    }

    fn shrunk(&self, now: u64) -> Error {
        Error::file(
            &self.path,
            format!(
                "has shrunk from {} to {now} bytes while it was read: let nothing write to it",
                self.bytes
            ),
        )
    }
}
