//! What to compute: the method with its parameters, shared by curves and images.

use crate::error::{Error, Result};
use crate::planes::Planes;
use phasewalk_core::Params;
use phasewalk_core::params::{DIRECT_FRAME, RANDOM_PROBABILITY};
use phasewalk_core::weights::{Weighting, Weights};
use std::ops::RangeInclusive;

/// How the phase is obtained from the cross-spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Phase difference to one frame (paper lines 975-984).
    Direct,
    /// Knox-Thompson walk in single steps (line 421).
    OneStep,
    /// All pairs up to the largest lag, weighted least squares (lines 850-948).
    Paper(Weighting),
    /// All pairs, maximum likelihood with a coherence model fitted to the data
    /// (`phasewalk_core::linking`).
    Linked,
}

/// What the ensemble average that gives a pair's phase is taken over. Weights and coherences are the
/// same for both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Average {
    /// C: bright pixels count more (paper lines 739-757).
    #[default]
    Field,
    /// C/|C|: all pixels count the same, so that single bright speckles do not dominate. Not the
    /// paper's.
    Phasor,
}

/// Method and parameters for a series of known length.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The method.
    pub method: Method,
    /// What the phases are averaged over.
    pub average: Average,
    /// Parameters of the least squares, `max_lag` included.
    pub params: Params,
    /// t_0 of the direct difference.
    pub direct_frame: usize,
    /// Acquisition times, one per frame; frame numbers where none are known.
    pub times_s: Vec<f64>,
    /// Standard deviation of the phase's second derivative, rad per squared unit of time, where it is known
    /// beforehand (linked curves only).
    pub acceleration: Option<f64>,
    /// Which depths are combined, of which recordings.
    pub depths: Planes,
}

impl Plan {
    /// The paper's parameters for `frames` frames; `max_lag` and `direct_frame` as the user gave them.
    ///
    /// # Errors
    /// Fewer than two frames, a lag or a frame outside the series.
    pub fn new(
        method: Method,
        frames: usize,
        max_lag: Option<usize>,
        direct_frame: Option<usize>,
        depths: impl Into<Planes>,
    ) -> Result<Self> {
        if frames < 2 {
            let plural = if frames == 1 { "" } else { "s" };
            return Err(Error::failed(format!(
                "the series has {frames} frame{plural}: a phase change needs at least 2"
            )));
        }
        let params = Params::paper(max_lag.unwrap_or(frames - 1));
        params.validate(frames).map_err(|_| {
            let lag = params.max_lag;
            Error::usage(format!(
                "--max-lag {lag}: must be 1 ..= {} for {frames} frames",
                frames - 1
            ))
        })?;
        let direct_frame = direct_frame.unwrap_or(DIRECT_FRAME.min(frames - 1));
        if direct_frame >= frames {
            let last = frames - 1;
            return Err(Error::usage(format!(
                "--reference-frame {direct_frame}: the frames are 0 ..= {last}"
            )));
        }
        let times_s = (0..frames).map(|frame| frame as f64).collect();
        let (average, depths) = (Average::default(), depths.into());
        Ok(Self { method, average, params, direct_frame, times_s, acceleration: None, depths })
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.times_s.len()
    }

    /// The gauge frame g: the fifth, or the last of a shorter series.
    #[must_use]
    pub fn gauge(&self) -> usize {
        self.params.gauge_frame.min(self.frames() - 1)
    }

    /// The frames (t, s) whose cross-spectrum U(t) conj U(s) the method needs, in the order it needs
    /// them: for the least squares all (t, t+1), (t, t+2), ... of t = 0, then those of t = 1, ...
    #[must_use]
    pub fn pairs(&self) -> Vec<(usize, usize)> {
        let frames = self.frames();
        match self.method {
            Method::Direct => (0..frames).map(|s| (self.direct_frame, s)).collect(),
            Method::OneStep => (1..frames).map(|s| (s - 1, s)).collect(),
            Method::Paper(_) | Method::Linked => {
                let last = |t: usize| (t + self.params.max_lag).min(frames - 1);
                (0..frames).flat_map(|t| (t + 1..=last(t)).map(move |s| (t, s))).collect()
            }
        }
    }

    /// The weight function for an ensemble of so many looks.
    #[must_use]
    pub fn weights(&self, looks: f64) -> Weights {
        let weighting = match self.method {
            Method::Paper(weighting) => weighting,
            Method::Direct | Method::OneStep | Method::Linked => Weighting::Paper,
        };
        Weights::new(weighting, looks, RANDOM_PROBABILITY)
    }
}

/// The depths (z pixels, both ends included) whose cross-spectra are combined.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Depths {
    /// Z1: summed.
    pub first: RangeInclusive<usize>,
    /// Z2: summed and subtracted in phase, if there are two layers.
    pub second: Option<RangeInclusive<usize>>,
}

impl Depths {
    /// The one depth of a series without a z axis.
    #[must_use]
    pub const fn single() -> Self {
        Self { first: 0..=0, second: None }
    }

    /// Check against the number of depth pixels; `None` stands for no `--layers` given.
    ///
    /// # Errors
    /// Empty ranges, ranges outside the volume, or a volume without `--layers`.
    pub fn for_volume(given: Option<Self>, depth: usize) -> Result<Self> {
        let Some(depths) = given else {
            if depth == 1 {
                return Ok(Self::single());
            }
            return Err(Error::usage(format!(
                "the series has {depth} depth pixels: say which to compare, as --layers A..B,C..D"
            )));
        };
        for range in std::iter::once(&depths.first).chain(&depths.second) {
            let (a, b) = (range.start(), range.end());
            if a > b || *b >= depth {
                return Err(Error::usage(format!(
                    "--layers {a}..{b}: must ascend within the depth pixels 0 ..= {}",
                    depth - 1
                )));
            }
        }
        Ok(depths)
    }

    /// All depths used, Z1 first; a depth in both layers appears twice.
    #[must_use]
    pub fn all(&self) -> Vec<usize> {
        self.first.clone().chain(self.second.clone().into_iter().flatten()).collect()
    }

    /// How many of [`Self::all`] belong to Z1.
    #[must_use]
    pub fn in_first(&self) -> usize {
        self.first.clone().count()
    }
}

impl std::fmt::Display for Depths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}..{}", self.first.start(), self.first.end())?;
        match &self.second {
            Some(second) => write!(f, ",{}..{}", second.start(), second.end()),
            None => Ok(()),
        }
    }
}

impl std::str::FromStr for Depths {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let explain = || format!("'{text}' is not A..B or A..B,C..D (depth pixels, ends included)");
        let range = |part: &str| {
            let (a, b) = part.split_once("..")?;
            Some(a.trim().parse().ok()?..=b.trim().trim_start_matches('=').parse().ok()?)
        };
        let mut parts = text.split(',');
        let first = parts.next().and_then(range).ok_or_else(explain)?;
        let second = parts.next().map(|part| range(part).ok_or_else(explain)).transpose()?;
        if parts.next().is_some() {
            return Err(explain());
        }
        if second.as_ref() == Some(&first) {
            return Err(format!("'{text}' compares a layer with itself"));
        }
        Ok(Self { first, second })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_read_and_checked() {
        let depths: Depths = "3..5,9..10".parse().unwrap();
        assert_eq!(depths, Depths { first: 3..=5, second: Some(9..=10) });
        assert_eq!(depths.all(), [3, 4, 5, 9, 10]);
        assert_eq!(depths.to_string(), "3..5,9..10");
        assert_eq!("7..7".parse::<Depths>().unwrap(), Depths { first: 7..=7, second: None });
        for wrong in ["", "3", "a..b", "1..2,", "1..2,3..4,5..6", "-1..2", "1..2,1..2"] {
            assert!(wrong.parse::<Depths>().is_err(), "{wrong}");
        }
        assert!(Depths::for_volume(Some(depths.clone()), 11).is_ok());
        assert_eq!(Depths::for_volume(Some(depths), 10).unwrap_err().exit_status(), 2);
        let backwards = Depths { first: std::ops::RangeInclusive::new(5, 3), second: None };
        assert!(Depths::for_volume(Some(backwards), 10).is_err());
        assert!(Depths::for_volume(None, 2).is_err());
        assert_eq!(Depths::for_volume(None, 1).unwrap(), Depths::single());
    }

    #[test]
    fn pairs_of_each_method() {
        let plan = |method, lag| Plan::new(method, 4, lag, None, Depths::single()).unwrap();
        assert_eq!(plan(Method::OneStep, None).pairs(), [(0, 1), (1, 2), (2, 3)]);
        assert_eq!(plan(Method::Direct, None).pairs(), [(3, 0), (3, 1), (3, 2), (3, 3)]);
        let paper = Method::Paper(Weighting::Paper);
        assert_eq!(plan(paper, Some(2)).pairs(), [(0, 1), (0, 2), (1, 2), (1, 3), (2, 3)]);
        assert_eq!(plan(paper, None).pairs().len(), 6);
    }
}
