//! Loads and stores.
//!
//! The library's own go to a system control block that stops the emulation at most registers, and
//! that cannot be replaced; so the accesses are made here.

use super::chip::Chip;
use super::fault::Fault;
use super::instruction::{Flow, bit, field, is_wide, register};
use armagnac::registers::{CoreRegisters, RegisterIndex};

/// Where the offset of an address comes from.
#[derive(Clone, Copy, Debug)]
pub enum Offset {
    /// A constant.
    Constant(i32),
    /// A register, shifted left.
    Register(RegisterIndex, u32),
}

/// How the base register takes part.
#[derive(Clone, Copy, Debug)]
pub struct Indexing {
    /// The offset counts for the address.
    before: bool,
    /// The base register becomes base and offset.
    writes_back: bool,
}

const PLAIN: Indexing = Indexing { before: true, writes_back: false };

/// A load or a store.
#[derive(Clone, Copy, Debug)]
pub enum Access {
    /// One register.
    Single {
        load: bool,
        bytes: u32,
        signed: bool,
        target: RegisterIndex,
        base: RegisterIndex,
        offset: Offset,
        indexing: Indexing,
    },
    /// Two registers.
    Double {
        load: bool,
        targets: [RegisterIndex; 2],
        base: RegisterIndex,
        offset: i32,
        indexing: Indexing,
    },
    /// A set of registers, upwards from the base or downwards below it.
    Multiple { load: bool, base: RegisterIndex, list: u16, up: bool, writes_back: bool },
    /// A load that marks its address.
    LoadExclusive { bytes: u32, target: RegisterIndex, base: RegisterIndex, offset: i32 },
    /// A store that fails unless its address is still marked.
    StoreExclusive {
        bytes: u32,
        failed: RegisterIndex,
        source: RegisterIndex,
        base: RegisterIndex,
        offset: i32,
    },
    /// A jump by a table.
    Table { bytes: u32, base: RegisterIndex, index: RegisterIndex },
    /// A hint about memory: nothing happens.
    Preload,
}

impl Access {
    /// What an instruction does, if it is a load or a store.
    pub fn decode(code: u32) -> Option<Self> {
        if is_wide(code) { wide(code) } else { narrow(code >> 16) }
    }

    /// Carry it out. The mark is that of the exclusive accesses.
    pub fn execute(
        &self,
        registers: &mut CoreRegisters,
        chip: &mut Chip,
        mark: &mut Option<u32>,
    ) -> Result<Flow, Fault> {
        match *self {
            Self::Single { load, bytes, signed, target, base, offset, indexing } => {
                let (at, end) = address(registers, base, offset, indexing);
                if load {
                    let value = extend(chip.read(at, bytes)?, bytes, signed);
                    write_back(registers, base, end, indexing);
                    return Ok(assign(registers, target, value));
                }
                chip.write(at, registers[target], bytes)?;
                write_back(registers, base, end, indexing);
                Ok(Flow::Next)
            }
            Self::Double { load, targets, base, offset, indexing } => {
                let at = address(registers, base, Offset::Constant(offset), indexing);
                double(registers, chip, load, targets, at.0)?;
                write_back(registers, base, at.1, indexing);
                Ok(Flow::Next)
            }
            Self::Multiple { load, base, list, up, writes_back } => {
                multiple(registers, chip, (load, up, writes_back), base, list)
            }
            Self::LoadExclusive { bytes, target, base, offset } => {
                let address = registers[base].wrapping_add_signed(offset);
                aligned(address, bytes)?;
                let value = chip.read(address, bytes)?;
                *mark = Some(address);
                registers.set(target, value);
                Ok(Flow::Next)
            }
            Self::StoreExclusive { bytes, failed, source, base, offset } => {
                let address = registers[base].wrapping_add_signed(offset);
                aligned(address, bytes)?;
                let kept = mark.take() == Some(address);
                if kept {
                    chip.write(address, registers[source], bytes)?;
                }
                registers.set(failed, u32::from(!kept));
                Ok(Flow::Next)
            }
            Self::Table { bytes, base, index } => {
                let at = registers[base].wrapping_add(registers[index].wrapping_mul(bytes));
                let halfwords = chip.read(at, bytes)?;
                registers.pc = registers.pc.wrapping_add(2 * halfwords);
                Ok(Flow::Jump)
            }
            Self::Preload => Ok(Flow::Next),
        }
    }
}

/// Where to access, and what the base register becomes if it is written back.
fn address(
    registers: &CoreRegisters,
    base: RegisterIndex,
    offset: Offset,
    indexing: Indexing,
) -> (u32, u32) {
    let start = if base.is_pc() { registers.pc & !3 } else { registers[base] };
    let end = match offset {
        Offset::Constant(offset) => start.wrapping_add_signed(offset),
        Offset::Register(index, shift) => start.wrapping_add(registers[index] << shift),
    };
    (if indexing.before { end } else { start }, end)
}

fn write_back(registers: &mut CoreRegisters, base: RegisterIndex, end: u32, indexing: Indexing) {
    if indexing.writes_back {
        registers.set(base, end);
    }
}

fn extend(value: u32, bytes: u32, signed: bool) -> u32 {
    match (bytes, signed) {
        (1, true) => value as i8 as u32,
        (2, true) => value as i16 as u32,
        _ => value,
    }
}

/// Put a loaded value into a register; into the program counter, it is a jump.
fn assign(registers: &mut CoreRegisters, target: RegisterIndex, value: u32) -> Flow {
    if target.is_pc() {
        let _ = registers.psr.set_t(value & 1 != 0);
        registers.pc = value & !1;
        return Flow::Jump;
    }
    registers.set(target, value);
    Flow::Next
}

fn double(
    registers: &mut CoreRegisters,
    chip: &mut Chip,
    load: bool,
    targets: [RegisterIndex; 2],
    address: u32,
) -> Result<(), Fault> {
    aligned(address, 4)?;
    for (target, at) in targets.into_iter().zip([address, address.wrapping_add(4)]) {
        if load {
            let value = chip.read(at, 4)?;
            registers.set(target, value);
        } else {
            chip.write(at, registers[target], 4)?;
        }
    }
    Ok(())
}

/// An address that must be a multiple of this.
pub fn aligned(address: u32, bytes: u32) -> Result<(), Fault> {
    if address.is_multiple_of(bytes) { Ok(()) } else { Err(Fault::Unaligned(address)) }
}

fn multiple(
    registers: &mut CoreRegisters,
    chip: &mut Chip,
    (load, up, writes_back): (bool, bool, bool),
    base: RegisterIndex,
    list: u16,
) -> Result<Flow, Fault> {
    let start = registers[base];
    let length = 4 * list.count_ones();
    let end = if up { start.wrapping_add(length) } else { start.wrapping_sub(length) };
    let mut at = if up { start } else { end };
    aligned(at, 4)?;
    // All are read before one is written: a fault leaves the base as it was.
    let mut values = [0; 16];
    for index in (0..16).filter(|index| list >> index & 1 != 0) {
        if load {
            values[index] = chip.read(at, 4)?;
        } else {
            chip.write(at, registers[index as u32], 4)?;
        }
        at = at.wrapping_add(4);
    }
    if writes_back {
        registers.set(base, end);
    }
    let mut flow = Flow::Next;
    for index in (0..16).filter(|index| load && list >> index & 1 != 0) {
        flow = assign(registers, RegisterIndex::new_main(index as u32), values[index]);
    }
    Ok(flow)
}

// ---- encodings -----------------------------------------------------------------------------

fn single(load: bool, bytes: u32, target: u32, base: u32, offset: Offset) -> Access {
    let (target, base) = (RegisterIndex::new_main(target), RegisterIndex::new_main(base));
    Access::Single { load, bytes, signed: false, target, base, offset, indexing: PLAIN }
}

/// Instructions of 16 bits.
fn narrow(code: u32) -> Option<Access> {
    let low = |at: u32| code >> at & 7;
    let scaled = |bytes: u32| Offset::Constant(((code >> 6 & 31) * bytes) as i32);
    let load = bit(code, 11);
    let words = Offset::Constant((4 * (code & 0xff)) as i32);
    Some(match code >> 12 {
        0b0100 if load => single(true, 4, low(8), 15, words),
        0b0101 => by_register(code),
        0b0110 => single(load, 4, low(0), low(3), scaled(4)),
        0b0111 => single(load, 1, low(0), low(3), scaled(1)),
        0b1000 => single(load, 2, low(0), low(3), scaled(2)),
        0b1001 => single(load, 4, low(8), 13, words),
        0b1011 if code & 0x0600 == 0x0400 => {
            // PUSH takes LR, POP gives PC.
            let list = (code & 0xff | (code & 0x100) << if load { 7 } else { 6 }) as u16;
            Access::Multiple { load, base: RegisterIndex::Sp, list, up: load, writes_back: true }
        }
        0b1100 => {
            let (base, list) = (low(8), (code & 0xff) as u16);
            let writes_back = !(load && list >> base & 1 != 0);
            let base = RegisterIndex::new_main(base);
            Access::Multiple { load, base, list, up: true, writes_back }
        }
        _ => return None,
    })
}

fn by_register(code: u32) -> Access {
    let (load, bytes, is_signed) = match code >> 9 & 7 {
        0 => (false, 4, false),
        1 => (false, 2, false),
        2 => (false, 1, false),
        3 => (true, 1, true),
        4 => (true, 4, false),
        5 => (true, 2, false),
        6 => (true, 1, false),
        _ => (true, 2, true),
    };
    let low = |at: u32| RegisterIndex::new_main(code >> at & 7);
    Access::Single {
        load,
        bytes,
        signed: is_signed,
        target: low(0),
        base: low(3),
        offset: Offset::Register(low(6), 0),
        indexing: PLAIN,
    }
}

/// Instructions of 32 bits.
fn wide(code: u32) -> Option<Access> {
    match code >> 25 {
        0b111_0100 if !bit(code, 22) => several(code),
        0b111_0100 => pair(code),
        0b111_1100 => one(code),
        _ => None,
    }
}

fn several(code: u32) -> Option<Access> {
    let up = match code >> 23 & 3 {
        1 => true,
        2 => false,
        _ => return None,
    };
    let (load, base) = (bit(code, 20), register(code, 16));
    Some(Access::Multiple { load, base, list: code as u16, up, writes_back: bit(code, 21) })
}

fn constant(code: u32, value: u32) -> i32 {
    let value = value as i32;
    if bit(code, 23) { value } else { -value }
}

fn pair(code: u32) -> Option<Access> {
    let (load, base) = (bit(code, 20), register(code, 16));
    let offset = constant(code, 4 * (code & 0xff));
    if bit(code, 24) || bit(code, 21) {
        let indexing = Indexing { before: bit(code, 24), writes_back: bit(code, 21) };
        let targets = [register(code, 12), register(code, 8)];
        return Some(Access::Double { load, targets, base, offset, indexing });
    }
    let (target, offset) = (register(code, 12), (4 * (code & 0xff)) as i32);
    if !bit(code, 23) {
        let failed = register(code, 8);
        return Some(exclusive(load, 4, target, failed, base, offset));
    }
    match field(code, 4, 4) {
        size @ 0..=1 if load => {
            Some(Access::Table { bytes: 1 << size, base, index: register(code, 0) })
        }
        size @ 4..=5 => Some(exclusive(load, 1 << (size - 4), target, register(code, 0), base, 0)),
        _ => None,
    }
}

fn exclusive(
    load: bool,
    bytes: u32,
    target: RegisterIndex,
    failed: RegisterIndex,
    base: RegisterIndex,
    offset: i32,
) -> Access {
    if load {
        Access::LoadExclusive { bytes, target, base, offset }
    } else {
        Access::StoreExclusive { bytes, failed, source: target, base, offset }
    }
}

fn one(code: u32) -> Option<Access> {
    let (load, bytes, is_signed) = (bit(code, 20), 1 << field(code, 21, 2), bit(code, 24));
    let (target, base) = (register(code, 12), register(code, 16));
    if bytes == 8 || !load && (is_signed || base.is_pc()) {
        return None;
    }
    if load && bytes < 4 && target.is_pc() {
        return Some(Access::Preload);
    }
    let (offset, indexing) = if base.is_pc() {
        (Offset::Constant(constant(code, code & 0xfff)), PLAIN)
    } else if bit(code, 23) {
        (Offset::Constant((code & 0xfff) as i32), PLAIN)
    } else if bit(code, 11) {
        let magnitude = (code & 0xff) as i32;
        let offset = if bit(code, 9) { magnitude } else { -magnitude };
        (Offset::Constant(offset), Indexing { before: bit(code, 10), writes_back: bit(code, 8) })
    } else if field(code, 6, 5) == 0 {
        (Offset::Register(register(code, 0), field(code, 4, 2)), PLAIN)
    } else {
        return None;
    };
    Some(Access::Single { load, bytes, signed: is_signed, target, base, offset, indexing })
}
