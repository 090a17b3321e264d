//! `phasewalk simulate oct`.

use crate::cli::{Common, list, megabytes, print};
use crate::error::Result;
use crate::progress::Progress;
use crate::simulate::oct::{HeaderKind, OctScene, Plan, Preset, write_recording};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Options of `simulate oct`.
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct Oct {
    /// Motion, dispersion, brightness and faults
    #[arg(long, value_enum, default_value_t = Preset::Easy)]
    preset: Preset,
    /// Number of sweeps
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    sweeps: Option<usize>,
    /// Images per sweep
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    images: Option<usize>,
    /// Rows of the images
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    height: Option<usize>,
    /// Columns of the images
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    width: Option<usize>,
    /// Bits per pixel in the file: 12 (packed) or 16; the camera has 12 either way
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    bits: Option<u32>,
    /// Wavelength in the middle of the band [default: 841]
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    wavelength_nm: Option<f64>,
    /// Width of the band [default: 51]
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    bandwidth_nm: Option<f64>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Change any other parameter of the preset, such as axial_px=2 or dispersion_rad=[8,2]; a wrong
    /// name lists them all
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    set: Vec<(String, String)>,
    /// Write the header as lines of text, run.cih, rather than as run.cihx
    #[arg(long)]
    cih: bool,
    /// Folder for run.cihx, run.mraw, mask.npy, control.npy, phase.npy and truth.zarr
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Oct {
    /// The preset with what the user changed.
    fn scene(&self) -> Result<OctScene> {
        let mut scene = self.preset.scene();
        scene.seed = self.seed;
        for (count, value) in [
            (&mut scene.sweeps, self.sweeps),
            (&mut scene.images, self.images),
            (&mut scene.height, self.height),
            (&mut scene.width, self.width),
        ] {
            *count = value.unwrap_or(*count);
        }
        scene.bits = self.bits.unwrap_or(scene.bits);
        scene.wavelength_nm = self.wavelength_nm.unwrap_or(scene.wavelength_nm);
        scene.bandwidth_nm = self.bandwidth_nm.unwrap_or(scene.bandwidth_nm);
        self.set.iter().try_for_each(|(name, value)| scene.set(name, value))?;
        Ok(scene)
    }
}

/// `NAME=VALUE`.
fn setting(text: &str) -> std::result::Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("give NAME=VALUE")?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

pub(super) fn run(options: &Oct, common: &Common) -> Result<()> {
    let start = Instant::now();
    let plan = Plan::new(options.scene()?)?;
    let memory = plan.memory_bytes(common.threads());
    let scene = &plan.scene;
    if !common.json {
        print(&format!(
            "{} sweeps of {} images of {} x {} pixels; {} of memory",
            scene.sweeps,
            scene.images,
            scene.width,
            scene.height,
            megabytes(memory)
        ));
    }
    let kind = if options.cih { HeaderKind::Cih } else { HeaderKind::Cihx };
    let progress = Progress::new("simulating", plan.images() as u64);
    let files = write_recording(&plan, &options.output, kind, &progress)?;
    drop(progress);
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        print(&json!({ "files": files, "seconds": seconds, "memory_bytes": memory }).to_string());
    } else {
        print(&format!("wrote {} in {seconds:.1} s", list(&files)));
    }
    Ok(())
}
