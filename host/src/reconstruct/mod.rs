//! Raw sweeps to complex volumes (paper lines 655-712).
//!
//! ```text
//! recording ── scan ── sweeps ──┐
//!           ── illumination ────┤ preparation ── first_pass ── analysis ── second_pass ── volumes
//!           ── lines ── dispersion ┘                │              │            │
//!                            background, spectrum, register, mean  │    background, spectrum, resample
//!                                                        jitter, segment
//! ```
//!
//! | file | what it holds |
//! |---|---|
//! | `settings` | what the user says |
//! | `counts`, `strips`, `illumination`, `background`, `grid` | the camera's side: counts, dead pixels, source and fixed fringes |
//! | `scan`, `sweeps` | where each sweep begins, and what is wrong with it |
//! | `lines`, `dispersion`, `sharpness`, `fringes`, `simplex` | the phase that blurs depth |
//! | `spectrum`: `remove`, `pairs`, `zoom`, `whole`, `turn` | counts to depth |
//! | `register`, `resample` | how the eye moved, and the motion undone |
//! | `mean`, `segment`, `quantile` | averaged volume and its surfaces |
//! | `jitter` | late starts of the camera |
//! | `preparation`, `first_pass`, `analysis`, `second_pass`, `recording` | the order of work |
//! | `findings`, `preview` | what is kept and shown of it |
//! | `linearise`, `mirror`, `smooth` | spectra at equal steps of the wavenumber |
//! | `spectra` | a volume of recorded spectra, all steps |
//! | `window` | windows over the spectrum |

pub mod analysis;
pub mod background;
pub mod counts;
pub mod dispersion;
pub mod findings;
pub mod first_pass;
mod fringes;
pub mod grid;
pub mod illumination;
pub mod jitter;
pub mod linearise;
pub mod lines;
pub mod mean;
pub mod mirror;
mod pairs;
pub mod preparation;
pub mod preview;
mod quantile;
pub mod recording;
pub mod register;
mod remove;
pub mod resample;
pub mod scan;
pub mod second_pass;
pub mod segment;
pub mod settings;
mod sharpness;
mod simplex;
mod smooth;
pub mod spectra;
pub mod spectrum;
pub mod strips;
pub mod sweeps;
mod turn;
mod whole;
pub mod window;
mod zoom;
