//! `phasewalk reconstruct`.

mod pictures;
mod recording;

use super::Common;
use crate::error::Result;
use std::path::PathBuf;

/// Options of `reconstruct`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Recording: run.cih, run.cihx or run.mraw
    input: PathBuf,
    /// Centre wavelength of the source, nm
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    wavelength_nm: f64,
    /// Width of the band that one sweep covers, nm
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    bandwidth_nm: f64,
    #[command(flatten)]
    recording: recording::Options,
    /// Result: a .zarr group
    #[arg(short, long, value_name = "V.zarr")]
    output: PathBuf,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let target = recording::Target {
        input: &arguments.input,
        output: &arguments.output,
        wavelength_nm: arguments.wavelength_nm,
        bandwidth_nm: arguments.bandwidth_nm,
    };
    recording::run(&target, &arguments.recording, common)
}
