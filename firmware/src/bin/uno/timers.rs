//! The timers: one clock, three outputs.
//!
//! All run at the processor's clock and never stop; an output is set or cleared when its counter
//! equals its compare register, in the following tick, on every timer alike. So an edge "at tick t"
//! changes its pin at t + 1 ticks of Timer1, always.
//!
//! Timer0 has 8 bits and a phase of its own against Timer1, measured at the start. Timer2 counts
//! eighths; it only wakes the interrupt that arms Timer0, early enough.

use crate::registers::{change, portb, portd, set, tc0, tc1, tc2};
use phasewalk_firmware::arming::{NearEdge, REACH, Window};

/// Laser and camera: 16 bits.
pub const FAR: Window = Window { least: 160, most: REACH };

/// The LED: 8 bits, so it must be written within the last 255 ticks.
pub const CLOSE: Window = Window { least: 40, most: 254 };

/// The LED's arming is woken so many ticks before its edge: less than [`CLOSE`]`.most`, and more
/// than `.least` by the longest time for which interrupts are disabled.
const WAKE: u16 = 252;

/// Nearer than this an edge of the LED is not waited for by Timer2, whose compare value it might
/// already have reached: two of its ticks and the time to set it more than [`WAKE`].
pub const TOO_CLOSE_TO_WAKE: u16 = WAKE + 80;

const CLK_1: u8 = 0b001;
const CLK_8: u8 = 0b010;
const COM_A: u8 = 0b11 << 6;
const COM_B: u8 = 0b11 << 4;
/// In normal mode: 0b10 clears, 0b11 sets on match.
const CLEAR: u8 = 0b10;
const SET: u8 = 0b11;

pub const LASER: u8 = 1 << 1;
pub const CAMERA: u8 = 1 << 2;
pub const LED: u8 = 1 << 6;

/// Phases of Timer0 and Timer2 against Timer1.
#[derive(Clone, Copy)]
pub struct Phases {
    timer0: u8,
    timer2: u16,
}

impl Phases {
    pub const UNKNOWN: Self = Self { timer0: 0, timer2: 0 };

    /// The compare value of Timer2 that wakes the arming of an edge, [`WAKE`] before or up to 8
    /// ticks later.
    #[inline(always)]
    pub fn wake(self, tick: u16) -> u8 {
        (tick.wrapping_sub(WAKE).wrapping_add(self.timer2).wrapping_add(7) >> 3) as u8
    }
}

/// What Timer0 is to be set to for an edge of the LED.
#[derive(Clone, Copy)]
pub struct LedSetting {
    /// The edge's tick.
    pub tick: u16,
    compare: u8,
    mode: u8,
}

impl LedSetting {
    pub const NONE: Self = Self { tick: 0, compare: 0, mode: 0 };

    #[inline(always)]
    pub fn new(edge: NearEdge, phases: Phases) -> Self {
        let compare = (edge.tick as u8).wrapping_add(phases.timer0);
        Self { tick: edge.tick, compare, mode: mode(edge.high) << 6 }
    }
}

/// Start the counters, outputs disconnected and low; interrupts of overflow and matches on.
pub fn start() -> Phases {
    all_low();
    set!(tc1().tccr1b, CLK_1 | 1 << 6); // ICES1: EXPOSE by its rising edge
    set!(tc0().tccr0b, CLK_1);
    set!(tc2().tccr2a, 0);
    set!(tc2().tccr2b, CLK_8);
    set!(tc1().timsk1, 0b111); // overflow, match A, match B
    Phases { timer0: phase0(), timer2: phase2() }
}

/// Timer0 less Timer1, modulo 256: two reads of the same kind are exactly two cycles apart.
fn phase0() -> u8 {
    let (one, zero): (u8, u8);
    // SAFETY: reads two counters; no memory, no flags. Interrupts are off at the start.
    unsafe {
        core::arch::asm!(
            "lds {one}, 0x84", // TCNT1L
            "lds {zero}, 0x46", // TCNT0
            one = out(reg) one,
            zero = out(reg) zero,
            options(nomem, nostack, preserves_flags)
        );
    }
    zero.wrapping_sub(one).wrapping_sub(2)
}

/// 8·Timer2 less Timer1, modulo 2048, at most 8 too small.
fn phase2() -> u16 {
    let before = tc2().tcnt2.read().bits();
    loop {
        let two = tc2().tcnt2.read().bits();
        if two != before {
            return (u16::from(two) << 3).wrapping_sub(counter());
        }
    }
}

/// Timer1. With interrupts disabled: they use the same temporary register.
#[inline(always)]
pub fn counter() -> u16 {
    tc1().tcnt1.read().bits()
}

/// Timer1 has wrapped and its interrupt has not been served.
#[inline(always)]
pub fn overflow_pending() -> bool {
    tc1().tifr1.read().bits() & 1 != 0
}

#[inline(always)]
const fn mode(high: bool) -> u8 {
    if high { SET } else { CLEAR }
}

// The register first: a match of the old value can but repeat the last edge.

#[inline(always)]
pub fn arm_laser(edge: NearEdge) {
    set!(tc1().ocr1a, edge.tick);
    change!(tc1().tccr1a, COM_A, mode(edge.high) << 6);
}

#[inline(always)]
pub fn arm_camera(edge: NearEdge) {
    set!(tc1().ocr1b, edge.tick);
    change!(tc1().tccr1a, COM_B, mode(edge.high) << 4);
}

/// And Timer2 need not wake us again until the edge is made.
#[inline(always)]
pub fn arm_led(setting: LedSetting) {
    set!(tc0().ocr0a, setting.compare);
    set!(tc0().tccr0a, setting.mode);
    set!(tc0().tifr0, 1 << 1); // forget matches of the old value
    set!(tc0().timsk0, 1 << 1);
    let_led_sleep();
}

/// The LED's edge was made: its match repeats every 256 ticks and need not be told again.
#[inline(always)]
pub fn led_made() {
    set!(tc0().timsk0, 0);
}

/// Wake the arming of the LED for the edge at `tick`.
#[inline(always)]
pub fn wake_led(tick: u16, phases: Phases) {
    set!(tc2().ocr2a, phases.wake(tick));
    set!(tc2().timsk2, 1 << 1);
}

/// No edge of the LED is near.
#[inline(always)]
pub fn let_led_sleep() {
    set!(tc2().timsk2, 0);
}

/// Outputs low at once: by a forced match of "clear", so that no level is left in the compare units
/// to come back when they are connected again; then disconnected, the ports, always low, behind.
#[inline(always)]
pub fn all_low() {
    set!(tc1().tccr1a, CLEAR << 6 | CLEAR << 4);
    set!(tc1().tccr1c, 0b11 << 6);
    set!(tc0().tccr0a, CLEAR << 6);
    set!(tc0().tccr0b, CLK_1 | 1 << 7);
    set!(tc1().tccr1a, 0);
    set!(tc0().tccr0a, 0);
    change!(portb().portb, LASER | CAMERA, 0);
    change!(portd().portd, LED, 0);
    set!(tc0().timsk0, 0);
    set!(tc2().timsk2, 0);
}

// The pins as they are.

#[inline(always)]
pub fn laser_level() -> bool {
    portb().pinb.read().bits() & LASER != 0
}

#[inline(always)]
pub fn camera_level() -> bool {
    portb().pinb.read().bits() & CAMERA != 0
}

#[inline(always)]
pub fn led_level() -> bool {
    portd().pind.read().bits() & LED != 0
}

/// EXPOSE: forget captures so far.
#[inline(always)]
pub fn forget_capture() {
    set!(tc1().tifr1, 1 << 5);
}

/// EXPOSE: there was a capture since [`forget_capture`].
#[inline(always)]
pub fn has_captured() -> bool {
    tc1().tifr1.read().bits() & 1 << 5 != 0
}

/// EXPOSE: time of the last capture.
#[inline(always)]
pub fn capture() -> u16 {
    tc1().icr1.read().bits()
}

/// EXPOSE: interrupt at the next capture, or not.
#[inline(always)]
pub fn await_capture(on: bool) {
    change!(tc1().timsk1, 1 << 5, if on { 1 << 5 } else { 0 });
}
