//! Which peaks are the two ends of the outer segments.
//!
//! IS/OS, tips and pigment epithelium are three bright layers close together at the far side of the
//! retina. Of all peaks at plausible distances those are chosen whose heights have the greatest
//! geometric mean, weighted by how much of the retina lies before them.

use super::Hints;
use super::peaks::{Layer, Peak};

/// Length of the outer segments in µm.
const OUTER_SEGMENT_UM: [f64; 2] = [14.0, 52.0];
/// From the tips to the pigment epithelium in µm.
const TIPS_TO_EPITHELIUM_UM: [f64; 2] = [7.0, 42.0];
/// A pair is as good as three layers of this share of its height.
const PAIR_SHARE: f64 = 0.5;
/// Layers left out in between must be lower than this share of those chosen.
const BETWEEN_SHARE: f64 = 0.5;
/// Weight of a choice with nothing before it.
const NOTHING_BEFORE: f64 = 0.2;
/// How far a hint may be from the layer, in depth pixels.
const HINT_PX: f64 = 2.5;
/// .. and relative, of the outer segments' length.
const HINT_SHARE: f64 = 0.25;

/// The chosen peaks.
#[derive(Clone, Debug)]
pub(super) struct Choice {
    pub isos: usize,
    pub tips: usize,
    pub epithelium: Option<usize>,
    score: f64,
}

/// Chooses among `peaks`; `hint_px` is where the IS/OS should be, in the peaks' depths.
pub(super) fn choose(
    peaks: &[Peak],
    depth_px_um: f64,
    hints: &Hints,
    hint_px: Option<f64>,
) -> Option<Choice> {
    let distance = |a: usize, b: usize| (peaks[b].depth_px - peaks[a].depth_px) * depth_px_um;
    let length_fits = |um: f64| match hints.outer_segment_um {
        Some(hint) => (um - hint).abs() < (HINT_SHARE * hint).max(depth_px_um),
        None => (OUTER_SEGMENT_UM[0]..OUTER_SEGMENT_UM[1]).contains(&um),
    };
    let place_fits =
        |at: usize| hint_px.is_none_or(|hint| (peaks[at].depth_px - hint).abs() < HINT_PX);
    // A given length says which two are meant, whatever lies in between.
    let between = if hints.outer_segment_um.is_some() { f64::INFINITY } else { BETWEEN_SHARE };
    let mut choices = Vec::new();
    for isos in (0..peaks.len()).filter(|&at| place_fits(at)) {
        for tips in (isos + 1..peaks.len()).filter(|&at| length_fits(distance(isos, at))) {
            choices.push(scored(peaks, isos, tips, None, between));
            for last in tips + 1..peaks.len() {
                let um = distance(tips, last);
                if (TIPS_TO_EPITHELIUM_UM[0]..TIPS_TO_EPITHELIUM_UM[1]).contains(&um) {
                    choices.push(scored(peaks, isos, tips, Some(last), between));
                }
            }
        }
    }
    choices.into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score))
}

/// A choice with its score; none if something above `between` times its lowest peak is left out.
fn scored(
    peaks: &[Peak],
    isos: usize,
    tips: usize,
    epithelium: Option<usize>,
    between: f64,
) -> Option<Choice> {
    let last = epithelium.unwrap_or(tips);
    let chosen = [Some(isos), Some(tips), epithelium];
    let heights = || chosen.iter().flatten().map(|&at| peaks[at].height);
    let lowest = heights().fold(f64::INFINITY, f64::min);
    let left_out = (isos..last).filter(|at| !chosen.contains(&Some(*at)));
    if left_out.map(|at| peaks[at].height).any(|height| height > between * lowest) {
        return None;
    }
    let count = heights().count() as f64;
    let mean = (heights().map(f64::ln).sum::<f64>() / count).exp();
    let sum = |range: &[Peak]| range.iter().map(|peak| peak.height).sum::<f64>();
    let (before, behind) = (sum(&peaks[..isos]), sum(&peaks[last + 1..]));
    let depth = NOTHING_BEFORE + before / (before + behind + NOTHING_BEFORE);
    let kind = if epithelium.is_some() { 1.0 } else { PAIR_SHARE };
    Some(Choice { isos, tips, epithelium, score: mean * depth * kind })
}

impl Choice {
    /// Names the chosen peaks.
    pub fn label(&self, peaks: &mut [Peak]) {
        peaks[self.isos].layer = Layer::InnerOuter;
        peaks[self.tips].layer = Layer::Tips;
        if let Some(at) = self.epithelium {
            peaks[at].layer = Layer::PigmentEpithelium;
        }
    }

    /// One line for the report: what was chosen and why.
    pub fn reason(&self, peaks: &[Peak], depth_px_um: f64, hinted: bool) -> String {
        let um = |a: usize, b: usize| (peaks[b].depth_px - peaks[a].depth_px) * depth_px_um;
        let by = if hinted { "as hinted" } else { "the brightest at plausible distances" };
        let [isos, tips] = [self.isos, self.tips].map(|at| peaks[at].height);
        let length = um(self.isos, self.tips);
        let begin = format!(
            "{} peaks; IS/OS (height {isos:.2}) and tips {length:.0} µm behind ({tips:.2})",
            peaks.len()
        );
        match self.epithelium {
            Some(at) => {
                let (height, gap) = (peaks[at].height, um(self.tips, at));
                format!("{begin}, pigment epithelium {gap:.0} µm further ({height:.2}): {by}")
            }
            None => format!("{begin}, no pigment epithelium told apart: {by}"),
        }
    }
}
