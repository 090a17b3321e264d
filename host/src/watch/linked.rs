//! The curve of a region by phase linking, frame by frame: the core's tracker, with the fields on the heap.

use super::curve::WatchedCurve;
use super::first::{First, is_finite};
use super::paper::chosen;
use crate::curve::Selection;
use crate::error::Result;
use crate::io::{CurveRow, without_rim};
use crate::looks::Looks;
use num_complex::{Complex32, Complex64};
use phasewalk_core::tracker::{Absorb, Estimate, NODES, Tracker, TrackerSettings};
use rayon::prelude::*;
use std::collections::VecDeque;
use std::ops::Range;

/// Light from outside of the mask is taken off by pixels that are hardly ever further from it.
const AROUND: usize = 12;

/// Parameters of [`LinkedCurve`].
#[derive(Clone, Copy, Debug)]
pub struct LinkedSettings {
    /// Looks of the coherence and the standard deviations.
    pub looks: Looks,
    /// Is light from outside of the mask left in?
    pub keep_leakage: bool,
    /// Are the final estimates kept?
    pub history: bool,
}

/// The curve by phase linking, with a window of 16 frames and the anchor.
pub struct LinkedCurve {
    selection: Selection,
    scale: f32,
    looks: f64,
    tracker: Box<Tracker<f64, NODES>>,
    /// The anchor, if there is one, then the frames of the window, oldest first; of power 1.
    nodes: VecDeque<Vec<Complex64>>,
    /// Numbers of the frames in the source, of those whose final estimate is not known.
    waiting: VecDeque<usize>,
    /// Final estimates, where they are kept.
    history: Option<Vec<CurveRow>>,
}

impl LinkedCurve {
    /// A curve of the pixels of the mask (y, x), none of whose frames has been taken.
    ///
    /// # Errors
    /// When no pixel is usable, or there are too few looks.
    pub fn new(first: &First, mask: &[bool], settings: LinkedSettings) -> Result<Self> {
        let _ = chosen(first, mask)?;
        let LinkedSettings { looks, keep_leakage, history } = settings;
        let (selection, effective) = first.select(mask, keep_leakage)?;
        let looks = looks.choose(selection.pixels() as f64, effective);
        Ok(Self {
            scale: first.scale(),
            looks,
            tracker: Box::new(Tracker::new(TrackerSettings::for_looks(looks, 1.0))?),
            nodes: VecDeque::with_capacity(NODES),
            waiting: VecDeque::with_capacity(NODES),
            history: history.then(Vec::new),
            selection,
        })
    }

    /// Independent looks of the region.
    #[must_use]
    pub fn looks(&self) -> f64 {
        self.looks
    }

    /// Bytes for a region of this mask (y, x) and what is around it, and for each frame of a history.
    #[must_use]
    pub fn bytes(mask: &[bool], width: usize, history: bool) -> [u64; 2] {
        let elsewhere: Vec<bool> = mask.iter().map(|inside| !inside).collect();
        let far = without_rim(&elsewhere, width, AROUND);
        let pixels = far.iter().filter(|&&far| !far).count();
        let fields = (NODES + 1) * pixels * size_of::<Complex64>();
        let frame = if history { size_of::<CurveRow>() } else { 0 };
        [(fields + size_of::<Tracker<f64, NODES>>()) as u64, frame as u64]
    }

    /// Do with the fields as the tracker has done with their cross-spectra.
    fn follow(&mut self, absorb: &Absorb<f64>) {
        let anchored = usize::from(self.nodes.len() > self.waiting.len());
        if let Some(estimate) = absorb.smoothed() {
            let number = self.waiting.pop_front().unwrap_or(estimate.frame);
            if let Some(history) = &mut self.history {
                history.push(row(number, &estimate, self.looks));
            }
        }
        match *absorb {
            Absorb::Nothing => {}
            Absorb::Drop { .. } => {
                self.nodes.remove(anchored);
            }
            Absorb::Found { factor, .. } => {
                for pixel in self.nodes.front_mut().into_iter().flatten() {
                    *pixel *= factor;
                }
            }
            Absorb::Merge { anchor_factor, oldest_factor, .. } => {
                let oldest = self.nodes.remove(1).unwrap_or_default();
                let anchor = self.nodes.front_mut().into_iter().flatten();
                for (pixel, old) in anchor.zip(oldest) {
                    *pixel = *pixel * anchor_factor + old * oldest_factor;
                }
            }
        }
    }
}

impl WatchedCurve for LinkedCurve {
    fn push(&mut self, frame: usize, field: &[Complex32]) -> CurveRow {
        let absorb = self.tracker.absorb();
        self.follow(&absorb);
        let pixel = |u: Complex32| {
            let u = if is_finite(&u) { u } else { Complex32::default() };
            Complex64::new(f64::from(u.re), f64::from(u.im))
        };
        let mut field: Vec<Complex64> =
            self.selection.of_image(field, self.scale).map(pixel).collect();
        let inside = self.selection.pixels();
        let power = make_unit(&mut field, inside);
        let correlations: Vec<Complex64> =
            self.nodes.par_iter().map(|node| correlation(&field, node, inside)).collect();
        let estimate = self.tracker.push(&correlations, power, frame as f64);
        self.nodes.push_back(field);
        self.waiting.push_back(frame);
        // Cannot fail: numbers ascend, and the tracker has made room.
        let missing = CurveRow::missing(frame, frame as f64);
        estimate.map_or(missing, |estimate| row(frame, &estimate, self.looks))
    }

    fn smoothed(&self) -> Option<Vec<CurveRow>> {
        let mut rows = self.history.clone()?;
        let mut waiting = self.waiting.iter();
        self.tracker.finish(|estimate| {
            let number = waiting.next().copied().unwrap_or(estimate.frame);
            rows.push(row(number, &estimate, self.looks));
        });
        Some(rows)
    }

    fn pixels(&self) -> usize {
        self.selection.pixels()
    }
}

/// A frame without a usable phase has none.
fn row(number: usize, estimate: &Estimate<f64>, looks: f64) -> CurveRow {
    let missing = CurveRow::missing(number, number as f64);
    let Estimate { phase_rad, sigma_rad, quality, .. } = *estimate;
    if estimate.is_usable(looks) {
        return CurveRow { phase_rad, sigma_rad, quality, ..missing };
    }
    CurveRow { sigma_rad: f64::INFINITY, quality, ..missing }
}

/// Scale the field so that its squares sum to 1; a dark one stays dark. The sum of the squares, 1 or 0.
fn make_unit(field: &mut [Complex64], inside: usize) -> f64 {
    let power = correlation(field, field, inside).re;
    if power < f64::from(f32::MIN_POSITIVE) {
        field.fill(Complex64::default());
        return 0.0;
    }
    let factor = power.sqrt().recip();
    for pixel in field {
        *pixel *= factor;
    }
    1.0
}

/// Sum of u conj v over the pixels inside, less that over what is behind them.
fn correlation(u: &[Complex64], v: &[Complex64], inside: usize) -> Complex64 {
    let sum = |of: Range<usize>| -> Complex64 {
        u[of.clone()].iter().zip(&v[of]).map(|(u, v)| u * v.conj()).sum()
    };
    sum(0..inside) - sum(inside..u.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::testing::frames;
    use phasewalk_core::tracker::FieldTracker;

    const PIXELS: usize = 96;

    /// It is the core's tracker with fields, its numbers and its smoothed estimates.
    #[test]
    fn it_is_the_cores_tracker() {
        let frames = frames(60, PIXELS, 0.95, |frame, _| 0.3 * frame as f32);
        let first = First::of(&frames[0], 8, PIXELS / 8).unwrap();
        let looks = Looks::Number(90.0);
        let settings = LinkedSettings { looks, keep_leakage: false, history: true };
        let mut curve = LinkedCurve::new(&first, &[true; PIXELS], settings).unwrap();
        let settings = TrackerSettings::for_looks(90.0, 1.0);
        let mut core = FieldTracker::<f64, PIXELS, NODES>::new(settings).unwrap();
        let mut smoothed = Vec::new();
        for (number, frame) in frames.iter().enumerate() {
            // Every tenth frame of the source is not usable.
            let number = number + number / 10;
            let field: Vec<Complex64> =
                frame.iter().map(|u| Complex64::new(f64::from(u.re), f64::from(u.im))).collect();
            let keep = |estimate| smoothed.push(estimate);
            let expected = core.push(&field, number as f64, keep).unwrap();
            let newest = curve.push(number, frame);
            assert_eq!(newest.frame, number);
            assert!((newest.phase_rad - expected.phase_rad).abs() < 1e-9, "{newest:?}");
            let ratio = newest.sigma_rad / expected.sigma_rad;
            assert!(number == 0 || (ratio - 1.0).abs() < 1e-9, "{newest:?} {expected:?}");
        }
        core.finish(|estimate| smoothed.push(estimate));
        let rows = curve.smoothed().unwrap();
        assert_eq!((rows.len(), smoothed.len(), rows[59].frame), (60, 60, 64));
        for (row, expected) in rows.iter().zip(&smoothed) {
            assert!((row.phase_rad - expected.phase_rad).abs() < 1e-9, "{row:?} {expected:?}");
        }
    }
}
