//! The serial port USART6: bytes at the rate that the program has set.
//!
//! Not modelled: bits on the wire, parity errors, framing errors, idle detection, DMA.

use super::CYCLES_PER_TICK;
use std::collections::VecDeque;

const OVERRUN: u32 = 1 << 3;
const RECEIVED: u32 = 1 << 5;
const SENT: u32 = 1 << 6;
const EMPTY: u32 = 1 << 7;

/// A byte from the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    /// The tick at which its stop bit ended.
    pub tick: u64,
    /// The byte.
    pub value: u8,
}

/// The port. Times are in cycles.
pub struct Serial {
    status: u32,
    /// When the flags that request the interrupt were set.
    since: u64,
    rate: u32,
    control: [u32; 3],
    data: u8,
    /// The status was read while it said overrun: reading the data clears that.
    overrun_read: bool,
    waiting: Option<u8>,
    sending: Option<(u8, u64)>,
    arriving: Option<(u8, u64)>,
    /// Bytes that the outside wants to send.
    pub line: VecDeque<u8>,
    /// Bytes that have gone out.
    pub sent: Vec<SentByte>,
    /// Bytes that were lost because the program did not fetch them.
    pub overruns: u64,
    /// Its pins are connected to it.
    pub wired: [bool; 2],
}

impl Default for Serial {
    fn default() -> Self {
        Self {
            status: EMPTY | SENT,
            since: 0,
            rate: 0,
            control: [0; 3],
            data: 0,
            overrun_read: false,
            waiting: None,
            sending: None,
            arriving: None,
            line: VecDeque::new(),
            sent: Vec::new(),
            overruns: 0,
            wired: [false; 2],
        }
    }
}

impl Serial {
    /// After a reset; what is on the line stays there.
    pub fn reset(&mut self) {
        *self = Self {
            line: std::mem::take(&mut self.line),
            sent: std::mem::take(&mut self.sent),
            overruns: self.overruns,
            ..Self::default()
        };
    }

    /// Cycles of a byte, start and stop bits with it; none before a rate is set.
    pub fn cycles_per_byte(&self) -> Option<u64> {
        let whole = self.control[0] & 1 << 15 == 0;
        let bit = if whole { self.rate } else { (self.rate >> 4) * 8 + (self.rate & 7) };
        let long = u64::from(self.control[0] >> 12 & 1) + u64::from(self.control[1] >> 13 & 1);
        (bit != 0).then(|| u64::from(bit) * (10 + long) * CYCLES_PER_TICK)
    }

    fn on(&self, which: u32) -> bool {
        self.control[0] & 1 << 13 != 0 && self.control[0] & which != 0
    }

    /// The next cycle at which something happens.
    pub fn next(&self) -> Option<u64> {
        let ends = [self.sending, self.arriving];
        ends.iter().flatten().map(|&(_, end)| end).min()
    }

    /// Let time pass.
    pub fn advance(&mut self, cycle: u64) {
        while let Some((value, end)) = self.arriving.filter(|&(_, end)| end <= cycle) {
            self.arriving = None;
            self.receive(value, end);
            self.listen(end);
        }
        while let Some((value, end)) = self.sending.filter(|&(_, end)| end <= cycle) {
            self.sending = None;
            if self.wired[0] {
                self.sent.push(SentByte { tick: end / CYCLES_PER_TICK, value });
            }
            self.say(end);
            if self.sending.is_none() {
                self.set(SENT, end);
            }
        }
    }

    fn set(&mut self, flag: u32, cycle: u64) {
        if self.status & flag == 0 {
            self.since = cycle;
        }
        self.status |= flag;
    }

    fn receive(&mut self, value: u8, cycle: u64) {
        if !self.on(1 << 2) {
            return;
        }
        if self.status & RECEIVED == 0 {
            self.data = value;
            self.set(RECEIVED, cycle);
        } else {
            self.overruns += 1;
            self.set(OVERRUN, cycle);
        }
    }

    /// The next byte from outside begins, if one waits and the receiver is on.
    pub fn listen(&mut self, cycle: u64) {
        let ready = self.on(1 << 2) && self.wired[1] && self.arriving.is_none();
        if let Some(length) = self.cycles_per_byte().filter(|_| ready)
            && let Some(value) = self.line.pop_front()
        {
            self.arriving = Some((value, cycle + length));
        }
    }

    /// The next byte of the program begins, if one waits.
    fn say(&mut self, cycle: u64) {
        if self.sending.is_none()
            && self.on(1 << 3)
            && let Some(length) = self.cycles_per_byte()
            && let Some(value) = self.waiting.take()
        {
            self.sending = Some((value, cycle + length));
            self.set(EMPTY, cycle);
        }
    }

    /// Since when it requests its interrupt.
    pub fn request(&self) -> Option<u64> {
        let receives = self.control[0] & 1 << 5 != 0 && self.status & (RECEIVED | OVERRUN) != 0;
        let others = self.status & self.control[0] & (EMPTY | SENT) != 0;
        (receives || others).then_some(self.since)
    }

    /// Read a register; none when there is no such.
    pub fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00 => {
                self.overrun_read = self.status & OVERRUN != 0;
                self.status
            }
            0x04 => {
                self.status &= !RECEIVED;
                if std::mem::take(&mut self.overrun_read) {
                    self.status &= !OVERRUN;
                }
                self.data.into()
            }
            0x08 => self.rate,
            0x0c | 0x10 | 0x14 => self.control[(offset as usize - 0x0c) / 4],
            0x18 => 0,
            _ => return None,
        })
    }

    /// Write a register; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Option<()> {
        match offset {
            0x00 => self.status &= value | !(RECEIVED | SENT),
            0x04 => {
                self.waiting = Some(value as u8);
                self.status &= !(EMPTY | SENT);
                self.say(cycle);
            }
            0x08 => self.rate = value & 0xffff,
            0x0c => {
                let new = value & !self.control[0];
                self.control[0] = value;
                if new & (EMPTY | SENT) & self.status != 0 {
                    self.since = cycle;
                }
                self.say(cycle);
            }
            0x10 | 0x14 => self.control[(offset as usize - 0x0c) / 4] = value,
            0x18 => {}
            _ => return None,
        }
        self.listen(cycle);
        Some(())
    }

    /// Something was asked for that is not modelled.
    pub fn beyond(&self) -> bool {
        self.control[2] != 0
    }
}
