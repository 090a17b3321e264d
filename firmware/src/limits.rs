//! What a board can do, as it says in its hello, and what no plan may ask of it.

use crate::arming::REACH;
use crate::compiled::{MAX_BYTES, SMALL_BYTES};
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
    /// The longest period of the camera's frame clock; 0: the board makes none. The shortest is
    /// [`Self::shortest`].
    #[serde(default)]
    pub frame_longest: u32,
    /// Speckles of the on-line solver at most; 0: the board has none.
    #[serde(default)]
    pub speckles: u16,
    /// Largest lag of the on-line solver.
    #[serde(default)]
    pub lags: u8,
}

impl Limits {
    /// Bytes of a compiled plan at most.
    #[must_use]
    pub const fn plan_bytes(&self) -> usize {
        if self.speckles > 0 { MAX_BYTES } else { SMALL_BYTES }
    }

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
        frame_longest: 0,
        speckles: 0,
        lags: 0,
    };

    /// The STM32F405: timers at 84 MHz. A pass of its main loop comes every 100 us. Its counter has 32
    /// bits: edges are taken late enough for the camera to be asked shortly before its sweep.
    pub const F405: Self = Self {
        ticks_per_second: 84_000_000,
        shortest: 840,
        lead: 420,
        reach: 5 * 84_000,
        pass: 21_000,
        interrupt: 420,
        laser_pulse: 84_000_000,
        laser_total: 600 * 84_000_000,
        stimulus_total: 8 * 3_600 * 84_000_000,
        // A counter of 16 bits.
        frame_longest: 65_535,
        speckles: 64,
        lags: 16,
    };
}
