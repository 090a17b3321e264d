//! What a [`Tracker`](super::Tracker) is told, and the ranges of it.

use crate::error::Error;
use crate::params::REFERENCE_FRAMES;

/// Longest lag that the decay rates resolve, in windows: beyond it a decay counts as static.
const LONGEST: f64 = 3.0;

/// Parameters of a [`Tracker`](super::Tracker).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerSettings {
    /// L: effective looks behind each ⟨C⟩, above 1.
    pub looks: f64,
    /// Shortest interval between frames, in the unit of the times; sets the fastest decay of the model.
    pub interval: f64,
    /// Longest lag that the decay rates resolve, in the unit of the times; three windows if `None`.
    pub longest: Option<f64>,
    /// N_0: the phase is reported against the mean of the first so many frames (the usable ones of them).
    pub reference_frames: usize,
    /// Share of what is known of the coherence that is kept from frame to frame, 0 ..= 1.
    pub forget: f64,
    /// Added to the diagonal of the regression on the predecessors, over L: shrinks the weights of pairs
    /// whose coherence is chance.
    pub ridge: f64,
    /// Steps of scoring after each frame, at least 1.
    pub passes: usize,
    /// Keep all frames older than the window as one compressed anchor frame? Without it coherence over more than
    /// a window is lost.
    pub anchor: bool,
    /// lambda: factor of what the anchor holds when a frame joins it, 0 ..= 1; 1 keeps all frames alike.
    pub anchor_memory: f64,
    /// How many pairs of the window the coherence with the anchor counts as, in the fit of the decays.
    pub anchor_weight: f64,
    /// May the speckle move on by more from one frame to the next than the times say (a jump, a rate that varies)? A frame
    /// of low quality with which the next one agrees then counts as good and late.
    pub jumps: bool,
    /// May the pattern come back, as with a pulse or a vibration (periods of 6 intervals and more)? Cosines then join the decays where
    /// these cannot follow. A tracker that has none ([`Tracker`](super::Tracker)) does without whatever this says.
    pub periodic: bool,
}

impl TrackerSettings {
    /// Defaults for L effective looks and frames at least `interval` apart.
    #[must_use]
    pub const fn for_looks(looks: f64, interval: f64) -> Self {
        Self {
            looks,
            interval,
            longest: None,
            reference_frames: REFERENCE_FRAMES,
            forget: 0.98,
            ridge: 0.5,
            passes: 2,
            anchor: true,
            anchor_memory: 1.0,
            anchor_weight: 4.0,
            jumps: true,
            periodic: true,
        }
    }

    /// Longest lag of the decay rates for a window of `window` frames.
    pub(super) fn longest_for(&self, window: usize) -> f64 {
        self.longest.unwrap_or(LONGEST * window as f64 * self.interval)
    }

    /// Check the ranges for a window of `window` frames.
    ///
    /// # Errors
    /// Names the first parameter that is out of its range.
    pub fn validate(&self, window: usize) -> Result<(), Error> {
        let share = 0.0..=1.0;
        let large = 0.0..=1e6;
        let times = 1e-30..=1e30;
        // Looks beyond 1e9 are no measurement, and f32 could not hold their information.
        let looks = self.looks > 1.0 && self.looks <= 1e9;
        let longest = self.longest_for(window);
        let references = 1..=window;
        let ranges = [
            ("looks", self.looks, looks, "above 1 and at most 1e9"),
            ("interval", self.interval, times.contains(&self.interval), "1e-30 ..= 1e30"),
            (
                "longest lag",
                longest,
                longest >= self.interval && longest <= 1e36,
                "the interval ..= 1e36",
            ),
            (
                "number of reference frames",
                self.reference_frames as f64,
                references.contains(&self.reference_frames),
                "1 to the frames of the window",
            ),
            ("forget", self.forget, share.contains(&self.forget), "0 ..= 1"),
            ("ridge", self.ridge, large.contains(&self.ridge), "0 ..= 1e6"),
            ("passes", self.passes as f64, self.passes > 0, "at least 1"),
            ("anchor memory", self.anchor_memory, share.contains(&self.anchor_memory), "0 ..= 1"),
            ("anchor weight", self.anchor_weight, large.contains(&self.anchor_weight), "0 ..= 1e6"),
        ];
        match ranges.into_iter().find(|&(_, _, fits, _)| !fits) {
            Some((parameter, value, _, allowed)) => Err(Error { parameter, value, allowed }),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_checked_and_named() {
        let good = TrackerSettings::for_looks(100.0, 1.0);
        assert!(good.validate(16).is_ok());
        let refused = |settings: TrackerSettings, name| {
            assert_eq!(settings.validate(16).unwrap_err().parameter, name);
        };
        refused(TrackerSettings { looks: 1.0, ..good }, "looks");
        refused(TrackerSettings { looks: f64::NAN, ..good }, "looks");
        refused(TrackerSettings { interval: 0.0, ..good }, "interval");
        refused(TrackerSettings { longest: Some(0.5), ..good }, "longest lag");
        refused(TrackerSettings { reference_frames: 17, ..good }, "number of reference frames");
        refused(TrackerSettings { reference_frames: 0, ..good }, "number of reference frames");
        refused(TrackerSettings { forget: 1.1, ..good }, "forget");
        refused(TrackerSettings { ridge: -1.0, ..good }, "ridge");
        refused(TrackerSettings { passes: 0, ..good }, "passes");
        refused(TrackerSettings { anchor_memory: f64::NAN, ..good }, "anchor memory");
        refused(TrackerSettings { anchor_weight: f64::INFINITY, ..good }, "anchor weight");
    }
}
