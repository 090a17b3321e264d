//! Shifts, and arithmetic with a shifted operand: the library stops the emulation at arithmetic
//! shifts by 32 and more, and at rotations by multiples of 32.

use super::instruction::{bit, field, is_wide, register};
use armagnac::core::ItState;
use armagnac::registers::{CoreRegisters, RegisterIndex};

/// How an operand is shifted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Left,
    Right,
    Arithmetic,
    Rotate,
    RotateThroughCarry,
}

/// By how much.
#[derive(Clone, Copy, Debug)]
pub enum Amount {
    Constant(u32),
    /// The lowest byte of a register.
    Register(RegisterIndex),
}

/// What is done with the shifted operand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    Move,
    MoveNot,
    And,
    AndNot,
    Or,
    OrNot,
    ExclusiveOr,
    Add,
    AddCarry,
    Subtract,
    SubtractCarry,
    SubtractFrom,
}

/// An instruction.
#[derive(Clone, Copy, Debug)]
pub struct Shift {
    what: What,
    /// None for a comparison.
    to: Option<RegisterIndex>,
    first: RegisterIndex,
    second: RegisterIndex,
    kind: Kind,
    amount: Amount,
    sets_flags: bool,
}

impl Shift {
    /// What an instruction does, if it is one of these.
    pub fn decode(code: u32, state: ItState) -> Option<Self> {
        if !is_wide(code) {
            return narrow(code >> 16, !state.in_it_block());
        }
        match code >> 25 {
            0b111_0101 if !bit(code, 15) => operand(code),
            0b111_1101 if code & 0xf0f0 == 0xf000 && !bit(code, 23) => Some(Self {
                what: What::Move,
                to: Some(register(code, 8)),
                first: RegisterIndex::R0,
                second: register(code, 16),
                kind: kind(field(code, 21, 2)),
                amount: Amount::Register(register(code, 0)),
                sets_flags: bit(code, 20),
            }),
            _ => None,
        }
    }

    /// Carry it out.
    pub fn execute(&self, registers: &mut CoreRegisters) {
        let carry = registers.psr.c();
        let amount = match self.amount {
            Amount::Constant(amount) => amount,
            Amount::Register(register) => registers[register] & 0xff,
        };
        let (second, shifted_out) = shift(registers[self.second], self.kind, amount, carry);
        let first = registers[self.first];
        let plain = |value| (value, shifted_out, registers.psr.v());
        let (value, carry, overflow) = match self.what {
            What::Move => plain(second),
            What::MoveNot => plain(!second),
            What::And => plain(first & second),
            What::AndNot => plain(first & !second),
            What::Or => plain(first | second),
            What::OrNot => plain(first | !second),
            What::ExclusiveOr => plain(first ^ second),
            What::Add => add(first, second, false),
            What::AddCarry => add(first, second, carry),
            What::Subtract => add(first, !second, true),
            What::SubtractCarry => add(first, !second, carry),
            What::SubtractFrom => add(!first, second, true),
        };
        if let Some(to) = self.to {
            registers.set(to, value);
        }
        if self.sets_flags {
            let _ = registers.psr.set_nz(value).set_c(carry).set_v(overflow);
        }
    }
}

/// The shifted value, and the last bit that was shifted out.
fn shift(value: u32, kind: Kind, amount: u32, carry: bool) -> (u32, bool) {
    let wide = u64::from(value);
    match (kind, amount) {
        (Kind::RotateThroughCarry, _) => (value >> 1 | u32::from(carry) << 31, bit(value, 0)),
        (_, 0) => (value, carry),
        (Kind::Left, 33..) | (Kind::Right, 33..) => (0, false),
        (Kind::Left, _) => ((wide << amount) as u32, (wide << amount) >> 32 & 1 != 0),
        (Kind::Right, _) => ((wide >> amount) as u32, bit(value, amount - 1)),
        (Kind::Arithmetic, _) => {
            let wide = i64::from(value as i32);
            let amount = amount.min(32);
            ((wide >> amount) as u32, wide >> (amount - 1) & 1 != 0)
        }
        (Kind::Rotate, _) => {
            let rotated = value.rotate_right(amount % 32);
            (rotated, bit(rotated, 31))
        }
    }
}

/// Sum, carry and overflow.
fn add(first: u32, second: u32, carry: bool) -> (u32, bool, bool) {
    let (sum, one) = first.overflowing_add(second);
    let (sum, two) = sum.overflowing_add(carry.into());
    (sum, one || two, (first ^ sum) & (second ^ sum) & 1 << 31 != 0)
}

// ---- encodings -----------------------------------------------------------------------------

fn kind(bits: u32) -> Kind {
    match bits {
        0 => Kind::Left,
        1 => Kind::Right,
        2 => Kind::Arithmetic,
        _ => Kind::Rotate,
    }
}

/// A constant shift: right by 0 stands for 32, a rotation by 0 for one through the carry.
fn constant(bits: u32, amount: u32) -> (Kind, Amount) {
    match (kind(bits), amount) {
        (Kind::Rotate, 0) => (Kind::RotateThroughCarry, Amount::Constant(1)),
        (Kind::Left, 0) => (Kind::Left, Amount::Constant(0)),
        (kind, 0) => (kind, Amount::Constant(32)),
        (kind, amount) => (kind, Amount::Constant(amount)),
    }
}

/// Instructions of 16 bits.
fn narrow(code: u32, sets_flags: bool) -> Option<Shift> {
    let low = |at: u32| RegisterIndex::new_main(code >> at & 7);
    let to = Some(low(0));
    let shift = |second, (kind, amount)| {
        let first = RegisterIndex::R0;
        Some(Shift { what: What::Move, to, first, second, kind, amount, sets_flags })
    };
    let by_register = |kind| shift(low(0), (kind, Amount::Register(low(3))));
    match code >> 6 {
        // A shift by 0 is a plain move, which the library makes.
        0..=0x5f if code >> 11 != 0 || field(code, 6, 5) != 0 => {
            shift(low(3), constant(code >> 11, field(code, 6, 5)))
        }
        0x102 => by_register(Kind::Left),
        0x103 => by_register(Kind::Right),
        0x104 => by_register(Kind::Arithmetic),
        0x107 => by_register(Kind::Rotate),
        _ => None,
    }
}

/// Arithmetic with a shifted register.
fn operand(code: u32) -> Option<Shift> {
    let (to, first, second) = (register(code, 8), register(code, 16), register(code, 0));
    let (compares, moves) = (to.is_pc(), first.is_pc());
    let what = match field(code, 21, 4) {
        0 => What::And,
        1 => What::AndNot,
        2 if moves => What::Move,
        2 => What::Or,
        3 if moves => What::MoveNot,
        3 => What::OrNot,
        4 => What::ExclusiveOr,
        8 => What::Add,
        10 => What::AddCarry,
        11 => What::SubtractCarry,
        13 => What::Subtract,
        14 => What::SubtractFrom,
        _ => return None,
    };
    let comparing = matches!(what, What::And | What::ExclusiveOr | What::Add | What::Subtract);
    if compares && !(comparing && bit(code, 20)) {
        return None;
    }
    let (kind, amount) = constant(field(code, 4, 2), field(code, 12, 3) << 2 | field(code, 6, 2));
    let to = (!compares).then_some(to);
    Some(Shift { what, to, first, second, kind, amount, sets_flags: bit(code, 20) })
}
