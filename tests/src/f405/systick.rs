//! The core's own timer.

const ENABLE: u32 = 1;
const INTERRUPT: u32 = 2;
const CORE_CLOCK: u32 = 4;

/// SysTick. Times are in cycles.
#[derive(Default)]
pub struct SysTick {
    control: u32,
    reload: u32,
    /// What the counter holds while it rests.
    rest: u32,
    /// When the counter becomes 0 next, while it runs.
    zero: Option<u64>,
    passed: bool,
}

impl SysTick {
    fn divider(&self) -> u64 {
        if self.control & CORE_CLOCK != 0 { 1 } else { 8 }
    }

    fn period(&self) -> u64 {
        (u64::from(self.reload) + 1) * self.divider()
    }

    /// The next cycle at which something happens.
    pub fn next(&self) -> Option<u64> {
        self.zero
    }

    /// Let time pass; the cycle at which it last asked for its interrupt.
    pub fn advance(&mut self, cycle: u64) -> Option<u64> {
        let mut asked = None;
        while let Some(zero) = self.zero.filter(|&zero| zero <= cycle) {
            self.passed = true;
            asked = Some(zero).filter(|_| self.control & INTERRUPT != 0);
            self.zero = (self.reload != 0).then(|| zero + self.period());
        }
        asked
    }

    fn value(&self, cycle: u64) -> u32 {
        self.zero.map_or(self.rest, |zero| (zero.saturating_sub(cycle) / self.divider()) as u32)
    }

    /// Read a register.
    pub fn read(&mut self, offset: u32, cycle: u64) -> u32 {
        match offset {
            0x10 => self.control | u32::from(std::mem::take(&mut self.passed)) << 16,
            0x14 => self.reload,
            0x18 => self.value(cycle) % (self.reload + 1),
            // No reference clock, no calibration.
            _ => 0xc000_0000,
        }
    }

    /// Write a register.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) {
        match offset {
            0x10 => {
                self.rest = self.value(cycle);
                self.control = value & 7;
                self.go(cycle);
            }
            0x14 => self.reload = value & 0xff_ffff,
            0x18 => {
                self.rest = 0;
                self.passed = false;
                self.go(cycle);
            }
            _ => {}
        }
    }

    fn go(&mut self, cycle: u64) {
        let ticks = if self.rest == 0 { self.period() } else { self.rest as u64 * self.divider() };
        let runs = self.control & ENABLE != 0 && (self.reload != 0 || self.rest != 0);
        self.zero = runs.then_some(cycle + ticks);
    }
}
