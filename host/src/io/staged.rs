//! Results appear under their final name whole, or not at all.
//!
//! A result grows under a name like `.F.npy.partialA1b2C3` beside its target and takes the final
//! name in one rename. Dropped before that, it is removed and an earlier result stays as it was.
//! The temporary name is taken before any computing, so a folder that cannot be written to is
//! refused at once.

use super::flush::Flush;
use crate::error::{Error, Result};
use std::ffi::OsString;
use std::fs::{self, Permissions};
use std::io::{self, ErrorKind, Write};
use std::os::unix::fs::{FileExt, PermissionsExt};
use std::path::{Path, PathBuf};
use tempfile::{Builder, NamedTempFile, TempDir};

/// A file on its way to its final name.
pub(crate) struct StagedFile {
    file: NamedTempFile,
    target: PathBuf,
    bytes: u64,
    flush: Option<Box<Flush>>,
}

impl StagedFile {
    /// Begin a file of `bytes` bytes.
    pub(crate) fn create(target: &Path, bytes: u64) -> Result<Self> {
        let target = behind_links(target);
        if fs::metadata(&target).is_ok_and(|found| !found.is_file()) {
            return Err(Error::file(
                &target,
                "exists and is not an ordinary file, so it is not replaced: choose another name",
            ));
        }
        let file = Builder::new()
            .prefix(&partial_name(&target)?)
            // Less the umask, as for any other new file; tempfile's own default is private.
            .permissions(Permissions::from_mode(0o666))
            .tempfile_in(folder_of(&target))
            .map_err(|error| cannot_create(&target, &error))?;
        Ok(Self { file, target, bytes, flush: None })
    }

    /// The same file, of which the disk gets what is there while it grows: for large ones that are written little by
    /// little and end by [`Self::finish`].
    pub(crate) fn flushed(mut self) -> Self {
        self.flush = Flush::begin(self.file.as_file(), self.bytes);
        self
    }

    /// Write at a position; several threads may do so at once.
    pub(crate) fn write_at(&self, bytes: &[u8], position: u64) -> Result<()> {
        self.file
            .as_file()
            .write_all_at(bytes, position)
            .map_err(|error| cannot_write(&self.target, &error, self.bytes))?;
        if let Some(flush) = &self.flush {
            flush.written(bytes.len() as u64);
        }
        Ok(())
    }

    /// Give the file its final name.
    pub(crate) fn finish(mut self) -> Result<()> {
        // Some file systems report a full disk only now.
        let flushed = self.flush.take().map_or(Ok(()), |flush| flush.finish());
        let synced = flushed.and_then(|()| self.file.as_file().sync_all());
        synced.map_err(|error| cannot_write(&self.target, &error, self.bytes))?;
        self.publish()
    }

    /// Give the file its final name without waiting for the disk: readers find it whole, a failure of power may not.
    /// For files that are soon replaced.
    pub(crate) fn publish(self) -> Result<()> {
        let Self { file, target, bytes, .. } = self;
        file.persist(&target).map_err(|failure| cannot_write(&target, &failure.error, bytes))?;
        Ok(())
    }
}

/// A folder on its way to its final name.
///
/// The temporary folder holds `new`, the result, and while the two change places `old`.
pub(crate) struct StagedFolder {
    temporary: TempDir,
    target: PathBuf,
    bytes: u64,
    /// Refuses an existing target that is not ours to replace.
    refuse_foreign: fn(&Path) -> Result<()>,
}

impl StagedFolder {
    /// Begin a Zarr folder of at most about `bytes` bytes.
    pub(crate) fn create(target: &Path, bytes: u64) -> Result<Self> {
        Self::create_unless(target, bytes, refuse_foreign)
    }

    /// Begin a folder of at most about `bytes` bytes, unless `refuse_foreign` is against replacing
    /// what is there.
    pub(crate) fn create_unless(
        target: &Path,
        bytes: u64,
        refuse_foreign: fn(&Path) -> Result<()>,
    ) -> Result<Self> {
        let target = behind_links(target);
        refuse_foreign(&target)?;
        let temporary = Builder::new()
            .prefix(&partial_name(&target)?)
            .tempdir_in(folder_of(&target))
            .map_err(|error| cannot_create(&target, &error))?;
        let staged = Self { temporary, target, bytes, refuse_foreign };
        fs::create_dir(staged.path()).map_err(|error| cannot_create(&staged.target, &error))?;
        Ok(staged)
    }

    /// Where the result grows.
    pub(crate) fn path(&self) -> PathBuf {
        self.temporary.path().join("new")
    }

    /// The final name, for messages.
    pub(crate) fn target(&self) -> &Path {
        &self.target
    }

    /// What the whole result needs, for messages.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Give the folder its final name; an earlier result is removed afterwards.
    pub(crate) fn finish(self) -> Result<()> {
        (self.refuse_foreign)(&self.target)?;
        let old = self.temporary.path().join("old");
        replace_folder(&self.path(), &old, &self.target, self.bytes)
    }
}

/// Give the folder `new` the name `target`; an earlier result there is moved to `old`.
pub(super) fn replace_folder(new: &Path, old: &Path, target: &Path, bytes: u64) -> Result<()> {
    let report = |error| cannot_write(target, &error, bytes);
    let replaces = target.exists();
    if replaces {
        fs::rename(target, old).map_err(report)?;
    }
    if let Err(error) = fs::rename(new, target) {
        if replaces {
            fs::rename(old, target).map_err(report)?;
        }
        return Err(report(error));
    }
    Ok(())
}

/// Write a small file, such as a picture or a report, in one step.
///
/// # Errors
/// When the folder is missing or cannot be written to, or the disk is full.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<()> {
    let needed = bytes.len() as u64;
    let mut staged = StagedFile::create(path, needed)?;
    let written = staged.file.write_all(bytes);
    written.map_err(|error| cannot_write(path, &error, needed))?;
    staged.finish()
}

/// Only Zarr groups are replaced: a folder with anything else in it may be somebody's data.
pub(super) fn refuse_foreign(target: &Path) -> Result<()> {
    match fs::metadata(target) {
        Err(_) => Ok(()),
        Ok(found) if !found.is_dir() => Err(Error::file(
            target,
            "is a file, a Zarr store is a folder: remove it or choose another name",
        )),
        Ok(_) if target.join("zarr.json").is_file() => Ok(()),
        Ok(_) => Err(Error::file(
            target,
            "is a folder but not a Zarr group (no zarr.json), so it is not replaced: choose another name",
        )),
    }
}

/// A link keeps its place: the file behind it is replaced.
pub(super) fn behind_links(target: &Path) -> PathBuf {
    if target.is_symlink() {
        fs::canonicalize(target).unwrap_or_else(|_| target.to_owned())
    } else {
        target.to_owned()
    }
}

fn partial_name(target: &Path) -> Result<OsString> {
    let name = target.file_name().ok_or_else(|| {
        Error::usage(format!("{}: an output needs a file name", target.display()))
    })?;
    let mut partial = OsString::from(".");
    partial.push(name);
    partial.push(".partial");
    Ok(partial)
}

fn folder_of(target: &Path) -> &Path {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// An input that the operating system does not open.
pub(crate) fn cannot_open(path: &Path, error: &io::Error) -> Error {
    match error.kind() {
        ErrorKind::NotFound => Error::file(path, "no such file: check the name"),
        ErrorKind::PermissionDenied => Error::file(path, "no permission to read it"),
        _ => Error::file(path, format!("cannot be opened: {error}")),
    }
}

/// An output whose folder does not take it.
pub(super) fn cannot_create(target: &Path, error: &io::Error) -> Error {
    let folder = folder_of(target).display();
    match error.kind() {
        ErrorKind::NotFound => Error::file(
            target,
            format!("the folder {folder} does not exist: create it or choose another"),
        ),
        ErrorKind::NotADirectory => {
            Error::file(target, format!("{folder} is not a folder: choose another name"))
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => Error::file(
            target,
            format!("no permission to write to the folder {folder}: choose another"),
        ),
        _ => Error::file(target, format!("cannot be created: {error}")),
    }
}

/// An output that does not get through; `bytes` is what the whole of it needs.
pub(crate) fn cannot_write(target: &Path, error: &io::Error, bytes: u64) -> Error {
    match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Error::file(
            target,
            format!(
                "the disk is full, {bytes} bytes are needed: free space or choose another disk"
            ),
        ),
        _ => Error::file(target, format!("cannot be written: {error}")),
    }
}
