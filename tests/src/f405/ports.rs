//! General-purpose inputs and outputs: what the registers of a port ask of its pins.

/// What a pin is used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// It is read only.
    Input,
    /// The port drives it.
    Output(bool),
    /// A peripheral has it: its number in the table of alternate functions.
    Peripheral(u32),
    /// It is neither read nor driven.
    Analog,
}

/// One port.
pub struct Port {
    /// MODER, OTYPER, OSPEEDR, PUPDR.
    setup: [u32; 4],
    output: u32,
    lock: u32,
    functions: [u32; 2],
}

impl Port {
    /// After a reset; the pins of the debugger are its own.
    pub fn new(port: usize) -> Self {
        let (modes, speeds, pulls) = match port {
            0 => (0xa800_0000, 0x0c00_0000, 0x6400_0000),
            1 => (0x280, 0xc0, 0x100),
            _ => (0, 0, 0),
        };
        Self { setup: [modes, 0, speeds, pulls], output: 0, lock: 0, functions: [0; 2] }
    }

    /// What a pin is used for.
    pub fn usage(&self, number: u8) -> Use {
        match self.setup[0] >> (2 * number) & 3 {
            0 => Use::Input,
            1 => Use::Output(self.output >> number & 1 != 0),
            2 => {
                let functions = self.functions[usize::from(number) / 8];
                Use::Peripheral(functions >> (4 * (number % 8)) & 0xf)
            }
            _ => Use::Analog,
        }
    }

    /// An output that only pulls down.
    pub fn open_drain(&self, number: u8) -> bool {
        self.setup[1] >> number & 1 != 0
    }

    /// The resistor: to the supply, to ground, or none.
    pub fn pull(&self, number: u8) -> Option<bool> {
        match self.setup[3] >> (2 * number) & 3 {
            1 => Some(true),
            2 => Some(false),
            _ => None,
        }
    }

    /// Read a register other than IDR; none when there is no such.
    pub fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x00..=0x0c => self.setup[offset as usize / 4],
            0x14 => self.output,
            0x18 => 0,
            0x1c => self.lock,
            0x20 | 0x24 => self.functions[(offset as usize - 0x20) / 4],
            _ => return None,
        })
    }

    /// Write a register; none when there is no such.
    pub fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x00..=0x0c => self.setup[offset as usize / 4] = value,
            0x10 => {}
            0x14 => self.output = value & 0xffff,
            0x18 => self.output = self.output & !(value >> 16) | value & 0xffff,
            0x1c => self.lock = value,
            0x20 | 0x24 => self.functions[(offset as usize - 0x20) / 4] = value,
            _ => return None,
        }
        Some(())
    }
}
