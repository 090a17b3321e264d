//! CIH, a camera header in lines of text: `Key : Value`, up to the first empty line.

use super::fields::{Fields, Keys, one_line};
use super::header::CameraHeader;
use crate::error::{Error, Result};
use std::fmt::Write;
use std::path::Path;

const FIRST_LINE: &str = "#Camera Information Header";

const KEYS: Keys = Keys {
    file_format: "File Format",
    width: "Image Width",
    height: "Image Height",
    images: "Total Frame",
    stored_bits: "Color Bit",
    effective_bits: "EffectiveBit Depth",
    side: "EffectiveBit Side",
    color: "Color Type",
    rate_hz: "Record Rate(fps)",
    save_step: "Save Step",
    recorded_images: "Original Total Frame",
    start_image: "Start Frame",
    device: "Camera Type",
    comment: "Comment Text",
    date: "Date",
    time: "Time",
};

const SHUTTER: &str = "Shutter Speed(s)";

/// Read a header; `path` is for messages.
pub(super) fn parse(path: &Path, bytes: &[u8]) -> Result<CameraHeader> {
    // Comments may be in any encoding; keys and numbers are ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut lines = text.trim_start_matches('\u{feff}').lines();
    if lines.next().is_none_or(|line| line.trim_end() != FIRST_LINE) {
        return Err(Error::file(
            path,
            format!("is no camera header: its first line must be '{FIRST_LINE}'"),
        ));
    }
    let pairs: Vec<(&str, &str)> = lines
        .take_while(|line| !line.trim().is_empty())
        .filter_map(|line| line.split_once(':'))
        .map(|(key, value)| (key.trim(), value.trim()))
        .collect();
    let text = |wanted: &str| {
        pairs.iter().find(|(key, _)| *key == wanted).map(|(_, value)| (*value).to_owned())
    };
    let shutter_s = text(SHUTTER).and_then(|text| seconds(&text));
    Fields { path, text: &text }.header(&KEYS, shutter_s)
}

/// `1/800000`, or a plain number.
fn seconds(text: &str) -> Option<f64> {
    match text.split_once('/') {
        Some((above, below)) => {
            Some(above.trim().parse::<f64>().ok()? / below.trim().parse::<f64>().ok()?)
        }
        None => text.parse().ok(),
    }
}

/// The header as the camera writes it.
pub(super) fn print(header: &CameraHeader) -> Vec<u8> {
    let mut text = format!("{FIRST_LINE}\n");
    let mut line = |key: &str, value: &dyn std::fmt::Display| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{key} : {value}");
    };
    line(KEYS.date, &one_line(&header.date));
    line(KEYS.time, &one_line(&header.time));
    line(KEYS.device, &one_line(&header.device));
    line(KEYS.rate_hz, &header.rate_hz.unwrap_or(0.0));
    if let Some(shutter_s) = header.shutter_s {
        line(SHUTTER, &fraction(shutter_s));
    }
    line(KEYS.recorded_images, &header.recorded_images);
    line(KEYS.images, &header.images);
    line(KEYS.start_image, &header.start_image);
    line(KEYS.save_step, &header.save_step);
    line(KEYS.width, &header.width);
    line(KEYS.height, &header.height);
    line(KEYS.color, &"Mono");
    line(KEYS.stored_bits, &header.packing.bits());
    line(KEYS.file_format, &"MRaw");
    line(KEYS.effective_bits, &header.effective_bits);
    line(KEYS.side, &header.side.word());
    line(KEYS.comment, &one_line(&header.comment));
    text.push_str("\nEND");
    text.into_bytes()
}

/// One over a whole number where the camera would write so.
fn fraction(seconds: f64) -> String {
    let below = (1.0 / seconds).round();
    if below >= 1.0 && 1.0 / below == seconds { format!("1/{below}") } else { format!("{seconds}") }
}
