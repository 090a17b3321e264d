//! Special registers, masks and hints.

use super::chip::Chip;
use super::exceptions::SUPERVISOR_CALL;
use super::fault::Fault;
use super::float::FloatRegisters;
use super::instruction::{Flow, bit, field, is_wide, register, unknown};
use armagnac::registers::{CoreRegisters, RegisterIndex};

/// The bits of xPSR that a program can write as flags: N, Z, C, V, Q and GE.
const FLAGS: u32 = 0xf80f_0000;

/// An instruction.
#[derive(Clone, Copy, Debug)]
pub enum Special {
    Read { to: RegisterIndex, number: u32 },
    Write { from: RegisterIndex, number: u32, mask: u32 },
    Mask { on: bool, primask: bool, faultmask: bool },
    WaitForInterrupt,
    WaitForEvent,
    SendEvent,
    ClearMark,
    Call,
    Breakpoint(u8),
    Nothing,
    Undefined(u32),
}

impl Special {
    /// What an instruction does, if it is one of these.
    pub fn decode(code: u32) -> Option<Self> {
        if !is_wide(code) {
            return narrow(code >> 16);
        }
        let number = code & 0xff;
        Some(match code >> 16 {
            0xf3ef if code & 0xf000 == 0x8000 => Self::Read { to: register(code, 8), number },
            0xf380..=0xf38e if code & 0xf000 == 0x8000 => {
                Self::Write { from: register(code, 16), number, mask: field(code, 10, 2) }
            }
            0xf3af if code & 0xff00 == 0x8000 => hint(number),
            0xf3bf if code & 0xfff0 == 0x8f20 => Self::ClearMark,
            0xf3bf if matches!(code & 0xfff0, 0x8f40 | 0x8f50 | 0x8f60) => Self::Nothing,
            0xf7f0..=0xf7ff if code & 0xf000 == 0xa000 => Self::Undefined(code),
            _ => return None,
        })
    }

    /// Carry it out.
    pub fn execute(
        &self,
        registers: &mut CoreRegisters,
        float: &mut FloatRegisters,
        chip: &mut Chip,
        mark: &mut Option<u32>,
    ) -> Result<Flow, Fault> {
        match *self {
            Self::Read { to, number } => {
                let value = read(number, registers, float, chip);
                registers.set(to, value);
            }
            Self::Write { from, number, mask } => {
                let value = registers[from];
                write((number, mask), value, registers, float, chip);
            }
            Self::Mask { on, primask, faultmask } => {
                let exceptions = &mut chip.exceptions;
                exceptions.primask = if primask { on } else { exceptions.primask };
                exceptions.faultmask = if faultmask { on } else { exceptions.faultmask };
                exceptions.masks_changed(chip.cycle);
            }
            Self::WaitForInterrupt => return Ok(Flow::Sleep),
            Self::WaitForEvent if !registers.event => return Ok(Flow::Sleep),
            Self::WaitForEvent => registers.event = false,
            Self::SendEvent => registers.event = true,
            Self::ClearMark => *mark = None,
            Self::Call => chip.exceptions.pend(SUPERVISOR_CALL, chip.cycle),
            Self::Breakpoint(number) => return Err(Fault::Breakpoint(number)),
            Self::Nothing => {}
            Self::Undefined(code) => return Err(unknown(code)),
        }
        Ok(Flow::Next)
    }
}

fn read(number: u32, registers: &CoreRegisters, float: &FloatRegisters, chip: &Chip) -> u32 {
    let exceptions = &chip.exceptions;
    match number {
        0..=7 => {
            let flags = if bit(number, 2) { 0 } else { registers.psr.get() & FLAGS };
            let exception = if bit(number, 0) { registers.psr.ipsr() } else { 0 };
            flags | exception
        }
        8 => registers.msp,
        9 => registers.psp,
        16 => exceptions.primask.into(),
        17 | 18 => exceptions.basepri.into(),
        19 => exceptions.faultmask.into(),
        20 => registers.control.read() & 3 | u32::from(float.used) << 2,
        _ => 0,
    }
}

fn write(
    (number, mask): (u32, u32),
    value: u32,
    registers: &mut CoreRegisters,
    float: &mut FloatRegisters,
    chip: &mut Chip,
) {
    let exceptions = &mut chip.exceptions;
    match number {
        0..=3 => {
            let upper = if bit(mask, 1) { 0xf800_0000 } else { 0 };
            let lanes = if bit(mask, 0) { 0x000f_0000 } else { 0 };
            let written = upper | lanes;
            registers.psr.set(registers.psr.get() & !written | value & written);
        }
        8 => registers.msp = value & !3,
        9 => registers.psp = value & !3,
        16 => exceptions.primask = value & 1 != 0,
        17 => exceptions.basepri = value as u8 & 0xf0,
        // Only ever stricter.
        18 => {
            let new = value as u8 & 0xf0;
            if new != 0 && (exceptions.basepri == 0 || new < exceptions.basepri) {
                exceptions.basepri = new;
            }
        }
        19 => exceptions.faultmask = value & 1 != 0,
        20 => {
            float.used = bit(value, 2);
            // Handlers always have the main stack.
            if registers.psr.ipsr() == 0 {
                registers.control.set_spsel(bit(value, 1));
            }
        }
        _ => {}
    }
    exceptions.masks_changed(chip.cycle);
}

/// Instructions of 16 bits.
fn narrow(code: u32) -> Option<Special> {
    Some(match code >> 8 {
        0xb6 if code & 0xe8 == 0x60 => {
            Special::Mask { on: bit(code, 4), primask: bit(code, 1), faultmask: bit(code, 0) }
        }
        0xbf if code & 15 == 0 => hint(code >> 4 & 15),
        0xbe => Special::Breakpoint(code as u8),
        0xde => Special::Undefined(code << 16),
        0xdf => Special::Call,
        _ => return None,
    })
}

fn hint(number: u32) -> Special {
    match number {
        2 => Special::WaitForEvent,
        3 => Special::WaitForInterrupt,
        4 => Special::SendEvent,
        _ => Special::Nothing,
    }
}
