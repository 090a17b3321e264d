//! The options of `watch`, and what they alone can tell.

use crate::cli::{check_output, leakage_is_of_linked_curves};
use crate::error::{Error, Result};
use crate::io::{CurveFile, Format};
use crate::looks::Looks;
use crate::watch::LARGEST_LAG;
use clap::ValueEnum;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The largest lag where none is asked for.
const MAX_LAG: usize = 16;

/// Options of `watch`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("region").required(true).args(["mask", "gaussian"]))]
pub(in crate::cli) struct Arguments {
    /// Complex frames that another program is writing: .npy or .zarr of axes (time, y, x), or - for standard input
    ///
    /// A frame of an .npy file is there when the header counts it and the file is long enough for it: the header may
    /// name all frames from the beginning, or be rewritten. A frame of a Zarr array (`field` of a group) is there when
    /// the array's shape counts it and the files of its chunks were not written to in the last 0.2 s.
    ///
    /// Standard input begins with a line of JSON,
    /// {"format":"phasewalk-frames/1","height":368,"width":640,"dtype":"complex64"}
    /// (interval_s and wavelength_nm may stand there, too); the frames follow, little-endian, row after row, with
    /// nothing between them.
    ///
    /// Frames without a finite number other than 0 are left out; their results are nan.
    #[arg(value_name = "FRAMES")]
    pub(super) source: PathBuf,
    /// Curve: average over the pixels of this mask (y, x), true or non-zero inside
    #[arg(long, value_name = "M.npy")]
    pub(super) mask: Option<PathBuf>,
    /// Keep the light that the aperture mixes in from outside of the mask (curves of method linked), see `phase --help`
    #[arg(long)]
    pub(super) keep_leakage: bool,
    /// Images: average with a Gaussian of this standard deviation, in pixels (periodic edges)
    ///
    /// Each pixel's newest phase is put where its pairs with the L frames before want it, their phases being held; the
    /// weights are the paper's.
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    pub(super) gaussian: Option<f64>,
    /// How a curve is obtained from the cross-spectrum; images are of method paper
    /// [default: linked for a curve]
    #[arg(long, value_enum)]
    pub(super) method: Option<MethodName>,
    /// Use pairs of frames up to L apart, not counting those left out, at most 64 (method paper and images)
    /// [default: 16]
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    pub(super) max_lag: Option<usize>,
    /// Looks for the weights' threshold: nominal (pixels of the mask, 4 pi sigma^2), effective (independent
    /// speckles, estimated from the first frame) or a number
    /// [default: nominal, for method linked effective]
    #[arg(long, value_name = "LOOKS", allow_negative_numbers = true)]
    pub(super) looks: Option<Looks>,
    /// Keep what the smoothed curve of all frames needs, and write it at the end beside -o, as OUT.smoothed.csv
    ///
    /// Of method paper it is the curve of `phase --method paper --max-lag L` on the same frames; of method linked each
    /// frame is smoothed by the 16 that follow it.
    #[arg(long)]
    pub(super) history: bool,
    /// Time from frame to frame [default: the source's own, where it has one, else times are frame numbers]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(super) interval: Option<f64>,
    /// Wavelength, for the optical path length (phase lambda / 4 pi) beside a curve's phase
    /// [default: the source's own, where it has one]
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    pub(super) wavelength_nm: Option<f64>,
    /// Stop when no frame has come for so long [default: wait until Ctrl-C, or the end of standard input]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub(super) idle: Option<f64>,
    /// Print a line for every frame
    #[arg(long)]
    pub(super) follow: bool,
    /// Result: a curve grows by a line per frame in a .csv or .ndjson; images are the newest one, in an .npy that is
    /// replaced, or all in a .zarr
    #[arg(short, long, value_name = "OUT", required_unless_present = "follow")]
    pub(super) output: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum MethodName {
    /// Pairs of frames up to --max-lag, weighted least squares (extended Knox-Thompson)
    Paper,
    /// Maximum likelihood with a coherence fitted to the data, frame by frame
    Linked,
}

impl Arguments {
    /// The method of the curve or the images.
    pub(super) fn method(&self) -> MethodName {
        let default = if self.mask.is_some() { MethodName::Linked } else { MethodName::Paper };
        self.method.unwrap_or(default)
    }

    pub(super) fn max_lag(&self) -> usize {
        self.max_lag.unwrap_or(MAX_LAG)
    }

    /// Looks that set the weights.
    pub(super) fn looks(&self) -> Looks {
        self.looks.unwrap_or(match self.method() {
            MethodName::Linked => Looks::Effective,
            MethodName::Paper => Looks::Nominal,
        })
    }

    /// How long to wait for a frame.
    pub(super) fn idle(&self) -> Option<Duration> {
        self.idle.map(Duration::from_secs_f64)
    }

    /// Where the smoothed curve goes.
    pub(super) fn smoothed(&self) -> Option<PathBuf> {
        let output = self.output.as_deref().filter(|_| self.history)?;
        Some(output.with_extension("smoothed.csv"))
    }

    /// What the flags alone can tell.
    pub(super) fn validate(&self) -> Result<()> {
        for (flag, value) in [
            ("--interval", self.interval),
            ("--wavelength-nm", self.wavelength_nm),
            ("--idle", self.idle),
        ] {
            // A duration holds so many seconds.
            if let Some(value) = value.filter(|&value| !(value > 0.0 && value < 1e18)) {
                return Err(Error::usage(format!("{flag} {value}: must be a number above 0")));
            }
        }
        self.validate_method()?;
        self.validate_history()?;
        self.validate_output()
    }

    fn validate_method(&self) -> Result<()> {
        if self.mask.is_none() && self.method() == MethodName::Linked {
            return Err(Error::usage(
                "--method linked is for curves (--mask): images are of method paper while they \
                 come, and linked by `phase` afterwards",
            ));
        }
        if self.max_lag.is_some() && self.method() == MethodName::Linked {
            return Err(Error::usage(
                "--max-lag belongs to --method paper: add it, or leave it out (linked has a \
                 window of 16 frames)",
            ));
        }
        if self.keep_leakage && self.method() == MethodName::Paper {
            return Err(leakage_is_of_linked_curves());
        }
        if !(1..=LARGEST_LAG).contains(&self.max_lag()) {
            let lag = self.max_lag();
            return Err(Error::usage(format!("--max-lag {lag}: must be 1 ..= {LARGEST_LAG}")));
        }
        Ok(())
    }

    fn validate_history(&self) -> Result<()> {
        if !self.history {
            return Ok(());
        }
        if self.mask.is_none() {
            return Err(Error::usage(
                "--history is for curves (--mask): of images keep the frames, and take `phase` afterwards",
            ));
        }
        if self.output.is_none() {
            return Err(Error::usage(
                "--history needs -o: the smoothed curve is written beside it",
            ));
        }
        Ok(())
    }

    /// The output has a format that can grow, and is no input.
    fn validate_output(&self) -> Result<()> {
        let Some(output) = &self.output else { return Ok(()) };
        let images = self.mask.is_none();
        if images && matches!(Format::of(output)?, Format::Csv) {
            return Err(Error::usage(format!(
                "-o {}: images go to .npy or .zarr",
                output.display()
            )));
        }
        if !images {
            CurveFile::check(output)?;
        }
        let mut inputs: Vec<&Path> = vec![&self.source];
        inputs.extend(self.mask.as_deref());
        check_output("-o", output, &inputs)?;
        self.smoothed().map_or(Ok(()), |smoothed| check_output("-o", &smoothed, &inputs))
    }
}
