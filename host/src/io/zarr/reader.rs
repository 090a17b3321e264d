//! Opening the arrays, with messages for what can be wrong.

use super::node::{ArrayNode, Node};
use super::one_line;
use crate::error::{Error, Result};
use crate::io::shape::byte_count;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zarrs::array::{Array, ArrayBytes, CodecOptions};
use zarrs::filesystem::FilesystemStore;
use zarrs::storage::ReadableStorageTraits;

/// An array opened for reading.
pub(crate) type ReadableArray = Array<dyn ReadableStorageTraits>;

/// Bytes of one chunk (or shard) above which a store is taken for damaged.
const LARGEST_CHUNK: usize = 1 << 36;

/// Open the array in `folder`, whose metadata is known to be Zarr v3.
pub(crate) fn open_array(folder: &Path) -> Result<Arc<ReadableArray>> {
    let unreadable = |what: String| Error::file(folder, format!("cannot be read as Zarr: {what}"));
    let store = FilesystemStore::new(folder).map_err(|error| unreadable(one_line(&error)))?;
    let store: Arc<dyn ReadableStorageTraits> = Arc::new(store);
    let array = Array::open(store, "/").map_err(|error| unreadable(one_line(&error)))?;
    let origin = vec![0; array.dimensionality()];
    let chunk = array.chunk_shape_usize(&origin).map_err(|error| unreadable(one_line(&error)))?;
    let element = array.data_type().fixed_size().unwrap_or(1);
    if byte_count(&chunk, element).is_none_or(|bytes| bytes > LARGEST_CHUNK) {
        return Err(unreadable(format!("chunks of shape {chunk:?} do not fit in memory")));
    }
    Ok(Arc::new(array))
}

/// A read that failed after the array was opened.
pub(crate) fn cannot_read(folder: &Path, error: &impl std::fmt::Display) -> Error {
    Error::file(folder, format!("cannot be read, the store may be damaged: {}", one_line(error)))
}

/// The calling threads share the work already: the library adds none.
pub(crate) fn single_threaded() -> CodecOptions {
    CodecOptions::default().with_concurrent_target(1)
}

/// `path` itself where it is an array, else the array `name` in the group `path`.
pub(crate) fn find_array(path: &Path, name: &str) -> Result<(PathBuf, ArrayNode)> {
    if let Node::Array(array) = Node::read(path)? {
        return Ok((path.to_owned(), array));
    }
    let folder = path.join(name);
    if folder.join("zarr.json").is_file() {
        let array = Node::read_array(&folder)?;
        return Ok((folder, array));
    }
    let found = Node::arrays_in(path)?;
    let found = if found.is_empty() {
        "no arrays".to_owned()
    } else {
        format!("{}: give one as {}/NAME", found.join(", "), path.display())
    };
    Err(Error::file(path, format!("holds no array `{name}`; it holds {found}")))
}

/// The numbers of a coordinate of one axis, such as `time_s`.
pub(crate) fn read_coordinate(folder: &Path) -> Result<Vec<f64>> {
    let node = Node::read_array(folder)?;
    let wrong =
        |what: String| Error::file(folder, format!("{what}; float64 of one axis is needed"));
    let [length] = node.shape[..] else {
        return Err(wrong(format!("has shape {:?}", node.shape)));
    };
    if byte_count(&[length], size_of::<f64>()).is_none() {
        return Err(wrong(format!("has {length} elements")));
    }
    let array = open_array(folder)?;
    let all = array.subset_all();
    let options = single_threaded();
    match node.data_type.as_str() {
        "float64" => array.retrieve_array_subset_opt::<Vec<f64>>(&all, &options),
        "float32" => array
            .retrieve_array_subset_opt::<Vec<f32>>(&all, &options)
            .map(|values| values.into_iter().map(f64::from).collect()),
        other => return Err(wrong(format!("holds {other}"))),
    }
    .map_err(|error| cannot_read(folder, &error))
}

/// Shape and elements of an array of booleans or integers: true where not zero.
pub(crate) fn read_flags(path: &Path, name: &str) -> Result<(Vec<usize>, Vec<bool>)> {
    let (folder, node) = find_array(path, name)?;
    let is_flag = node.data_type == "bool"
        || ["int", "uint"].iter().any(|kind| node.data_type.starts_with(kind));
    if !is_flag {
        let found = node.data_type;
        return Err(Error::file(
            &folder,
            format!("holds {found}; a mask needs booleans or integers"),
        ));
    }
    if byte_count(&node.shape, size_of::<u64>()).is_none() {
        return Err(Error::file(
            &folder,
            format!("shape {:?} is larger than any memory", node.shape),
        ));
    }
    let array = open_array(&folder)?;
    let element = array.data_type().fixed_size().unwrap_or(1);
    let bytes: ArrayBytes = array
        .retrieve_array_subset_opt(&array.subset_all(), &single_threaded())
        .map_err(|error| cannot_read(&folder, &error))?;
    let bytes = bytes.into_fixed().map_err(|error| cannot_read(&folder, &error))?;
    let flags = bytes.chunks_exact(element).map(|n| n.iter().any(|&byte| byte != 0)).collect();
    Ok((node.shape, flags))
}
