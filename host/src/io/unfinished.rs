//! A Zarr folder that outlives an interruption.
//!
//! Long work grows in `.NAME.unfinished` beside its target: `new` is the result so far, `state` what
//! its maker needs to go on. Both stay when the work ends early, and the next run may take them up;
//! the last step renames `new` to its final name, as for any staged result.

use super::staged::{behind_links, cannot_create, cannot_write, refuse_foreign, replace_folder};
use crate::error::{Error, Result};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

/// Work that may be taken up again.
pub struct Unfinished {
    folder: PathBuf,
    target: PathBuf,
    bytes: u64,
}

impl Unfinished {
    /// Begin anew, or go on with what an earlier run left, if it left something. The result will
    /// need at most about `bytes` bytes.
    ///
    /// # Errors
    /// When the target is not ours to replace, or the folder cannot be written to.
    pub fn open(target: &Path, bytes: u64, resume: bool) -> Result<Self> {
        let target = behind_links(target);
        refuse_foreign(&target)?;
        let folder = folder_beside(&target)?;
        let report = |error| cannot_create(&target, &error);
        if !resume && folder.exists() {
            fs::remove_dir_all(&folder).map_err(report)?;
        }
        for folder in [folder.clone(), folder.join("new")] {
            if !folder.is_dir() {
                fs::create_dir(&folder).map_err(report)?;
            }
        }
        Ok(Self { folder, target, bytes })
    }

    /// Whether an earlier run left something beside the target.
    #[must_use]
    pub fn is_left(target: &Path) -> bool {
        folder_beside(&behind_links(target)).is_ok_and(|folder| folder.exists())
    }

    /// Where the result grows.
    #[must_use]
    pub fn path(&self) -> PathBuf {
        self.folder.join("new")
    }

    /// The folder that is left behind when the work ends early.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The final name, for messages.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// What the whole result needs, for messages.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Keep `bytes` under a name of the maker's state; an earlier state of that name is replaced in
    /// one step.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn save(&self, name: &str, bytes: &[u8]) -> Result<()> {
        let (new, place) = (self.folder.join(format!("{name}.new")), self.folder.join(name));
        let report = |error| cannot_write(&self.target, &error, self.bytes);
        fs::write(&new, bytes).map_err(report)?;
        fs::rename(&new, &place).map_err(report)
    }

    /// What was kept under that name, if anything.
    ///
    /// # Errors
    /// When it is there and cannot be read.
    pub fn load(&self, name: &str) -> Result<Option<Vec<u8>>> {
        match fs::read(self.folder.join(name)) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(Error::file(&self.folder, format!("cannot be read: {error}"))),
        }
    }

    /// Give the result its final name and remove the state; an earlier result is replaced.
    ///
    /// # Errors
    /// When the folder cannot be renamed.
    pub fn finish(self) -> Result<()> {
        refuse_foreign(&self.target)?;
        replace_folder(&self.path(), &self.folder.join("old"), &self.target, self.bytes)?;
        fs::remove_dir_all(&self.folder)
            .map_err(|error| cannot_write(&self.target, &error, self.bytes))
    }

    /// Remove all traces: the work failed before anything was worth keeping.
    pub fn discard(&self) {
        // What cannot be removed is replaced by the next run.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// `.V.zarr.unfinished` beside `V.zarr`.
fn folder_beside(target: &Path) -> Result<PathBuf> {
    let name = target.file_name().ok_or_else(|| {
        Error::usage(format!("{}: an output needs a file name", target.display()))
    })?;
    let mut unfinished = OsString::from(".");
    unfinished.push(name);
    unfinished.push(".unfinished");
    Ok(target.with_file_name(unfinished))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_taken_up_and_finished() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("V.zarr");
        let work = Unfinished::open(&target, 10, false).unwrap();
        fs::write(work.path().join("zarr.json"), b"{}").unwrap();
        work.save("state", b"half").unwrap();
        drop(work);

        let work = Unfinished::open(&target, 10, true).unwrap();
        assert_eq!(work.load("state").unwrap().as_deref(), Some(b"half".as_slice()));
        assert_eq!(work.load("other").unwrap(), None);
        work.finish().unwrap();
        let names: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["V.zarr"]);

        let again = Unfinished::open(&target, 10, false).unwrap();
        assert_eq!(again.load("state").unwrap(), None, "begun anew");
        again.discard();
        assert!(target.join("zarr.json").exists());
    }

    #[test]
    fn a_folder_that_is_not_there_is_not_made() {
        let folder = tempfile::tempdir().unwrap();
        let refused = Unfinished::open(&folder.path().join("no/V.zarr"), 10, false);
        assert!(refused.err().unwrap().to_string().contains("does not exist"));
        assert!(!folder.path().join("no").exists());
    }

    #[test]
    fn somebodys_folder_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("photos");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("cat.jpg"), b"").unwrap();
        assert!(Unfinished::open(&target, 10, false).is_err());
    }
}
