//! The cheapest way to cut a recording into sweeps: dynamic programming over all starts.
//!
//! D(n) = min over L ≤ K of D(n−L) + cost of the L images before n as the beginning of a sweep
//! (+ a penalty when L < K). Every start and every length is tried, so the result is exact.

use super::scaled::Scaled;
use super::template::Template;
use rayon::prelude::*;

/// Starts whose costs are computed side by side.
const BLOCK: usize = 128;
/// A cut must save the noise of this many whole sweeps: late starts alone change a sweep's misfit by
/// that of one, and two cuts would turn a late sweep into one image and the rest.
const CUT_SHARE: f64 = 2.0;
/// Cost of an image of a dark or bright sweep, which has no noise to go by, in units of the noise.
const LIGHT_COST: f32 = 1.5;
/// Cost of calling a sweep dark or bright.
const LIGHT_PENALTY: f32 = 8.0;
/// An image is brighter than the source when it exceeds the median sweep by this factor.
const BRIGHT_FACTOR: f32 = 1.3;
/// Cost of an image that fits nothing, in units of the noise.
const CAP_NOISE: f64 = 16.0;
/// The same as share of the contrast, while the noise is not well known.
const CAP_CONTRAST: f64 = 0.05;

/// What costs are compared with.
pub(super) struct Units {
    /// Cost of an image that fits.
    pub noise: f32,
    /// Cost of an image that fits nothing.
    pub cap: f32,
    /// Cost of ending a sweep early.
    pub cut: f64,
}

impl Units {
    /// While the noise is known from neighbouring sweeps only.
    pub fn first(template: &Template) -> Self {
        let cap = CAP_NOISE.max(CAP_CONTRAST * template.contrast()) as f32;
        Self { noise: 1.0, cap, cut: CUT_SHARE * template.period() as f64 }
    }

    /// With the misfit of an image in nearly all sweeps, all slow changes and late starts included.
    pub fn of_noise(noise: f64, period: usize) -> Self {
        let noise = noise.max(0.1);
        let cap = (CAP_NOISE * noise) as f32;
        Self { noise: noise as f32, cap, cut: CUT_SHARE * noise * period as f64 }
    }
}

/// A cut of the recording.
pub(super) struct Alignment {
    /// First image of each sweep, and the end of the last.
    pub bounds: Vec<usize>,
    /// Sum of all costs.
    pub cost: f64,
}

/// Cuts the first `images` of `data`; a sweep that goes on behind them is not cut short.
pub(super) fn align(data: &Scaled, template: &Template, images: usize, units: &Units) -> Alignment {
    let period = template.period();
    let open_end = if images < data.images() { images } else { usize::MAX };
    let mut best = vec![f64::INFINITY; images + 1];
    let mut from = vec![0; images + 1];
    best[0] = 0.0;
    let mut costs = vec![0.0; BLOCK * period];
    for block in (0..images).step_by(BLOCK) {
        let starts = BLOCK.min(images - block);
        costs.par_chunks_mut(period).take(starts).enumerate().for_each(|(at, costs)| {
            let start = block + at;
            let length = period.min(images - start);
            stretch_costs(data, template, start, units, &mut costs[..length]);
        });
        for (start, costs) in (block..block + starts).zip(costs.chunks_exact(period)) {
            for (before, cost) in costs[..period.min(images - start)].iter().enumerate() {
                let length = before + 1;
                let ends_early = length < period && start + length != open_end;
                let penalty = if ends_early { units.cut } else { 0.0 };
                let total = best[start] + f64::from(*cost) + penalty;
                if total < best[start + length] {
                    best[start + length] = total;
                    from[start + length] = start;
                }
            }
        }
    }
    Alignment { bounds: trace_back(&from), cost: best[images] }
}

fn trace_back(from: &[usize]) -> Vec<usize> {
    let mut at = from.len() - 1;
    let mut bounds = vec![at];
    while at > 0 {
        at = from[at];
        bounds.push(at);
    }
    bounds.reverse();
    bounds
}

/// Cost of the period that begins at `start` as a whole sweep.
pub(super) fn stretch_cost(data: &Scaled, template: &Template, start: usize, units: &Units) -> f32 {
    let mut costs = vec![0.0; template.period()];
    stretch_costs(data, template, start, units, &mut costs);
    costs.last().copied().unwrap_or(0.0)
}

/// Costs of the 1, 2, .. images from `start` on as a sweep, be it good, dark, bright or odd.
fn stretch_costs(
    data: &Scaled,
    template: &Template,
    start: usize,
    units: &Units,
    costs: &mut [f32],
) {
    let limit = f64::from(units.cap) * template.period() as f64;
    template.prefix_costs(data, start, limit, costs);
    let (mut dark, mut bright) = (LIGHT_PENALTY * units.noise, LIGHT_PENALTY * units.noise);
    for (m, cost) in costs.iter_mut().enumerate() {
        let image = start + m;
        let is_bright =
            data.clipped[image] || data.brightness[image] > BRIGHT_FACTOR * template.brightness[m];
        let step = |known: bool| if known { LIGHT_COST * units.noise } else { units.cap };
        dark += step(data.dark[image]);
        bright += step(is_bright);
        *cost = cost.min(units.cap * (m + 1) as f32).min(dark).min(bright);
    }
}
