//! From raw spectra to complex depth: one file of this folder per step.
//!
//! | file | what it does |
//! |---|---|
//! | `dispersion` | the phase of dispersion, estimated from the sharpness of the image |
//! | `spectra` | a volume of recorded spectra, all steps |
//! | `window` | windows over the spectrum |
//! | `linearise` | spectra at equal steps of the wavenumber |
//! | `mirror` | the wavenumber of every sample, from the fringes of mirrors |
//! | `sharpness` | the sharpness of A-lines under a trial correction |
//! | `fringes` | fixed fringes, which would pass for an undispersed sample |
//! | `simplex` | the minimum of a function of two variables (Nelder-Mead) |
//! | `smooth` | least-squares polynomials |

pub mod dispersion;
mod fringes;
pub mod linearise;
pub mod mirror;
mod sharpness;
mod simplex;
mod smooth;
pub mod spectra;
pub mod window;
