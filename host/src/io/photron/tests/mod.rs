//! Recordings written, read, damaged and described.

use super::header::{CameraHeader, Side};
use super::samples::Packing;
use super::{PhotronImages, PhotronWriter, cih, cihx};
use crate::error::Result;
use crate::io::{describe, open_raw};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

mod bad_files;
mod counts;
mod headers;
mod recordings;

const PACKINGS: [Packing; 4] = [Packing::Bits8, Packing::Bits10, Packing::Bits12, Packing::Bits16];

/// Counts that use every bit and repeat in no simple way.
fn counts(number: usize, bits: u32) -> Vec<u16> {
    (0..number)
        .map(|i| (i.wrapping_mul(0x9e37_79b9) >> 8) as u16 & (u16::MAX >> (16 - bits)))
        .collect()
}

/// A header with every fact in it.
fn full_header(images: usize, height: usize, width: usize, packing: Packing) -> CameraHeader {
    CameraHeader {
        rate_hz: Some(60_000.0),
        save_step: 3,
        shutter_s: Some(1.0 / 800_000.0),
        recorded_images: 677,
        start_image: -20,
        device: "FASTCAM SA-Z".to_owned(),
        comment: "x < y & z > \"0\" : ü".to_owned(),
        date: "2026/4/21".to_owned(),
        time: "00:11".to_owned(),
        ..CameraHeader::new(images, height, width, packing)
    }
}

/// Write a recording, all images at once.
fn write(path: &Path, header: &CameraHeader, images: &[u16]) -> Result<Vec<PathBuf>> {
    let mut writer = PhotronWriter::create(path, header.clone())?;
    writer.push(images)?;
    writer.finish()
}

/// The one line that a refusal says, which begins with the name of `file`.
fn refusal<T>(result: Result<T>, file: &Path) -> String {
    let text = result.err().expect("it is refused").to_string();
    assert!(!text.contains('\n'), "{text}");
    assert!(text.starts_with(&file.display().to_string()), "{text}");
    text
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// The text of `full_header(2, 1, 4, Packing::Bits12)`.
const CIH: &str = "#Camera Information Header
Date : 2026/4/21
Time : 00:11
Camera Type : FASTCAM SA-Z
Record Rate(fps) : 60000
Shutter Speed(s) : 1/800000
Original Total Frame : 677
Total Frame : 2
Start Frame : -20
Save Step : 3
Image Width : 4
Image Height : 1
Color Type : Mono
Color Bit : 12
File Format : MRaw
EffectiveBit Depth : 12
EffectiveBit Side : Lower
Comment Text : x < y & z > \"0\" : ü

END";

/// A recording of three images of 2 x 4 pixels in 12 bits: 36 bytes.
fn recording(folder: &TempDir, name: &str) -> (PathBuf, PathBuf) {
    let path = folder.path().join(name);
    let header = full_header(3, 2, 4, Packing::Bits12);
    write(&path, &header, &counts(24, 12)).unwrap();
    (path.clone(), path.with_extension("mraw"))
}
