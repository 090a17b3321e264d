//! Simulated recordings whose true phase is known.
//!
//! `simulate speckle` is the scene of the paper (lines 613–642): point scatterers in random motion,
//! an x-shaped region that also moves as a whole, seen through a limited aperture.
//!
//! ```text
//! scene ── stimulus ─┐
//! philox, vector_math ┴─> scatterers ─(simd)─> speckle ── aperture ─> U(t, y, x) ─> autocorrelation
//! ```
//!
//! `simulate oct` is a whole camera recording of a retina: see [`oct`].
//!
//! The bytes depend on the parameters and the seed only: not on the number of threads (every random
//! number is a function of seed, scatterer and frame, every sum over scatterers is a sum of
//! integers), nor on the vector instructions (one body of plain IEEE arithmetic, without fused
//! multiply-add, compiled once for each instruction set).

mod aperture;
mod autocorrelation;
pub mod oct;
pub(crate) mod philox;
mod scatterers;
mod scene;
mod simd;
mod speckle;
mod stimulus;
pub(crate) mod vector_math;

pub use autocorrelation::coherence_at_lags;
pub use scene::SpeckleScene;
pub use stimulus::{
    MODULATION_RAD_PER_FRAME, MODULATION_WAVELENGTHS, START_FRAME, VELOCITY_WAVELENGTHS,
};
