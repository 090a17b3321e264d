//! What a board can do, as it says in its hello, and what no plan may ask of it.

use crate::arming::REACH;
use serde::{Deserialize, Serialize};

/// What a board can do and what no plan may ask of it. Times are in ticks of its clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits {
    /// Ticks of the board's clock per second, nominally.
    pub ticks_per_second: u32,
    /// The shortest pulse, and the shortest gap between two edges of a channel.
    pub shortest: u32,
    /// How long before it is due an edge must be armed.
    pub lead: u32,
    /// How far ahead an edge can be handed to the hardware.
    pub reach: u32,
    /// The longest pass of the main loop that the timing is built for.
    pub pass: u32,
    /// The longest time from a compare match until its interrupt has armed the next edge.
    pub interrupt: u32,
    /// The longest pulse of the laser's trigger.
    pub laser_pulse: u32,
    /// The laser's trigger over a run.
    pub laser_total: u64,
    /// The stimulus over a run.
    pub stimulus_total: u64,
}

impl Limits {
    /// The Arduino Uno: ATmega328P at 16 MHz.
    pub const UNO: Self = Self {
        ticks_per_second: 16_000_000,
        shortest: 800,
        lead: 160,
        reach: REACH as u32,
        pass: 20_000,
        interrupt: 480,
        laser_pulse: 16_000_000,
        laser_total: 600 * 16_000_000,
        stimulus_total: 8 * 3_600 * 16_000_000,
    };
}
