//! `phasewalk phase`.
//!
//! | file | what it holds |
//! |---|---|
//! | `arguments` | the options, and what they alone can tell |
//! | `closure` | whether one motion explains the data |
//! | `curve` | the phase of a region over time |
//! | `decorrelation` | how fast each part of the image decorrelates |
//! | `images` | phase images of all frames |
//! | `shown` | the frames that the figure of images shows |
//! | `figure` | the file of a figure |
//! | `report` | what is kept with the result and said about it |

mod arguments;
mod closure;
mod curve;
mod decorrelation;
mod figure;
mod images;
mod report;
mod shown;

pub(super) use arguments::Arguments;

use super::Common;
use crate::error::{Error, Result};
use crate::figures::style;
use crate::frames::ChosenFrames;
use crate::io::{Recordings, Series, Timed, check_times};
use crate::looks::{SpatialCoherence, looks_of_depths, looks_of_recordings, speckled};
use crate::method::{Method, Plan};
use crate::planes::Planes;
use crate::series::{Survey, survey};
use phasewalk_core::params::RANDOM_PROBABILITY;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    arguments.validate()?;
    let recordings = Recordings::open(&arguments.series)?;
    let planes = arguments.planes(&recordings)?;
    let (series, times_from) = with_times(arguments, recordings)?;
    let series = series.as_ref();
    let about = |error: Error| arguments.about(error);
    let wavelength_nm = arguments.wavelength(series).map_err(about)?;
    let good = ChosenFrames::good(series, &planes.all()).map_err(about)?;
    let plan = plan(arguments, &good, planes).map_err(about)?;
    let start = Instant::now();
    let task = Task { arguments, common, good, plan, times_from, wavelength_nm, start };
    match (&arguments.mask, arguments.gaussian) {
        (Some(path), _) => task.curve(path),
        (None, sigma) => task.images(sigma.unwrap_or_default()),
    }
}

/// The series with the times asked for, else its own, and the file that they come from; none: frames are counted.
fn with_times(
    arguments: &Arguments,
    recordings: Recordings,
) -> Result<(Box<dyn Series>, Option<PathBuf>)> {
    if let Some(path) = &arguments.times {
        let timed = Timed::read(Box::new(recordings), path)?;
        return Ok((Box::new(timed), Some(path.clone())));
    }
    let recordings = recordings.own_times()?;
    let from = recordings.times_from().map(Path::to_owned);
    Ok((Box::new(recordings), from))
}

/// The method for the good frames, which keep their times.
fn plan(arguments: &Arguments, good: &ChosenFrames<'_>, planes: Planes) -> Result<Plan> {
    let reference = arguments.reference_frame;
    let reference = reference.map(|frame| good.position(frame, "--reference-frame")).transpose()?;
    let frames = good.numbers().len();
    let mut plan = Plan::new(arguments.method(), frames, arguments.max_lag, reference, planes)?;
    plan.average = arguments.average();
    plan.times_s = good.numbers().iter().map(|&frame| good.time_of(frame)).collect();
    plan.acceleration = arguments.acceleration;
    check_times(&plan.times_s).map_err(|frame| {
        let number = good.numbers()[frame];
        Error::failed(format!(
            "the series' coordinate time_s does not ascend at frame {number}, or by 1e12 times another interval: \
             correct it, or give --times"
        ))
    })?;
    Ok(plan)
}

/// Too few looks cannot be told from random phases; with fewer than twelve the threshold of the paper's weights
/// is above any mean phasor. An average over `averaged` numbers has no more looks, whatever `--looks` says: the coherence of
/// one pixel is 1.
pub(super) fn check_looks(method: Method, looks: f64, averaged: f64, region: &str) -> Result<()> {
    let needed = match method {
        Method::Paper(_) => -(1.0 - RANDOM_PROBABILITY).ln(),
        // With two looks even frames without any coherence have |gamma| = 0.7 on average.
        Method::Linked => 2.0,
        Method::Direct | Method::OneStep => 0.0,
    };
    if looks.min(averaged) > needed {
        return Ok(());
    }
    let other_looks =
        if averaged > needed { " or, if that is not their number, --looks" } else { "" };
    Err(Error::usage(format!(
        "{region}: {:.1} looks cannot be told from random phases, {} are needed: average over \
         more pixels, or take --method one-step{other_looks}",
        looks.min(averaged),
        (needed + 0.5).ceil()
    )))
}

/// Factors of the looks of one plane.
#[derive(Clone, Copy)]
struct AddedLooks {
    /// Of the depths of a layer, where the method counts them.
    depths: f64,
    /// Of the recordings.
    recordings: f64,
}

impl AddedLooks {
    fn product(self) -> f64 {
        self.depths * self.recordings
    }
}

/// What the flags and the files have settled.
struct Task<'a> {
    arguments: &'a Arguments,
    common: &'a Common,
    /// The series without its bad sweeps.
    good: ChosenFrames<'a>,
    plan: Plan,
    /// The file of the times; none: frames are counted.
    times_from: Option<PathBuf>,
    wavelength_nm: Option<f64>,
    start: Instant,
}

impl Task<'_> {
    fn survey(&self) -> Result<Survey> {
        survey(&self.good, &self.plan.depths.all()).map_err(|error| self.arguments.about(error))
    }

    /// Looks that depths and recordings add to each pixel: of the layer that has fewer.
    fn added_looks(&self, survey: &Survey, coherence: &SpatialCoherence) -> Result<AddedLooks> {
        let layers = self.plan.depths.by_layer();
        let mut added = AddedLooks { depths: 1.0, recordings: f64::INFINITY };
        for layer in &layers {
            let amount = looks_of_recordings(&self.good, survey, layer)?;
            added.recordings = added.recordings.min(amount);
        }
        let several = layers.iter().flatten().any(|depths| depths.len() > 1);
        if self.plan.method == Method::Linked && several {
            let pixels = coherence.looks_of_mask(&survey.valid, self.good.shape().width);
            let of = |depths: &Vec<usize>| looks_of_depths(&self.good, survey, depths, pixels);
            let looks: Vec<f64> = layers.iter().flatten().map(of).collect::<Result<_>>()?;
            added.depths = looks.into_iter().fold(f64::INFINITY, f64::min);
        }
        Ok(added)
    }

    /// The survey of where there is speckle.
    fn speckled(&self, survey: &Survey) -> Result<Survey> {
        let depth = self.first_layer().first().copied().unwrap_or_default();
        speckled(&self.good, survey, depth)
    }

    fn coherence(&self, survey: &Survey) -> Result<SpatialCoherence> {
        SpatialCoherence::estimate(&self.good, survey, &self.first_layer())
    }

    /// Z1 of the first recording.
    fn first_layer(&self) -> Vec<usize> {
        self.plan.depths.by_layer().into_iter().flatten().next().unwrap_or_default()
    }

    /// What figures call the method, and its colour.
    fn method_name(&self) -> (&'static str, [u8; 3]) {
        match self.plan.method {
            Method::Direct => (style::DIRECT_NAME, style::DIRECT),
            Method::OneStep => (style::ONE_STEP_NAME, style::ONE_STEP),
            Method::Paper(_) => (style::EXTENDED_NAME, style::EXTENDED),
            Method::Linked => (style::LINKED_NAME, style::LINKED),
        }
    }
}
