//! `phasewalk simulate`.

mod oct;

use super::{Common, fraction, list, megabytes, print};
use crate::error::Result;
use crate::io::{Attributes, FieldLayout, FieldWriter, Truth, read_times};
use crate::progress::Progress;
use crate::simulate::SpeckleScene;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

/// Kinds of series that can be made.
#[derive(Debug, clap::Subcommand)]
pub(super) enum Scenes {
    /// Complex speckle images of moving point scatterers with an x-shaped area that moves together
    /// (the paper's simulation)
    Speckle(Speckle),
    /// A raw recording of a full-field swept-source OCT camera, retina in motion, truth beside it
    Oct(oct::Oct),
}

/// Options of `simulate speckle`.
#[derive(Debug, clap::Args)]
pub(super) struct Speckle {
    /// Columns of the images
    #[arg(long, value_name = "PX", default_value_t = 640, allow_negative_numbers = true)]
    width: usize,
    /// Rows of the images
    #[arg(long, value_name = "PX", default_value_t = 368, allow_negative_numbers = true)]
    height: usize,
    /// Number of frames
    #[arg(long, value_name = "N", default_value_t = 70, allow_negative_numbers = true)]
    frames: usize,
    /// Random motion per frame in x, y and z: standard deviation in wavelengths, such as 1/32 or 0
    #[arg(long, value_name = "WAVELENGTHS", default_value = "1/32", value_parser = fraction,
          allow_negative_numbers = true)]
    sigma: f64,
    /// Scatterers per pixel
    #[arg(long, value_name = "N", default_value_t = 50, allow_negative_numbers = true)]
    scatterers: usize,
    /// Aperture: cut-off in cycles per wavelength
    #[arg(long, value_name = "CYCLES", default_value_t = 0.06, allow_negative_numbers = true)]
    na: f64,
    /// When the frames are taken, in the intervals that --sigma is given for (of a second each, as `phase` reads
    /// F.times.npy): .npy, or text as `phase --times` takes it
    #[arg(long, value_name = "FILE", conflicts_with = "burst")]
    times: Option<PathBuf>,
    /// Bursts of N frames an interval apart, GAP intervals from the last frame of one to the first of the next
    #[arg(long, value_name = "N,GAP", value_parser = burst, allow_negative_numbers = true)]
    burst: Option<Burst>,
    /// Seed of the random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
    /// Result: F.npy (complex64 (time, y, x), with F.mask.npy and F.phase.npy beside it) or F.zarr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
}

/// Frames in bursts.
#[derive(Clone, Copy, Debug)]
struct Burst {
    frames: usize,
    gap: f64,
}

impl Burst {
    fn time(self, frame: usize) -> f64 {
        let Self { frames, gap } = self;
        (frame / frames) as f64 * (gap + (frames - 1) as f64) + (frame % frames) as f64
    }
}

fn burst(text: &str) -> std::result::Result<Burst, String> {
    let explain = || format!("'{text}' is not N,GAP: frames above 0, and intervals of at least 1");
    let (frames, gap) = text.split_once(',').ok_or_else(explain)?;
    let frames = frames.trim().parse().ok().filter(|&frames| frames > 0).ok_or_else(explain)?;
    let gap = gap.trim().parse().ok().filter(|&gap: &f64| gap >= 1.0 && gap.is_finite());
    Ok(Burst { frames, gap: gap.ok_or_else(explain)? })
}

impl Speckle {
    fn scene(&self) -> Result<SpeckleScene> {
        let burst = self.burst;
        let bursts = burst.map(|burst| (0..self.frames).map(|frame| burst.time(frame)).collect());
        let times = match &self.times {
            Some(path) => Some(read_times(path, self.frames)?),
            None => bursts,
        };
        Ok(SpeckleScene {
            times,
            width: self.width,
            height: self.height,
            frames: self.frames,
            scatterers_per_pixel: self.scatterers,
            sigma_wavelengths: self.sigma,
            aperture_cycles_per_wavelength: self.na,
            seed: self.seed,
            ..SpeckleScene::default()
        })
    }
}

pub(super) fn run(scenes: &Scenes, common: &Common) -> Result<()> {
    match scenes {
        Scenes::Speckle(options) => speckle(options, common),
        Scenes::Oct(options) => oct::run(options, common),
    }
}

fn speckle(options: &Speckle, common: &Common) -> Result<()> {
    let scene = options.scene()?;
    scene.validate()?;
    let start = Instant::now();
    let memory = scene.memory_bytes(common.threads());
    if !common.json {
        let scatterers = scene.pixels() * scene.scatterers_per_pixel;
        print(&format!(
            "{scatterers} scatterers, {} frames of {} x {} pixels; {} of memory",
            scene.frames,
            scene.width,
            scene.height,
            megabytes(memory)
        ));
    }
    let (mask, phase_rad) = (scene.mask(), scene.true_phase_rad());
    let layout = FieldLayout {
        frames: scene.frames,
        height: scene.height,
        width: scene.width,
        attributes: attributes(&scene),
        times_s: scene.times.clone(),
    };
    let truth = Truth { mask: &mask, phase_rad: &phase_rad };
    let mut writer = FieldWriter::create(&options.output, layout, truth)?;
    let progress = Progress::new("simulating", scene.frames as u64);
    scene.for_each_frame(&progress, |_, field| writer.push_frame(field))?;
    let files = writer.finish()?;
    drop(progress);
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        print(&json!({ "files": files, "seconds": seconds, "memory_bytes": memory }).to_string());
    } else {
        print(&format!("wrote {} in {seconds:.1} s", list(&files)));
    }
    Ok(())
}

/// What made the series, kept with it.
fn attributes(scene: &SpeckleScene) -> Attributes {
    let mut attributes = Attributes::new();
    for (key, value) in [
        ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
        ("kind", json!("simulated speckle")),
        ("seed", json!(scene.seed)),
        ("sigma_wavelengths", json!(scene.sigma_wavelengths)),
        ("scatterers_per_pixel", json!(scene.scatterers_per_pixel)),
        ("aperture_cycles_per_wavelength", json!(scene.aperture_cycles_per_wavelength)),
        ("pixel_pitch_wavelengths", json!(scene.pitch_wavelengths)),
    ] {
        attributes.insert(key.to_owned(), value);
    }
    attributes
}
