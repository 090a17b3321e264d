//! `phasewalk phase`.

use super::{Common, check_output, list, megabytes, print};
use crate::curve::{Region, curve};
use crate::error::{Error, Result};
use crate::image::{ImageJob, Kernel};
use crate::io::npy::sibling;
use crate::io::{
    Attributes, Format, ImageLayout, ImageWriter, Series, Shape, open_series, read_mask,
    write_curve,
};
use crate::lanes::Path as LanePath;
use crate::looks::{Looks, SpatialCoherence};
use crate::method::{Depths, Method, Plan};
use crate::progress::Progress;
use crate::series::{Survey, survey};
use clap::ValueEnum;
use phasewalk_core::params::RANDOM_PROBABILITY;
use phasewalk_core::weights::Weighting;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `phase`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("ensemble").required(true).args(["mask", "gaussian"]))]
pub(super) struct Arguments {
    /// Complex series: .npy with axes (time, y, x) or (time, z, y, x), or a .zarr group with `field`
    series: PathBuf,
    /// Curve: average over the pixels of this mask (y, x), true or non-zero inside
    #[arg(long, value_name = "M.npy")]
    mask: Option<PathBuf>,
    /// Images: average with a Gaussian of this standard deviation, in pixels (periodic edges)
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    gaussian: Option<f64>,
    /// How the phase is obtained from the cross-spectrum
    #[arg(long, value_enum, default_value_t = MethodName::Paper)]
    method: MethodName,
    /// Weights of the pairs (method paper)
    #[arg(long, value_enum, default_value_t = WeightsName::Paper)]
    weights: WeightsName,
    /// Use pairs of frames up to L apart (method paper) [default: all pairs]
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    max_lag: Option<usize>,
    /// Frame to which the direct difference compares [default: 4, the fifth]
    #[arg(long, value_name = "FRAME", allow_negative_numbers = true)]
    reference_frame: Option<usize>,
    /// Depth pixels, both ends included: A..B for one layer, A..B,C..D for Z1 minus Z2
    #[arg(long, value_name = "A..B,C..D", allow_hyphen_values = true)]
    layers: Option<Depths>,
    /// Looks for the weights' threshold: nominal (pixels of the mask, 4 pi sigma^2), effective
    /// (independent speckles, estimated from the frames) or a number
    /// [default: nominal for paper weights, effective for fisher]
    #[arg(long, value_name = "LOOKS", allow_negative_numbers = true)]
    looks: Option<Looks>,
    /// Write standard deviations of images too (curves always have them)
    #[arg(long)]
    sigma: bool,
    /// Arithmetic of images (curves always use f64)
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    precision: Precision,
    /// Memory that images may take for their work, in MB (files held whole come on top)
    #[arg(long, value_name = "MB", default_value_t = 2000, allow_negative_numbers = true)]
    memory: u64,
    /// Result: .csv, .npy or .zarr for a curve, .npy or .zarr for images
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum MethodName {
    /// Phase difference to one frame
    Direct,
    /// Walk in steps of one frame
    OneStep,
    /// All pairs of frames, weighted least squares (extended Knox-Thompson)
    Paper,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum WeightsName {
    /// Mean unit phasor above the level of random phases
    Paper,
    /// Fisher information of the coherence
    Fisher,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Precision {
    /// Fast, on vector registers
    F32,
    /// For checks
    F64,
}

impl Arguments {
    fn method(&self) -> Method {
        match (self.method, self.weights) {
            (MethodName::Direct, _) => Method::Direct,
            (MethodName::OneStep, _) => Method::OneStep,
            (MethodName::Paper, WeightsName::Paper) => Method::Paper(Weighting::Paper),
            (MethodName::Paper, WeightsName::Fisher) => Method::Paper(Weighting::Fisher),
        }
    }

    fn looks(&self) -> Looks {
        self.looks.unwrap_or(match self.weights {
            WeightsName::Paper => Looks::Nominal,
            WeightsName::Fisher => Looks::Effective,
        })
    }

    /// What the flags alone can tell.
    fn validate(&self) -> Result<()> {
        let format = Format::of(&self.output)?;
        if self.gaussian.is_some() && matches!(format, Format::Csv) {
            return Err(Error::usage(format!(
                "-o {}: images go to .npy or .zarr",
                self.output.display()
            )));
        }
        let paper = matches!(self.method, MethodName::Paper);
        if !paper && (self.max_lag.is_some() || self.weights != WeightsName::Paper || self.sigma) {
            let what = "--max-lag, --weights and --sigma";
            return Err(Error::usage(format!("{what} belong to --method paper: leave them out")));
        }
        if self.reference_frame.is_some() && !matches!(self.method, MethodName::Direct) {
            return Err(Error::usage("--reference-frame belongs to --method direct: leave it out"));
        }
        if self.mask.is_some() && (self.sigma || self.precision == Precision::F64) {
            let what = "--sigma and --precision";
            return Err(Error::usage(format!(
                "{what} are for images: a curve has standard deviations and f64 anyway"
            )));
        }
        let mut inputs = vec![self.series.as_path()];
        inputs.extend(self.mask.as_deref());
        let sigma = sibling(&self.output, "sigma");
        check_output(&self.output, &inputs)?;
        check_output(&sigma, &inputs)
    }
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    arguments.validate()?;
    let series = open_series(&arguments.series)?;
    let shape = series.shape();
    let depths = Depths::for_volume(arguments.layers.clone(), shape.depth)?;
    let (lag, frame) = (arguments.max_lag, arguments.reference_frame);
    let about = |error: Error| error.about(&arguments.series);
    let mut plan =
        Plan::new(arguments.method(), shape.frames, lag, frame, depths).map_err(about)?;
    if let Some(times) = series.times_s() {
        check_times(times).map_err(about)?;
        plan.times_s = times.to_vec();
    }
    let task = Task { arguments, common, series: series.as_ref(), plan, start: Instant::now() };
    match (&arguments.mask, arguments.gaussian) {
        (Some(path), _) => {
            let mask = read_mask(path, shape.height, shape.width)?;
            task.curve(&mask, path)
        }
        (None, sigma) => task.images(sigma.unwrap_or_default()),
    }
}

/// Fewer than twelve looks cannot be told from random phases: the threshold is above any mean phasor.
fn check_looks(method: Method, looks: f64, ensemble: &str) -> Result<()> {
    let needed = -(1.0 - RANDOM_PROBABILITY).ln();
    if !matches!(method, Method::Paper(_)) || looks > needed {
        return Ok(());
    }
    Err(Error::usage(format!(
        "{ensemble}: {looks:.1} looks cannot be told from random phases, {} are needed: average over \
         more pixels, or take --method one-step or --looks",
        needed.ceil()
    )))
}

/// Gamma_2 divides by the intervals.
fn check_times(times: &[f64]) -> Result<()> {
    let ascending = times.windows(2).all(|pair| pair[1] > pair[0]);
    if ascending && times.iter().all(|time| time.is_finite()) {
        return Ok(());
    }
    Err(Error::failed("the series' coordinate time_s is not strictly ascending: correct it"))
}

/// A standard deviation that only Gamma_2 (1000 rad a step) leaves behind.
const BRIDGED_RAD: f64 = 100.0;

/// What the flags and the file have settled.
struct Task<'a> {
    arguments: &'a Arguments,
    common: &'a Common,
    series: &'a dyn Series,
    plan: Plan,
    start: Instant,
}

impl Task<'_> {
    fn curve(&self, mask: &[bool], mask_path: &Path) -> Result<()> {
        let Shape { frames, width, .. } = self.series.shape();
        let depths = self.plan.depths.all();
        let survey = self.survey()?;
        let asked = mask.iter().filter(|&&inside| inside).count();
        let memory = Region::bytes(asked, frames, depths.len());
        let progress = Progress::new("phase curve", 2 * frames as u64);
        let region = Region::read(self.series, &survey, mask, &self.plan, &progress)
            .map_err(|error| error.about(mask_path))?;
        let coherence = self.coherence(&survey)?;
        let usable: Vec<bool> = mask.iter().zip(&survey.valid).map(|(&m, &v)| m && v).collect();
        let effective = coherence.looks_of_mask(&usable, width);
        let looks = self.arguments.looks().choose(region.pixels() as f64, effective);
        check_looks(self.plan.method, looks, "--mask")?;
        let rows = curve(&region, &self.plan, looks, effective, &progress)?;
        drop(progress);
        let mut facts = self.facts(&survey, looks, effective, memory);
        facts.insert("pixels".to_owned(), json!(region.pixels()));
        facts.insert("pixels_left_out".to_owned(), json!(region.left_out));
        let left_out = if region.left_out > 0 {
            format!(" ({} of the mask left out: not finite, or always zero)", region.left_out)
        } else {
            String::new()
        };
        // Bridges have hundreds of radians, measured frames at most that of a random walk.
        let bridged = rows.iter().filter(|row| row.sigma_rad > BRIDGED_RAD).count();
        facts.insert("frames_bridged".to_owned(), json!(bridged));
        let files = write_curve(&self.arguments.output, &rows, facts.clone())?;
        if bridged > 0 && !self.common.json {
            print(&format!(
                "{bridged} of {frames} frames have no pair above random phases: bridged"
            ));
        }
        self.report(&format!("{} pixels{left_out}", region.pixels()), facts, &files);
        Ok(())
    }

    fn images(&self, sigma_px: f64) -> Result<()> {
        let Shape { height, width, frames, .. } = self.series.shape();
        let double = self.arguments.precision == Precision::F64;
        let kernel = Kernel::new(sigma_px, height, width, double)?;
        let path = LanePath::best()?;
        let survey = self.survey()?;
        let effective = self.coherence(&survey)?.looks_of_kernel(&kernel);
        let looks = self.arguments.looks().choose(kernel.nominal_looks(), effective);
        check_looks(self.plan.method, looks, "--gaussian")?;
        let job = ImageJob {
            series: self.series,
            survey: &survey,
            plan: &self.plan,
            sigma_px,
            looks,
            effective_looks: effective,
            sigma: self.arguments.sigma,
            double,
            path,
            threads: self.common.threads(),
            memory: self.arguments.memory.saturating_mul(1_000_000),
        };
        let memory = job.memory_plan()?;
        if !self.common.json {
            let (strips, threads) = (height.div_ceil(memory.strip_rows), memory.threads);
            let bytes = megabytes(memory.bytes);
            print(&format!("{strips} strips on {threads} threads; {bytes} of memory"));
        }
        let facts = self.facts(&survey, job.looks, effective, memory.bytes);
        let layout = ImageLayout {
            frames,
            height,
            width,
            strip_rows: memory.strip_rows,
            sigma: self.arguments.sigma,
            attributes: facts.clone(),
            times_s: self.series.times_s().map(<[f64]>::to_vec),
        };
        let writer = ImageWriter::create(&self.arguments.output, layout)?;
        let progress = Progress::new("phase images", job.steps()?);
        let unmeasured = job.run(&progress, &|strip| {
            writer.write_strip(strip.first_row, strip.phases, strip.sigmas, strip.valid)
        })?;
        let files = writer.finish()?;
        drop(progress);
        let mut facts = facts;
        facts.insert("pixels_without_weight".to_owned(), json!(unmeasured));
        if unmeasured > 0 && !self.common.json {
            print(&format!("{unmeasured} pixels have no pair above random phases: 0 there"));
        }
        let lost = survey.not_finite + survey.dark;
        let left_out = if lost > 0 {
            let Survey { not_finite, dark, .. } = survey;
            format!(" ({not_finite} not finite and {dark} always zero: NaN there)")
        } else {
            String::new()
        };
        self.report(&format!("{width} x {height} pixels{left_out}"), facts, &files);
        Ok(())
    }

    fn survey(&self) -> Result<Survey> {
        survey(self.series, &self.plan.depths.all())
            .map_err(|error| error.about(&self.arguments.series))
    }

    fn coherence(&self, survey: &Survey) -> Result<SpatialCoherence> {
        let layer: Vec<usize> = self.plan.depths.first.clone().collect();
        SpatialCoherence::estimate(self.series, survey, &layer)
    }

    /// What made the result, kept with it.
    fn facts(&self, survey: &Survey, looks: f64, effective: f64, memory: u64) -> Attributes {
        let mut facts = Attributes::new();
        let method = self.arguments.method.to_possible_value();
        let weights = self.arguments.weights.to_possible_value();
        let name = |value: Option<clap::builder::PossibleValue>| {
            value.map_or(Value::Null, |value| json!(value.get_name()))
        };
        let paper = matches!(self.plan.method, Method::Paper(_));
        for (key, value) in [
            ("software", json!(concat!("phasewalk ", env!("CARGO_PKG_VERSION")))),
            ("series", json!(self.arguments.series)),
            ("method", name(method)),
            ("weights", if paper { name(weights) } else { Value::Null }),
            ("max_lag", if paper { json!(self.plan.params.max_lag) } else { Value::Null }),
            ("gaussian_px", json!(self.arguments.gaussian)),
            ("looks", json!(looks)),
            ("effective_looks", json!(effective)),
            ("wavelength_nm", json!(self.series.wavelength_nm())),
            ("pixels_not_finite", json!(survey.not_finite)),
            ("pixels_dark", json!(survey.dark)),
            ("memory_bytes", json!(memory)),
        ] {
            if !value.is_null() {
                facts.insert(key.to_owned(), value);
            }
        }
        facts
    }

    fn report(&self, ensemble: &str, mut facts: Attributes, files: &[PathBuf]) {
        let seconds = self.start.elapsed().as_secs_f64();
        if self.common.json {
            facts.insert("files".to_owned(), json!(files));
            facts.insert("seconds".to_owned(), json!(seconds));
            print(&Value::Object(facts).to_string());
            return;
        }
        let looks = |key: &str| facts.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
        print(&format!(
            "{} frames, {ensemble}, {} pairs; {:.1} looks, {:.1} of them independent",
            self.plan.frames(),
            self.plan.pairs().len(),
            looks("looks"),
            looks("effective_looks"),
        ));
        print(&format!("wrote {} in {seconds:.1} s", list(files)));
    }
}
