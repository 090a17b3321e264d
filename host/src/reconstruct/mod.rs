//! From raw spectra to complex depth: one file of this folder per step.
//!
//! | file | what it does |
//! |---|---|
//! | `dispersion` | the phase of dispersion, estimated from the sharpness of the image |
//! | `sharpness` | the sharpness of A-lines under a trial correction |
//! | `fringes` | fixed fringes, which would pass for an undispersed sample |
//! | `simplex` | the minimum of a function of two variables (Nelder-Mead) |

pub mod dispersion;
mod fringes;
mod sharpness;
mod simplex;
