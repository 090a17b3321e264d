//! Where each sweep of a recording begins.
//!
//! A recording is sweeps back to back, normally of K images each. A sweep that lost images moves
//! all later ones, so their starts are looked for in the data:
//! ```text
//! trace ── noise of the repeat ─> scaled ── quietest run ─> median sweep ── begin ─> first image
//!       ─> align (dynamic programming, exact) ─> median of all good sweeps ─> align ─> verdicts
//! ```

mod align;
mod begin;
mod period;
mod scaled;
mod template;
mod trace;
mod verdict;

pub use trace::Trace;
pub use verdict::Verdict;

use crate::error::{Error, Result};
use crate::reconstruct::quantile::quantile;
use align::{Units, align};
use scaled::{Scaled, noise_of_repeat};
use template::Template;

/// One sweep in the recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Its first image, counted from the beginning of the recording.
    pub first_image: usize,
    /// How many of its images are in the recording, at most K.
    pub images: usize,
    /// Whether it can be used.
    pub verdict: Verdict,
    /// Images the camera started later than in the median sweep (−0.5 ..= 0.5); 0 of bad sweeps.
    pub delay_images: f64,
    /// Power relative to the median sweep; 1 of bad sweeps.
    pub power: f64,
}

/// Alignments with ever better median sweeps, at most.
const PASSES: usize = 8;
/// Earliest and latest start, without outliers.
const DELAY_QUANTILES: [f64; 2] = [0.02, 0.98];
/// So many short sweeps are nothing special.
const FEW_SHORT: usize = 2;
/// Good sweeps whose misfit is not above what is called usual.
const USUAL_SHARE: f64 = 0.9;
/// Least contrast of the median sweep, in units of the noise, to tell where it begins.
const LEAST_CONTRAST: f64 = 0.5;

impl Sweep {
    /// Can it be used?
    #[must_use]
    pub fn is_ok(&self) -> bool {
        self.verdict == Verdict::Ok
    }
}

/// Finds the sweeps of `images_per_sweep` images in the order of the recording.
///
/// Every image belongs to a sweep; a short one consists of its first images.
///
/// # Errors
/// Fewer images than one sweep, no light, all images clipped, another period in the data than
/// `images_per_sweep`, or a spectrum too flat to tell where sweeps begin when they must be looked for.
pub fn find(trace: &Trace, images_per_sweep: usize) -> Result<Vec<Sweep>> {
    let period = images_per_sweep;
    check(trace, period)?;
    let data = Scaled::new(trace, &noise_of_repeat(trace, period));
    let whole = trace.images().is_multiple_of(period);
    let Some(run) = begin::quietest_run(&data, period) else {
        return Ok(verdict::by_light(trace, &data, &back_to_back(trace.images(), period), period));
    };
    period::check(trace, &data, period)?;
    let cycle = Template::median(&data, &run, period);
    if cycle.contrast() < LEAST_CONTRAST {
        if whole {
            let bounds = back_to_back(trace.images(), period);
            return Ok(verdict::by_light(trace, &data, &bounds, period));
        }
        return Err(too_flat(trace.images(), period));
    }
    let first = cycle.rotated((period - run[0] % period) % period);
    if whole && verdict::all_in_place(&data, &first) {
        let bounds = back_to_back(trace.images(), period);
        return Ok(verdict::judge(trace, &data, &first, &bounds));
    }
    let template = begin::first_image(&data, &cycle, run[0]);
    let sweeps = refine(trace, &data, template);
    plausible(trace, &data, period, &sweeps)?;
    Ok(sweeps)
}

/// Refuses sweeps that only a wrong K can explain.
fn plausible(trace: &Trace, data: &Scaled, period: usize, sweeps: &[Sweep]) -> Result<()> {
    let good = sweeps.iter().filter(|sweep| sweep.is_ok()).count();
    let short = number_short(sweeps);
    if 2 * good < sweeps.len() || short > (sweeps.len() / 4).max(FEW_SHORT) {
        return Err(period::not_repeating(trace, data, period, good, sweeps.len()));
    }
    if short <= FEW_SHORT {
        return Ok(());
    }
    // A short sweep now and then makes up for a K that is wrong by an image or two.
    match period::neighbour(trace, data, period) {
        Some(other) if searched(trace, other).is_some_and(|other| number_short(&other) < short) => {
            Err(period::wrong(other, period))
        }
        _ => Ok(()),
    }
}

/// The sweeps of `period` images, wherever they begin.
fn searched(trace: &Trace, period: usize) -> Option<Vec<Sweep>> {
    let data = Scaled::new(trace, &noise_of_repeat(trace, period));
    let run = begin::quietest_run(&data, period)?;
    let cycle = Template::median(&data, &run, period);
    Some(refine(trace, &data, begin::first_image(&data, &cycle, run[0])))
}

fn number_short(sweeps: &[Sweep]) -> usize {
    sweeps.iter().filter(|sweep| matches!(sweep.verdict, Verdict::Short { .. })).count()
}

/// Aligns, takes the median of all good sweeps, and aligns again until nothing changes.
fn refine(trace: &Trace, data: &Scaled, mut template: Template) -> Vec<Sweep> {
    let mut units = Units::first(&template);
    let mut bounds = align(data, &template, data.images(), &units).bounds;
    for _ in 0..PASSES {
        let Some(next) = improved(data, &template, &bounds, &units) else { break };
        (template, units) = next;
        let again = align(data, &template, data.images(), &units).bounds;
        if again == bounds {
            break;
        }
        bounds = again;
    }
    verdict::judge(trace, data, &template, &bounds)
}

/// The median of the good sweeps in the middle of their delays, and their usual misfit.
fn improved(
    data: &Scaled,
    template: &Template,
    bounds: &[usize],
    units: &Units,
) -> Option<(Template, Units)> {
    let period = template.period();
    let good: Vec<usize> =
        verdict::good_fits(data, template, bounds, units).iter().map(|&(start, _)| start).collect();
    if good.len() < 2 {
        return None;
    }
    let median = Template::median(data, &good, period);
    let delays = || good.iter().map(|&start| median.fit(data, start, period).delay);
    let middle = DELAY_QUANTILES.map(|share| quantile(delays(), share)).iter().sum::<f64>() / 2.0;
    let template = median.centred(middle);
    let misfit =
        quantile(good.iter().map(|&start| template.fit(data, start, period).cost), USUAL_SHARE);
    Some((template, Units::of_noise(misfit / period as f64, period)))
}

fn back_to_back(images: usize, period: usize) -> Vec<usize> {
    let mut bounds: Vec<usize> = (0..images).step_by(period).collect();
    bounds.push(images);
    bounds
}

fn check(trace: &Trace, period: usize) -> Result<()> {
    let images = trace.images();
    if period < 2 || images < period {
        return Err(Error::failed(format!(
            "the recording has {images} images, less than one sweep of {period}: check --images"
        )));
    }
    let brightest = trace.brightness().into_iter().fold(0.0, f32::max);
    if brightest <= verdict::NO_LIGHT_SHARE * f32::from(trace.full_scale()) {
        return Err(Error::failed(format!(
            "no light in the recording: the brightest image has a mean of {brightest:.1} counts"
        )));
    }
    let clipped = quantile(trace.clipped().iter().map(|&share| f64::from(share)), 0.5);
    if clipped > verdict::ALL_CLIPPED_SHARE {
        let percent = 100.0 * clipped;
        return Err(Error::failed(format!(
            "the recording is saturated: half of the images have {percent:.0}% of their pixels at \
             full scale; lower the exposure or the power"
        )));
    }
    Ok(())
}

fn too_flat(images: usize, period: usize) -> Error {
    let rest = images % period;
    Error::failed(format!(
        "{images} images are not whole sweeps of {period} ({rest} left over), and the spectrum is \
         too flat to find the short one: give the run log or check --images"
    ))
}

#[cfg(test)]
mod tests;
