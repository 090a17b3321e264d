//! An instruction, decoded once: the library's, or one of those that are carried out here.

use super::access::Access;
use super::dsp::Dsp;
use super::fault::Fault;
use super::float::Float;
use super::shift::Shift;
use super::special::Special;
use armagnac::core::{Condition, ItState};
use armagnac::decoder::InstructionDecode;
use armagnac::instructions::{Instruction, InstructionSize};
use armagnac::registers::RegisterIndex;
use std::rc::Rc;

/// How the program goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// With the next instruction.
    Next,
    /// At the address in the program counter.
    Jump,
    /// When an interrupt comes.
    Sleep,
}

/// Who carries it out.
pub enum Operation {
    /// The library: arithmetic and jumps.
    Library(Rc<dyn Instruction>),
    /// Loads and stores.
    Access(Access),
    /// Floating point.
    Float(Float),
    /// Arithmetic that the library lacks.
    Dsp(Dsp),
    /// Shifts, and arithmetic with a shifted operand.
    Shift(Shift),
    /// Special registers and hints.
    Special(Special),
    /// Nobody.
    Unknown,
}

/// A decoded instruction.
pub struct Decoded {
    /// Its length in bytes.
    pub bytes: u32,
    /// A condition of its own.
    pub condition: Option<Condition>,
    /// What it does.
    pub operation: Operation,
}

impl Decoded {
    /// Decode an instruction, whose first halfword is the upper one.
    pub fn new(decoder: &dyn InstructionDecode, code: u32, state: ItState) -> Self {
        let bytes = if is_wide(code) { 4 } else { 2 };
        let ours = Access::decode(code)
            .map(Operation::Access)
            .or_else(|| Float::decode(code).map(Operation::Float))
            .or_else(|| Dsp::decode(code).map(Operation::Dsp))
            .or_else(|| Shift::decode(code, state).map(Operation::Shift))
            .or_else(|| Special::decode(code).map(Operation::Special));
        if let Some(operation) = ours {
            return Self { bytes, condition: None, operation };
        }
        let (code, size) = match bytes {
            4 => (code, InstructionSize::Ins32),
            _ => (code >> 16, InstructionSize::Ins16),
        };
        match decoder.try_decode(code, size, state) {
            // What is left to the coprocessors of the library is floating point nobody has.
            Ok(_) if bytes == 4 && code >> 26 & 0x3b == 0x3b => Self::unknown(bytes),
            Ok(library) => {
                let condition = library.condition();
                Self { bytes, condition, operation: Operation::Library(library) }
            }
            Err(_) => Self::unknown(bytes),
        }
    }

    fn unknown(bytes: u32) -> Self {
        Self { bytes, condition: None, operation: Operation::Unknown }
    }
}

/// Whether an instruction has 32 bits, by its first halfword in the upper half.
pub fn is_wide(code: u32) -> bool {
    code >> 27 >= 0b11101
}

/// One bit.
pub fn bit(code: u32, at: u32) -> bool {
    code >> at & 1 != 0
}

/// Some bits from `at` on.
pub fn field(code: u32, at: u32, count: u32) -> u32 {
    code >> at & ((1 << count) - 1)
}

/// The register that four bits name.
pub fn register(code: u32, at: u32) -> RegisterIndex {
    RegisterIndex::new_main(code >> at & 15)
}

/// A fault at an instruction that is not known.
pub fn unknown(code: u32) -> Fault {
    Fault::Undefined(if is_wide(code) { code } else { code >> 16 })
}
