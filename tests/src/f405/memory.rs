//! The memory map: what answers at an address.

use super::chip::{Chip, FLASH_SIZE, FLASH_START, RAM_START};
use super::fault::Fault;

/// Unique identity and size of the flash in KiB, as the factory writes them.
const FACTORY: [(u32, u32); 4] = [
    (0x1fff_7a10, 0x0034_0021),
    (0x1fff_7a14, 0x3038_510a),
    (0x1fff_7a18, 0x3337_3536),
    (0x1fff_7a20, 0x0400_0000),
];

/// Where an address lies.
enum Place<'a> {
    Memory(&'a mut [u8], usize, bool),
    Factory,
    Peripheral,
    System,
    Nothing,
}

impl Chip {
    fn place(&mut self, address: u32) -> Place<'_> {
        let flash = |address: u32| (address - FLASH_START) as usize;
        match address {
            0x2000_0000..0x2002_0000 => {
                Place::Memory(&mut self.ram, (address - RAM_START) as usize, true)
            }
            0x0800_0000..0x0810_0000 => Place::Memory(&mut self.flash, flash(address), false),
            0x1000_0000..0x1001_0000 => {
                Place::Memory(&mut self.ccm, (address & 0xffff) as usize, true)
            }
            0x4000_0000..0x6000_0000 => Place::Peripheral,
            0xe000_0000..0xe010_0000 => Place::System,
            0..0x10_0000 => Place::Memory(&mut self.flash, address as usize, false),
            0x1fff_0000..0x1fff_8000 => Place::Factory,
            _ => Place::Nothing,
        }
    }

    /// Read so many bytes, 1, 2 or 4, as a program does.
    pub fn read(&mut self, address: u32, bytes: u32) -> Result<u32, Fault> {
        match self.place(address) {
            Place::Memory(memory, at, _) => load(memory, at, bytes).ok_or(Fault::NoMemory(address)),
            Place::Nothing => Err(Fault::NoMemory(address)),
            _ if !address.is_multiple_of(bytes) => Err(Fault::Unaligned(address)),
            place => {
                let word = match place {
                    Place::Factory => factory(address & !3),
                    Place::Peripheral => self.read_register(address & !3),
                    _ => self.read_system(address & !3),
                };
                Ok(word >> (8 * (address & 3)) & mask(bytes))
            }
        }
    }

    /// Write so many bytes, 1, 2 or 4, as a program does.
    pub fn write(&mut self, address: u32, value: u32, bytes: u32) -> Result<(), Fault> {
        match self.place(address) {
            Place::Memory(memory, at, true) => {
                store(memory, at, value, bytes).ok_or(Fault::NoMemory(address))
            }
            Place::Memory(_, _, false) | Place::Factory | Place::Nothing => {
                Err(Fault::NoMemory(address))
            }
            _ if !address.is_multiple_of(bytes) => Err(Fault::Unaligned(address)),
            Place::Peripheral => {
                let word = self.widen(address, value, bytes);
                self.write_register(address & !3, word);
                Ok(())
            }
            Place::System => {
                let word = self.widen(address, value, bytes);
                self.write_system(address & !3, word);
                self.settle();
                Ok(())
            }
        }
    }

    /// The word that a narrow write makes: the buses APB1 and APB2 repeat it, others keep the rest
    /// of the register, unless that is one whose bits act when they are written.
    fn widen(&mut self, address: u32, value: u32, bytes: u32) -> u32 {
        let lane = value & mask(bytes);
        let shift = 8 * (address & 3);
        match address {
            _ if bytes == 4 => value,
            0x4000_0000..0x4002_0000 if bytes == 2 => lane * 0x1_0001,
            0x4000_0000..0x4002_0000 => lane * 0x0101_0101,
            0x4002_0000..0x4002_1000 if address & 0x3fc == 0x18 => lane << shift,
            0xe000_e100..0xe000_e300 => lane << shift,
            _ => {
                let word = if address >= 0xe000_0000 {
                    self.read_system(address & !3)
                } else {
                    self.read_register(address & !3)
                };
                word & !(mask(bytes) << shift) | lane << shift
            }
        }
    }

    /// Memory as it is, for a test; none where there is none.
    pub fn peek(&self, address: u32) -> Option<u8> {
        let (memory, at) = match address {
            0x2000_0000.. => (&self.ram, address - RAM_START),
            0x1000_0000.. => (&self.ccm, address - 0x1000_0000),
            _ => (&self.flash, address & !FLASH_START),
        };
        memory.get(at as usize).copied()
    }

    /// Overwrite memory, flash too, as a disturbance would.
    pub fn poke(&mut self, address: u32, value: u8) -> Option<()> {
        let Place::Memory(memory, at, _) = self.place(address) else { return None };
        *memory.get_mut(at)? = value;
        Some(())
    }

    /// An erased word of the flash at its end.
    pub fn erased(&self) -> Option<u32> {
        let erased = |at: &usize| self.flash[*at..*at + 4] == [0xff; 4];
        let place = (0..FLASH_SIZE - 4).step_by(4).rev().find(erased)?;
        Some(FLASH_START + place as u32)
    }
}

const fn mask(bytes: u32) -> u32 {
    u32::MAX >> (32 - 8 * bytes)
}

fn factory(address: u32) -> u32 {
    FACTORY.iter().find(|&&(at, _)| at == address).map_or(u32::MAX, |&(_, word)| word)
}

fn load(memory: &[u8], at: usize, bytes: u32) -> Option<u32> {
    Some(match bytes {
        4 => u32::from_le_bytes(memory.get(at..at + 4)?.try_into().ok()?),
        2 => u16::from_le_bytes(memory.get(at..at + 2)?.try_into().ok()?).into(),
        _ => (*memory.get(at)?).into(),
    })
}

fn store(memory: &mut [u8], at: usize, value: u32, bytes: u32) -> Option<()> {
    let count = bytes as usize;
    memory.get_mut(at..at + count)?.copy_from_slice(&value.to_le_bytes()[..count]);
    Some(())
}
