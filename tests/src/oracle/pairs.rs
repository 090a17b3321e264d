//! The pairs of frames, and what is known of each.

use super::cross_spectrum::arg;
use num_complex::Complex;

/// All pairs (t, Δt), 1 ≤ Δt ≤ `max_lag`, t+Δt < `frames`, in the order of the rows of S
/// (lines 890-901).
pub fn pair_list(frames: usize, max_lag: usize) -> Vec<(usize, usize)> {
    let mut list = Vec::new();
    for t in 0..frames {
        for lag in 1..frames - t {
            if lag <= max_lag {
                list.push((t, lag));
            }
        }
    }
    list
}

/// The averaged cross-spectrum of one curve or of one pixel, and what is derived from it.
///
/// The vectors over pairs are in the order of [`pair_list`]`(frames, max_lag)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Pairs {
    /// N, the number of frames.
    pub frames: usize,
    /// The largest Δt held.
    pub max_lag: usize,
    /// ⟨C(t,0)⟩ for each frame t: the mean of |U|², or for two layers of the product of powers.
    pub power: Vec<f64>,
    /// ⟨C(t,Δt)⟩ for each pair.
    pub mean: Vec<Complex<f64>>,
    /// arg⟨C(t,Δt)⟩ = φ(t) − φ(t+Δt), wrapped to −π … π, for each pair; 0 where ⟨C⟩ = 0.
    pub phase: Vec<f64>,
    /// |⟨C/|C|⟩|, 0 … 1, for each pair; C/|C| counts as 0 where C = 0 (lines 770, 776).
    pub phasor: Vec<f64>,
    /// |γ̂| = |⟨C(t,Δt)⟩| / √(⟨C(t,0)⟩⟨C(t+Δt,0)⟩), for each pair; 0 where a power is 0.
    pub coherence: Vec<f64>,
}

impl Pairs {
    /// Where the pair (t, Δt) stands in the vectors over pairs, or `None` if it is not held.
    pub fn index(&self, t: usize, lag: usize) -> Option<usize> {
        pair_list(self.frames, self.max_lag).iter().position(|&pair| pair == (t, lag))
    }

    /// The same with only the lags up to `max_lag`.
    pub fn up_to_lag(&self, max_lag: usize) -> Pairs {
        let kept: Vec<usize> = pair_list(self.frames, self.max_lag)
            .iter()
            .enumerate()
            .filter(|(_, (_, lag))| *lag <= max_lag)
            .map(|(index, _)| index)
            .collect();
        let choose = |values: &[f64]| kept.iter().map(|&index| values[index]).collect();
        Pairs {
            frames: self.frames,
            max_lag: self.max_lag.min(max_lag),
            power: self.power.clone(),
            mean: kept.iter().map(|&index| self.mean[index]).collect(),
            phase: choose(&self.phase),
            phasor: choose(&self.phasor),
            coherence: choose(&self.coherence),
        }
    }

    /// From ⟨C(t,0)⟩ (N values), ⟨C(t,Δt)⟩ and ⟨C/|C|⟩ (one value per pair, all lags).
    pub(super) fn from_means(
        power: Vec<f64>,
        mean: Vec<Complex<f64>>,
        phasors: &[Complex<f64>],
    ) -> Pairs {
        let frames = power.len();
        let max_lag = frames - 1;
        let coherence = pair_list(frames, max_lag)
            .iter()
            .zip(&mean)
            .map(|(&(t, lag), c)| {
                let scale = power[t].sqrt() * power[t + lag].sqrt();
                if scale > 0.0 { c.norm() / scale } else { 0.0 }
            })
            .collect();
        Pairs {
            frames,
            max_lag,
            phase: mean.iter().map(|&c| arg(c)).collect(),
            phasor: phasors.iter().map(|p| p.norm()).collect(),
            coherence,
            power,
            mean,
        }
    }
}
