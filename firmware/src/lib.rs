//! Trigger board of Phasewalk: the parts shared by board and host.
//!
//! The board of the paper (lines 669-683) starts the swept laser, the camera and the stimulation
//! LED. This crate holds its plan, protocol, sequencer and safety rules once, so that the host
//! checks, previews and records with the very code that the board runs.
//!
//! ```text
//!   plan ─ check ─ compiled ══ frame, message ══► session ─► sequencer ─► board (compare hardware)
//!                                                  device       ▲             │
//!                                                               └── guard ◄───┘ edges made
//! ```
//!
//! | what | where |
//! |---|---|
//! | nested loops in ticks | [`plan`] |
//! | what no plan may break | [`check`], [`limits`] |
//! | its bytes and their hash | [`compiled`], `layout`, `crc` |
//! | its edges, one after the other | [`channel`], [`schedule`] |
//! | what travels | [`message`], [`frame`] |
//! | the phase of the on-line solver, and its limit | `online` |
//! | what the hardware must offer | [`board`] |
//! | edges handed over in time | [`sequencer`] |
//! | safety rules and reason codes | [`guard`], [`fault`] |
//! | one pass of the main loop | [`device`] |
//! | arming a compare register | [`arming`] |
//! | a 64-bit clock from a 16-bit counter | [`clock`] |
//! | the same program without hardware | [`rehearsal`] |
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod arming;
pub mod board;
pub mod channel;
pub mod check;
pub mod clock;
pub mod compiled;
mod crc;
pub mod device;
pub mod fault;
pub mod frame;
pub mod guard;
mod layout;
pub mod limits;
pub mod message;
#[cfg(feature = "extended")]
mod online;
pub mod outbox;
pub mod plan;
#[cfg(test)]
mod presets;
pub mod rehearsal;
pub mod schedule;
pub mod sequencer;
mod session;
