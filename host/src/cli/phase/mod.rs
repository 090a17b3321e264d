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
use crate::io::{Timed, check_times, open_series};
use crate::looks::{SpatialCoherence, looks_of_depths};
use crate::method::{Depths, Method, Plan};
use crate::series::{Survey, survey};
use phasewalk_core::params::RANDOM_PROBABILITY;
use std::time::Instant;

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    arguments.validate()?;
    let mut series = open_series(&arguments.series)?;
    if let Some(times) = &arguments.times {
        series = Box::new(Timed::read(series, times)?);
    }
    let series = series.as_ref();
    let about = |error: Error| error.about(&arguments.series);
    let depths = arguments.depths(series).map_err(about)?;
    let wavelength_nm = arguments.wavelength(series).map_err(about)?;
    let good = ChosenFrames::good(series, &depths.all()).map_err(about)?;
    let plan = plan(arguments, &good, depths).map_err(about)?;
    let task = Task { arguments, common, good, plan, wavelength_nm, start: Instant::now() };
    match (&arguments.mask, arguments.gaussian) {
        (Some(path), _) => task.curve(path),
        (None, sigma) => task.images(sigma.unwrap_or_default()),
    }
}

/// The method for the good frames, which keep their times.
fn plan(arguments: &Arguments, good: &ChosenFrames<'_>, depths: Depths) -> Result<Plan> {
    let reference = arguments.reference_frame;
    let reference = reference.map(|frame| good.position(frame, "--reference-frame")).transpose()?;
    let frames = good.numbers().len();
    let mut plan = Plan::new(arguments.method(), frames, arguments.max_lag, reference, depths)?;
    plan.average = arguments.average();
    plan.times_s = good.numbers().iter().map(|&frame| good.time_of(frame)).collect();
    plan.acceleration = arguments.acceleration;
    check_times(&plan.times_s).map_err(|frame| {
        let number = good.numbers()[frame];
        Error::failed(format!(
            "the series' coordinate time_s is not strictly ascending at frame {number}: correct it, or \
             give --times"
        ))
    })?;
    Ok(plan)
}

/// Too few looks cannot be told from random phases; with fewer than twelve the threshold of the paper's weights
/// is above any mean phasor.
fn check_looks(method: Method, looks: f64, region: &str) -> Result<()> {
    let needed = match method {
        Method::Paper(_) => -(1.0 - RANDOM_PROBABILITY).ln(),
        // With two looks even frames without any coherence have |gamma| = 0.7 on average.
        Method::Linked => 2.0,
        Method::Direct | Method::OneStep => 0.0,
    };
    if looks > needed {
        return Ok(());
    }
    Err(Error::usage(format!(
        "{region}: {looks:.1} looks cannot be told from random phases, {} are needed: average over \
         more pixels, or take --method one-step or --looks",
        (needed + 0.5).ceil()
    )))
}

/// What the flags and the file have settled.
struct Task<'a> {
    arguments: &'a Arguments,
    common: &'a Common,
    /// The series without its bad sweeps.
    good: ChosenFrames<'a>,
    plan: Plan,
    wavelength_nm: Option<f64>,
    start: Instant,
}

impl Task<'_> {
    fn survey(&self) -> Result<Survey> {
        survey(&self.good, &self.plan.depths.all())
            .map_err(|error| error.about(&self.arguments.series))
    }

    /// Looks that the depths of a layer add to each pixel: of the layer that has fewer.
    fn looks_of_layers(&self, survey: &Survey) -> Result<f64> {
        let of = |layer: &std::ops::RangeInclusive<usize>| {
            looks_of_depths(&self.good, survey, &layer.clone().collect::<Vec<_>>())
        };
        let first = of(&self.plan.depths.first)?;
        let second = self.plan.depths.second.as_ref().map(of).transpose()?;
        Ok(second.map_or(first, |second| first.min(second)))
    }

    fn coherence(&self, survey: &Survey) -> Result<SpatialCoherence> {
        let layer: Vec<usize> = self.plan.depths.first.clone().collect();
        SpatialCoherence::estimate(&self.good, survey, &layer)
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
