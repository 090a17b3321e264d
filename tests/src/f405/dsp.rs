//! Multiplication, division, and the DSP extension: the library lacks most of that, and stops the
//! emulation where a sum overflows or a divisor is zero.

use super::chip::Chip;
use super::fault::Fault;
use super::instruction::{bit, field, is_wide, register};
use armagnac::registers::{CoreRegisters, RegisterIndex};

/// How a lane-wise result is made to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// It wraps, and GE tells of each lane whether it is not negative, or carries.
    Wrap,
    /// It saturates.
    Saturate,
    /// It is halved.
    Halve,
}

/// What the lanes of two registers do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lanes {
    AddBytes,
    AddHalves,
    AddSubtractCrossed,
    SubtractAddCrossed,
    SubtractBytes,
    SubtractHalves,
}

/// What is done.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    Divide {
        signed: bool,
    },
    /// Extend a byte, a halfword, or two bytes, after a rotation, and add.
    Extend {
        signed: bool,
        lanes: u32,
        rotation: u32,
    },
    Lanes {
        lanes: Lanes,
        signed: bool,
        fit: Fit,
    },
    Select,
    Pack {
        shift: u32,
        top: bool,
    },
    /// The lower half of the product, added or taken away.
    Multiply {
        subtract: bool,
    },
    /// Halves of both. A sum that overflows sets Q.
    MultiplyHalves {
        first: u32,
        second: u32,
    },
    MultiplyWordHalf {
        second: u32,
    },
    MultiplyDual {
        subtract: bool,
        exchange: bool,
    },
    MultiplyTop {
        subtract: bool,
        round: bool,
    },
    Differences,
    /// The whole product, added or not.
    Long {
        signed: bool,
        adds: bool,
    },
    LongHalves {
        first: u32,
        second: u32,
    },
    LongDual {
        subtract: bool,
        exchange: bool,
    },
    LongTwice,
    SaturateHalves {
        signed: bool,
        bits: u32,
    },
}

/// An instruction.
#[derive(Clone, Copy, Debug)]
pub struct Dsp {
    kind: Kind,
    /// Destination, or the upper half of a long one.
    to: RegisterIndex,
    first: RegisterIndex,
    second: RegisterIndex,
    /// What is added, or the lower half of a long destination; the program counter stands for none.
    third: RegisterIndex,
}

impl Dsp {
    /// What an instruction does, if it is one of these.
    pub fn decode(code: u32) -> Option<Self> {
        if !is_wide(code) {
            return None;
        }
        let mut instruction = Self {
            kind: Kind::Select,
            to: register(code, 8),
            first: register(code, 16),
            second: register(code, 0),
            third: register(code, 12),
        };
        instruction.kind = match code >> 20 {
            0xeac if !bit(code, 4) && !bit(code, 15) => {
                let shift = field(code, 12, 3) << 2 | field(code, 6, 2);
                Kind::Pack { shift, top: bit(code, 5) }
            }
            0xf32 | 0xf3a if code & 0xf0f0 == 0 => {
                let signed = !bit(code, 23);
                Kind::SaturateHalves { signed, bits: field(code, 0, 4) + u32::from(signed) }
            }
            0xfa0..=0xfa5 if field(code, 12, 4) == 15 && field(code, 6, 2) == 2 => extension(code),
            0xfaa if code & 0xf0f0 == 0xf080 => Kind::Select,
            0xfa8..=0xfaf if field(code, 12, 4) == 15 && !bit(code, 7) => lanes(code)?,
            0xfb0..=0xfb7 if field(code, 6, 2) == 0 => product(code)?,
            0xfb8..=0xfbf => long(code)?,
            _ => return None,
        };
        if matches!(instruction.kind, Kind::SaturateHalves { .. }) {
            instruction.second = instruction.first;
        }
        Some(instruction)
    }

    /// Carry it out.
    pub fn execute(&self, registers: &mut CoreRegisters, chip: &Chip) -> Result<(), Fault> {
        let (first, second) = (registers[self.first], registers[self.second]);
        let added = if self.third.is_pc() { 0 } else { registers[self.third] };
        let result = match self.kind {
            Kind::Divide { signed } => {
                if second == 0 && chip.system.configuration & 1 << 4 != 0 {
                    return Err(Fault::DivisionByZero);
                }
                divide(first, second, signed)
            }
            Kind::Extend { signed, lanes, rotation } => {
                let base = if self.first.is_pc() { 0 } else { first };
                extend(base, second.rotate_right(rotation), signed, lanes)
            }
            Kind::Lanes { lanes, signed, fit } => {
                lane_wise(registers, lanes, signed, fit, [first, second])
            }
            Kind::Select => select(registers.psr.get() >> 16, first, second),
            Kind::Pack { shift, top: false } => first & 0xffff | second << shift & 0xffff_0000,
            Kind::Pack { shift, top: true } => {
                let shifted = (second as i32 >> if shift == 0 { 31 } else { shift }) as u32;
                first & 0xffff_0000 | shifted & 0xffff
            }
            Kind::SaturateHalves { signed, bits } => {
                saturate_halves(registers, first, signed, bits)
            }
            Kind::Long { .. }
            | Kind::LongHalves { .. }
            | Kind::LongDual { .. }
            | Kind::LongTwice => {
                let sum = self.multiply_long(registers, [first, second]);
                registers.set(self.third, sum as u32);
                (sum >> 32) as u32
            }
            _ => {
                let sum = self.multiply([first, second], added);
                if i64::from(sum as i32) != sum {
                    let _ = registers.psr.set_q(true);
                }
                sum as u32
            }
        };
        registers.set(self.to, result);
        Ok(())
    }

    /// Products of 32 bits.
    fn multiply(&self, [first, second]: [u32; 2], added: u32) -> i64 {
        let added = i64::from(added as i32);
        let product = i64::from(first as i32) * i64::from(second as i32);
        match self.kind {
            // Only the lower half counts.
            Kind::Multiply { subtract: true } => (added - product) as i32 as i64,
            Kind::Multiply { subtract: false } => (added + product) as i32 as i64,
            Kind::MultiplyHalves { first: x, second: y } => {
                added + half(first, x) * half(second, y)
            }
            Kind::MultiplyWordHalf { second: y } => {
                added + ((i64::from(first as i32) * half(second, y)) >> 16)
            }
            Kind::MultiplyDual { subtract, exchange } => {
                added + dual(first, second, subtract, exchange)
            }
            Kind::MultiplyTop { subtract, round } => {
                let rounding = if round { 1 << 31 } else { 0 };
                let product = if subtract { product.wrapping_neg() } else { product };
                (added << 32).wrapping_add(product).wrapping_add(rounding) >> 32
            }
            _ => {
                let bytes = first.to_le_bytes().into_iter().zip(second.to_le_bytes());
                let differences: i64 = bytes.map(|(a, b)| i64::from(a.abs_diff(b))).sum();
                (added + differences) as i32 as i64
            }
        }
    }

    /// Products that are added to 64 bits.
    fn multiply_long(&self, registers: &CoreRegisters, [first, second]: [u32; 2]) -> u64 {
        let (high, low) = (registers[self.to], registers[self.third]);
        let sum = u64::from(high) << 32 | u64::from(low);
        match self.kind {
            Kind::Long { signed, adds } => {
                let sum = if adds { sum } else { 0 };
                let signed_product = i64::from(first as i32) * i64::from(second as i32);
                let product = u64::from(first) * u64::from(second);
                sum.wrapping_add(if signed { signed_product as u64 } else { product })
            }
            Kind::LongHalves { first: x, second: y } => {
                sum.wrapping_add_signed(half(first, x) * half(second, y))
            }
            Kind::LongDual { subtract, exchange } => {
                sum.wrapping_add_signed(dual(first, second, subtract, exchange))
            }
            _ => u64::from(first) * u64::from(second) + u64::from(high) + u64::from(low),
        }
    }
}

// ---- arithmetic ----------------------------------------------------------------------------

fn divide(first: u32, second: u32, signed: bool) -> u32 {
    match (second, signed) {
        (0, _) => 0,
        (_, true) => (first as i32).wrapping_div(second as i32) as u32,
        (_, false) => first / second,
    }
}

/// Half 0 or 1 of a register.
fn half(word: u32, which: u32) -> i64 {
    i64::from((word >> (16 * which)) as i16)
}

fn dual(first: u32, second: u32, subtract: bool, exchange: bool) -> i64 {
    let second = if exchange { second.rotate_left(16) } else { second };
    let (low, high) = (half(first, 0) * half(second, 0), half(first, 1) * half(second, 1));
    if subtract { low - high } else { low + high }
}

/// Lanes: 1 for a byte, 2 for a halfword, 3 for the bytes 0 and 2.
fn extend(base: u32, value: u32, signed: bool, lanes: u32) -> u32 {
    let byte = |value: u32| if signed { value as i8 as u32 } else { value & 0xff };
    match lanes {
        1 => base.wrapping_add(byte(value)),
        2 if signed => base.wrapping_add(value as i16 as u32),
        2 => base.wrapping_add(value & 0xffff),
        _ => {
            let low = base.wrapping_add(byte(value)) & 0xffff;
            let high = (base >> 16).wrapping_add(byte(value >> 16));
            high << 16 | low
        }
    }
}

fn select(flags: u32, first: u32, second: u32) -> u32 {
    let mask =
        (0..4).filter(|lane| bit(flags, *lane)).fold(0, |mask, lane| mask | 0xff << (8 * lane));
    first & mask | second & !mask
}

fn saturate_halves(registers: &mut CoreRegisters, word: u32, signed: bool, bits: u32) -> u32 {
    let limits =
        if signed { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1 << bits) - 1) };
    let saturated = [0, 1].map(|which| half(word, which).clamp(limits.0, limits.1));
    if (0..2).any(|which| half(word, which as u32) != saturated[which]) {
        let _ = registers.psr.set_q(true);
    }
    (saturated[1] as u32) << 16 | saturated[0] as u32 & 0xffff
}

fn lane_wise(
    registers: &mut CoreRegisters,
    lanes: Lanes,
    signed: bool,
    fit: Fit,
    [first, second]: [u32; 2],
) -> u32 {
    let bytes = matches!(lanes, Lanes::AddBytes | Lanes::SubtractBytes);
    let (count, bits) = if bytes { (4, 8) } else { (2, 16) };
    let crossed = matches!(lanes, Lanes::AddSubtractCrossed | Lanes::SubtractAddCrossed);
    let second = if crossed { second.rotate_left(16) } else { second };
    let lane = |word: u32, at: u32| {
        let shifted = word << (32 - bits - bits * at);
        if signed {
            i64::from(shifted as i32 >> (32 - bits))
        } else {
            (shifted >> (32 - bits)).into()
        }
    };
    let (mut result, mut flags) = (0, 0);
    for at in 0..count {
        let adds = match lanes {
            Lanes::AddBytes | Lanes::AddHalves => true,
            Lanes::SubtractBytes | Lanes::SubtractHalves => false,
            Lanes::AddSubtractCrossed => at == 1,
            Lanes::SubtractAddCrossed => at == 0,
        };
        let (a, b) = (lane(first, at), lane(second, at));
        let sum = if adds { a + b } else { a - b };
        let carries = if adds && !signed { sum >= 1 << bits } else { sum >= 0 };
        if carries {
            flags |= ((1 << (4 / count)) - 1) << (at * (4 / count));
        }
        let (low, high) =
            if signed { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1 << bits) - 1) };
        let fitted = match fit {
            Fit::Wrap => sum,
            Fit::Saturate => sum.clamp(low, high),
            Fit::Halve => sum >> 1,
        };
        result |= (fitted as u32 & ((1 << bits) - 1)) << (bits * at);
    }
    if fit == Fit::Wrap {
        registers.psr.set(registers.psr.get() & !(0xf << 16) | flags << 16);
    }
    result
}

// ---- encodings -----------------------------------------------------------------------------

fn extension(code: u32) -> Kind {
    let kind = field(code, 20, 3);
    let lanes = match kind >> 1 {
        0 => 2,
        1 => 3,
        _ => 1,
    };
    Kind::Extend { signed: kind & 1 == 0, lanes, rotation: 8 * field(code, 4, 2) }
}

fn lanes(code: u32) -> Option<Kind> {
    let lanes = match field(code, 20, 3) {
        0 => Lanes::AddBytes,
        1 => Lanes::AddHalves,
        2 => Lanes::AddSubtractCrossed,
        4 => Lanes::SubtractBytes,
        5 => Lanes::SubtractHalves,
        6 => Lanes::SubtractAddCrossed,
        _ => return None,
    };
    let fit = match field(code, 4, 2) {
        0 => Fit::Wrap,
        1 => Fit::Saturate,
        2 => Fit::Halve,
        _ => return None,
    };
    Some(Kind::Lanes { lanes, signed: !bit(code, 6), fit })
}

fn product(code: u32) -> Option<Kind> {
    let (second, first) = (field(code, 4, 1), field(code, 5, 1));
    let flag = second != 0;
    match (field(code, 20, 3), first) {
        (0, 0) => Some(Kind::Multiply { subtract: flag }),
        (1, _) => Some(Kind::MultiplyHalves { first, second }),
        (2, 0) => Some(Kind::MultiplyDual { subtract: false, exchange: flag }),
        (3, 0) => Some(Kind::MultiplyWordHalf { second }),
        (4, 0) => Some(Kind::MultiplyDual { subtract: true, exchange: flag }),
        (5, 0) => Some(Kind::MultiplyTop { subtract: false, round: flag }),
        (6, 0) => Some(Kind::MultiplyTop { subtract: true, round: flag }),
        (7, 0) if !flag => Some(Kind::Differences),
        _ => None,
    }
}

fn long(code: u32) -> Option<Kind> {
    let (second, first) = (field(code, 4, 1), field(code, 5, 1));
    match (field(code, 20, 3), field(code, 4, 4)) {
        (0, 0) => Some(Kind::Long { signed: true, adds: false }),
        (2, 0) => Some(Kind::Long { signed: false, adds: false }),
        (4, 0) => Some(Kind::Long { signed: true, adds: true }),
        (6, 0) => Some(Kind::Long { signed: false, adds: true }),
        (1, 15) => Some(Kind::Divide { signed: true }),
        (3, 15) => Some(Kind::Divide { signed: false }),
        (4, 8..=11) => Some(Kind::LongHalves { first, second }),
        (4, 12 | 13) => Some(Kind::LongDual { subtract: false, exchange: second != 0 }),
        (5, 12 | 13) => Some(Kind::LongDual { subtract: true, exchange: second != 0 }),
        (6, 6) => Some(Kind::LongTwice),
        _ => None,
    }
}
