//! What the sequencer asks of the hardware, in the manner of embedded-hal: small traits that the
//! boards implement, and so does the [`rehearsal`](crate::rehearsal) on the desktop.

use crate::channel::Edge;
use crate::fault::{Fault, ResetCause};
use crate::limits::Limits;
use crate::message::{Estimate, Model};

/// What became of an edge that was handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Offer {
    /// The hardware will make it.
    Taken,
    /// Too far ahead, or too many wait before it: offer it again.
    Later,
    /// Less than [`Limits::lead`] ahead, or past.
    Late,
}

/// Clock and outputs. Edges are made by compare hardware, at their tick and not a tick beside it.
pub trait Outputs {
    /// Ticks since the board started.
    fn now(&mut self) -> u64;

    /// Hand over the next edge of a channel; in the order of time, channel by channel.
    fn offer(&mut self, edge: Edge) -> Offer;

    /// An edge that the hardware has made, in the order of time, channel by channel.
    fn made(&mut self) -> Option<Edge>;

    /// When the camera's first exposure after a trigger began.
    fn exposed(&mut self) -> Option<u64>;

    /// All outputs low at once, all waiting edges forgotten.
    fn all_low(&mut self);

    /// The stimulus low at once, its waiting edges forgotten; those made so far are still told. Asked
    /// only of boards that can solve.
    fn stimulus_low(&mut self) {
        self.all_low();
    }

    /// From now on a frame clock of this period runs while the camera's trigger is high; 0: none.
    fn frame_clock(&mut self, _period: u32) {}

    /// Whether the pins are what the edges made so far say.
    fn read_back(&mut self) -> bool;

    /// What an interrupt has found; it has already put all outputs low. Stays until `all_low`.
    fn latched(&mut self) -> Option<Fault>;

    /// Counts the interrupts of the clock, wrapping.
    fn interrupts(&mut self) -> u16;
}

/// Inputs.
pub trait Inputs {
    /// The safety loop is closed.
    fn interlock_closed(&mut self) -> bool;

    /// Whether a short pulse at the loop's far end comes through.
    fn interlock_passes_pulse(&mut self) -> bool;

    /// From now on an open loop puts all outputs low without the main loop's help, or not.
    fn guard_interlock(&mut self, on: bool);

    /// The camera says that it is ready.
    fn camera_ready(&mut self) -> bool;

    /// From now on the start input is watched for its first rise, or not.
    fn await_start(&mut self, on: bool);

    /// When the start input rose, once.
    fn start_edge(&mut self) -> Option<u64>;
}

/// The serial line, byte by byte, without waiting.
pub trait Line {
    /// A byte from the host.
    fn read(&mut self) -> Option<u8>;

    /// A byte to the host; false when the line is still busy.
    fn write(&mut self, byte: u8) -> bool;

    /// Bytes that came faster than they were read, wrapping.
    fn overrun(&mut self) -> u16;
}

/// Signs of life.
pub trait Life {
    /// Restart the watchdog.
    fn feed_watchdog(&mut self);

    /// Change the dynamic enable: a square wave that a charge pump or one-shot turns into leave
    /// for the light sources.
    fn toggle_enable(&mut self);

    /// The dynamic enable rests.
    fn rest_enable(&mut self);

    /// The stack has not reached the variables.
    fn stack_intact(&mut self) -> bool;
}

/// The on-line solver of boards that have one: those whose [`Limits::speckles`] is above 0.
pub trait Solve {
    /// Forget all volumes; from now on they have so many speckles with so many effective looks (the
    /// bits of an `f32`). False when the solver cannot.
    fn begin_series(&mut self, _speckles: u16, _looks: u32) -> bool {
        false
    }

    /// Speckles of the next volume from number `first` on, 8 bytes each; false when it is not their
    /// turn.
    fn samples(&mut self, _first: u16, _bytes: &[u8]) -> bool {
        false
    }

    /// A volume that was solved, once.
    fn solved(&mut self) -> Option<Estimate> {
        None
    }

    /// The line that says that the phase has left its bounds.
    fn phase_line(&mut self, _high: bool) {}
}

/// What a board knows of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// Which board.
    pub model: Model,
    /// Hash of the firmware's sources.
    pub build: u32,
    /// Hash of the program memory as read back.
    pub image: u32,
    /// Bytes that hash covers.
    pub image_bytes: u32,
    /// Why it started.
    pub reset: ResetCause,
}

/// A whole board.
pub trait Board: Outputs + Inputs + Line + Life + Solve {
    /// What it can do.
    const LIMITS: Limits;

    /// What it knows of itself.
    fn identity(&mut self) -> Identity;
}
