//! Unwrapping, in Δt and in t.

use super::pairs::{Pairs, pair_list};
use std::f64::consts::PI;

/// D, the number of preceding phases the unwrapping looks at, Δt = 0 included (lines 834–840).
pub const UNWRAP_DEPTH: usize = 10;

/// Phases unwrapped along Δt, and how sure each choice of branch was.
#[derive(Clone, Debug, PartialEq)]
pub struct Unwrapped {
    /// The unwrapped phases, rad; as many and in the same order as the wrapped ones.
    pub phase: Vec<f64>,
    /// How far each choice was from falling out differently, rad. From Δt = D on: the sum of
    /// absolute differences at the next best branch less that at the chosen one. Before, where
    /// the phase is taken as it is: π − |phase|, the distance from the cut of arg.
    pub margin: Vec<f64>,
}

/// Unwraps arg⟨C(t,Δt)⟩ of one t along Δt (lines 834–840).
///
/// `phases[k]` belongs to Δt = k+1; Δt = 0, with phase 0, comes before them and counts as one of
/// the `depth` (D) phases assumed free of wrapping. So for Δt = D, D+1, …: the phase is increased
/// or decreased by 2π as long as Σ_{j=1…D} |phase(Δt) − unwrapped phase(Δt−j)| keeps decreasing.
///
/// # Panics
/// If `depth` is 0.
pub fn unwrap_row(phases: &[f64], depth: usize) -> Unwrapped {
    assert!(depth > 0, "unwrapping needs at least one preceding phase");
    let mut unwrapped = vec![0.0]; // index Δt
    let mut margin = Vec::new();
    for (k, &wrapped) in phases.iter().enumerate() {
        let lag = k + 1;
        if lag < depth {
            unwrapped.push(wrapped);
            margin.push(PI - wrapped.abs());
            continue;
        }
        let preceding = &unwrapped[lag - depth..lag];
        let sum = |phase: f64| preceding.iter().map(|before| (phase - before).abs()).sum::<f64>();
        let branch = |turns: i64| wrapped + 2.0 * PI * turns as f64;
        let mut turns = 0;
        while sum(branch(turns + 1)) < sum(branch(turns)) {
            turns += 1;
        }
        while sum(branch(turns - 1)) < sum(branch(turns)) {
            turns -= 1;
        }
        let next_best = sum(branch(turns + 1)).min(sum(branch(turns - 1)));
        margin.push(next_best - sum(branch(turns)));
        unwrapped.push(branch(turns));
    }
    Unwrapped { phase: unwrapped.split_off(1), margin }
}

/// [`unwrap_row`] for every t of `pairs`: c_φ of line 877 and the margins, in the order of
/// [`pair_list`].
///
/// # Panics
/// If `depth` is 0.
pub fn unwrap_pairs(pairs: &Pairs, depth: usize) -> Unwrapped {
    let list = pair_list(pairs.frames, pairs.max_lag);
    let mut all = Unwrapped { phase: Vec::new(), margin: Vec::new() };
    for t in 0..pairs.frames {
        let of_t = list.iter().zip(&pairs.phase).filter(|(pair, _)| pair.0 == t);
        let row: Vec<f64> = of_t.map(|(_, &phase)| phase).collect();
        let unwrapped = unwrap_row(&row, depth);
        all.phase.extend(unwrapped.phase);
        all.margin.extend(unwrapped.margin);
    }
    all
}

/// The usual unwrapping in t: multiples of 2π are added so that neighbours differ by at most π,
/// starting at frame 0, which stays (lines 987-988).
pub fn unwrap_in_time(phases: &[f64]) -> Vec<f64> {
    let mut unwrapped: Vec<f64> = Vec::new();
    for &wrapped in phases {
        let mut phase = wrapped;
        if let Some(&before) = unwrapped.last() {
            while phase - before > PI {
                phase -= 2.0 * PI;
            }
            while phase - before < -PI {
                phase += 2.0 * PI;
            }
        }
        unwrapped.push(phase);
    }
    unwrapped
}

#[cfg(test)]
mod tests {
    use super::unwrap_row;
    use crate::oracle::fixtures::worst;
    use num_complex::Complex;
    use std::f64::consts::PI;

    #[test]
    fn unwrapping() {
        let wrap = |phase: f64| Complex::from_polar(1.0, phase).arg();
        let truth: Vec<f64> = (1..60).map(|lag| -0.3 * lag as f64).collect();
        let wrapped: Vec<f64> = truth.iter().copied().map(wrap).collect();
        assert!(worst(&unwrap_row(&wrapped, 10).phase, &truth) < 1e-12);
        // One outlier does not carry over.
        let mut outlier = wrapped.clone();
        outlier[20] = wrap(truth[20] + 2.5);
        let result = unwrap_row(&outlier, 10).phase;
        for k in (0..59).filter(|&k| k != 20) {
            assert!((result[k] - truth[k]).abs() < 1e-12);
        }
        // Faster than π in the first D lags: "free of wrapping" is wrong, as known.
        let fast: Vec<f64> = (1..60).map(|lag| wrap(-0.43 * lag as f64)).collect();
        assert!((unwrap_row(&fast, 10).phase[58] + 0.43 * 59.0).abs() > 6.0);
        // Unwrapping starts at Δt = D: the phase of Δt = 9 is left alone.
        let mut late = vec![0.0; 10];
        late[8] = 3.1;
        late[9] = -3.1;
        let result = unwrap_row(&late, 10);
        assert_eq!(result.phase[8], 3.1);
        assert!((result.margin[8] - (PI - 3.1)).abs() < 1e-15);
    }

    #[test]
    fn unwrapping_margin() {
        // D = 1, the phase before is 0 (Δt = 0): −x stays for x < π by a margin of 2π − 2x.
        let result = unwrap_row(&[-3.0], 1);
        assert_eq!(result.phase, vec![-3.0]);
        assert!((result.margin[0] - (2.0 * PI - 6.0)).abs() < 1e-12);
        // D = 2: before are 0 and 3; of −3 and −3 + 2π the latter is nearer, by
        // (3 + 6) − (2π−3 + 2π−6) = 18 − 4π; and beyond it (−3 + 4π) costs 4π more.
        let result = unwrap_row(&[3.0, -3.0], 2);
        assert!((result.phase[1] - (2.0 * PI - 3.0)).abs() < 1e-12);
        let chosen = (2.0 * PI - 3.0) + (2.0 * PI - 6.0);
        assert!((result.margin[1] - (9.0 - chosen)).abs() < 1e-12);
        // Preceding phases more than 2π apart make exact ties of the sums: margin 0, and the
        // phase stays where it is.
        let result = unwrap_row(&[3.0, 2.0 * PI - 3.0, 1.0], 1);
        assert!(result.margin.iter().all(|&margin| margin >= 0.0));
        let tie = unwrap_row(&[-8.0, -1.0], 2);
        assert_eq!(tie.phase[1], -1.0);
        assert!(tie.margin[1] < 1e-12, "{tie:?}");
    }
}
