//! Recorded spectra as `.npy`: k-linearisation from mirrors or a map, dispersion, depth.

use super::{Arguments, expect_none};
use crate::cli::{Common, check_output, list, print};
use crate::error::{Error, Result};
use crate::figures::bscan::{BScan, BScans};
use crate::io::npy::{SpectraFile, read_f64_1d};
use crate::io::{Attributes, VolumeWriter, write_atomic};
use crate::progress::Progress;
use crate::reconstruct::dispersion::Dispersion;
use crate::reconstruct::mirror::{Sides, Wavenumber, wavenumber};
use crate::reconstruct::spectra::{
    Background, Compensation, Settings, Sharpness, SpectraVolume, Stage,
};
use crate::reconstruct::spectrum::Direction;
use crate::reconstruct::window::Window;
use ndarray::Array2;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options for recorded spectra.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Recorded spectra (.npy)")]
pub(super) struct Options {
    /// Spectrum of a mirror, for equal steps of k; a second one at another depth keeps dispersion
    /// out of k
    #[arg(long, value_name = "A.npy", conflicts_with = "k_map")]
    mirror: Vec<PathBuf>,
    /// Where two mirrors stood about zero delay [default: found in the data]
    #[arg(long, value_enum, requires = "mirror")]
    mirror_sides: Option<SidesName>,
    /// Spectrum without light, for the mirrors
    #[arg(long, value_name = "D.npy", requires = "mirror")]
    dark: Option<PathBuf>,
    /// Spectrum of the reference arm alone, for the mirrors
    #[arg(long, value_name = "R.npy", requires = "mirror")]
    reference_only: Option<PathBuf>,
    /// Spectrum of the sample arm alone: one for all mirrors, or one for each
    #[arg(long, value_name = "S.npy", requires = "mirror")]
    sample_only: Vec<PathBuf>,
    /// Wavenumber of every sample in any unit, instead of mirrors
    #[arg(long, value_name = "K.npy")]
    k_map: Option<PathBuf>,
    /// Background: the mean spectrum of each B-scan or of the volume
    #[arg(long, value_enum, default_value_t)]
    background: Background,
    /// Window over the spectrum
    #[arg(long, value_enum, default_value_t)]
    window: Window,
    /// Depth pixels over which sharpness is measured, both ends included [default: all but the
    /// nearest]
    #[arg(long, value_name = "A..B", value_parser = depths)]
    depths: Option<Range<usize>>,
    /// B-scan of the picture [default: the middle one]
    #[arg(long, value_name = "Y")]
    bscan: Option<usize>,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum SidesName {
    /// Both on one side
    Same,
    /// One on each side
    Opposite,
}

impl Options {
    /// Options that mean nothing for camera recordings.
    pub(super) fn expect_none(&self) -> Result<()> {
        let given = [
            ("--mirror", !self.mirror.is_empty()),
            ("--k-map", self.k_map.is_some()),
            ("--depths", self.depths.is_some()),
            ("--bscan", self.bscan.is_some()),
        ];
        expect_none(&given, "recorded spectra (.npy)")
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let (options, start) = (&arguments.spectra, Instant::now());
    arguments.camera.expect_none()?;
    arguments.expect_group()?;
    check_output("-o", &arguments.output, &options.inputs(&arguments.recording))?;
    let depth_px_um = arguments.depth_px_um()?;
    let file = SpectraFile::open(&arguments.recording)?;
    let y = options.bscan.unwrap_or(file.bscans / 2);
    if y >= file.bscans {
        let last = file.bscans - 1;
        return Err(Error::usage(format!("--bscan {y}: the B-scans are 0..{last}")));
    }
    let mirrors = options.mirrors(file.images)?;
    let settings = options.settings(arguments, mirrors.as_ref())?;
    let volume = SpectraVolume::prepare(file, &settings);
    let volume = volume.map_err(|error| error.about(&arguments.recording))?;
    let facts = facts(arguments, &volume, mirrors.as_ref());
    let attributes = attributes(arguments, &facts, depth_px_um);
    let group = write(&volume, &arguments.output, attributes)?;
    let picture = arguments.output.with_extension("bscan.png");
    write_atomic(&picture, &draw(&volume, y, depth_px_um)?)?;
    let files = [group, picture];
    let seconds = start.elapsed().as_secs_f64();
    if common.json {
        let mut summary = facts;
        summary["files"] = json!(files);
        summary["seconds"] = json!(seconds);
        print(&summary.to_string());
    } else {
        tell(&volume, mirrors.as_ref());
        print(&format!("wrote {} in {seconds:.1} s", list(&files)));
    }
    Ok(())
}

impl Options {
    fn inputs<'a>(&'a self, recording: &'a Path) -> Vec<&'a Path> {
        let single = [&self.dark, &self.reference_only, &self.k_map].into_iter().flatten();
        let several = self.mirror.iter().chain(&self.sample_only);
        single.chain(several).map(PathBuf::as_path).chain([recording]).collect()
    }

    /// The wavenumber from the mirrors, where there are any.
    fn mirrors(&self, images: usize) -> Result<Option<Wavenumber>> {
        if self.mirror.is_empty() {
            return Ok(None);
        }
        if self.mirror.len() > 2
            || !matches!(self.sample_only.len(), 0 | 1)
                && self.sample_only.len() != self.mirror.len()
        {
            return Err(Error::usage(
                "give --mirror once or twice, and --sample-only once or as often",
            ));
        }
        let spectra = (0..self.mirror.len()).map(|n| self.fringe(n, images));
        let spectra: Vec<Vec<f64>> = spectra.collect::<Result<_>>()?;
        let sides = self.mirror_sides.map(|sides| match sides {
            SidesName::Same => Sides::Same,
            SidesName::Opposite => Sides::Opposite,
        });
        wavenumber(&spectra, sides).map(Some)
    }

    /// Mirror `n` without the light of the arms: M - R - S + D, as R and S hold the dark level each.
    fn fringe(&self, n: usize, images: usize) -> Result<Vec<f64>> {
        let mut fringe = read_spectrum(&self.mirror[n], images)?;
        let sample = self.sample_only.get(n).or(self.sample_only.first());
        let arms: Vec<&PathBuf> =
            [self.reference_only.as_ref(), sample].into_iter().flatten().collect();
        for arm in &arms {
            let light = read_spectrum(arm, images)?;
            fringe.iter_mut().zip(light).for_each(|(value, light)| *value -= light);
        }
        if let Some(path) = &self.dark {
            let share = arms.len() as f64 - 1.0;
            let dark = read_spectrum(path, images)?;
            fringe.iter_mut().zip(dark).for_each(|(value, dark)| *value += share * dark);
        }
        Ok(fringe)
    }

    fn settings(&self, arguments: &Arguments, mirrors: Option<&Wavenumber>) -> Result<Settings> {
        let map = self.k_map.as_deref().map(read_f64_1d).transpose()?;
        Ok(Settings {
            background: self.background,
            window: self.window,
            wavenumber: map.or(mirrors.map(|mirrors| mirrors.k.clone())),
            compensation: arguments.dispersion,
            depths: self.depths.clone(),
            falling: arguments.sweep == Direction::Down,
        })
    }
}

/// A calibration spectrum of `images` samples.
fn read_spectrum(path: &Path, images: usize) -> Result<Vec<f64>> {
    let spectrum = read_f64_1d(path)?;
    if spectrum.len() == images {
        return Ok(spectrum);
    }
    let found = spectrum.len();
    Err(Error::file(path, format!("has {found} samples, the spectra of the recording {images}")))
}

fn write(volume: &SpectraVolume, output: &Path, attributes: Attributes) -> Result<PathBuf> {
    let shape = volume.shape();
    let writer = VolumeWriter::create(output, shape, attributes)?;
    let Dispersion { a2, a3 } = volume.dispersion;
    writer.write_numbers("dispersion_rad", "order", &[a2, a3])?;
    let progress = Progress::new("reconstructing", shape[1] as u64);
    for rows in VolumeWriter::slabs(shape[1]) {
        let steps = rows.len() as u64;
        writer.write_slab(rows.clone(), &volume.slab(rows)?)?;
        progress.advance(steps)?;
    }
    writer.finish()
}

/// B-scan `y` after every step.
fn draw(volume: &SpectraVolume, y: usize, depth_px_um: Option<f64>) -> Result<Vec<u8>> {
    let stages = volume.stages();
    let [depths, _, columns] = volume.shape();
    let amplitude = |&stage: &Stage| -> Result<Array2<f32>> {
        let field = volume.bscan(y, stage)?;
        Ok(Array2::from_shape_fn((depths, columns), |(z, x)| field[x * depths + z].norm()))
    };
    let amplitudes: Vec<Array2<f32>> = stages.iter().map(amplitude).collect::<Result<_>>()?;
    let label = format!("B-scan {y}");
    let panels = stages.iter().zip(&amplitudes);
    let scans = panels.map(|(&stage, amplitude)| BScan {
        label: stage_name(stage),
        amplitude: amplitude.view(),
        surfaces: Vec::new(),
    });
    let scans = scans.collect();
    BScans { label: &label, scans, first_depth_px: 0.0, depth_px_um }.draw().png()
}

/// What was found, as JSON.
fn facts(arguments: &Arguments, volume: &SpectraVolume, mirrors: Option<&Wavenumber>) -> Value {
    let pair = |dispersion: Dispersion| json!([dispersion.a2, dispersion.a3]);
    let found = volume.estimate.as_ref();
    let mirrors = mirrors.map(|mirrors| {
        json!({
            "sides": mirrors.sides.map(side_name),
            "residual_rad": mirrors.residual_rad,
            "dispersion_rad": mirrors.dispersion.map(pair),
        })
    });
    json!({
        "recording": arguments.recording,
        "shape_zyx": volume.shape(),
        "sharpness": volume.sharpness.iter().map(sharpness).collect::<Vec<_>>(),
        "dispersion_rad": pair(volume.dispersion),
        "dispersion_significance": found.map(|found| found.significance),
        "dispersion_reliable": found.map(|found| found.is_reliable()),
        "mirrors": mirrors,
    })
}

fn attributes(arguments: &Arguments, facts: &Value, depth_px_um: Option<f64>) -> Attributes {
    let mut attributes = facts.as_object().cloned().unwrap_or_default();
    let sweep = if arguments.sweep == Direction::Up { "up" } else { "down" };
    for (key, value) in [
        ("software", Some(json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION"))))),
        ("sweep", Some(json!(sweep))),
        ("wavelength_nm", arguments.wavelength_nm.map(|nm| json!(nm))),
        ("bandwidth_nm", arguments.bandwidth_nm.map(|nm| json!(nm))),
        ("depth_px_um", depth_px_um.map(|um| json!(um))),
        ("background", Some(json!(format!("{:?}", arguments.spectra.background).to_lowercase()))),
        ("window", Some(json!(format!("{:?}", arguments.spectra.window).to_lowercase()))),
    ] {
        attributes.extend(value.map(|value| (key.to_owned(), value)));
    }
    attributes
}

/// What was found, in words.
fn tell(volume: &SpectraVolume, mirrors: Option<&Wavenumber>) {
    let [depths, rows, columns] = volume.shape();
    print(&format!("{rows} B-scans of {columns} A-lines, {depths} depths"));
    if let Some(mirrors) = mirrors {
        print(&format!("mirrors    {}", about_mirrors(mirrors)));
    }
    print(&format!("dispersion {}", about_dispersion(volume)));
    for step in &volume.sharpness {
        let Sharpness { value, gain, median_gain, .. } = step;
        print(&format!(
            "sharpness  {value:7.2} {:<19} {gain:.2} times, median of the B-scans {median_gain:.2} times",
            stage_name(step.stage)
        ));
    }
}

fn about_mirrors(mirrors: &Wavenumber) -> String {
    let residual = mirrors.residual_rad;
    match (mirrors.sides, mirrors.dispersion) {
        (Some(sides), Some(Dispersion { a2, a3 })) => format!(
            "on {} of zero delay, phase smooth within {residual:.3} rad; dispersion of the first a2 {a2:.2}, a3 {a3:.2} rad",
            side_name(sides)
        ),
        _ => format!(
            "one, phase smooth within {residual:.3} rad; its dispersion counts as part of k"
        ),
    }
}

fn about_dispersion(volume: &SpectraVolume) -> String {
    let Dispersion { a2, a3 } = volume.dispersion;
    match volume.estimate {
        Some(found) if !found.is_reliable() => {
            let Dispersion { a2, a3 } = found.dispersion;
            format!("left as it is: a2 {a2:.1}, a3 {a3:.1} rad is not certain")
        }
        _ => format!("a2 {a2:.2}, a3 {a3:.2} rad at the band's edge"),
    }
}

/// One step, as JSON.
fn sharpness(step: &Sharpness) -> Value {
    json!({
        "step": stage_name(step.stage),
        "value": step.value,
        "gain": step.gain,
        "median_gain": step.median_gain,
    })
}

fn stage_name(stage: Stage) -> &'static str {
    match stage {
        Stage::Recorded => "as recorded",
        Stage::Linear => "equal steps of k",
        Stage::Compensated => "without dispersion",
    }
}

fn side_name(sides: Sides) -> &'static str {
    match sides {
        Sides::Same => "the same side",
        Sides::Opposite => "opposite sides",
    }
}

/// `auto`, `none` or `A2,A3`.
pub(super) fn compensation(text: &str) -> std::result::Result<Compensation, String> {
    let known = || {
        let (a2, a3) = text.split_once(',')?;
        let [a2, a3] =
            [a2, a3].map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite()));
        Some(Compensation::Known(Dispersion { a2: a2?, a3: a3? }))
    };
    match text {
        "auto" => Ok(Compensation::Estimated),
        "none" => Ok(Compensation::Known(Dispersion::default())),
        _ => known().ok_or_else(|| format!("'{text}' is not auto, none or A2,A3 in rad")),
    }
}

/// `A..B`, both ends included.
fn depths(text: &str) -> std::result::Result<Range<usize>, String> {
    let range = || {
        let (first, last) = text.split_once("..")?;
        let (first, last): (usize, usize) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        (first <= last).then(|| first..last.saturating_add(1))
    };
    range().ok_or_else(|| format!("'{text}' is not A..B, ascending depth pixels"))
}
