//! Why a run ends: the reason codes.

use core::fmt;
use serde::{Deserialize, Serialize};

/// Why all outputs went low before the plan's end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Fault {
    /// The host asked for it.
    Abort,
    /// The safety loop is open.
    Interlock,
    /// The safety loop's test pulse did not come through: the input is stuck or shorted.
    InterlockStuck,
    /// The camera was not ready before a sweep.
    NotReady,
    /// An edge could not be armed in time, or was armed and not made.
    Late,
    /// An output is not what it was told to be.
    ReadBack,
    /// The laser's trigger was on for too long.
    LaserCap,
    /// The stimulus was on for too long.
    StimulusCap,
    /// The host was silent for too long.
    Heartbeat,
    /// The plan in memory is not the one that was sent.
    PlanMemory,
    /// The stack has reached the variables.
    Stack,
    /// The timer's interrupt or the clock has stopped.
    Clock,
    /// The phase of the on-line solver has left its bounds.
    Phase,
    /// The on-line solver has had nothing to solve for too long.
    NoPhase,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Abort => "aborted by the host",
            Self::Interlock => "the interlock is open",
            Self::InterlockStuck => {
                "the interlock's test pulse did not come through: input stuck, shorted or not wired"
            }
            Self::NotReady => "the camera was not ready before a sweep",
            Self::Late => "an edge could not be armed in time, or was not made",
            Self::ReadBack => "an output is not what it was told to be",
            Self::LaserCap => "the laser's trigger was on for longer than its cap",
            Self::StimulusCap => "the stimulus was on for longer than its cap",
            Self::Heartbeat => "the host was silent for longer than the plan allows",
            Self::PlanMemory => "the plan in the board's memory has changed",
            Self::Stack => "the board's stack has overflowed",
            Self::Clock => "the board's clock or its interrupt has stopped",
            Self::Phase => "the phase has left the bounds that the plan sets",
            Self::NoPhase => "no volume was solved for longer than the plan allows",
        })
    }
}

/// Why the board started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ResetCause {
    /// Power was switched on.
    PowerOn,
    /// The reset line; opening an Uno's port does that.
    External,
    /// The supply fell below the brown-out level.
    BrownOut,
    /// The program hung: the watchdog ended it.
    Watchdog,
    /// The board cannot tell (a boot loader has cleared the register).
    Unknown,
}

impl fmt::Display for ResetCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::PowerOn => "power on",
            Self::External => "reset line",
            Self::BrownOut => "brown-out",
            Self::Watchdog => "watchdog",
            Self::Unknown => "unknown",
        })
    }
}
