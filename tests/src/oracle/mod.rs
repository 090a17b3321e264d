//! The paper's estimators, slow and plain: what the fast code is compared with.
//!
//! Written from `paper.tex` (line numbers below are of that file) and from the readings settled in
//! `docs/mathematics.md`, without a look at the fast code: dense matrices, direct sums, `f64`.
//!
//! Conventions throughout:
//! * Frames, rows, columns and lags count from 0; N is the number of frames.
//! * Phases are in radians. C(t,Δt) = U(t) U*(t+Δt), so arg C(t,Δt) = φ(t) − φ(t+Δt).
//! * A *pair* is (t, Δt) with Δt ≥ 1 and t+Δt ≤ N−1. Lists of pairs are in the order of the rows
//!   of S (lines 890-901): (0,1), (0,2), …, (1,1), (1,2), …; see [`pair_list`].
//! * Images are flat and in C order, (y, x); series are (time, y, x).
//! * A lag limit beyond N−1 means N−1.
//!
//! | file | what it holds |
//! |---|---|
//! | `series` | a series of complex fields |
//! | `cross_spectrum` | C(t,Δt), of one layer and of two |
//! | `pairs` | the list of pairs, and the averages of each pair |
//! | `ensemble` | the averages over a mask and over a Gaussian neighbourhood |
//! | `gaussian` | the circular convolution with a Gaussian |
//! | `weights` | the paper's and the Fisher weights, their thresholds, valid frames |
//! | `unwrap` | unwrapping in Δt and in t |
//! | `least_squares` | S, Γ₁, Γ₂ and the solution |
//! | `paper` | the paper's estimator, of curves and of images |
//! | `walks` | direct differences and single steps, of curves and of images |
//! | `sigma` | the standard deviation of the phases |
//! | `bound` | the Cramér–Rao bound |
//! | `fixtures` | what the unit tests share |

mod bound;
mod cross_spectrum;
mod ensemble;
#[cfg(test)]
mod fixtures;
mod gaussian;
mod least_squares;
mod pairs;
mod paper;
mod series;
mod sigma;
mod unwrap;
mod walks;
mod weights;

pub use bound::crlb;
pub use cross_spectrum::{cross_spectrum, layer_difference};
pub use ensemble::{gaussian_mean, gaussian_mean_of, mask_mean, mask_mean_of};
pub use gaussian::{gaussian_filter, gaussian_kernel};
pub use least_squares::{
    GAUGE_FRAME, MU_1, MU_2, REFERENCE_FRAMES, Regularisation, difference_matrix, gamma_1, gamma_2,
    solve,
};
pub use pairs::{Pairs, pair_list};
pub use paper::{
    PhaseImages, Solution, images_from_pairs, paper_phase_curve, paper_phase_images,
    phase_from_pairs,
};
pub use series::Series;
pub use sigma::{pair_variance, phase_sigma};
pub use unwrap::{UNWRAP_DEPTH, Unwrapped, unwrap_in_time, unwrap_pairs, unwrap_row};
pub use walks::{direct_curve, direct_images, one_step_curve, one_step_images};
pub use weights::{
    THRESHOLD_PROBABILITY, Weighting, debiased_squared_coherence, fisher_threshold, fisher_weight,
    gaussian_looks, paper_weight, rayleigh_threshold, valid_frames, weights,
};
