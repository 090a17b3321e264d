//! The first median sweep: a quiet run of sweeps, and where in its cycle a sweep begins.

use super::align::{Units, align};
use super::scaled::Scaled;
use super::template::Template;
use crate::reconstruct::quantile::quantile;

/// Sweeps of the quiet run at most: few, lest a lost image falls into it.
const RUN_SWEEPS: usize = 8;
/// Every sweep of a run must have this share of the usual light: dark sweeps are quiet, too.
const LIGHT_SHARE: f64 = 0.8;
/// Every sweep of a run may have this share of clipped images: clipped sweeps are quiet, too.
const CLIPPED_SHARE: f64 = 0.05;
/// Neighbours in a run differ by no more than this times the quiet quarter of all neighbours: more
/// than the camera's late starts do, less than a sweep out of place.
const UNREST_FACTOR: f64 = 8.0;
/// Sweeps at the beginning over which the first image is judged.
const JUDGED_SWEEPS: usize = 8;
/// Turns are judged by the whole recording when they differ by no more cuts than these.
const CLOSE_CUTS: f64 = 3.0;
/// How many sweeps after the first may be the first regular one.
const SEARCHED_SWEEPS: usize = 4;

/// Starts of the sweep-long stretches that differ least from one to the next.
///
/// Bad sweeps leave quiet runs of any length between them: the longest without one is taken, as
/// starts of the camera differ less from the median of many. Of equally long ones the quietest wins.
pub(super) fn quietest_run(data: &Scaled, period: usize) -> Option<Vec<usize>> {
    let pairs = (data.images() + 1).checked_sub(2 * period)?;
    let lit = lit_stretches(data, period);
    let distance = |image| f64::from(data.distance(image, image + period));
    let sums = running((0..data.images() - period).map(distance));
    let unrest: Vec<Option<f64>> = (0..pairs)
        .map(|start| {
            (lit[start] && lit[start + period]).then(|| sums[start + period] - sums[start])
        })
        .collect();
    let limit = UNREST_FACTOR * quantile(unrest.iter().copied().flatten(), 0.25);
    let unrest_of_run = |start: usize, length: usize| -> Option<f64> {
        let neighbours = unrest[start..].iter().step_by(period).take(length - 1);
        neighbours.map(|unrest| unrest.filter(|&unrest| unrest <= limit)).sum()
    };
    let longest = (data.images() / period / 3).clamp(2, RUN_SWEEPS);
    (2..=longest).rev().find_map(|length| {
        let starts = 0..(data.images() + 1).saturating_sub(length * period);
        let (_, start) = starts
            .filter_map(|start| Some((unrest_of_run(start, length)?, start)))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((0..length).map(|sweep| start + sweep * period).collect())
    })
}

/// Whether the sweep-long stretch from each image on has the usual light, neither dark nor clipped.
fn lit_stretches(data: &Scaled, period: usize) -> Vec<bool> {
    let light = running(data.brightness.iter().map(|&value| f64::from(value)));
    let clipped = running(data.clipped.iter().map(|&clipped| f64::from(u8::from(clipped))));
    let over = |sums: &[f64], start: usize| sums[start + period] - sums[start];
    let starts = || 0..=data.images() - period;
    let usual = quantile(starts().map(|start| over(&light, start)), 0.5);
    starts()
        .map(|start| {
            over(&light, start) >= LIGHT_SHARE * usual
                && over(&clipped, start) <= CLIPPED_SHARE * period as f64
        })
        .collect()
}

/// Sums of the values before each place.
fn running(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    std::iter::once(0.0)
        .chain(values.map(|value| {
            sum += value;
            sum
        }))
        .collect()
}

/// The cycle turned so that it starts where sweeps start: the recording's first image is m = 0.
///
/// `cycle` begins at image `run`, anywhere in a sweep. Tried are the turns that make the first
/// sweeps, the sweeps after a short first one, or the last sweep whole; the cheapest cut wins.
pub(super) fn first_image(data: &Scaled, cycle: &Template, run: usize) -> Template {
    let period = cycle.period();
    let mut turns = vec![(period - run % period) % period];
    let sweeps = data.images() / period;
    for regular in 1..=SEARCHED_SWEEPS.min(sweeps - 1) {
        let turn = turn_at(data, cycle, regular * period);
        turns.extend([turn, turn_after_short(data, cycle, regular * period, turn)]);
    }
    turns.push(turn_at(data, cycle, data.images() - period));
    let mut seen: Vec<usize> = Vec::new();
    turns.retain(|turn| {
        !seen.contains(turn) && {
            seen.push(*turn);
            true
        }
    });
    let judge = |turn: usize, images: usize| {
        let template = cycle.rotated(turn);
        let units = Units::first(&template);
        (align(data, &template, images, &units).cost, units.cut)
    };
    let front = data.images().min(JUDGED_SWEEPS * period);
    let costs: Vec<(f64, f64)> = turns.iter().map(|&turn| judge(turn, front)).collect();
    let least = costs.iter().map(|cost| cost.0).fold(f64::INFINITY, f64::min);
    let close =
        turns.iter().zip(&costs).filter(|(_, (cost, cut))| *cost <= least + CLOSE_CUTS * cut);
    let finalists: Vec<usize> = close.map(|(&turn, _)| turn).collect();
    if let [turn] = finalists[..] {
        return cycle.rotated(turn);
    }
    let best = least_index(finalists.iter().map(|&turn| judge(turn, data.images()).0));
    cycle.rotated(finalists.get(best).copied().unwrap_or(0))
}

/// Factor that brings the period from image `at` on to the power of the cycle.
fn power(data: &Scaled, cycle: &Template, at: usize) -> f32 {
    let light: f32 = data.brightness[at..at + cycle.period()].iter().sum();
    cycle.brightness.iter().sum::<f32>() / light.max(f32::MIN_POSITIVE)
}

/// Place in the cycle of image `at`, from the period that begins there.
fn turn_at(data: &Scaled, cycle: &Template, at: usize) -> usize {
    let (period, power) = (cycle.period(), power(data, cycle, at));
    let cost = |turn: usize| -> f64 {
        (0..period).map(|m| cycle.distance(data, at + m, (turn + m) % period, power)).sum()
    };
    least_index((0..period).map(cost))
}

/// Place in the cycle of image 0, if a first sweep of 1 .. K images is followed by regular ones
/// that have image `at` at place `turn`.
fn turn_after_short(data: &Scaled, cycle: &Template, at: usize, turn: usize) -> usize {
    let (period, power) = (cycle.period(), power(data, cycle, at));
    let back = |image: usize| (turn + at * period + image - at) % period;
    let distance = |image: usize, place: usize| cycle.distance(data, image, place % period, power);
    let regular = running((0..at).map(|image| distance(image, back(image))));
    let cost = |short: usize| -> f64 {
        let begin = back(short);
        let first: f64 = (0..short).map(|image| distance(image, begin + image)).sum();
        first + regular[at] - regular[short]
    };
    let short = 1 + least_index((1..=period.min(at)).map(cost));
    back(short)
}

/// Index of the least value.
fn least_index(values: impl Iterator<Item = f64>) -> usize {
    values
        .enumerate()
        .fold((0, f64::INFINITY), |best, next| if next.1 < best.1 { next } else { best })
        .0
}
