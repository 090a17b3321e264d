//! A folder of results, `--out`.

use crate::error::{Error, Result};
use crate::io::write_atomic;
use crate::progress;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Where the results go; a folder made for them disappears again when there are none.
pub(super) struct Folder<'a> {
    path: &'a Path,
    is_new: bool,
}

impl<'a> Folder<'a> {
    /// Make the folder, or see that it takes files, before anything is computed.
    pub(super) fn prepare(path: &'a Path) -> Result<Self> {
        let is_new = match fs::create_dir(path) {
            Ok(()) => true,
            Err(_) if path.is_dir() => false,
            Err(error) => return Err(refused(path, &error)),
        };
        let folder = Self { path, is_new };
        tempfile::tempfile_in(path).map_err(|error| refused(path, &error))?;
        Ok(folder)
    }

    /// Write the files; their paths are returned.
    pub(super) fn write(&self, files: &[(&str, Vec<u8>)]) -> Result<Vec<PathBuf>> {
        progress::check()?;
        let write = |(name, bytes): &(&str, Vec<u8>)| {
            let path = self.path.join(name);
            write_atomic(&path, bytes).map(|()| path)
        };
        files.iter().map(write).collect()
    }
}

impl Drop for Folder<'_> {
    fn drop(&mut self) {
        if self.is_new {
            // Only an empty folder is removed; with results in it this does nothing.
            let _ = fs::remove_dir(self.path);
        }
    }
}

fn refused(path: &Path, error: &std::io::Error) -> Error {
    let name = path.display();
    Error::failed(match error.kind() {
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
            format!("--out {name}: is a file, or lies below one; give the name of a folder")
        }
        ErrorKind::NotFound if !path.exists() => {
            format!("--out {name}: the folder above it does not exist; make it or choose another")
        }
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            format!("--out {name}: no permission to write there; choose another folder")
        }
        _ => format!("--out {name}: cannot be written to: {error}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unused_folder_disappears() {
        let above = tempfile::tempdir().unwrap();
        let path = above.path().join("demo");
        drop(Folder::prepare(&path).unwrap());
        assert!(!path.exists());
        let folder = Folder::prepare(&path).unwrap();
        folder.write(&[("a", vec![1])]).unwrap();
        drop(folder);
        assert!(path.join("a").is_file());
        drop(Folder::prepare(&path).unwrap());
        assert!(path.join("a").is_file());
    }

    #[test]
    fn a_file_and_a_missing_folder_are_refused() {
        let above = tempfile::tempdir().unwrap();
        let file = above.path().join("file");
        fs::write(&file, b"mine").unwrap();
        for (path, expected) in [
            (file.clone(), "is a file"),
            (file.join("x"), "is a file"),
            (above.path().join("a/b"), "does not exist"),
        ] {
            let error = Folder::prepare(&path).err().unwrap().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(fs::read(&file).unwrap(), b"mine");
    }
}
