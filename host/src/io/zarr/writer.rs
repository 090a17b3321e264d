//! A group of arrays, written in pieces.

use super::one_line;
use crate::error::{Error, Result};
use crate::io::Attributes;
use crate::io::element::Element;
use crate::io::staged::{StagedFolder, cannot_write};
use crate::io::unfinished::Unfinished;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zarrs::array::codec::{Crc32cCodec, ZstdCodec};
use zarrs::array::{
    Array, ArrayBuilder, ArrayError, ArraySubset, BytesToBytesCodecTraits, CodecError, CodecOptions,
};
use zarrs::filesystem::FilesystemStore;
use zarrs::group::GroupBuilder;
use zarrs::storage::StorageError;

/// zstd's default: results shrink, and writing stays faster than computing.
const ZSTD_LEVEL: i32 = 3;

/// What happens to the bytes of a chunk; all of them carry a checksum.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compression {
    /// For speckle, whose mantissas are noise.
    None,
    /// For results, which are smooth or masked.
    Zstd,
}

/// Axes and chunks of an array.
pub(crate) struct Layout<'a> {
    /// Names of the axes.
    pub(crate) axes: &'a [&'a str],
    pub(crate) shape: &'a [usize],
    /// What is compressed in one piece.
    pub(crate) chunk: &'a [usize],
    /// What is one file, in whole chunks; a chunk where not given.
    pub(crate) shard: Option<&'a [usize]>,
    pub(crate) compression: Compression,
}

/// Where a group grows.
enum Folder {
    /// Gone when the work ends early.
    Staged(StagedFolder),
    /// Kept for a later run.
    Unfinished(Unfinished),
}

impl Folder {
    fn path(&self) -> PathBuf {
        match self {
            Self::Staged(folder) => folder.path(),
            Self::Unfinished(folder) => folder.path(),
        }
    }

    fn report(&self) -> Report {
        let (target, bytes) = match self {
            Self::Staged(folder) => (folder.target(), folder.bytes()),
            Self::Unfinished(folder) => (folder.target(), folder.bytes()),
        };
        Report { target: target.to_owned(), bytes }
    }
}

/// A group on its way to its final name.
pub(crate) struct GroupWriter {
    folder: Folder,
    store: Arc<FilesystemStore>,
    path: PathBuf,
}

impl GroupWriter {
    /// Begin a group that will hold about `bytes` bytes.
    pub(crate) fn create(path: &Path, attributes: Attributes, bytes: u64) -> Result<Self> {
        let folder = StagedFolder::create(path, bytes)?;
        Self::within(Folder::Staged(folder), path.to_owned(), attributes)
    }

    /// Begin or go on with a group that an interruption leaves behind.
    pub(crate) fn go_on(work: Unfinished, attributes: Attributes) -> Result<Self> {
        let path = work.target().to_owned();
        Self::within(Folder::Unfinished(work), path, attributes)
    }

    fn within(folder: Folder, path: PathBuf, attributes: Attributes) -> Result<Self> {
        let store = FilesystemStore::new(folder.path())
            .map_err(|error| Error::file(&path, format!("cannot hold a Zarr store: {error}")))?;
        let group = Self { folder, store: Arc::new(store), path };
        GroupBuilder::new()
            .attributes(attributes)
            .build(Arc::clone(&group.store), "/")
            .map_err(|error| Error::file(&group.path, one_line(&error)))?
            .store_metadata()
            .map_err(|error| group.report().storage(&error))?;
        Ok(group)
    }

    /// Begin an array of the group.
    pub(crate) fn array<T: Element>(&self, name: &str, layout: &Layout) -> Result<ArrayWriter<T>> {
        let cannot_form = |error: &dyn std::fmt::Display| {
            Error::file(&self.path, format!("array {name}: {}", one_line(&error)))
        };
        let to_u64 = |lengths: &[usize]| lengths.iter().map(|&n| n as u64).collect::<Vec<_>>();
        let outer = to_u64(layout.shard.unwrap_or(layout.chunk));
        let mut builder =
            ArrayBuilder::new(to_u64(layout.shape), outer, T::data_type(), T::fill_value());
        builder
            .subchunk_shape(layout.shard.map(|_| to_u64(layout.chunk)))
            .bytes_to_bytes_codecs(codecs(layout.compression))
            .dimension_names(Some(layout.axes.iter().copied()));
        let array = builder
            .build(Arc::clone(&self.store), &format!("/{name}"))
            .map_err(|error| cannot_form(&error))?;
        array.store_metadata().map_err(|error| self.report().storage(&error))?;
        Ok(ArrayWriter { array, report: self.report(), element: PhantomData })
    }

    /// Write an array of one chunk.
    pub(crate) fn write_whole<T: Element>(
        &self,
        name: &str,
        axes: &[&str],
        shape: &[usize],
        elements: &[T],
    ) -> Result<()> {
        let layout =
            Layout { axes, shape, chunk: shape, shard: None, compression: Compression::Zstd };
        self.array(name, &layout)?.write(&vec![0; shape.len()], shape, elements)
    }

    /// Give the group its final name, which is returned.
    pub(crate) fn finish(self) -> Result<PathBuf> {
        match self.folder {
            Folder::Staged(folder) => folder.finish()?,
            Folder::Unfinished(folder) => folder.finish()?,
        }
        Ok(self.path)
    }

    /// Keep what a later run needs to go on.
    pub(crate) fn save(&self, name: &str, state: &[u8]) -> Result<()> {
        match &self.folder {
            Folder::Staged(_) => Ok(()),
            Folder::Unfinished(folder) => folder.save(name, state),
        }
    }

    /// The folder that stays behind when the work ends early.
    pub(crate) fn unfinished_folder(&self) -> Option<&Path> {
        match &self.folder {
            Folder::Staged(_) => None,
            Folder::Unfinished(folder) => Some(folder.folder()),
        }
    }

    fn report(&self) -> Report {
        self.folder.report()
    }
}

/// An array whose pieces are written by several threads, each whole chunks.
pub(crate) struct ArrayWriter<T> {
    array: Array<FilesystemStore>,
    report: Report,
    element: PhantomData<fn(T)>,
}

impl<T: Element> ArrayWriter<T> {
    /// Write the elements of the box of `shape` that begins at `start`.
    pub(crate) fn write(&self, start: &[usize], shape: &[usize], elements: &[T]) -> Result<()> {
        let ranges: Vec<_> =
            start.iter().zip(shape).map(|(&from, &n)| from as u64..(from + n) as u64).collect();
        let subset = ArraySubset::new_with_ranges(&ranges);
        // The calling threads share the work already: the library adds none.
        let options = CodecOptions::default().with_concurrent_target(1);
        self.array
            .store_array_subset_opt(&subset, elements, &options)
            .map_err(|error| self.report.array(&error))
    }
}

fn codecs(compression: Compression) -> Vec<Arc<dyn BytesToBytesCodecTraits>> {
    let checksum: Arc<dyn BytesToBytesCodecTraits> = Arc::new(Crc32cCodec::new());
    match compression {
        Compression::None => vec![checksum],
        Compression::Zstd => vec![Arc::new(ZstdCodec::new(ZSTD_LEVEL, false)), checksum],
    }
}

/// What a message about a failed write needs to know.
pub(super) struct Report {
    pub(super) target: PathBuf,
    pub(super) bytes: u64,
}

impl Report {
    pub(super) fn array(&self, error: &ArrayError) -> Error {
        match error {
            ArrayError::StorageError(error) => self.storage(error),
            ArrayError::CodecError(CodecError::StorageError(error)) => self.storage(error),
            _ => Error::file(&self.target, format!("cannot be written: {}", one_line(error))),
        }
    }

    fn storage(&self, error: &StorageError) -> Error {
        match error {
            StorageError::IOError(error) => cannot_write(&self.target, error, self.bytes),
            _ => Error::file(&self.target, format!("cannot be written: {}", one_line(error))),
        }
    }
}
