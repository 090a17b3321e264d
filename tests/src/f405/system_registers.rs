//! Registers of the core at 0xE0000000: interrupt controller, faults, SysTick, cycle counter.

use super::chip::Chip;
use super::exceptions::{BUS_FAULT, COUNT, PEND_SV, SYS_TICK, USAGE_FAULT};

/// Enables of the configurable faults, bits 16 to 18 of SHCSR, are exceptions 4 to 6.
const FAULTS: u128 = 0b111 << 4;

/// What the core's registers hold.
pub struct SystemRegisters {
    pub vectors: u32,
    pub configuration: u32,
    pub fault_status: u32,
    pub hard_fault_status: u32,
    pub fault_address: u32,
    /// Who may use the coprocessors: bits 20 to 23 belong to the floating point unit.
    pub coprocessors: u32,
    pub float_control: u32,
    pub float_address: u32,
    pub float_default: u32,
    priority_group: u32,
    sleep: u32,
    debug: u32,
    /// The cycle counter: what it held, and since when it has counted on.
    counted: u32,
    counts_since: Option<u64>,
}

impl Default for SystemRegisters {
    fn default() -> Self {
        Self {
            vectors: 0,
            configuration: 0x200,
            fault_status: 0,
            hard_fault_status: 0,
            fault_address: 0,
            coprocessors: 0,
            float_control: 0xc000_0000,
            float_address: 0,
            float_default: 0,
            priority_group: 0,
            sleep: 0,
            debug: 0,
            counted: 0,
            counts_since: None,
        }
    }
}

/// The interrupts of a word of ISER and its like, as exceptions.
fn interrupts(word: u32, value: u32) -> u128 {
    let existing = (1 << COUNT) - 1;
    u128::from(value).checked_shl(16 + 32 * word).unwrap_or(0) & existing
}

fn word_of(set: u128, word: u32) -> u32 {
    set.checked_shr(16 + 32 * word).unwrap_or(0) as u32
}

impl Chip {
    /// Read a word of the core's registers.
    pub(super) fn read_system(&mut self, address: u32) -> u32 {
        let (registers, exceptions) = (&self.system, &self.exceptions);
        match address {
            0xe000_1000 => 0x4000_0000 | u32::from(registers.counts_since.is_some()),
            0xe000_1004 => self.count_cycles(),
            0xe000_e004 => 2,
            0xe000_e010..=0xe000_e01c => self.systick.read(address & 0xff, self.cycle),
            0xe000_e100..=0xe000_e11c | 0xe000_e180..=0xe000_e19c => {
                word_of(exceptions.enabled, (address & 0x1f) / 4)
            }
            0xe000_e200..=0xe000_e21c | 0xe000_e280..=0xe000_e29c => {
                word_of(exceptions.pending, (address & 0x1f) / 4)
            }
            0xe000_e300..=0xe000_e31c => word_of(exceptions.active, (address & 0x1f) / 4),
            0xe000_e400..=0xe000_e4ef => self.priorities(address as usize - 0xe000_e400 + 16),
            0xe000_ed00 => 0x410f_c241,
            0xe000_ed04 => self.control_state(),
            0xe000_ed08 => registers.vectors,
            0xe000_ed0c => 0xfa05_0000 | registers.priority_group << 8,
            0xe000_ed10 => registers.sleep,
            0xe000_ed14 => registers.configuration,
            0xe000_ed18..=0xe000_ed23 => self.priorities(address as usize - 0xe000_ed18 + 4),
            0xe000_ed24 => ((exceptions.enabled & FAULTS) >> 4 << 16) as u32,
            0xe000_ed28 => registers.fault_status,
            0xe000_ed2c => registers.hard_fault_status,
            0xe000_ed34 | 0xe000_ed38 => registers.fault_address,
            0xe000_ed88 => registers.coprocessors,
            0xe000_edfc => registers.debug,
            0xe000_ef34 => registers.float_control,
            0xe000_ef38 => registers.float_address,
            0xe000_ef3c => registers.float_default,
            0xe004_2000 => self.identity,
            _ => self.note_read(address),
        }
    }

    fn count_cycles(&self) -> u32 {
        let since = self.system.counts_since.map_or(0, |since| self.cycle - since);
        self.system.counted.wrapping_add(since as u32)
    }

    fn priorities(&self, first: usize) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|at| self.exceptions.priority(first + at)))
    }

    fn control_state(&self) -> u32 {
        let waiting = self.exceptions.pending & self.exceptions.enabled;
        let pending = |number: u8| (self.exceptions.pending >> number & 1) as u32;
        let active = self.exceptions.active.checked_ilog2().unwrap_or(0);
        let first = if waiting == 0 { 0 } else { waiting.trailing_zeros() };
        active
            | first << 12
            | u32::from(waiting >> 16 != 0) << 22
            | pending(SYS_TICK) << 26
            | pending(PEND_SV) << 28
    }

    /// Write a word of the core's registers.
    pub(super) fn write_system(&mut self, address: u32, value: u32) {
        let word = (address & 0x1f) / 4;
        match address {
            0xe000_1000 => self.count_from(self.count_cycles(), value & 1 != 0),
            0xe000_1004 => self.count_from(value, self.system.counts_since.is_some()),
            0xe000_e010..=0xe000_e01c => self.systick.write(address & 0xff, value, self.cycle),
            0xe000_e100..=0xe000_e11c => {
                self.exceptions.set_enabled(interrupts(word, value), true);
            }
            0xe000_e180..=0xe000_e19c => {
                self.exceptions.set_enabled(interrupts(word, value), false);
            }
            0xe000_e200..=0xe000_e21c => self.pend(interrupts(word, value)),
            0xe000_e280..=0xe000_e29c => self.exceptions.unpend(interrupts(word, value)),
            0xe000_e400..=0xe000_e4ef => {
                self.prioritise(address as usize - 0xe000_e400 + 16, value)
            }
            0xe000_ed04 => self.set_control_state(value),
            0xe000_ed08 => self.system.vectors = value & !0x7f,
            0xe000_ed0c => self.application_interrupt(value),
            0xe000_ed10 => self.system.sleep = value,
            0xe000_ed14 => self.system.configuration = value,
            0xe000_ed18..=0xe000_ed23 => self.prioritise(address as usize - 0xe000_ed18 + 4, value),
            0xe000_ed24 => {
                self.exceptions.set_enabled(FAULTS, false);
                self.exceptions.set_enabled(u128::from(value >> 16 << 4) & FAULTS, true);
            }
            0xe000_ed28 => self.system.fault_status &= !value,
            0xe000_ed2c => self.system.hard_fault_status &= !value,
            0xe000_ed34 | 0xe000_ed38 => self.system.fault_address = value,
            0xe000_ed88 => self.system.coprocessors = value,
            0xe000_edfc => self.system.debug = value,
            0xe000_ef00 => self.pend(1 << (16 + (value & 0x1ff).min(111))),
            0xe000_ef34 => self.system.float_control = value,
            0xe000_ef38 => self.system.float_address = value,
            0xe000_ef3c => self.system.float_default = value,
            _ => self.note_write(address, value),
        }
    }

    fn count_from(&mut self, count: u32, on: bool) {
        self.system.counted = count;
        self.system.counts_since = on.then_some(self.cycle);
    }

    fn pend(&mut self, which: u128) {
        for number in (0..COUNT as u8).filter(|n| which >> n & 1 != 0) {
            self.exceptions.pend(number, self.cycle);
        }
    }

    fn prioritise(&mut self, first: usize, value: u32) {
        for (at, priority) in value.to_le_bytes().into_iter().enumerate() {
            self.exceptions.set_priority(first + at, priority);
        }
    }

    fn set_control_state(&mut self, value: u32) {
        for (number, set, clear) in [(PEND_SV, 28, 27), (SYS_TICK, 26, 25)] {
            if value >> set & 1 != 0 {
                self.exceptions.pend(number, self.cycle);
            }
            if value >> clear & 1 != 0 {
                self.exceptions.unpend(1 << number);
            }
        }
    }

    fn application_interrupt(&mut self, value: u32) {
        if value >> 16 != 0x05fa {
            return;
        }
        self.system.priority_group = value >> 8 & 7;
        self.exceptions.group_bits = 0xfe_u8 << self.system.priority_group;
        if value & 4 != 0 {
            self.ask_reset(super::clocks::Reset::Software);
        }
    }

    /// Note a fault; the exception that serves it.
    pub(super) fn record(&mut self, fault: super::fault::Fault) -> u8 {
        let (bits, number) = fault.status();
        self.system.fault_status |= bits;
        if let Some(address) = fault.address() {
            self.system.fault_address = address;
        }
        debug_assert!(matches!(number, BUS_FAULT | USAGE_FAULT));
        number
    }
}
