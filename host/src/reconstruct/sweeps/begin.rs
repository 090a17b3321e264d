//! The first median sweep: a quiet run of sweeps, and where in its cycle a sweep begins.

use super::align::{Units, align};
use super::scaled::Scaled;
use super::template::Template;
use crate::reconstruct::quantile::quantile;

/// Sweeps of the quiet run at most: few, lest a lost image falls into it.
const RUN_SWEEPS: usize = 8;
/// A run must have this share of the usual light: dark sweeps are quiet, too.
const LIGHT_SHARE: f64 = 0.8;
/// A run may have this share of clipped images: clipped sweeps are quiet, too.
const CLIPPED_SHARE: f64 = 0.05;
/// Sweeps at the beginning over which the first image is judged.
const JUDGED_SWEEPS: usize = 8;
/// Turns are judged by the whole recording when they differ by no more cuts than these.
const CLOSE_CUTS: f64 = 3.0;
/// How many sweeps after the first may be the first regular one.
const SEARCHED_SWEEPS: usize = 4;

/// Starts of the sweep-long stretches that differ least from one to the next.
pub(super) fn quietest_run(data: &Scaled, period: usize) -> Option<Vec<usize>> {
    let sweeps = data.images() / period;
    let length = (sweeps / 3).clamp(2, RUN_SWEEPS);
    if sweeps < 2 {
        return None;
    }
    let pairs = data.images() - period;
    let unrest = running((0..pairs).map(|image| f64::from(data.distance(image, image + period))));
    let light = running(data.brightness.iter().map(|&value| f64::from(value)));
    let clipped = running(data.clipped.iter().map(|&clipped| f64::from(u8::from(clipped))));
    let starts = data.images() - length * period + 1;
    let over = |sums: &[f64], start: usize, images: usize| sums[start + images] - sums[start];
    let run = length * period;
    let usual = quantile((0..starts).map(|start| over(&light, start, run)), 0.5);
    let best = (0..starts)
        .filter(|&start| over(&light, start, run) >= LIGHT_SHARE * usual)
        .filter(|&start| over(&clipped, start, run) <= CLIPPED_SHARE * run as f64)
        .min_by(|&a, &b| {
            let [a, b] = [a, b].map(|start| over(&unrest, start, run - period));
            a.total_cmp(&b)
        })?;
    Some((0..length).map(|sweep| best + sweep * period).collect())
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
