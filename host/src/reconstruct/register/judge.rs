//! Which sweeps show the retina standing still enough.
//!
//! A blink shows nothing: it matches no sweep. A sweep smeared by a saccade matches its neighbours
//! a little, at every place it passed, but far less than they match each other.

use super::MATCHED;
use super::pair::PairMotion;

/// A pair whose correlation falls below this share of the usual one at its lag is not used.
const SHARE: f64 = 0.25;

/// True for sweeps that hang together by matching pairs, false for the others.
///
/// `pairs` holds (earlier, later, motion). Blinks that only match each other, by what is fixed to
/// the camera, are a smaller group and therefore not good.
#[must_use]
pub fn judge(sweeps: usize, pairs: &[(usize, usize, PairMotion)]) -> Vec<bool> {
    let usable = usable(pairs);
    let mut group: Vec<usize> = (0..sweeps).collect();
    for &(i, j, _) in &usable {
        let (kept, gone) = (group[i].min(group[j]), group[i].max(group[j]));
        group.iter_mut().filter(|g| **g == gone).for_each(|g| *g = kept);
    }
    let size = |of: usize| group.iter().filter(|&&g| g == of).count();
    let largest = (0..sweeps).max_by_key(|&g| (size(g), sweeps - g)).unwrap_or(0);
    let lonely = size(largest) < 2;
    group.iter().map(|&g| g == largest && !lonely).collect()
}

/// The pairs that match, and match about as well as pairs of their lag do.
pub fn usable(pairs: &[(usize, usize, PairMotion)]) -> Vec<(usize, usize, PairMotion)> {
    let matched: Vec<_> = pairs.iter().copied().filter(|p| p.2.quality >= MATCHED).collect();
    let usual: Vec<f64> = matched.iter().map(|p| usual(&matched, p.0.abs_diff(p.1))).collect();
    let kept = matched.iter().zip(usual).filter(|(p, usual)| p.2.correlation >= SHARE * usual);
    kept.map(|(p, _)| *p).collect()
}

/// Median correlation of the pairs of one lag.
fn usual(pairs: &[(usize, usize, PairMotion)], lag: usize) -> f64 {
    let same = pairs.iter().filter(|p| p.0.abs_diff(p.1) == lag);
    let mut correlations: Vec<f64> = same.map(|p| p.2.correlation).collect();
    correlations.sort_by(f64::total_cmp);
    correlations.get(correlations.len() / 2).copied().unwrap_or(0.0)
}
