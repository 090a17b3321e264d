//! Compare outputs and the capture input.

use super::{board, variable};
use crate::f405::{Pin, PinEdge};

/// PA0 toggles at 500 and then every 100 ticks of TIM2, each armed by the handler of the match before;
/// captures at PA3 go to a variable.
#[rustfmt::skip]
const TOGGLE: &[u8] = &[
    0x17, 0x48, // ldr r0, =0x40023800
    0x01, 0x21, // movs r1, #1
    0x01, 0x63, // str r1, [r0, #0x30]
    0x01, 0x64, // str r1, [r0, #0x40]
    0x16, 0x4a, // ldr r2, =0x40020000
    0x41, 0xf2, 0x11, 0x13, // ldr r3, =0x1111
    0x13, 0x62, // str r3, [r2, #0x20]
    0x15, 0x4b, // ldr r3, =0xa80000aa
    0x13, 0x60, // str r3, [r2, #0x00]
    0x4f, 0xf0, 0x80, 0x44, // mov.w r4, #0x40000000
    0x40, 0xf2, 0xf4, 0x13, // movw r3, #500
    0x63, 0x63, // str r3, [r4, #0x34]
    0x30, 0x23, // movs r3, #0x30
    0xa3, 0x61, // str r3, [r4, #0x18]
    0x41, 0xf2, 0x01, 0x03, // movw r3, #0x1001
    0x23, 0x62, // str r3, [r4, #0x20]
    0x40, 0xf2, 0x00, 0x13, // movw r3, #0x0100
    0xe3, 0x61, // str r3, [r4, #0x1c]
    0x12, 0x23, // movs r3, #0x12
    0xe3, 0x60, // str r3, [r4, #0x0c]
    0x0e, 0x4d, // ldr r5, =0xe000e100
    0x4f, 0xf0, 0x80, 0x53, // mov.w r3, #0x10000000
    0x2b, 0x60, // str r3, [r5]
    0x21, 0x60, // str r1, [r4, #0x00]
    // sleep:
    0x30, 0xbf, // wfi
    0xfd, 0xe7, // b sleep
    // handler:
    0x4f, 0xf0, 0x80, 0x40, // mov.w r0, #0x40000000
    0x01, 0x69, // ldr r1, [r0, #0x10]
    0xca, 0x06, // lsls r2, r1, #27
    0x04, 0xd5, // bpl.n match
    0x4f, 0xf0, 0x00, 0x53, // mov.w r3, #0x20000000
    0x02, 0x6c, // ldr r2, [r0, #0x40]
    0x1a, 0x60, // str r2, [r3, #0]
    0x70, 0x47, // bx lr
    // match:
    0x00, 0x22, // movs r2, #0
    0x02, 0x61, // str r2, [r0, #0x10]
    0x42, 0x6b, // ldr r2, [r0, #0x34]
    0x64, 0x32, // adds r2, #100
    0x42, 0x63, // str r2, [r0, #0x34]
    0x70, 0x47, // bx lr
    // constants
    0x00, 0x38, 0x02, 0x40,
    0x00, 0x00, 0x02, 0x40,
    0xaa, 0x00, 0x00, 0xa8,
    0x00, 0xe1, 0x00, 0xe0,
];

const HANDLER: (usize, u32) = (16 + 28, 0x40);

fn edges() -> Vec<PinEdge> {
    let mut board = board(TOGGLE, &[HANDLER]);
    board.run_until(5_000);
    board.edges_of(Pin::LASER).collect()
}

#[test]
fn outputs_change_at_the_tick_of_the_match() {
    let edges = edges();
    assert!(edges.len() > 40);
    for pair in edges.windows(2) {
        assert_eq!(pair[1].tick - pair[0].tick, 100);
        assert_ne!(pair[1].high, pair[0].high);
    }
    // The counter was started by the 24th instruction, in its first cycle.
    assert_eq!(edges[0].tick, 500 + 24 / 2);
}

#[test]
fn slower_instructions_do_not_move_an_edge() {
    let mut slow = board(TOGGLE, &[HANDLER]);
    slow.set_cycles_per_instruction(3);
    slow.run_until(5_000);
    let ticks: Vec<u64> = slow.edges_of(Pin::LASER).map(|edge| edge.tick).collect();
    assert!(ticks.windows(2).all(|pair| pair[1] - pair[0] == 100));
}

#[test]
fn a_capture_holds_the_tick_of_its_edge() {
    let mut board = board(TOGGLE, &[HANDLER]);
    board.drive_at(3_333, Pin::EXPOSE, true);
    board.run_until(5_000);
    let first = board.edges_of(Pin::LASER).next().map_or(0, |edge| edge.tick);
    assert_eq!(u64::from(variable(&board, 0)), 3_333 - first + 500);
}

#[test]
fn a_stuck_wire_stays_where_it_is() {
    let mut board = board(TOGGLE, &[HANDLER]);
    board.stick(Pin::LASER, false);
    board.run_until(5_000);
    assert_eq!(board.edges_of(Pin::LASER).count(), 0);
}

#[test]
fn the_worst_latency_is_that_of_the_entry() {
    let mut board = board(TOGGLE, &[HANDLER]);
    board.run_until(5_000);
    let latency = board.max_interrupt_latency();
    assert_eq!(latency.len(), 1);
    assert_eq!((latency[0].exception, latency[0].worst), (16 + 28, 12));
}
