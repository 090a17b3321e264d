//! What `phasewalk info` prints.

use super::files::{HeaderKind, ImagesState, RecordingFiles};
use super::header::CameraHeader;
use crate::error::Result;
use crate::io::Attributes;
use crate::io::describe::{ArrayDescription, Description};
use serde_json::json;
use std::fs;
use std::path::Path;

/// Describe a recording by its header or its images, which need not be whole.
pub(crate) fn describe(path: &Path) -> Result<Description> {
    let files = RecordingFiles::find(path)?;
    let header = files.read_header()?;
    let header_bytes = fs::metadata(&files.header).map_or(0, |metadata| metadata.len());
    let image_bytes = fs::metadata(&files.images).ok().map(|metadata| metadata.len());
    let mut attributes = facts(&header);
    for (key, value) in [
        ("header_file", json!(files.header.display().to_string())),
        ("images_file", json!(files.images.display().to_string())),
        ("images_bytes_found", json!(image_bytes)),
        ("images_bytes_wanted", json!(header.image_bytes())),
        ("images_state", json!(ImagesState::of(&header, image_bytes).to_string())),
    ] {
        attributes.insert(key.to_owned(), value);
    }
    Ok(Description {
        path: path.display().to_string(),
        kind: match files.kind {
            HeaderKind::Cih => "Photron recording (CIH, MRAW)",
            HeaderKind::Cihx => "Photron recording (CIHX, MRAW)",
        },
        bytes: header_bytes + image_bytes.unwrap_or(0),
        arrays: vec![counts(&header)],
        attributes,
    })
}

fn counts(header: &CameraHeader) -> ArrayDescription {
    let axes = ["image", "y", "x"];
    ArrayDescription {
        name: String::new(),
        data_type: format!("uint{}", header.packing.bits()),
        axes: axes.map(str::to_owned).to_vec(),
        shape: vec![header.images, header.height, header.width],
        range: None,
    }
}

/// What the header knows; what it does not is left out.
fn facts(header: &CameraHeader) -> Attributes {
    let word = |text: &str| (!text.is_empty()).then(|| json!(text));
    [
        ("camera", word(&header.device)),
        ("comment", word(&header.comment)),
        ("date", word(&header.date)),
        ("time", word(&header.time)),
        ("record_rate_hz", header.rate_hz.map(|rate| json!(rate))),
        ("image_rate_hz", header.image_rate_hz().map(|rate| json!(rate))),
        ("save_step", Some(json!(header.save_step))),
        ("shutter_s", header.shutter_s.map(|shutter| json!(shutter))),
        ("stored_bits", Some(json!(header.packing.bits()))),
        ("significant_bits", Some(json!(header.significant_bits()))),
        ("significant_side", Some(json!(header.side.word()))),
        ("recorded_images", Some(json!(header.recorded_images))),
        ("start_image", Some(json!(header.start_image))),
    ]
    .into_iter()
    .filter_map(|(key, value)| Some((key.to_owned(), value?)))
    .collect()
}
