//! Why an instruction could not be carried out.

use super::exceptions::{BUS_FAULT, USAGE_FAULT};
use std::fmt;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No memory answers at this address.
    NoMemory(u32),
    /// No memory to fetch an instruction from.
    NoCode(u32),
    /// There is no such instruction, or the emulator does not know it.
    Undefined(u32),
    /// The floating point unit is off.
    NoFloat,
    /// A jump to an even address.
    NotThumb,
    /// A return from an exception that is not active, or with a wrong code.
    WrongReturn(u32),
    /// An access that must be aligned was not.
    Unaligned(u32),
    /// Division by zero, if the program wants to know.
    DivisionByZero,
    /// A breakpoint without a debugger.
    Breakpoint(u8),
}

impl Fault {
    /// Bits of CFSR, and the exception.
    pub fn status(self) -> (u32, u8) {
        match self {
            Self::NoMemory(_) => (1 << 9 | 1 << 15, BUS_FAULT),
            Self::NoCode(_) => (1 << 8, BUS_FAULT),
            Self::Undefined(_) => (1 << 16, USAGE_FAULT),
            Self::NotThumb => (1 << 17, USAGE_FAULT),
            Self::WrongReturn(_) => (1 << 18, USAGE_FAULT),
            Self::NoFloat => (1 << 19, USAGE_FAULT),
            Self::Unaligned(_) => (1 << 24, USAGE_FAULT),
            Self::DivisionByZero => (1 << 25, USAGE_FAULT),
            Self::Breakpoint(_) => (0, USAGE_FAULT),
        }
    }

    /// The address that BFAR tells.
    pub fn address(self) -> Option<u32> {
        match self {
            Self::NoMemory(address) => Some(address),
            _ => None,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoMemory(address) => write!(f, "no memory at {address:#010x}"),
            Self::NoCode(address) => write!(f, "no code at {address:#010x}"),
            Self::Undefined(code) => write!(f, "unknown instruction {code:#010x}"),
            Self::NoFloat => write!(f, "the floating point unit is off"),
            Self::NotThumb => write!(f, "a jump to an even address"),
            Self::WrongReturn(code) => write!(f, "a wrong exception return {code:#010x}"),
            Self::Unaligned(address) => write!(f, "an unaligned access to {address:#010x}"),
            Self::DivisionByZero => write!(f, "a division by zero"),
            Self::Breakpoint(number) => write!(f, "breakpoint {number}"),
        }
    }
}
