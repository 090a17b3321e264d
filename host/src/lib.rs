//! Phasewalk's host library.
//!
//! ```text
//! recording -> simulate | io -> U(x,t) -> cross-spectrum -> layers -> ensemble (mask | Gaussian)
//!           -> weights -> unwrap -> solver -> reference -> io | figures | report
//! ```
//! The mathematics is `phasewalk_core`'s; this crate brings the data to it in registers, all
//! cores and bounded memory, and carries the results to files and pictures.

pub mod allocate;
pub mod cli;
pub mod curve;
pub mod demo;
pub mod error;
pub mod figures;
pub mod frames;
pub mod image;
pub mod io;
pub mod lanes;
pub mod looks;
pub mod method;
pub mod notes;
pub mod paper;
pub mod planes;
pub mod progress;
pub mod reconstruct;
pub mod report;
pub mod series;
pub mod simulate;
pub mod study;
pub mod trigger;
pub mod watch;
