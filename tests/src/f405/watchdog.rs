//! The independent watchdog.

use super::CLOCK;

/// Nominal frequency of the low-speed oscillator.
const LOW_SPEED: f64 = 32_000.0;

/// The watchdog. Times are in cycles.
pub struct Watchdog {
    unlocked: bool,
    prescaler: u32,
    reload: u32,
    /// When it bites; it runs if there is such a time.
    pub due: Option<u64>,
    /// The oscillator's frequency over its nominal one: the data sheet gives 17 to 47 kHz.
    pub tolerance: f64,
}

impl Default for Watchdog {
    fn default() -> Self {
        Self { unlocked: false, prescaler: 0, reload: 0xfff, due: None, tolerance: 1.0 }
    }
}

impl Watchdog {
    /// After a reset.
    pub fn reset(&mut self) {
        *self = Self { tolerance: self.tolerance, ..Self::default() };
    }

    fn cycles(&self) -> u64 {
        let steps = (self.reload + 1) * (4 << self.prescaler.min(6));
        (f64::from(steps) * CLOCK as f64 / (LOW_SPEED * self.tolerance)) as u64
    }

    /// Read a register; none when there is no such.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0x00 | 0x0c => Some(0),
            0x04 => Some(self.prescaler),
            0x08 => Some(self.reload),
            _ => None,
        }
    }

    /// Write a register; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Option<()> {
        match offset {
            0x00 => self.key(value & 0xffff, cycle),
            0x04 if self.unlocked => self.prescaler = value & 7,
            0x08 if self.unlocked => self.reload = value & 0xfff,
            0x04 | 0x08 | 0x0c => {}
            _ => return None,
        }
        Some(())
    }

    fn key(&mut self, key: u32, cycle: u64) {
        self.unlocked = key == 0x5555;
        match key {
            0xcccc => self.due = Some(cycle + self.cycles()),
            0xaaaa => self.due = self.due.map(|_| cycle + self.cycles()),
            _ => {}
        }
    }
}
