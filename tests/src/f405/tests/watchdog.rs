//! The watchdog, and what a reset leaves.

use super::{board, variable};
use crate::f405::{Happened, Pin, Reset, TICKS_PER_SECOND};

/// Keeps why it started, makes PA0 high, starts the watchdog with 32 steps of 4 / 32 kHz, and waits.
#[rustfmt::skip]
const NEVER_FED: &[u8] = &[
    0x0a, 0x48, // ldr r0, =0x40023800
    0x41, 0x6f, // ldr r1, [r0, #0x74]
    0x4f, 0xf0, 0x00, 0x52, // mov.w r2, #0x20000000
    0x11, 0x60, // str r1, [r2]
    0x01, 0x21, // movs r1, #1
    0x01, 0x63, // str r1, [r0, #0x30]
    0x08, 0x4b, // ldr r3, =0x40020000
    0x08, 0x4c, // ldr r4, =0xa8000001
    0x1c, 0x60, // str r4, [r3, #0x00]
    0x99, 0x61, // str r1, [r3, #0x18]
    0x08, 0x4b, // ldr r3, =0x40003000
    0x45, 0xf2, 0x55, 0x54, // movw r4, #0x5555
    0x1c, 0x60, // str r4, [r3, #0]
    0x1f, 0x24, // movs r4, #31
    0x9c, 0x60, // str r4, [r3, #8]
    0x4c, 0xf6, 0xcc, 0x44, // movw r4, #0xcccc
    0x1c, 0x60, // str r4, [r3, #0]
    0xfe, 0xe7, // b .
    // constants
    0x00, 0x00,
    0x00, 0x38, 0x02, 0x40,
    0x00, 0x00, 0x02, 0x40,
    0x01, 0x00, 0x00, 0xa8,
    0x00, 0x30, 0x00, 0x40,
];

/// 4 ms.
const PERIOD: u64 = TICKS_PER_SECOND / 250;

#[test]
fn who_does_not_feed_the_watchdog_is_reset() {
    let mut board = board(NEVER_FED, &[]);
    board.run_until(PERIOD / 2);
    assert_eq!(variable(&board, 0), 0x0e00_0000);
    assert!(board.level(Pin::LASER));
    board.run_until(PERIOD + 100);
    assert_eq!(variable(&board, 0), 0x2e00_0000);
    let &[Happened { tick, cause: Reset::Watchdog }] = board.resets() else {
        panic!("{:?}", board.resets());
    };
    assert!(tick.abs_diff(PERIOD) < 20);
    // The pin floated until the program made it an output again.
    assert_eq!(board.edges_of(Pin::LASER).count(), 3);
}

#[test]
fn its_clock_may_be_slow() {
    let mut board = board(NEVER_FED, &[]);
    board.set_watchdog_tolerance(0.5);
    board.run_until(2 * PERIOD - 100);
    assert!(board.resets().is_empty());
    board.run_until(2 * PERIOD + 100);
    assert_eq!(board.resets().len(), 1);
}

#[test]
fn registers_without_a_clock_are_told() {
    let mut board = board(NEVER_FED, &[]);
    board.run_until(100);
    assert_eq!(board.unknown_registers().count(), 0);
    // USART6 was never given its clock.
    assert_eq!(board.register(0x4001_1400), 0);
    assert_eq!(board.unknown_registers().count(), 1);
}
