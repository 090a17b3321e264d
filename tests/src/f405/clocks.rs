//! Reset and clock control: what is on, what is ready, why the chip started.

/// Why the chip started, as RCC_CSR says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// Power came on; memory holds a pattern.
    PowerOn,
    /// The reset pin.
    External,
    /// The supply was too low for a moment.
    BrownOut,
    /// The program asked for it.
    Software,
    /// The watchdog was not fed.
    Watchdog,
}

impl Reset {
    /// Every reset but one of the supply pulls the reset pin too.
    fn flags(self) -> u32 {
        match self {
            Self::PowerOn => 0x0e00_0000,
            Self::External => 0x0400_0000,
            Self::BrownOut => 0x0600_0000,
            Self::Software => 0x1400_0000,
            Self::Watchdog => 0x2400_0000,
        }
    }
}

const AHB1: u32 = 0x30;
const APB1: u32 = 0x40;
const APB2: u32 = 0x44;
const STATUS: u32 = 0x74;

/// The registers.
pub struct Clocks {
    words: [u32; 0x24],
    causes: u32,
    /// A fault: the crystal does not start.
    pub crystal_broken: bool,
}

impl Default for Clocks {
    fn default() -> Self {
        let mut words = [0; 0x24];
        words[0] = 0x83;
        words[1] = 0x2400_3010;
        words[AHB1 as usize / 4] = 0x0010_0000;
        Self { words, causes: 0, crystal_broken: false }
    }
}

impl Clocks {
    /// After a reset.
    pub fn reset(&mut self, cause: Reset) {
        let causes = if cause == Reset::PowerOn { 0 } else { self.causes };
        *self = Self {
            causes: causes | cause.flags(),
            crystal_broken: self.crystal_broken,
            ..Self::default()
        };
    }

    fn word(&self, offset: u32) -> u32 {
        self.words[offset as usize / 4]
    }

    /// Read a register; none when there is no such.
    pub fn read(&self, offset: u32) -> Option<u32> {
        let word = *self.words.get(offset as usize / 4)?;
        // A ready bit lies one above its enable bit.
        let ready = |enables: u32| word & !(enables << 1) | (word & enables) << 1;
        Some(match offset {
            0x00 if self.crystal_broken => ready(0x0500_0001),
            0x00 => ready(0x0501_0001),
            0x08 => word & !0xc | (word & 3) << 2,
            0x70 => ready(1),
            STATUS => ready(1) & 3 | self.causes,
            _ => word,
        })
    }

    /// Write a register; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.words.get_mut(offset as usize / 4)? = value;
        if offset == STATUS && value & 1 << 24 != 0 {
            self.causes = 0;
        }
        Some(())
    }

    /// Whether the peripheral with this base address has a clock.
    pub fn feeds(&self, base: u32) -> bool {
        let (register, bit) = match base {
            0x4002_0000..=0x4002_0c00 => (AHB1, (base - 0x4002_0000) / 0x400),
            0x4000_0000 => (APB1, 0),
            0x4000_0400 => (APB1, 1),
            0x4000_7000 => (APB1, 28),
            0x4001_1400 => (APB2, 5),
            0x4001_3800 => (APB2, 14),
            _ => return true,
        };
        self.word(register) >> bit & 1 != 0
    }
}
