//! External interrupts: edges on pins, and which port each line listens to.
//!
//! An edge is remembered in PR whether or not its line is unmasked.

/// Lines that come from pins.
const LINES: u8 = 16;

/// EXTI and the part of SYSCFG that belongs to it.
#[derive(Default)]
pub struct External {
    /// IMR, EMR, RTSR, FTSR, SWIER.
    setup: [u32; 5],
    pending: u32,
    since: [u64; LINES as usize],
    /// SYSCFG: memory map, peripheral mode, EXTICR1 to EXTICR4, and the rest.
    select: [u32; 9],
}

impl External {
    /// A pin has changed.
    pub fn edge(&mut self, port: usize, number: u8, high: bool, cycle: u64) {
        let line = usize::from(number);
        let listens = self.select[2 + line / 4] >> (4 * (line % 4)) & 0xf;
        let wanted = self.setup[if high { 2 } else { 3 }] >> line & 1 != 0;
        if listens as usize == port && wanted {
            self.set(line, cycle);
        }
    }

    fn set(&mut self, line: usize, cycle: u64) {
        if self.pending >> line & 1 == 0 {
            self.since[line] = cycle;
        }
        self.pending |= 1 << line;
    }

    /// Since when one of these lines requests its interrupt.
    pub fn request(&self, lines: std::ops::RangeInclusive<usize>) -> Option<u64> {
        let requested = self.pending & self.setup[0];
        lines.filter(|line| requested >> line & 1 != 0).map(|line| self.since[line]).min()
    }

    /// Read a register of EXTI; none when there is no such.
    pub fn read(&self, offset: u32) -> Option<u32> {
        match offset {
            0x00..=0x10 => Some(self.setup[offset as usize / 4]),
            0x14 => Some(self.pending),
            _ => None,
        }
    }

    /// Write a register of EXTI; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32, cycle: u64) -> Option<()> {
        match offset {
            0x00..=0x0c => self.setup[offset as usize / 4] = value,
            0x10 => {
                let new = value & !self.setup[4];
                self.setup[4] = value;
                for line in (0..usize::from(LINES)).filter(|line| new >> line & 1 != 0) {
                    self.set(line, cycle);
                }
            }
            0x14 => {
                self.pending &= !value;
                self.setup[4] &= !value;
            }
            _ => return None,
        }
        Some(())
    }

    /// Read a register of SYSCFG; none when there is no such.
    pub fn read_select(&self, offset: u32) -> Option<u32> {
        self.select.get(offset as usize / 4).copied()
    }

    /// Write a register of SYSCFG; none when there is no such.
    pub fn write_select(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.select.get_mut(offset as usize / 4)? = value;
        Some(())
    }
}
