//! The timers: one clock, three outputs, the frame clock.
//!
//! TIM2 counts 32 bits at 84 MHz and never stops; an output is set or cleared when the counter equals
//! its compare register. TIM3 counts frames at the same clock while the camera's trigger is high: the
//! pulse is a whole number of frames, so it ends as it began, at 0.

use crate::registers::{change, gpioa, set, tim2, tim3};
use phasewalk_firmware::arming::{Counter, NearEdge, Window};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::limits::Limits;

/// When a compare register may be written.
pub const WINDOW: Window<u32> = Window { least: Limits::F405.lead, most: u32::REACH };

// Modes of a compare output.
const SET: u32 = 0b001;
const CLEAR: u32 = 0b010;
const FORCE_LOW: u32 = 0b100;

const CAPTURED: u32 = 1 << 4;

/// Start the counter, outputs low; interrupts of the three matches on. `prescaler` + 1 divides its
/// clock.
pub fn start(prescaler: u32) {
    set!(tim2().cr1(), 0);
    set!(tim2().psc(), prescaler);
    set!(tim2().arr(), u32::MAX);
    set!(tim2().ccmr1_output(), FORCE_LOW << 4 | FORCE_LOW << 12);
    set!(tim2().ccmr2_output(), FORCE_LOW << 4 | 0b01 << 8); // CH4 captures
    set!(tim2().ccer(), 1 | 1 << 4 | 1 << 8 | 1 << 12);
    set!(tim2().cr2(), 0b101 << 4); // TRGO: the camera's output
    set!(tim2().egr(), 1); // the prescaler is taken over
    set!(tim2().sr(), 0);
    set!(tim2().dier(), 0b1110);
    set!(tim2().cr1(), 1);
    frame_clock(0);
}

/// The counter.
#[inline(always)]
pub fn counter() -> u32 {
    tim2().cnt().read().bits()
}

/// Write the edge's tick and what happens then. The register was last met by an edge before.
#[inline(always)]
pub fn arm(channel: Channel, edge: NearEdge<u32>) {
    let mode = if edge.high { SET } else { CLEAR };
    match channel {
        Channel::Laser => {
            set!(tim2().ccr1(), edge.tick);
            change!(tim2().ccmr1_output(), 0b111 << 4, mode << 4);
        }
        Channel::Camera => {
            set!(tim2().ccr2(), edge.tick);
            change!(tim2().ccmr1_output(), 0b111 << 12, mode << 12);
        }
        Channel::Stimulus => {
            set!(tim2().ccr3(), edge.tick);
            change!(tim2().ccmr2_output(), 0b111 << 4, mode << 4);
        }
    }
}

/// An output low at once.
#[inline(always)]
pub fn low(channel: Channel) {
    match channel {
        Channel::Laser => change!(tim2().ccmr1_output(), 0b111 << 4, FORCE_LOW << 4),
        Channel::Camera => change!(tim2().ccmr1_output(), 0b111 << 12, FORCE_LOW << 12),
        Channel::Stimulus => change!(tim2().ccmr2_output(), 0b111 << 4, FORCE_LOW << 4),
    };
}

/// All outputs low at once.
#[inline(always)]
pub fn all_low() {
    change!(tim2().ccmr1_output(), 0b111 << 4 | 0b111 << 12, FORCE_LOW << 4 | FORCE_LOW << 12);
    change!(tim2().ccmr2_output(), 0b111 << 4, FORCE_LOW << 4);
}

/// The matches were seen; those that come from now on interrupt again.
#[inline(always)]
pub fn forget_matches() {
    // Writing 0 clears a flag, 1 leaves it alone.
    set!(tim2().sr(), !0b1110);
}

/// The pin as it is.
#[inline(always)]
pub fn level(channel: Channel) -> bool {
    gpioa().idr().read().bits() & 1 << channel.index() != 0
}

/// EXPOSE: forget captures so far.
#[inline(always)]
pub fn forget_capture() {
    set!(tim2().sr(), !CAPTURED);
}

/// EXPOSE: the last capture, if there was one since [`forget_capture`].
#[inline(always)]
pub fn capture() -> Option<u32> {
    // Reading the register clears the flag.
    (tim2().sr().read().bits() & CAPTURED != 0).then(|| tim2().ccr4().read().bits())
}

/// EXPOSE: interrupt at the next capture, or not.
#[inline(always)]
pub fn await_capture(on: bool) {
    change!(tim2().dier(), CAPTURED, if on { CAPTURED } else { 0 });
}

/// Frame clock of this period from now on, or none.
pub fn frame_clock(period: u32) {
    set!(tim3().cr1(), 0);
    set!(tim3().ccmr1_output(), FORCE_LOW << 4);
    set!(tim3().ccer(), 1);
    if period == 0 {
        return;
    }
    set!(tim3().arr(), period - 1);
    set!(tim3().ccr1(), period / 2);
    set!(tim3().egr(), 1); // from 0
    set!(tim3().smcr(), 0b001 << 4 | 0b101); // gated by TIM2
    // High for the second half: so it rests low at 0, where each pulse of the camera leaves it.
    set!(tim3().ccmr1_output(), 0b111 << 4);
    set!(tim3().cr1(), 1);
}
