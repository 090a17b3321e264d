//! The host's side of the trigger board: plans, checks, previews, the serial line, runs and their logs.
//!
//! ```text
//! plan file ─► plan ─► check, certificate, budget ─► compiled ─► link ─► board
//!                        preview (SVG, VCD, WaveDrom)               run ◄─┘ events ─► log
//! ```

pub mod budget;
pub mod certificate;
pub mod check;
pub mod clock;
pub mod connection;
pub mod emulated;
pub mod expected;
pub mod failure;
pub mod flash;
pub mod ledger;
pub mod limits;
pub mod link;
pub mod log;
pub mod plan_file;
pub mod plan_keys;
pub mod plan_values;
pub mod port;
pub mod preview;
mod reader;
pub mod run;
pub mod selftest;
pub mod solve;
pub mod speckles;
pub mod summary;
pub mod units;
pub mod words;
