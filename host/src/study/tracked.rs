//! The tracker fed with the mean cross-spectra of a series, in place of the fields they come from.

use crate::error::{Error, Result};
use num_complex::{Complex, Complex64};
use phasewalk_core::tracker::{Absorb, Estimate, NODES, Tracker, TrackerSettings};

/// Newest phase of each frame against the first, and its standard deviation, from ⟨U_i conj U_j⟩, N x N; infinite for
/// frames that are not usable (an outlier has no phase).
///
/// A node of the tracker is a sum of frames, X_j = sum over n of share_jn U_n, so that
/// ⟨U_i conj X_j⟩ = sum over n of ⟨U_i conj U_n⟩ conj share_jn.
///
/// # Errors
/// When the tracker refuses looks or times.
pub fn track(cross: &[Complex64], times: &[f64], looks: f64) -> Result<(Vec<f64>, Vec<f64>)> {
    let n = times.len();
    let interval = times.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    let settings =
        TrackerSettings { reference_frames: 1, ..TrackerSettings::for_looks(looks, interval) };
    let refused = |error| Error::failed(format!("tracker: {error}"));
    let mut tracker = Tracker::<f64, NODES>::new(settings).map_err(refused)?;
    let mut shares: Vec<Vec<Complex64>> = Vec::with_capacity(NODES);
    let mut newest: Vec<Estimate<f64>> = Vec::with_capacity(n);
    for (i, row) in cross.chunks_exact(n).enumerate() {
        follow(&mut shares, &tracker.absorb());
        let with =
            |shares: &Vec<Complex64>| row.iter().zip(shares).map(|(c, s)| c * s.conj()).sum();
        let correlations: Vec<Complex64> = shares.iter().map(with).collect();
        newest.push(tracker.push(&correlations, row[i].re, times[i]).map_err(refused)?);
        let mut alone = vec![Complex::default(); n];
        alone[i] = Complex::new(1.0, 0.0);
        shares.push(alone);
    }
    let told = |estimate: &Estimate<f64>| {
        let usable = estimate.is_usable(looks);
        (estimate.phase_rad, if usable { estimate.sigma_rad } else { f64::INFINITY })
    };
    Ok(newest.iter().map(told).unzip())
}

/// Do with the nodes as the tracker says.
fn follow(shares: &mut Vec<Vec<Complex64>>, absorb: &Absorb<f64>) {
    match *absorb {
        Absorb::Nothing => {}
        Absorb::Drop { .. } => drop(shares.remove(0)),
        Absorb::Found { factor, .. } => shares[0].iter_mut().for_each(|share| *share *= factor),
        Absorb::Merge { anchor_factor, oldest_factor, .. } => {
            let oldest = shares.remove(1);
            for (anchor, share) in shares[0].iter_mut().zip(oldest) {
                *anchor = *anchor * anchor_factor + share * oldest_factor;
            }
        }
    }
}
