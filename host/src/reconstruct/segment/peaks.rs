//! The layers in a mean A-line.

use super::profile::Profile;

/// A peak must rise this many times the noise above the floor, and as much above its surroundings.
const SIGNIFICANCE: f64 = 6.0;
/// .. and above its surroundings by these shares of its own and of the highest peak.
const OWN_PROMINENCE: f64 = 0.06;
const LEAST_PROMINENCE: f64 = 0.02;

/// What a peak of the mean A-line is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layer {
    /// Junction of inner and outer segments, the near end of the outer segments.
    InnerOuter,
    /// Outer-segment tips, the far end.
    Tips,
    /// Retinal pigment epithelium, behind the tips.
    PigmentEpithelium,
    /// Any other.
    Other,
}

/// A layer in the mean A-line along the IS/OS.
#[derive(Clone, Debug, PartialEq)]
pub struct Peak {
    /// Depth behind the IS/OS in depth pixels.
    pub depth_px: f64,
    /// Sharpened height above the noise, the highest 1.
    pub height: f64,
    /// What it is taken for.
    pub layer: Layer,
}

/// Peaks in order of depth; depths are those of the profile.
pub(super) fn find(profile: &Profile) -> Vec<Peak> {
    let sharp = profile.sharpened();
    let highest = sharp.iter().copied().fold(0.0, f64::max);
    let uncertain = SIGNIFICANCE * profile.noise;
    (1..sharp.len().saturating_sub(1))
        .filter(|&at| sharp[at] > sharp[at - 1] && sharp[at] >= sharp[at + 1])
        .filter(|&at| {
            let height = sharp[at];
            let rise = height - saddle(&sharp, at);
            height > uncertain * (height + profile.floor)
                && rise > uncertain * height
                && rise > OWN_PROMINENCE * height
                && rise > LEAST_PROMINENCE * highest
        })
        .map(|at| Peak {
            depth_px: profile.distance(at as f64 + vertex(&sharp, at)),
            height: sharp[at] / highest,
            layer: Layer::Other,
        })
        .collect()
}

/// The higher of the lowest values on the way to higher ground on either side.
fn saddle(values: &[f64], at: usize) -> f64 {
    let lowest = |way: &mut dyn Iterator<Item = f64>| {
        let mut lowest = values[at];
        for value in way {
            if value > values[at] {
                return Some(lowest);
            }
            lowest = lowest.min(value);
        }
        None
    };
    let left = lowest(&mut values[..at].iter().rev().copied());
    let right = lowest(&mut values[at + 1..].iter().copied());
    left.into_iter().chain(right).fold(0.0, f64::max)
}

fn vertex(values: &[f64], at: usize) -> f64 {
    let [a, b, c] = [values[at - 1], values[at], values[at + 1]];
    let bend = a - 2.0 * b + c;
    if bend < 0.0 { (0.5 * (a - c) / bend).clamp(-0.5, 0.5) } else { 0.0 }
}
