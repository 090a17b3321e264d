//! The metadata of a group or an array, as stored in its `zarr.json`.

use crate::error::{Error, Result};
use crate::io::Attributes;
use crate::io::staged::cannot_open;
use serde_json::Value;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

/// What a folder with a `zarr.json` is.
pub(crate) enum Node {
    /// A group, with its attributes.
    Group(Attributes),
    /// An array.
    Array(ArrayNode),
}

/// An array as its metadata describes it.
pub(crate) struct ArrayNode {
    pub(crate) data_type: String,
    pub(crate) shape: Vec<usize>,
    /// Names of the axes, where they are given.
    pub(crate) dimension_names: Vec<Option<String>>,
    pub(crate) attributes: Attributes,
}

impl Node {
    /// Read the metadata in `folder`.
    pub(crate) fn read(folder: &Path) -> Result<Self> {
        let text = fs::read(folder.join("zarr.json")).map_err(|error| match error.kind() {
            ErrorKind::NotFound if is_version_2(folder) => Error::file(
                folder,
                "is a Zarr v2 store, v3 is needed: save it again with zarr_format=3",
            ),
            ErrorKind::NotFound | ErrorKind::NotADirectory => {
                Error::file(folder, "is not a Zarr v3 store: it has no zarr.json")
            }
            _ => cannot_open(folder, &error),
        })?;
        let damaged = || Error::file(folder, "its zarr.json is damaged: write the store again");
        let metadata: Value = serde_json::from_slice(&text).map_err(|_| damaged())?;
        let attributes = metadata.get("attributes").and_then(Value::as_object).cloned();
        let attributes = attributes.unwrap_or_default();
        match metadata.get("node_type").and_then(Value::as_str) {
            Some("group") => Ok(Self::Group(attributes)),
            Some("array") => {
                ArrayNode::parse(&metadata, attributes).map(Self::Array).ok_or_else(damaged)
            }
            _ => Err(damaged()),
        }
    }

    /// Read the metadata of an array.
    pub(crate) fn read_array(folder: &Path) -> Result<ArrayNode> {
        match Self::read(folder)? {
            Self::Array(array) => Ok(array),
            Self::Group(_) => Err(Error::file(folder, "is a Zarr group, an array is needed")),
        }
    }

    /// Names of the arrays directly in a group, sorted.
    pub(crate) fn arrays_in(group: &Path) -> Result<Vec<String>> {
        let entries = fs::read_dir(group).map_err(|error| cannot_open(group, &error))?;
        let mut names: Vec<String> = entries
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
            .filter(|name| matches!(Self::read(&group.join(name)), Ok(Self::Array(_))))
            .collect();
        names.sort();
        Ok(names)
    }
}

impl ArrayNode {
    fn parse(metadata: &Value, attributes: Attributes) -> Option<Self> {
        let data_type = metadata.get("data_type")?;
        let data_type = data_type.as_str().or_else(|| data_type.get("name")?.as_str())?.to_owned();
        let shape = metadata.get("shape")?.as_array()?;
        let shape =
            shape.iter().map(|n| usize::try_from(n.as_u64()?).ok()).collect::<Option<_>>()?;
        let names = metadata.get("dimension_names").and_then(Value::as_array);
        let dimension_names = names.map_or_else(Vec::new, |names| {
            names.iter().map(|name| name.as_str().map(str::to_owned)).collect()
        });
        Some(Self { data_type, shape, dimension_names, attributes })
    }
}

fn is_version_2(folder: &Path) -> bool {
    [".zgroup", ".zarray", ".zattrs"].iter().any(|name| folder.join(name).exists())
}
