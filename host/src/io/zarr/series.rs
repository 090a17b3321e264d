//! Complex frames, read row by row.

use super::node::{ArrayNode, Node};
use super::reader::{
    ReadableArray, cannot_read, find_array, open_array, read_coordinate, read_flags,
    single_threaded,
};
use crate::error::{Error, Result};
use crate::io::{Attributes, Series, Shape};
use num_complex::{Complex32, Complex64};
use serde_json::Value;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use zarrs::array::chunk_cache::{ChunkCache, ChunkCacheDecodedLruSizeLimit};
use zarrs::array::{
    ArrayError, ArrayShardedExt, ArrayShardedReadableExt, ArrayShardedReadableExtCache,
    ArraySubset, ElementOwned,
};

/// Decoded chunks kept in memory, for stores whose chunks span several frames.
const CACHE_BYTES: u64 = 256 << 20;

/// A complex array of axes (time, y, x) or (time, z, y, x).
pub(crate) struct ZarrSeries {
    folder: PathBuf,
    shape: Shape,
    has_depth: bool,
    is_double: bool,
    access: Access,
    times_s: Option<Vec<f64>>,
    sweep_ok: Option<Vec<bool>>,
    /// Those of the group, under those of the array itself.
    attributes: Attributes,
}

/// How repeated reads of the same chunk are kept cheap.
enum Access {
    /// Shards: their indices are remembered, the chunks inside are small.
    Sharded(Arc<ReadableArray>, ArrayShardedReadableExtCache),
    /// Plain chunks: the last ones are remembered decoded.
    Chunked(ChunkCacheDecodedLruSizeLimit),
}

impl ZarrSeries {
    /// Open the array `field` of a group, or the array at `path` itself.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let (folder, node) = find_array(path, "field")?;
        let is_double = holds_doubles(&folder, &node)?;
        let shape = Shape::of_series(&folder, &node.shape)?;
        let array = open_array(&folder)?;
        let access = if array.is_sharded() {
            let cache = ArrayShardedReadableExtCache::new(&array);
            Access::Sharded(array, cache)
        } else {
            Access::Chunked(ChunkCacheDecodedLruSizeLimit::new(array, CACHE_BYTES))
        };
        let group = folder.parent().unwrap_or(Path::new(""));
        let mut attributes = attributes_of_group(group);
        attributes.extend(node.attributes);
        let sweep_ok = flags_beside(group, shape.frames)?;
        Ok(Self {
            times_s: times_beside(group, shape.frames, sweep_ok.as_deref())?,
            sweep_ok,
            attributes,
            has_depth: node.shape.len() == 4,
            folder,
            shape,
            is_double,
            access,
        })
    }

    fn retrieve<T: ElementOwned>(&self, subset: &ArraySubset) -> Result<Vec<T>> {
        let options = single_threaded();
        let elements: std::result::Result<Vec<T>, ArrayError> = match &self.access {
            Access::Sharded(array, cache) => {
                array.retrieve_array_subset_sharded_opt(cache, subset, &options)
            }
            Access::Chunked(cache) => cache.retrieve_array_subset(subset, &options),
        };
        elements.map_err(|error| cannot_read(&self.folder, &error))
    }

    fn subset(&self, frame: usize, depth: usize, rows: &Range<usize>) -> ArraySubset {
        let one = |index: usize| index as u64..index as u64 + 1;
        let rows = rows.start as u64..rows.end as u64;
        let columns = 0..self.shape.width as u64;
        if self.has_depth {
            ArraySubset::new_with_ranges(&[one(frame), one(depth), rows, columns])
        } else {
            ArraySubset::new_with_ranges(&[one(frame), rows, columns])
        }
    }
}

impl Series for ZarrSeries {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        self.shape.check_request(frame, depth, &rows, out.len())?;
        if out.is_empty() {
            return Ok(());
        }
        let subset = self.subset(frame, depth, &rows);
        if self.is_double {
            for (value, double) in out.iter_mut().zip(self.retrieve::<Complex64>(&subset)?) {
                *value = Complex32::new(double.re as f32, double.im as f32);
            }
        } else {
            for (value, stored) in out.iter_mut().zip(self.retrieve(&subset)?) {
                *value = stored;
            }
        }
        Ok(())
    }

    fn times_s(&self) -> Option<&[f64]> {
        self.times_s.as_deref()
    }

    fn sweep_ok(&self) -> Option<&[bool]> {
        self.sweep_ok.as_deref()
    }

    fn attribute(&self, name: &str) -> Option<&Value> {
        self.attributes.get(name)
    }
}

/// Are the complex numbers of the array `node` in `folder` complex128, not complex64?
pub(crate) fn holds_doubles(folder: &Path, node: &ArrayNode) -> Result<bool> {
    match node.data_type.as_str() {
        "complex64" | "complex_float32" => Ok(false),
        "complex128" | "complex_float64" => Ok(true),
        other => Err(Error::file(
            folder,
            format!("holds {other}; the complex field is needed, as complex64 or complex128"),
        )),
    }
}

/// The flags `sweep_ok` in the same group, one per frame.
fn flags_beside(group: &Path, frames: usize) -> Result<Option<Vec<bool>>> {
    let folder = group.join("sweep_ok");
    if !folder.join("zarr.json").is_file() {
        return Ok(None);
    }
    let (shape, flags) = read_flags(&folder, "sweep_ok")?;
    if shape != [frames] {
        return Err(Error::file(
            &folder,
            format!("has shape {shape:?} for {frames} frames: write one flag per frame"),
        ));
    }
    Ok(Some(flags))
}

/// The coordinate `time_s` in the same group, one time per frame; a bad frame may lack its own.
fn times_beside(
    group: &Path,
    frames: usize,
    sweep_ok: Option<&[bool]>,
) -> Result<Option<Vec<f64>>> {
    let folder = group.join("time_s");
    if !folder.join("zarr.json").is_file() {
        return Ok(None);
    }
    let times = read_coordinate(&folder)?;
    if times.len() != frames {
        return Err(Error::file(
            &folder,
            format!("has {} times for {frames} frames: write one time per frame", times.len()),
        ));
    }
    let is_good = |frame: usize| sweep_ok.is_none_or(|flags| flags[frame]);
    let missing = |&frame: &usize| !times[frame].is_finite() && is_good(frame);
    if let Some(frame) = (0..frames).find(missing) {
        return Err(Error::file(&folder, format!("the time of frame {frame} is not a number")));
    }
    Ok(Some(times))
}

fn attributes_of_group(group: &Path) -> Attributes {
    match Node::read(group) {
        Ok(Node::Group(attributes)) => attributes,
        _ => Attributes::new(),
    }
}
