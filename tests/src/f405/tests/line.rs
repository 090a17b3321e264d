//! The serial line.

use super::board;

/// What comes is sent back, plus one: 84 MHz / 336 is 250,000 baud.
#[rustfmt::skip]
const ECHO: &[u8] = &[
    0x0c, 0x48, // ldr r0, =0x40023800
    0x04, 0x21, // movs r1, #4
    0x01, 0x63, // str r1, [r0, #0x30]
    0x20, 0x21, // movs r1, #0x20
    0x41, 0x64, // str r1, [r0, #0x44]
    0x0b, 0x4a, // ldr r2, =0x40020800
    0x4f, 0xf0, 0x08, 0x43, // mov.w r3, #0x88000000
    0x13, 0x62, // str r3, [r2, #0x20]
    0x4f, 0xf4, 0x20, 0x43, // mov.w r3, #0xa000
    0x13, 0x60, // str r3, [r2, #0x00]
    0x08, 0x4c, // ldr r4, =0x40011400
    0x4f, 0xf4, 0xa8, 0x73, // mov.w r3, #336
    0xa3, 0x60, // str r3, [r4, #0x08]
    0x42, 0xf2, 0x0c, 0x03, // movw r3, #0x200c
    0xe3, 0x60, // str r3, [r4, #0x0c]
    // wait:
    0x23, 0x68, // ldr r3, [r4, #0x00]
    0x9b, 0x06, // lsls r3, r3, #26
    0xfc, 0xd5, // bpl.n wait
    0x63, 0x68, // ldr r3, [r4, #0x04]
    0x01, 0x33, // adds r3, #1
    0x63, 0x60, // str r3, [r4, #0x04]
    0xf8, 0xe7, // b wait
    // constants
    0x00, 0x38, 0x02, 0x40,
    0x00, 0x08, 0x02, 0x40,
    0x00, 0x14, 0x01, 0x40,
];

#[test]
fn bytes_take_their_time_on_the_line() {
    let mut board = board(ECHO, &[]);
    board.run_until(100);
    assert_eq!(board.ticks_per_byte(), Some(3_360));
    board.send(&[1, 2, 0xff]);
    board.run_until(100 + 5 * 3_360);
    let sent = board.received_with_ticks();
    assert_eq!(sent.iter().map(|byte| byte.value).collect::<Vec<_>>(), [2, 3, 0]);
    assert_eq!(sent[1].tick - sent[0].tick, 3_360);
    assert!(sent[0].tick.abs_diff(100 + 2 * 3_360) < 30);
    assert_eq!(board.overruns(), 0);
}

#[test]
fn bytes_wait_until_the_receiver_is_on() {
    let mut board = board(ECHO, &[]);
    board.send(&[7]);
    assert_eq!(board.unsent(), 1);
    board.run_until(3 * 3_360);
    assert_eq!(board.received(), [8]);
}
