//! The linked phases of a tile's pixels in time, as many pixels at once as a vector has lanes: unwrapped, and less their
//! reference.

use super::Gaps;
use super::tiles::Tile;
use crate::lanes::Lanes;
use crate::method::Plan;
use phasewalk_core::chain::{least_sure_gap, unwrap_chain};
use phasewalk_core::reference::{reference_span, subtract_reference};
use std::ops::Range;

/// One of so many pixels is asked how sure its turns are over gaps: what it costs is not worth while for each.
const ASKED: usize = 16;

/// What the pixels of a tile share.
pub(super) struct Unwrapping<'a, L> {
    plan: &'a Plan,
    tile: &'a Tile,
    /// Usable pixels of the images.
    valid: &'a [bool],
    /// 1 for the frames that count in the reference, and how many of the first are looked at.
    counted: Vec<L>,
    references: usize,
    /// (time).
    series: Vec<L>,
    /// Is there a gap in the times of the sound frames?
    has_gaps: bool,
    /// What the pixels so far have told of it.
    pub gaps: Gaps,
}

impl<'a, L: Lanes> Unwrapping<'a, L> {
    pub fn new(plan: &'a Plan, tile: &'a Tile, valid: &'a [bool]) -> Self {
        let counted: Vec<f32> = tile.usable.iter().map(|&u| f32::from(u8::from(u))).collect();
        let still = vec![0.0; tile.quality.len()];
        Self {
            plan,
            tile,
            valid,
            references: reference_span(&counted, plan.params.reference_frames),
            series: vec![L::zero(); counted.len()],
            counted: counted.iter().map(|&counts| L::from_f64(f64::from(counts))).collect(),
            has_gaps: least_sure_gap(&still, &plan.times_s, &tile.quality).is_some(),
            gaps: Gaps::default(),
        }
    }

    /// Neighbouring pixels of the images `phases`, (time, pixel); NaN in frames without a phase.
    #[inline(always)]
    pub fn unwrap(&mut self, phases: &mut [f32], pixels: Range<usize>) {
        let Self { plan, tile, valid, counted, references, series, .. } = self;
        for first in pixels.clone().step_by(L::WIDTH) {
            let some = first..pixels.end.min(first + L::WIDTH);
            for (image, phase) in phases.chunks_exact(valid.len()).zip(series.iter_mut()) {
                let lanes = L::flat_mut(std::slice::from_mut(phase));
                for (lane, &phase) in lanes.iter_mut().zip(&image[some.clone()]) {
                    *lane = L::Element::from(phase);
                }
            }
            unwrap_chain(series, &plan.times_s, &tile.quality);
            subtract_reference(series, counted, *references);
            let images = phases.chunks_exact_mut(valid.len()).zip(series.iter().zip(&tile.usable));
            for (image, (phase, &known)) in images {
                let lanes = L::flat(std::slice::from_ref(phase));
                for (place, &lane) in image[some.clone()].iter_mut().zip(lanes) {
                    *place = if known { lane.into() as f32 } else { f32::NAN };
                }
            }
        }
        if self.has_gaps {
            self.ask(phases, pixels);
        }
    }

    /// How sure whole turns are over gaps, of some of the pixels just unwrapped.
    fn ask(&mut self, phases: &[f32], pixels: Range<usize>) {
        let Self { plan, tile, valid, gaps, .. } = self;
        for pixel in pixels.step_by(ASKED).filter(|&pixel| valid[pixel]) {
            let images = phases.chunks_exact(valid.len()).take(tile.quality.len());
            let series: Vec<f64> = images.map(|image| f64::from(image[pixel])).collect();
            if let Some((_, error)) = least_sure_gap(&series, &plan.times_s, &tile.quality) {
                gaps.count(error);
            }
        }
    }
}
