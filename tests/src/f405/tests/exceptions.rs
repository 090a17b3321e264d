//! Priorities, masks, faults, and what handlers leave as it was.

use super::{START, board, variable};
use crate::f405::State;

/// PendSV three times: at once, after PRIMASK, after BASEPRI. Its handler spoils registers of the
/// floating point unit and requests SysTick, which is more urgent.
#[rustfmt::skip]
const NESTING: &[u8] = &[
    0x1f, 0x48, // ldr r0, =0xe000ed88
    0x4f, 0xf4, 0x70, 0x01, // mov.w r1, #0xf00000
    0x01, 0x60, // str r1, [r0]
    0xb7, 0xee, 0x00, 0x0a, // vmov.f32 s0, #1.0
    0xf0, 0xee, 0x00, 0x7a, // vmov.f32 s15, #2.0
    0x1c, 0x48, // ldr r0, =0xe000ed20
    0x1d, 0x49, // ldr r1, =0xd0f00000
    0x01, 0x60, // str r1, [r0]
    0x1d, 0x48, // ldr r0, =0xe000ed04
    0x4f, 0xf0, 0x80, 0x51, // mov.w r1, #0x10000000
    0x01, 0x60, // str r1, [r0]
    0x00, 0xbf, // nop
    0x4f, 0xf0, 0x00, 0x52, // mov.w r2, #0x20000000
    0x82, 0xed, 0x00, 0x0a, // vstr s0, [r2, #0]
    0xc2, 0xed, 0x01, 0x7a, // vstr s15, [r2, #4]
    0x72, 0xb6, // cpsid i
    0x01, 0x60, // str r1, [r0]
    0x93, 0x68, // ldr r3, [r2, #8]
    0xd3, 0x60, // str r3, [r2, #12]
    0x62, 0xb6, // cpsie i
    0x00, 0xbf, // nop
    0xe0, 0x24, // movs r4, #0xe0
    0x84, 0xf3, 0x11, 0x88, // msr BASEPRI, r4
    0x01, 0x60, // str r1, [r0]
    0x93, 0x68, // ldr r3, [r2, #8]
    0x13, 0x61, // str r3, [r2, #16]
    0x00, 0x24, // movs r4, #0
    0x84, 0xf3, 0x11, 0x88, // msr BASEPRI, r4
    0x00, 0xbf, // nop
    0x93, 0x68, // ldr r3, [r2, #8]
    0x53, 0x61, // str r3, [r2, #20]
    // end:
    0xfe, 0xe7, // b end
    // pendsv:
    0xb1, 0xee, 0x00, 0x0a, // vmov.f32 s0, #4.0
    0xf1, 0xee, 0x00, 0x7a, // vmov.f32 s15, #4.0
    0x4f, 0xf0, 0x00, 0x52, // mov.w r2, #0x20000000
    0x93, 0x68, // ldr r3, [r2, #8]
    0x01, 0x33, // adds r3, #1
    0x93, 0x60, // str r3, [r2, #8]
    0x09, 0x48, // ldr r0, =0xe000ed04
    0x4f, 0xf0, 0x80, 0x61, // mov.w r1, #0x04000000
    0x01, 0x60, // str r1, [r0]
    0x00, 0xbf, // nop
    0x93, 0x69, // ldr r3, [r2, #24]
    0xd3, 0x61, // str r3, [r2, #28]
    0x70, 0x47, // bx lr
    // systick:
    0x4f, 0xf0, 0x00, 0x52, // mov.w r2, #0x20000000
    0x93, 0x69, // ldr r3, [r2, #24]
    0x01, 0x33, // adds r3, #1
    0x93, 0x61, // str r3, [r2, #24]
    0x70, 0x47, // bx lr
    // constants
    0x88, 0xed, 0x00, 0xe0,
    0x20, 0xed, 0x00, 0xe0,
    0x00, 0x00, 0xf0, 0xd0,
    0x04, 0xed, 0x00, 0xe0,
];

/// A load from where no memory is; the handler of the hard fault keeps the address, and faults too.
#[rustfmt::skip]
const FAULT: &[u8] = &[
    0x4f, 0xf0, 0x40, 0x50, // mov.w r0, #0x30000000
    0x01, 0x68, // ldr r1, [r0]
    0xfe, 0xe7, // b .
    // hardfault:
    0x4f, 0xf0, 0x00, 0x52, // mov.w r2, #0x20000000
    0x06, 0x9b, // ldr r3, [sp, #24]
    0x13, 0x60, // str r3, [r2]
    0x00, 0xde, // udf #0
];

#[test]
fn masks_hold_a_handler_back_and_priorities_let_one_through() {
    let mut board = board(NESTING, &[(14, 0x52), (15, 0x74)]);
    board.run_until(200);
    assert_eq!([3, 4, 5].map(|at| variable(&board, at)), [1, 2, 3]);
    // SysTick had been served before its handler looked.
    assert_eq!(variable(&board, 7), 3);
    assert!(board.longest_masked() >= 3);
}

#[test]
fn handlers_leave_floating_point_as_it_was() {
    let mut board = board(NESTING, &[(14, 0x52), (15, 0x74)]);
    board.run_until(200);
    assert_eq!([0, 1].map(|at| f32::from_bits(variable(&board, at))), [1.0, 2.0]);
    // Both frames held floating point registers.
    assert_eq!(board.stack_low_water(), 0x2001_0000 - 2 * 0x68);
}

#[test]
fn a_load_from_nowhere_is_a_hard_fault_and_a_fault_in_its_handler_the_end() {
    let mut board = board(FAULT, &[(3, 0x8)]);
    let state = board.run_until(100);
    assert_eq!(variable(&board, 0), START + 4);
    assert!(matches!(state, State::Crashed(_)), "{state:?}");
}
