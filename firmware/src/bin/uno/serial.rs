//! The serial line: USART at 250,000 baud, 8N1. Bytes come by interrupt and go by polling.

use crate::registers::{set, usart};
use crate::shared::Shared;
use heapless::Deque;

/// 16 MHz / (16 · 250,000) - 1.
const DIVIDER: u16 = 3;

/// Bytes that wait: in the longest pass of the main loop 25 come.
const BYTES: usize = 48;

/// Bytes from the host.
pub struct Inward {
    bytes: Deque<u8, BYTES>,
    overrun: u16,
}

/// The bytes that have come and were not read.
pub static INWARD: Shared<Inward> = Shared::new(Inward { bytes: Deque::new(), overrun: 0 });

impl Inward {
    #[inline(always)]
    pub fn push(&mut self, byte: u8) {
        if self.bytes.push_back(byte).is_err() {
            self.overrun = self.overrun.wrapping_add(1);
        }
    }

    pub fn pop(&mut self) -> Option<u8> {
        self.bytes.pop_front()
    }

    pub fn overrun(&self) -> u16 {
        self.overrun
    }
}

/// 250,000 baud, 8 data bits, no parity, one stop bit; interrupt on reception.
pub fn start() {
    set!(usart().ubrr0, DIVIDER);
    set!(usart().ucsr0a, 0);
    set!(usart().ucsr0c, 0b110);
    set!(usart().ucsr0b, 0b1001_1000);
}

/// Give the line a byte, if it has room.
pub fn write(byte: u8) -> bool {
    let room = usart().ucsr0a.read().bits() & 1 << 5 != 0;
    if room {
        set!(usart().udr0, byte);
    }
    room
}
