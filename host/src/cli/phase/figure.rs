//! The file of a figure: its folder is tried before anything is computed.

use crate::error::{Error, Result};
use crate::figures::Canvas;
use crate::io::StagedFile;
use std::path::{Path, PathBuf};

/// Kinds of pictures, by the extension of their name.
#[derive(Clone, Copy, Debug)]
pub(super) enum Picture {
    Png,
    Svg,
}

impl Picture {
    /// `option` is what names it on the command line.
    pub(super) fn of(option: &str, path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("svg") => Ok(Self::Svg),
            _ => {
                let path = path.display();
                Err(Error::usage(format!("{option} {path}: pictures go to .png or .svg")))
            }
        }
    }
}

/// A figure on its way to its final name.
pub(super) struct FigureFile {
    file: StagedFile,
    path: PathBuf,
    picture: Picture,
}

impl FigureFile {
    /// The file that `option` asks for, if it is given.
    pub(super) fn wanted(option: &str, path: Option<&Path>) -> Result<Option<Self>> {
        path.map(|path| Self::create(option, path)).transpose()
    }

    fn create(option: &str, path: &Path) -> Result<Self> {
        let picture = Picture::of(option, path)?;
        Ok(Self { file: StagedFile::create(path, 0)?, path: path.to_owned(), picture })
    }

    /// Write the drawing and give the file its final name, which is returned.
    pub(super) fn finish(self, canvas: &Canvas) -> Result<PathBuf> {
        let bytes = match self.picture {
            Picture::Png => canvas.png()?,
            Picture::Svg => canvas.svg()?.into_bytes(),
        };
        self.file.write_at(&bytes, 0)?;
        self.file.finish()?;
        Ok(self.path)
    }
}
