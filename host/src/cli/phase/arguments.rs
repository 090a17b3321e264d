//! The options of `phase`, and what they alone can tell.

use crate::cli::{check_output, leakage_is_of_linked_curves};
use crate::error::{Error, Result};
use crate::io::npy::sibling;
use crate::io::{Format, Recordings, Series, times_beside};
use crate::looks::Looks;
use crate::method::{Average, Depths, Method};
use crate::notes;
use crate::planes::Planes;
use clap::ValueEnum;
use phasewalk_core::weights::Weighting;
use std::path::{Path, PathBuf};

use super::figure::Picture;

/// Options of `phase`.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("region").required(true).args(["mask", "gaussian"]))]
pub(in crate::cli) struct Arguments {
    /// Complex series: .npy with axes (time, y, x) or (time, z, y, x), or a .zarr group with `field`
    ///
    /// Frames that the group's `sweep_ok` marks as bad, and frames without any finite number, are
    /// left out of the computation: like frames without a usable phase they have the phase NaN and an
    /// infinite standard deviation.
    ///
    /// Several series are repeated recordings of one scene, pixel on pixel and with the same timing
    /// (intervals to 1 %, the stimulus at the same frame), and give one result: cross-spectra are
    /// averaged over the recordings as well as over the pixels, never phases. How many independent
    /// recordings they amount to is measured from their frames. A frame that is bad in one of them is
    /// left out of all. Of one layer, motion of the whole sample must be the same in all; of two layers
    /// it cancels.
    #[arg(required = true, value_name = "SERIES")]
    pub(super) series: Vec<PathBuf>,
    /// Curve: average over the pixels of this mask (y, x), true or non-zero inside
    ///
    /// Method linked also tells whether one motion explains the region: closure_misfit, the closure phases over
    /// their noise, and closure_p, the chance that they are as bad where it does (below 0.001: look for parts
    /// that move differently); of one layer only.
    #[arg(long, value_name = "M.npy")]
    pub(super) mask: Option<PathBuf>,
    /// Curve: subtract that of this mask, an unstimulated region; the variances add
    #[arg(long, value_name = "M2.npy")]
    pub(super) control: Option<PathBuf>,
    /// Leave out the pixels of both masks within so many rows and columns of their edge: there the aperture mixes
    /// light from the other side in, and a phase that others do not share comes out too small (method linked takes
    /// that light off)
    #[arg(long, value_name = "PX", default_value_t = 0, allow_negative_numbers = true)]
    pub(super) rim: usize,
    /// Keep the light that the aperture mixes in from outside of the mask (curves of method linked)
    ///
    /// How far light spreads is seen in the speckle. Otherwise the cross-spectrum of the pixels around the mask is
    /// subtracted, with the weight that it has inside; the result's light_from_outside is that share.
    #[arg(long)]
    pub(super) keep_leakage: bool,
    /// Images: average with a Gaussian of this standard deviation, in pixels (periodic edges)
    ///
    /// Of method linked a .zarr result also holds closure_p, for each pixel the chance of such closure phases if
    /// one motion explains it (one layer), and quality, that of the frames in each tile of the image.
    #[arg(long, value_name = "SIGMA", allow_negative_numbers = true)]
    pub(super) gaussian: Option<f64>,
    /// How the phase is obtained from the cross-spectrum
    #[arg(long, value_enum, default_value_t = MethodName::Linked)]
    pub(super) method: MethodName,
    /// Weights of the pairs (method paper)
    #[arg(long, value_enum, default_value_t = WeightsName::Paper)]
    pub(super) weights: WeightsName,
    /// What the phase of a pair is averaged over; weights and standard deviations do not change
    #[arg(long, value_enum, default_value_t = EnsembleName::Field)]
    pub(super) ensemble: EnsembleName,
    /// Use pairs of frames up to L apart, not counting bad sweeps (method paper)
    /// [default: all pairs]
    #[arg(long, value_name = "L", allow_negative_numbers = true)]
    pub(super) max_lag: Option<usize>,
    /// Frame to which the direct difference and the images of --figure compare, counting bad sweeps
    /// [default: the fifth good one]
    #[arg(long, value_name = "FRAME", allow_negative_numbers = true)]
    pub(super) reference_frame: Option<usize>,
    /// When the frames were taken, in seconds: one time per frame, .npy, a text file with a number per line or a .csv
    /// table with a header (its column time_s), or the run log of the trigger board (`trigger run --log`)
    /// [default: the series' own times (time_s of a .zarr group, F.times.npy beside F.npy), else the numbers of the frames]
    #[arg(long, value_name = "FILE")]
    pub(super) times: Option<PathBuf>,
    /// What is known of the phase beforehand: standard deviation of its acceleration, rad per squared unit of
    /// the times (method linked, curves)
    #[arg(long, value_name = "RAD", allow_negative_numbers = true)]
    pub(super) acceleration: Option<f64>,
    /// Depth pixels, both ends included: A..B for one layer, A..B,C..D for Z1 minus Z2
    /// [default: the group's layer_ost_z minus layer_isos_z, where it has them]
    #[arg(long, value_name = "A..B,C..D", allow_hyphen_values = true)]
    pub(super) layers: Option<Depths>,
    /// Looks for the weights' threshold, and for coherence and standard deviation of method linked: nominal (pixels of
    /// the mask, 4 pi sigma^2, of each recording), effective (independent speckles, estimated from the frames) or a
    /// number; twice the looks make the sigma of linked smaller by the root of two
    /// [default: nominal for paper weights, effective for fisher and for method linked]
    #[arg(long, value_name = "LOOKS", allow_negative_numbers = true)]
    pub(super) looks: Option<Looks>,
    /// Wavelength, for the optical path length (phase lambda / 4 pi) beside a curve's phase
    /// [default: the series' own, where it has one]
    #[arg(long, value_name = "NM", allow_negative_numbers = true)]
    pub(super) wavelength_nm: Option<f64>,
    /// Write standard deviations of images too (curves and method linked always have them): infinite in frames without a
    /// phase, NaN in pixels that no frame can use
    #[arg(long)]
    pub(super) sigma: bool,
    /// Arithmetic of images (curves always use f64)
    #[arg(long, value_enum, default_value_t = Precision::F32)]
    pub(super) precision: Precision,
    /// Memory that images may take for their work, in MB (files held whole come on top)
    #[arg(long, value_name = "MB", default_value_t = 2000, allow_negative_numbers = true)]
    pub(super) memory: u64,
    /// Draw the result, .png or .svg, with the direct difference beside it: the curve, or the images
    /// of some frames with their speckle
    #[arg(long, value_name = "F.png")]
    pub(super) figure: Option<PathBuf>,
    /// Draw how fast each part of the image decorrelates, what is static and what is noise, .png or .svg
    /// (images of --method linked; a .zarr result holds the maps too); NaN where no coherence is found, or of two frames
    #[arg(long, value_name = "F.png")]
    pub(super) decorrelation: Option<PathBuf>,
    /// Frames that the figure of images shows, counting bad sweeps
    /// [default: seven from the reference to the last]
    #[arg(long, value_name = "FRAME,...", value_delimiter = ',', allow_negative_numbers = true)]
    pub(super) at: Vec<usize>,
    /// Result: .csv, .npy or .zarr for a curve, .npy or .zarr for images
    #[arg(short, long, value_name = "OUT")]
    pub(super) output: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum MethodName {
    /// Phase difference to one frame
    Direct,
    /// Walk in steps of one frame
    OneStep,
    /// All pairs of frames, weighted least squares (extended Knox-Thompson)
    Paper,
    /// All pairs of frames, maximum likelihood with a coherence fitted to the data
    Linked,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum WeightsName {
    /// Mean unit phasor above the level of random phases
    Paper,
    /// Fisher information of the coherence
    Fisher,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum EnsembleName {
    /// The cross-spectrum, as the paper does: bright pixels count more
    Field,
    /// Its unit phasors: all pixels count the same, which helps where single bright speckles
    /// dominate, as in layers of living tissue
    Phasor,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Precision {
    /// Fast, on vector registers
    F32,
    /// For checks
    F64,
}

impl Arguments {
    pub(super) fn method(&self) -> Method {
        match (self.method, self.weights) {
            (MethodName::Direct, _) => Method::Direct,
            (MethodName::OneStep, _) => Method::OneStep,
            (MethodName::Paper, WeightsName::Paper) => Method::Paper(Weighting::Paper),
            (MethodName::Paper, WeightsName::Fisher) => Method::Paper(Weighting::Fisher),
            (MethodName::Linked, _) => Method::Linked,
        }
    }

    pub(super) fn average(&self) -> Average {
        match self.ensemble {
            EnsembleName::Field => Average::Field,
            EnsembleName::Phasor => Average::Phasor,
        }
    }

    pub(super) fn looks(&self) -> Looks {
        self.looks.unwrap_or(match (self.method, self.weights) {
            (MethodName::Linked, _) | (_, WeightsName::Fisher) => Looks::Effective,
            (_, WeightsName::Paper) => Looks::Nominal,
        })
    }

    /// The depths to combine in every recording.
    pub(super) fn planes(&self, recordings: &Recordings) -> Result<Planes> {
        let of = |(path, series): (&Path, &dyn Series)| {
            let depths = self.depths(series).map_err(|error| error.about(path))?;
            Ok((depths, series.shape().depth))
        };
        let (depths, depth): (Vec<_>, Vec<_>) =
            recordings.each().map(of).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        Ok(Planes::of_recordings(depths, depth.first().copied().unwrap_or_default()))
    }

    /// The error with the recordings it is about, unless it names one already.
    pub(super) fn about(&self, error: Error) -> Error {
        if self.series.iter().any(|path| error.names(path)) {
            return error;
        }
        let names: Vec<String> =
            self.series.iter().map(|path| path.display().to_string()).collect();
        error.about(Path::new(&names.join(", ")))
    }

    /// What figures call the recordings.
    pub(super) fn label(&self) -> String {
        let first = self.series.first().and_then(|path| path.file_name()).unwrap_or_default();
        let name = first.to_string_lossy();
        match self.series.len().saturating_sub(1) {
            0 => name.into_owned(),
            more => format!("{name} and {more} more"),
        }
    }

    /// The depths asked for, else those that the series itself names.
    fn depths(&self, series: &dyn Series) -> Result<Depths> {
        let given = match &self.layers {
            Some(depths) => Some(depths.clone()),
            None => notes::layers(series)?,
        };
        Depths::for_volume(given, series.shape().depth)
    }

    /// The wavelength asked for, else the series' own, nm.
    pub(super) fn wavelength(&self, series: &dyn Series) -> Result<Option<f64>> {
        self.wavelength_nm.map_or_else(|| notes::wavelength_nm(series), |nm| Ok(Some(nm)))
    }

    /// What the flags alone can tell.
    pub(super) fn validate(&self) -> Result<()> {
        let format = Format::of(&self.output)?;
        if self.gaussian.is_some() && matches!(format, Format::Csv) {
            return Err(Error::usage(format!(
                "-o {}: images go to .npy or .zarr",
                self.output.display()
            )));
        }
        if let Some(nm) = self.wavelength_nm.filter(|nm| !nm.is_finite() || *nm <= 0.0) {
            let what = "must be a number of nanometres above 0";
            return Err(Error::usage(format!("--wavelength-nm {nm}: {what}")));
        }
        self.validate_methods()?;
        self.validate_prior()?;
        self.validate_regions()?;
        self.validate_files()
    }

    /// Options that belong to a method.
    fn validate_methods(&self) -> Result<()> {
        let paper = self.method == MethodName::Paper;
        if self.method == MethodName::Linked && self.ensemble != EnsembleName::Field {
            return Err(Error::usage(
                "--ensemble belongs to the other methods: add --method paper, or leave it out",
            ));
        }
        let sigma = self.sigma && self.method != MethodName::Linked;
        if !paper && (self.max_lag.is_some() || self.weights != WeightsName::Paper || sigma) {
            let what = "--max-lag, --weights and --sigma";
            return Err(Error::usage(format!(
                "{what} belong to --method paper: add it, or leave them out"
            )));
        }
        let compares = self.method == MethodName::Direct || self.figure.is_some();
        if self.reference_frame.is_some() && !compares {
            return Err(Error::usage(
                "--reference-frame belongs to --method direct and --figure: leave it out",
            ));
        }
        Ok(())
    }

    /// The prior of accelerations.
    fn validate_prior(&self) -> Result<()> {
        let Some(sigma) = self.acceleration else { return Ok(()) };
        if self.method != MethodName::Linked || self.mask.is_none() {
            return Err(Error::usage(
                "--acceleration belongs to curves (--mask) of --method linked: leave it out",
            ));
        }
        if sigma.is_finite() && sigma > 0.0 {
            return Ok(());
        }
        Err(Error::usage(format!("--acceleration {sigma}: must be a number above 0")))
    }

    /// The map of the decorrelation.
    fn validate_map(&self, inputs: &[&Path]) -> Result<()> {
        let Some(map) = &self.decorrelation else { return Ok(()) };
        if self.method != MethodName::Linked || self.gaussian.is_none() {
            return Err(Error::usage(
                "--decorrelation belongs to images (--gaussian) of --method linked: leave it out",
            ));
        }
        Picture::of("--decorrelation", map)?;
        check_output("--decorrelation", map, inputs)
    }

    /// Options that belong to curves or to images.
    fn validate_regions(&self) -> Result<()> {
        if self.mask.is_some() && (self.sigma || self.precision == Precision::F64) {
            let what = "--sigma and --precision";
            return Err(Error::usage(format!(
                "{what} are for images: a curve has standard deviations and f64 anyway"
            )));
        }
        if self.mask.is_none() && self.control.is_some() {
            return Err(Error::usage(
                "--control is for curves: leave it out, or give --mask for --gaussian",
            ));
        }
        if self.mask.is_none() && self.rim > 0 {
            return Err(Error::usage(
                "--rim is for curves: leave it out, or give --mask for --gaussian",
            ));
        }
        if self.keep_leakage && (self.mask.is_none() || self.method != MethodName::Linked) {
            return Err(leakage_is_of_linked_curves());
        }
        if !self.at.is_empty() && (self.mask.is_some() || self.figure.is_none()) {
            return Err(Error::usage(
                "--at is for the figure of images: give --gaussian and --figure, or leave it out",
            ));
        }
        Ok(())
    }

    /// No output may be an input, or another output.
    fn validate_files(&self) -> Result<()> {
        let mut inputs: Vec<&Path> = self.series.iter().map(PathBuf::as_path).collect();
        inputs.extend(self.mask.as_deref());
        inputs.extend(self.control.as_deref());
        inputs.extend(self.times.as_deref());
        let beside: Vec<PathBuf> =
            self.series.iter().filter_map(|path| times_beside(path)).collect();
        inputs.extend(beside.iter().map(PathBuf::as_path));
        let sigma = sibling(&self.output, "sigma");
        check_output("-o", &self.output, &inputs)?;
        check_output("-o", &sigma, &inputs)?;
        self.validate_map(&inputs)?;
        let Some(figure) = &self.figure else { return Ok(()) };
        Picture::of("--figure", figure)?;
        check_output("--figure", figure, &inputs)
    }
}
