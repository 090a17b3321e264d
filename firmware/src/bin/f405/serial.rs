//! The serial line: USART6 at 250,000 baud, 8N1; received by interrupt, sent by the passes.

use crate::chip::APB2_HZ;
use crate::registers::{set, usart6};
use crate::shared::Shared;
use heapless::Deque;

/// As the Uno's.
const BAUD: u32 = 250_000;

/// Bytes from the host that wait: two volumes of speckles, which come while one is solved.
const IN_BYTES: usize = 2048;

const OVERRUN: u16 = 1 << 3;
const RECEIVED: u16 = 1 << 5;
const CAN_SEND: u16 = 1 << 7;

struct Inward {
    bytes: Deque<u8, IN_BYTES>,
    /// Bytes that found no room, wrapping.
    overrun: u16,
}

/// The bytes that have come and were not read.
static INWARD: Shared<Inward> = Shared::new(Inward { bytes: Deque::new(), overrun: 0 });

/// 8 data bits, no parity, one stop bit; interrupt on reception.
pub fn start() {
    const { assert!(APB2_HZ.is_multiple_of(BAUD), "the line's clock must be exact") };
    set!(usart6().brr(), (APB2_HZ / BAUD) as u16);
    set!(usart6().cr2(), 0);
    set!(usart6().cr3(), 0);
    set!(usart6().cr1(), 1 << 13 | 1 << 5 | 1 << 3 | 1 << 2);
}

/// A byte has come, or was lost.
pub fn receive() {
    let status = usart6().sr().read().bits();
    // Reading it after the status clears both flags.
    let byte = usart6().dr().read().bits() as u8;
    INWARD.with(|inward| {
        let lost = status & OVERRUN != 0;
        let full = status & RECEIVED != 0 && inward.bytes.push_back(byte).is_err();
        inward.overrun = inward.overrun.wrapping_add(u16::from(lost) + u16::from(full));
    });
}

/// The next byte from the host.
pub fn read() -> Option<u8> {
    INWARD.with(|inward| inward.bytes.pop_front())
}

/// Bytes lost so far, wrapping.
pub fn overrun() -> u16 {
    INWARD.with(|inward| inward.overrun)
}

/// Give the line a byte, if it has room.
pub fn write(byte: u8) -> bool {
    let room = usart6().sr().read().bits() & CAN_SEND != 0;
    if room {
        set!(usart6().dr(), byte.into());
    }
    room
}
