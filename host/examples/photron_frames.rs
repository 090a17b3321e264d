//! Camera recordings to NumPy arrays and back.
//!
//! ```text
//! cargo run --release --example photron_frames -- run.cihx run.npy             counts as uint16
//! cargo run --release --example photron_frames -- run.npy run.cihx --bits 12   and back, packed
//! ```
//! The arrays have axes (image, y, x). Images stream: a recording need not fit in memory.

use clap::Parser;
use phasewalk::error::{Error, Result};
use phasewalk::io::photron::{CameraHeader, Packing, PhotronWriter};
use phasewalk::io::{RawImages, npy, open_raw, visit_images};
use std::path::PathBuf;
use std::process::ExitCode;

/// Convert raw images between a camera recording and an .npy file.
#[derive(Parser)]
struct Arguments {
    /// Recording (.cihx, .cih, .mraw) or array (.npy, uint8 or uint16)
    input: PathBuf,
    /// Array (.npy) or recording (.cihx, .cih) to write
    output: PathBuf,
    /// Bits per pixel of a recording: 8, 12 or 16
    #[arg(long, default_value_t = 16)]
    bits: u32,
    /// Image rate of a recording, Hz [default: as the input says]
    #[arg(long)]
    rate_hz: Option<f64>,
    /// Exposure time of an image, s
    #[arg(long)]
    shutter_s: Option<f64>,
    /// Comment of a recording
    #[arg(long, default_value = "")]
    comment: String,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("photron_frames: {error}");
            ExitCode::from(error.exit_status())
        }
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let input = open_raw(&arguments.input)?;
    if arguments.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("npy")) {
        return npy::save_images(&arguments.output, input.as_ref()).map(drop);
    }
    let mut writer = PhotronWriter::create(&arguments.output, header(arguments, input.as_ref())?)?;
    visit_images(input.as_ref(), |counts| writer.push(counts))?;
    writer.finish().map(drop)
}

fn header(arguments: &Arguments, input: &dyn RawImages) -> Result<CameraHeader> {
    let packing = Packing::of_bits(arguments.bits)
        .ok_or_else(|| Error::usage("--bits: recordings are written with 8, 12 or 16"))?;
    let format = input.format();
    let mut header = CameraHeader::new(format.images, format.height, format.width, packing);
    header.effective_bits = format.bits.min(packing.bits());
    header.rate_hz = arguments.rate_hz.or(format.rate_hz);
    header.shutter_s = arguments.shutter_s;
    header.comment.clone_from(&arguments.comment);
    Ok(header)
}
