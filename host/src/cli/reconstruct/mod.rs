//! `phasewalk reconstruct`.

mod pictures;
mod recording;
mod spectra;

use super::Common;
use crate::error::{Error, Result};
use crate::reconstruct::spectra::Compensation;
use crate::reconstruct::spectrum::Direction;
use std::path::PathBuf;

/// Options of `reconstruct`.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// Recording of a camera (run.cih, run.cihx or run.mraw) or spectra (.npy with axes B-scan, A-line,
    /// sample)
    recording: PathBuf,
    /// Whether the wavenumber rises or falls from sample to sample
    #[arg(long, value_enum, default_value_t = Direction::Up)]
    sweep: Direction,
    /// Centre wavelength, nm (needed for camera recordings)
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    wavelength_nm: Option<f64>,
    /// Width of the spectrum, first to last sample, nm (needed for camera recordings)
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    bandwidth_nm: Option<f64>,
    /// Refractive index of the sample
    #[arg(long, value_name = "N", default_value_t = 1.36, allow_negative_numbers = true)]
    index: f64,
    /// Dispersion in rad at the band's edge: A2,A3, none, or auto, by sharpness
    #[arg(long, value_name = "A2,A3", default_value = "auto", allow_hyphen_values = true,
          value_parser = spectra::compensation)]
    dispersion: Compensation,
    #[command(flatten)]
    camera: recording::CameraOptions,
    #[command(flatten)]
    spectra: spectra::Options,
    /// Result: a .zarr group with `field` (time, z, y, x), pictures beside it
    #[arg(short, long, value_name = "V.zarr")]
    output: PathBuf,
}

impl Arguments {
    /// The output must be a group.
    fn expect_group(&self) -> Result<()> {
        if self.output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("zarr")) {
            return Ok(());
        }
        let given = self.output.display();
        Err(Error::usage(format!("-o {given}: the result is a group: give a name with .zarr")))
    }

    /// A depth pixel, lambda^2 / (2 n Delta lambda) in µm, where wavelength and width are known.
    fn depth_px_um(&self) -> Result<Option<f64>> {
        let (Some(wavelength), Some(bandwidth)) = (self.wavelength_nm, self.bandwidth_nm) else {
            return Ok(None);
        };
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if [wavelength, bandwidth, self.index].into_iter().all(positive) {
            Ok(Some(wavelength * wavelength / (2.0 * self.index * bandwidth) / 1000.0))
        } else {
            Err(Error::usage("wavelength, width and index must be above 0"))
        }
    }
}

/// Refuse options that are for another kind of input.
fn expect_none(given: &[(&str, bool)], kind: &str) -> Result<()> {
    match given.iter().find(|(_, given)| *given) {
        Some((flag, _)) => Err(Error::usage(format!("{flag} is for {kind}: leave it out"))),
        None => Ok(()),
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let extension = arguments.recording.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("npy") => spectra::run(arguments, common),
        _ => recording::run(arguments, common),
    }
}
