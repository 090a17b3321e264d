//! `phasewalk reconstruct` of a camera recording.

use super::pictures::{self, Folder};
use super::{Arguments, expect_none};
use crate::cli::{Common, check_output, megabytes, print};
use crate::error::{Error, Result};
use crate::io::{Attributes, RawFormat, RawImages, Unfinished, open_raw};
use crate::reconstruct::dispersion::Dispersion;
use crate::reconstruct::findings::{Findings, Survey};
use crate::reconstruct::preparation::Preparation;
use crate::reconstruct::recording::{Job, Observer};
use crate::reconstruct::settings::Settings;
use crate::reconstruct::spectra::Compensation;
use crate::trigger::log::RunLog;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of a camera recording.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Camera recordings (.cih, .cihx, .mraw)")]
pub(super) struct CameraOptions {
    /// Images of a sweep
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    images: Option<usize>,
    /// Write whole volumes instead of the layers' surroundings
    #[arg(long)]
    full: bool,
    /// Run log of the trigger board: real times, and a check of the number of sweeps
    #[arg(long, value_name = "RUN.ndjson")]
    run_log: Option<PathBuf>,
    /// Distance of neighbouring pixels in the retina, um: for the figure's scale bar
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    pixel_pitch_um: Option<f64>,
    /// Sweep at which the stimulus began, counted from 0, where no run log tells
    #[arg(long, value_name = "SWEEP", conflicts_with = "run_log")]
    stimulus_sweep: Option<u32>,
    /// Depth of the IS/OS at the centre of the field, in depth pixels, where the choice is wrong
    #[arg(long, value_name = "PX", allow_negative_numbers = true)]
    isos_px: Option<f64>,
    /// Length of the outer segments, in um, where the choice is wrong
    #[arg(long, value_name = "UM", allow_negative_numbers = true)]
    outer_segment_um: Option<f64>,
    /// Go on with a run that was interrupted
    #[arg(long)]
    resume: bool,
    /// Leave out the folder of diagnostic pictures, V.steps beside V.zarr
    #[arg(long)]
    no_pictures: bool,
}

impl CameraOptions {
    /// Options that mean nothing for recorded spectra.
    pub(super) fn expect_none(&self) -> Result<()> {
        let given = [
            ("--images", self.images.is_some()),
            ("--full", self.full),
            ("--run-log", self.run_log.is_some()),
            ("--pixel-pitch-um", self.pixel_pitch_um.is_some()),
            ("--stimulus-sweep", self.stimulus_sweep.is_some()),
            ("--isos-px", self.isos_px.is_some()),
            ("--outer-segment-um", self.outer_segment_um.is_some()),
            ("--resume", self.resume),
            ("--no-pictures", self.no_pictures),
        ];
        expect_none(&given, "camera recordings, an .npy file holds spectra")
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let (options, recording) = (&arguments.camera, &arguments.recording);
    let settings = settings(arguments)?;
    arguments.spectra.expect_none()?;
    arguments.expect_group()?;
    check_output("-o", &arguments.output, &[recording.as_path()])?;
    let pictures = (!options.no_pictures).then(|| Folder::beside(&arguments.output)).transpose()?;
    let raw = open_raw(recording)?;
    let run = options.run_log.as_deref().map(times).transpose()?;
    let (times_s, stimulus_s) = run.map_or((None, None), |(times, began)| (Some(times), began));
    let notes = notes(options, stimulus_s)?;
    let start = Instant::now();
    let show = Show {
        common,
        format: raw.format(),
        pictures,
        pitch_um: options.pixel_pitch_um,
        raw: raw.as_ref(),
        settings: &settings,
    };
    let job = Job {
        raw: raw.as_ref(),
        name: recording,
        settings: &settings,
        times_s,
        notes,
        output: &arguments.output,
        resume: options.resume,
    };
    if !options.resume && !common.json && Unfinished::is_left(&arguments.output) {
        print("an unfinished run is replaced (--resume would have gone on with it)");
    }
    let (findings, path) = job.run(&show).map_err(|error| {
        let about_output = error.names(&arguments.output);
        if about_output { error } else { error.about(recording) }
    })?;
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        print(&summary(&findings, &show, &path, seconds).to_string());
    } else {
        tell(&findings, &show, &path, seconds);
    }
    Ok(())
}

fn settings(arguments: &Arguments) -> Result<Settings> {
    let missing = |flag: &str, what: &str| {
        Error::usage(format!("{flag} is missing: {what} of the camera recording"))
    };
    let CameraOptions { images, full, isos_px, outer_segment_um, .. } = arguments.camera;
    let settings = Settings {
        images: images.ok_or_else(|| missing("--images", "images of one sweep"))?,
        wavelength_nm: arguments
            .wavelength_nm
            .ok_or_else(|| missing("--wavelength-nm", "the centre wavelength"))?,
        bandwidth_nm: arguments
            .bandwidth_nm
            .ok_or_else(|| missing("--bandwidth-nm", "the width of the band"))?,
        refractive_index: arguments.index,
        direction: arguments.sweep,
        full,
        compensation: arguments.dispersion,
        isos_px,
        outer_segment_um,
    };
    settings.validate()?;
    Ok(settings)
}

/// Times of the volumes of a run, and of its stimulus.
fn times(path: &Path) -> Result<(Vec<f64>, Option<f64>)> {
    let run = RunLog::read(path)?;
    let times = run.volume_times_s().map_err(|error| error.about(path))?;
    Ok((times, run.stimulus_s()))
}

/// What the figure of `phase` is told: where the stimulus began, how large a pixel is.
fn notes(options: &CameraOptions, stimulus_s: Option<f64>) -> Result<Attributes> {
    let mut notes = Attributes::new();
    if let Some(pitch) = options.pixel_pitch_um {
        if !(pitch.is_finite() && pitch > 0.0) {
            return Err(Error::usage(format!("--pixel-pitch-um {pitch}: must be above 0")));
        }
        notes.insert("pixel_pitch_um".to_owned(), json!(pitch));
    }
    if let Some(began) = stimulus_s {
        notes.insert("stimulus_s".to_owned(), json!(began));
    }
    if let Some(sweep) = options.stimulus_sweep {
        notes.insert("stimulus_sweep".to_owned(), json!(sweep));
    }
    Ok(notes)
}

/// Lines on the terminal and pictures in a folder.
struct Show<'a> {
    common: &'a Common,
    format: RawFormat,
    pictures: Option<Folder>,
    /// Distance of neighbouring pixels.
    pitch_um: Option<f64>,
    raw: &'a dyn RawImages,
    settings: &'a Settings,
}

impl Observer for Show<'_> {
    fn goes_on(&self, pass: &str, sweeps: usize) {
        if !self.common.json {
            print(&format!("going on after {sweeps} sweeps of the {pass} pass"));
        }
    }

    fn prepared(&self, plan: &Preparation, memory: u64) {
        if self.common.json {
            return;
        }
        let RawFormat { width, height, .. } = self.format;
        let (sweeps, images) = (plan.sweeps.len(), plan.images);
        print(&format!(
            "{sweeps} sweeps of {images} images, {width} x {height} pixels, {} dead; {} of memory",
            plan.illumination.dead_pixels(),
            megabytes(memory)
        ));
        for (sweep, fault) in plan.sweeps.iter().enumerate().filter(|(_, s)| !s.is_ok()) {
            print(&format!("sweep {sweep} is left out: {}", fault.verdict));
        }
        let estimated = self.settings.compensation == Compensation::Estimated;
        if estimated && !plan.estimate.is_reliable() {
            print(
                "the dispersion cannot be told from the image (too little signal): give it as \
                 --dispersion A2,A3",
            );
        }
    }

    fn analysed(&self, findings: &Findings, survey: &Survey) -> Result<()> {
        match &self.pictures {
            Some(folder) => {
                let Self { raw, settings, pitch_um, .. } = *self;
                pictures::draw(folder, raw, settings, pitch_um, findings, survey)
            }
            None => Ok(()),
        }
    }
}

/// Samples of the sweeps that were used, per second of both passes.
fn samples_per_second(findings: &Findings, format: &RawFormat) -> f64 {
    let used = findings.analysis.motions.iter().flatten().count();
    let samples = used * findings.plan.images * format.width * format.height;
    2.0 * samples as f64 / (findings.seconds[1] + findings.seconds[3]).max(f64::MIN_POSITIVE)
}

fn tell(findings: &Findings, show: &Show<'_>, path: &Path, seconds: f64) {
    let Findings { plan, analysis, verdicts, .. } = findings;
    for (sweep, verdict) in verdicts.iter().enumerate() {
        if plan.sweeps[sweep].is_ok() && analysis.motions[sweep].is_none() {
            print(&format!("sweep {sweep} is left out: {verdict}"));
        }
    }
    let Dispersion { a2, a3 } = analysis.dispersion;
    print(&format!("dispersion {a2:.2} rad (q^2), {a3:.2} rad (q^3) at the band's edge"));
    let used = analysis.motions.iter().flatten().count();
    let [tips, isos] = analysis.layers;
    print(&format!(
        "{used} of {} sweeps used; IS/OS at z {}..{}, tips at z {}..{}",
        plan.sweeps.len(),
        isos[0],
        isos[1],
        tips[0],
        tips[1]
    ));
    let [prepared, first, between, second] = findings.seconds;
    print(&format!(
        "preparation {prepared:.1} s, first pass {first:.1} s, analysis {between:.1} s, second pass \
         {second:.1} s: {:.2} Gsamples/s",
        samples_per_second(findings, &show.format) / 1e9
    ));
    let beside = show
        .pictures
        .as_ref()
        .map_or(String::new(), |folder| format!(" and pictures in {}", folder.path().display()));
    print(&format!("wrote {}{beside} in {seconds:.1} s", path.display()));
}

fn summary(findings: &Findings, show: &Show<'_>, path: &Path, seconds: f64) -> Value {
    let Findings { plan, analysis, verdicts, memory, .. } = findings;
    let Dispersion { a2, a3 } = analysis.dispersion;
    let [prepared, first, between, second] = findings.seconds;
    json!({
        "files": [path],
        "pictures": show.pictures.as_ref().map(Folder::path),
        "sweeps": plan.sweeps.len(),
        "sweeps_used": analysis.motions.iter().flatten().count(),
        "verdicts": verdicts,
        "dead_pixels": plan.illumination.dead_pixels(),
        "dispersion_rad": [a2, a3],
        "dispersion_reliable": plan.estimate.is_reliable(),
        "sharpness_before": plan.estimate.sharpness_before,
        "sharpness_after": plan.estimate.sharpness_after,
        "layer_ost_z": analysis.layers[0],
        "layer_isos_z": analysis.layers[1],
        "start_jitter_sigma_images": analysis.jitter_sigma,
        "memory_bytes": memory,
        "seconds": seconds,
        "stages_s": { "preparation": prepared, "first_pass": first, "analysis": between, "second_pass": second },
        "samples_per_second": samples_per_second(findings, &show.format),
    })
}
