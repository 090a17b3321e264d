//! What `phasewalk info` prints.

use super::npy::Header;
use super::staged::cannot_open;
use super::zarr::{ArrayNode, Node, read_coordinate};
use super::{Attributes, InputKind, kind_of_input, photron};
use crate::error::{Error, Result};
use serde::Serialize;
use std::fmt;
use std::fs;
use std::path::Path;

/// A file or store in words; serialises for machines, displays for people.
#[derive(Debug, Clone, Serialize)]
pub struct Description {
    /// Its path.
    pub path: String,
    /// What it is.
    pub kind: &'static str,
    /// Bytes on disk.
    pub bytes: u64,
    /// The arrays (of a table, the columns) it holds.
    pub arrays: Vec<ArrayDescription>,
    /// Provenance, where the format keeps it.
    pub attributes: Attributes,
}

/// One array.
#[derive(Debug, Clone, Serialize)]
pub struct ArrayDescription {
    /// Its name; empty where the file holds only one array.
    pub name: String,
    /// Type of its elements.
    pub data_type: String,
    /// Names of its axes.
    pub axes: Vec<String>,
    /// Lengths of its axes.
    pub shape: Vec<usize>,
    /// First and last value of a time coordinate.
    pub range: Option<(f64, f64)>,
}

/// Describe an `.npy` file, a `.csv` table, a Zarr group, a Zarr array or a camera recording.
///
/// # Errors
/// When `path` does not exist, is of another kind, or is damaged.
pub fn describe(path: &Path) -> Result<Description> {
    if photron::is_recording(path) {
        return photron::describe(path);
    }
    let is_table = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("csv"));
    let (kind, arrays, attributes) = if is_table {
        ("CSV table", describe_table(path)?, Attributes::new())
    } else {
        match kind_of_input(path)? {
            InputKind::Npy => ("NumPy array", vec![describe_npy(path)?], Attributes::new()),
            InputKind::Zarr => describe_zarr(path)?,
        }
    };
    let shown = path.display().to_string();
    Ok(Description { path: shown, kind, bytes: bytes_on_disk(path)?, arrays, attributes })
}

fn describe_npy(path: &Path) -> Result<ArrayDescription> {
    let (_, header) = Header::open(path)?;
    Ok(ArrayDescription {
        name: String::new(),
        data_type: header.number_type.to_string(),
        axes: usual_axes(header.shape.len()),
        shape: header.shape,
        range: None,
    })
}

/// An `.npy` file names no axes: this is what Phasewalk takes them for.
fn usual_axes(rank: usize) -> Vec<String> {
    let names: &[&str] = match rank {
        1 => &["time"],
        2 => &["y", "x"],
        3 => &["time", "y", "x"],
        4 => &["time", "z", "y", "x"],
        _ => return (0..rank).map(|axis| format!("axis {axis}")).collect(),
    };
    names.iter().map(|&name| name.to_owned()).collect()
}

fn describe_table(path: &Path) -> Result<Vec<ArrayDescription>> {
    let damaged = |error: csv::Error| Error::file(path, format!("is not a table: {error}"));
    let file = fs::File::open(path).map_err(|error| cannot_open(path, &error))?;
    let mut reader = csv::Reader::from_reader(file);
    let names = reader.headers().map_err(damaged)?.clone();
    let mut rows = 0;
    for record in reader.byte_records() {
        record.map_err(damaged)?;
        rows += 1;
    }
    let column = |name: &str| ArrayDescription {
        name: name.to_owned(),
        data_type: "text".to_owned(),
        axes: vec!["row".to_owned()],
        shape: vec![rows],
        range: None,
    };
    Ok(names.iter().map(column).collect())
}

fn describe_zarr(path: &Path) -> Result<(&'static str, Vec<ArrayDescription>, Attributes)> {
    match Node::read(path)? {
        Node::Array(array) => {
            let attributes = array.attributes.clone();
            Ok(("Zarr v3 array", vec![describe_array(String::new(), path, array)], attributes))
        }
        Node::Group(attributes) => {
            let mut arrays = Vec::new();
            for name in Node::arrays_in(path)? {
                let folder = path.join(&name);
                arrays.push(describe_array(name, &folder, Node::read_array(&folder)?));
            }
            Ok(("Zarr v3 group", arrays, attributes))
        }
    }
}

fn describe_array(name: String, folder: &Path, array: ArrayNode) -> ArrayDescription {
    let unnamed = (0..array.shape.len()).map(|axis| format!("axis {axis}"));
    let mut given = array.dimension_names.into_iter();
    let axes = unnamed.map(|axis| given.next().flatten().unwrap_or(axis)).collect();
    let is_time = folder.file_name().is_some_and(|name| name == "time_s");
    let times = is_time.then(|| read_coordinate(folder).ok()).flatten();
    let range = times.and_then(|times| Some((*times.first()?, *times.last()?)));
    ArrayDescription { name, data_type: array.data_type, axes, shape: array.shape, range }
}

/// Bytes of a file, or of all files in a folder. Links are not followed: they may lead in circles.
fn bytes_on_disk(path: &Path) -> Result<u64> {
    let cannot_read = |error| cannot_open(path, &error);
    if !fs::metadata(path).map_err(cannot_read)?.is_dir() {
        return Ok(fs::metadata(path).map_err(cannot_read)?.len());
    }
    let mut bytes = 0;
    let mut folders = vec![path.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(cannot_read)? {
            let entry = entry.map_err(cannot_read)?;
            let metadata = entry.metadata().map_err(cannot_read)?;
            if metadata.is_dir() {
                folders.push(entry.path());
            } else {
                bytes += metadata.len();
            }
        }
    }
    Ok(bytes)
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}, {} bytes", self.path, self.kind, self.bytes)?;
        for array in &self.arrays {
            write!(f, "\n  {array}")?;
        }
        for (name, value) in &self.attributes {
            write!(f, "\n  {name} = {value}")?;
        }
        Ok(())
    }
}

impl fmt::Display for ArrayDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.name.is_empty() {
            write!(f, "{}: ", self.name)?;
        }
        let axes: Vec<String> =
            self.axes.iter().zip(&self.shape).map(|(name, n)| format!("{name} {n}")).collect();
        write!(f, "{} ({})", self.data_type, axes.join(", "))?;
        match self.range {
            Some((first, last)) => write!(f, ", {first} to {last}"),
            None => Ok(()),
        }
    }
}
