//! The serial line: USART at 250,000 baud, 8N1, by interrupt both ways.

use crate::registers::{set, usart};
use crate::shared::Shared;
use avr_device::interrupt::{CriticalSection, free};

/// 16 MHz / (16 · 250,000) - 1.
const DIVIDER: u16 = 3;

/// Bytes from the host that wait: in the longest pass of the main loop 32 come.
const IN_BYTES: usize = 64;

/// Bytes to the host that wait: what a pass of the main loop gives.
const OUT_BYTES: usize = 16;

/// Bytes that wait; for interrupts, and so of few instructions. The size is a power of two.
pub struct Ring<const N: usize> {
    bytes: [u8; N],
    /// Bytes put and taken so far, wrapping.
    put: u8,
    taken: u8,
    /// Bytes that found no room, wrapping.
    overrun: u16,
}

/// The bytes that have come and were not read.
pub static INWARD: Shared<Ring<IN_BYTES>> = Shared::new(Ring::new());

/// The bytes that are to go.
static OUTWARD: Shared<Ring<OUT_BYTES>> = Shared::new(Ring::new());

impl<const N: usize> Ring<N> {
    const fn new() -> Self {
        Self { bytes: [0; N], put: 0, taken: 0, overrun: 0 }
    }

    /// False when there is no room.
    #[inline(always)]
    pub fn push(&mut self, byte: u8) -> bool {
        let room = usize::from(self.put.wrapping_sub(self.taken)) < N;
        if room {
            self.bytes[usize::from(self.put) % N] = byte;
            self.put = self.put.wrapping_add(1);
        }
        room
    }

    /// As [`Ring::push`], and count what finds no room.
    #[inline(always)]
    pub fn push_or_count(&mut self, byte: u8) {
        if !self.push(byte) {
            self.overrun = self.overrun.wrapping_add(1);
        }
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<u8> {
        if self.put == self.taken {
            return None;
        }
        let byte = self.bytes[usize::from(self.taken) % N];
        self.taken = self.taken.wrapping_add(1);
        Some(byte)
    }

    pub fn overrun(&self) -> u16 {
        self.overrun
    }
}

/// Receiver and transmitter on, interrupt on reception; with or without that of an empty register.
const RECEIVE: u8 = 0b1001_1000;
const SEND: u8 = RECEIVE | 1 << 5;

/// 250,000 baud, 8 data bits, no parity, one stop bit; interrupt on reception.
pub fn start() {
    set!(usart().ubrr0, DIVIDER);
    set!(usart().ucsr0a, 0);
    set!(usart().ucsr0c, 0b110);
    set!(usart().ucsr0b, RECEIVE);
}

/// Give the line a byte, if it has room.
pub fn write(byte: u8) -> bool {
    free(|cs| {
        let room = OUTWARD.with(cs, |outward| outward.push(byte));
        set!(usart().ucsr0b, SEND);
        room
    })
}

/// The register is empty.
#[inline(always)]
pub fn send(cs: CriticalSection<'_>) {
    match OUTWARD.with(cs, Ring::pop) {
        Some(byte) => set!(usart().udr0, byte),
        None => set!(usart().ucsr0b, RECEIVE),
    }
}
