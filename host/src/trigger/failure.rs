//! What can go wrong while talking to the board.

use super::words;
use crate::error::Error;
use phasewalk_firmware::message::{Refusal, Reply};
use std::time::Duration;

/// Why a request has no result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Failure {
    /// No answer for so long; some frames came that were none of ours.
    Silent {
        /// How long was waited.
        waited: Duration,
        /// Frames in that time that could not be understood.
        garbled: u32,
    },
    /// The line is gone: unplugged, or the emulated board has ended.
    Gone(String),
    /// The board says no.
    Refused(Refusal),
    /// The answer does not belong to the request: a defect of the firmware.
    Unexpected(Reply),
    /// Ctrl-C or SIGTERM.
    Interrupted,
}

/// Result of a request.
pub type Result<T> = std::result::Result<T, Failure>;

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Silent { waited, garbled: 0 } => {
                write!(f, "no answer from the board for {:.1} s", waited.as_secs_f64())
            }
            Self::Silent { waited, garbled } => write!(
                f,
                "no answer from the board for {:.1} s, only {garbled} frames that cannot be \
                 understood",
                waited.as_secs_f64()
            ),
            Self::Gone(why) => write!(f, "the line to the board is lost ({why})"),
            Self::Refused(refusal) => {
                write!(f, "the board refused: {}", words::refusal(refusal))
            }
            Self::Unexpected(reply) => write!(
                f,
                "the board's answer does not belong to the question ({reply:?}): write its \
                 firmware anew with `phasewalk trigger flash`"
            ),
            Self::Interrupted => f.write_str("interrupted"),
        }
    }
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Interrupted => Self::Interrupted,
            other => Self::failed(other.to_string()),
        }
    }
}
