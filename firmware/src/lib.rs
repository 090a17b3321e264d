//! Trigger board of Phasewalk: the parts shared by board and host.
//!
//! The board of the paper (lines 669-683) starts the swept laser, the camera and the stimulation
//! LED of each volume. This crate is to hold its plan, protocol, sequencer and safety rules once,
//! so that the host previews, checks and records with the very code that the board runs.
//! Nothing is implemented yet: the crate fixes the name and the place in the workspace.
#![no_std]
#![forbid(unsafe_code)]
