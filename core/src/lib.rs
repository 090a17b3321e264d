//! The phase of decorrelating speckle, for any machine: no operating system, no heap, no `unsafe`.
//!
//! A coherent image series U(x,t) carries a systematic phase phi(t) that is the same for an
//! ensemble of speckles, while the speckle pattern itself falls apart. Two frames far apart have
//! nothing in common any more, but neighbouring ones do: the phase is *walked* through the
//! ensemble-averaged cross-spectrum (Hillmann, Spahr et al., Sci Rep 9:11748, 2019; "paper line"
//! means a line of its LaTeX source).
//!
//! ```text
//! U(t), U(t+dt)
//!   | cross_spectrum   C(t,dt) = U(t) conj U(t+dt)                  paper line 720
//!   | layers           C of a layer difference (optional)           727-735
//!   | ensemble         ⟨C⟩, ⟨C/|C|⟩ over a mask                     739-745, 770
//!   | weights          w = T(|⟨C/|C|⟩| - b), looks, pair variance   769-819
//!   | unwrap           arg ⟨C⟩ along dt, D = 10 neighbours          834-842
//!   | solver           normal equations, elimination                850-936
//!   | regularize       Gamma_1, Gamma_2                             913-936
//!   | reference        minus the mean of the first N_0 frames       945-948
//!   v variance         standard deviation of what is reported
//! phi(t)
//! ```
//! Beside it, the maximum-likelihood estimator that the host takes by default (docs/mathematics.md):
//!
//! ```text
//! ⟨C(t,dt)⟩ of all pairs
//!   | lags, model      Gamma: coherence (decays), quality (frames), periodic
//!   | linking          walk, Fisher scoring, no unwrapping of pairs
//!   | chain            the curve unwrapped in time, across gaps
//!   | bound            Cramer-Rao bound, sandwich, what is reported
//!   v closure          goodness of fit, from the closure phases
//! phi(t)               frame by frame in fixed memory: tracker
//! ```
//! [`batch`] runs the second half for all pairs of a series at once, [`walk`] the whole chain frame
//! by frame in fixed memory ([`pair_walk`] from the averages on), [`held`] the newest frame alone;
//! [`baseline`] holds what the method is compared with (lines 410, 421, 975-984), [`params`] every number
//! the paper gives.
//!
//! [`tracker`] is the other frame-by-frame estimator: maximum likelihood with a fitted coherence, as [`linking`] is for a
//! series. [`online`] is the one tracker that the trigger board and the host share.
//!
//! **Sign.** C(t,dt) = U(t) conj U(t+dt), so arg C = phi(t) - phi(t+dt). With U = |U| exp(i phi) and
//! phi = 2 k n z in reflection, a phase that grows is a path that grows.
//!
//! **Numbers.** Everything is generic over [`Scalar`]: `f32`, `f64`, and the host's lane types, which
//! solve many pixels in one register.
//!
//! **No panics.** Slices are reached by `get`, buffer sizes are checked when the code is compiled,
//! and loops end for NaN and infinity too.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod baseline;
pub mod batch;
pub mod bound;
pub mod chain;
pub mod closure;
pub mod coherence;
pub mod cross_spectrum;
pub mod ensemble;
mod error;
pub mod held;
pub mod lags;
pub mod layers;
pub mod linking;
pub mod model;
pub mod online;
pub mod pair_walk;
pub mod params;
mod periodic;
mod prior;
pub mod quality;
pub mod reference;
pub mod regularize;
pub mod scalar;
pub mod solver;
pub mod square;
pub mod storage;
pub mod tracker;
pub mod unwrap;
pub mod variance;
pub mod walk;
pub mod weights;

pub use error::Error;
pub use params::Params;
pub use scalar::{Mask, Real, Scalar};
