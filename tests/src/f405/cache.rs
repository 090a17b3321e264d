//! Decoded instructions by their addresses.

use super::chip::{FLASH_SIZE, RAM_SIZE};
use super::instruction::Decoded;
use armagnac::core::ItState;
use armagnac::decoder::InstructionDecode;

/// An instruction that was decoded before: it counts while memory still holds the same code.
struct Entry {
    code: u32,
    state: u8,
    decoded: Decoded,
}

/// The cache. Flash comes first, then memory; both grow as code is met.
#[derive(Default)]
pub struct Cache {
    flash: Vec<Option<Entry>>,
    ram: Vec<Option<Entry>>,
}

impl Cache {
    /// The instruction at an address, which holds this code.
    pub fn find(
        &mut self,
        decoder: &dyn InstructionDecode,
        address: u32,
        code: u32,
        state: ItState,
    ) -> &Decoded {
        let (entries, size) = if address >> 29 == 1 {
            (&mut self.ram, RAM_SIZE)
        } else {
            (&mut self.flash, FLASH_SIZE)
        };
        let place = address as usize % size / 2;
        if place >= entries.len() {
            entries.resize_with(place + 1, || None);
        }
        let entry = &mut entries[place];
        let known =
            entry.as_ref().is_some_and(|known| known.code == code && known.state == state.0);
        if !known {
            *entry = None;
        }
        let decode = || Entry { code, state: state.0, decoded: Decoded::new(decoder, code, state) };
        &entry.get_or_insert_with(decode).decoded
    }
}
