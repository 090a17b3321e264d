//! Diagnostic pictures of a reconstruction.
use crate::error::Result;
use crate::io::RawImages;
use crate::reconstruct::recording::Findings;
use crate::reconstruct::settings::Settings;
use std::path::{Path, PathBuf};

/// Where they go.
pub(super) struct Folder(PathBuf);
impl Folder {
    pub(super) fn beside(output: &Path) -> Self { Self(output.with_extension("steps")) }
    pub(super) fn path(&self) -> &Path { &self.0 }
}
pub(super) fn draw(_: &Folder, _: &dyn RawImages, _: &Settings, _: &Findings) -> Result<()> { Ok(()) }
