//! Which sweeps can be used, and why the others cannot.

use super::Sweep;
use super::align::{Units, stretch_cost};
use super::scaled::Scaled;
use super::template::{Fit, Template};
use super::trace::Trace;
use crate::reconstruct::quantile::quantile;
use std::fmt;

/// A recording whose brightest image is below this share of full scale has no light.
pub(super) const NO_LIGHT_SHARE: f32 = 0.005;
/// A recording with this share of clipped pixels in half of its images is saturated.
pub(super) const ALL_CLIPPED_SHARE: f64 = 0.5;
/// A sweep is saturated when this share of its pixels is clipped.
const SATURATED_SHARE: f64 = 0.02;
/// A sweep is dark below this share of the usual brightness.
const DARK_SHARE: f32 = 0.25;
/// A sweep is unlike the others when its misfit is this share of that of any other data.
const UNLIKE_SHARE: f64 = 0.5;
/// How far around its place a sweep must not fit better.
const PLACE_IMAGES: usize = 3;

/// Whether a sweep can be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// All images, as bright as the others.
    Ok,
    /// Images are missing at its end.
    Short {
        /// Images in the recording.
        images: usize,
        /// Images of a whole sweep, K.
        of: usize,
    },
    /// No light: the camera ran without a sweep.
    Dark,
    /// Pixels at full scale.
    Saturated {
        /// Share of the pixels, 0 ..= 1.
        share: f64,
    },
    /// Complete, but its spectrum is not that of the others.
    Unlike,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => write!(f, "ok"),
            Self::Short { images, of } => write!(f, "short: {images} of {of} images"),
            Self::Dark => write!(f, "dark"),
            Self::Saturated { share } => {
                write!(f, "saturated: {:.0}% of the pixels", 100.0 * share)
            }
            Self::Unlike => write!(f, "its spectrum is unlike that of the other sweeps"),
        }
    }
}

/// Verdicts on the sweeps between `bounds`, compared with the median sweep.
pub(super) fn judge(
    trace: &Trace,
    data: &Scaled,
    template: &Template,
    bounds: &[usize],
) -> Vec<Sweep> {
    let good = good_fits(data, template, bounds, &Units::first(template));
    let mut sweeps = by_light(trace, data, bounds, template.period());
    for sweep in sweeps.iter_mut().filter(|sweep| sweep.verdict == Verdict::Ok) {
        match good.binary_search_by_key(&sweep.first_image, |&(start, _)| start) {
            Ok(at) => (sweep.power, sweep.delay_images) = (1.0 + good[at].1.gain, good[at].1.delay),
            Err(_) => sweep.verdict = Verdict::Unlike,
        }
    }
    sweeps
}

/// Verdicts by length and brightness alone.
pub(super) fn by_light(
    trace: &Trace,
    data: &Scaled,
    bounds: &[usize],
    period: usize,
) -> Vec<Sweep> {
    let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len().max(1) as f32;
    let spans = || bounds.windows(2).map(|span| (span[0], span[1]));
    let whole = spans().filter(|(from, to)| to - from == period);
    let usual =
        quantile(whole.map(|(from, to)| f64::from(mean(&data.brightness[from..to]))), 0.5) as f32;
    spans()
        .map(|(from, to)| {
            let share = f64::from(mean(&trace.clipped()[from..to]));
            let verdict = if to - from < period {
                Verdict::Short { images: to - from, of: period }
            } else if share > SATURATED_SHARE {
                Verdict::Saturated { share }
            } else if mean(&data.brightness[from..to]) < DARK_SHARE * usual {
                Verdict::Dark
            } else {
                Verdict::Ok
            };
            Sweep { first_image: from, images: to - from, verdict, delay_images: 0.0, power: 1.0 }
        })
        .collect()
}

/// Start and fit of the whole sweeps that look like the median one.
pub(super) fn good_fits(
    data: &Scaled,
    template: &Template,
    bounds: &[usize],
    units: &Units,
) -> Vec<(usize, Fit)> {
    let period = template.period();
    let limit = UNLIKE_SHARE * f64::from(units.cap) * period as f64;
    bounds
        .windows(2)
        .filter(|span| span[1] - span[0] == period)
        .map(|span| (span[0], template.fit(data, span[0], period)))
        .filter(|(_, fit)| fit.cost < limit)
        .collect()
}

/// Whether the sweeps simply lie at the multiples of K and nothing fits better close by.
pub(super) fn all_in_place(data: &Scaled, template: &Template) -> bool {
    let period = template.period();
    let units = Units::first(template);
    let cost = |start: usize| f64::from(stretch_cost(data, template, start, &units));
    let last = data.images() - period;
    (0..=last).step_by(period).all(|start| {
        let here = cost(start);
        here < UNLIKE_SHARE * f64::from(units.cap) * period as f64
            && (start.saturating_sub(PLACE_IMAGES)..=(start + PLACE_IMAGES).min(last))
                .all(|near| here <= cost(near) + units.cut)
    })
}
