//! A whole series linked, with buffers from the heap.

use num_complex::Complex;
use phasewalk_core::Real;
use phasewalk_core::coherence::Lag;
use phasewalk_core::lags::Lags;
use phasewalk_core::linking::{Buffers, Results, Settings, Summary, link_series};

/// Phases against the first frame, standard deviations and qualities from ⟨U_i conj U_j⟩, N x N, and what else is known.
pub fn link<T: Real>(
    cross: &[Complex<f64>],
    times: &[f64],
    looks: f64,
) -> ([Vec<f64>; 3], Summary<T>) {
    let (n, zero) = (times.len(), T::zero());
    let single = |c: &Complex<f64>| Complex { re: T::from_f64(c.re), im: T::from_f64(c.im) };
    let mut cross: Vec<Complex<T>> = cross.iter().map(single).collect();
    let mut reals = vec![zero; Buffers::<T>::reals(n)];
    let mut phasors = vec![Complex { re: zero, im: zero }; n];
    let mut lags = vec![Lag { tau: zero, mean: zero, pairs: zero }; n * n];
    let mut indices = vec![0; Lags::indices(n)];
    let buffers = Buffers {
        reals: &mut reals,
        phasors: &mut phasors,
        lags: &mut lags,
        indices: &mut indices,
    };
    let mut found = [const { Vec::new() }; 3].map(|_: Vec<T>| vec![zero; n]);
    let mut gamma = vec![zero; n * n];
    let [phases, sigmas, quality] = &mut found;
    let results = Results { phases, sigmas, quality, gamma: &mut gamma };
    let settings = Settings { looks, reference_frames: 1, acceleration: None };
    let summary = link_series(&mut cross, times, &settings, buffers, results);
    (found.map(|numbers| numbers.into_iter().map(T::to_f64).collect()), summary)
}
