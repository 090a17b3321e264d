//! The floating point unit: VFPv4, single precision, in the machine's own `f32`.
//!
//! Not modelled: rounding modes other than to nearest (but for the conversions to integers), and
//! the cumulative flags of FPSCR.

use super::access::aligned;
use super::chip::Chip;
use super::fault::Fault;
use super::instruction::{Flow, bit, field, register};
use armagnac::registers::{CoreRegisters, RegisterIndex};

/// Default not-a-number of the processor.
const DEFAULT_NAN: u32 = 0x7fc0_0000;
/// All results that are not numbers are the default one.
const DEFAULT_NANS: u32 = 1 << 25;
/// Numbers too small to be normal are zero.
const FLUSH: u32 = 1 << 24;
/// AHP, DN, FZ and the rounding mode: what a new context takes from FPDSCR.
const MODES: u32 = 0x07c0_0000;

/// The registers.
#[derive(Clone, Debug, Default)]
pub struct FloatRegisters {
    pub single: [u32; 32],
    pub status: u32,
    /// CONTROL.FPCA: the running code has used them.
    pub used: bool,
}

/// Arithmetic of two operands, or of three with the destination.
#[derive(Clone, Copy, Debug)]
pub enum Arithmetic {
    MultiplyAdd { negate_product: bool, negate_sum: bool, fused: bool },
    Multiply { negate: bool },
    Add,
    Subtract,
    Divide,
}

/// Arithmetic of one operand.
#[derive(Clone, Copy, Debug)]
pub enum Unary {
    Move,
    Absolute,
    Negate,
    Root,
    FromHalf { upper: bool },
    ToHalf { upper: bool },
    FromInteger { signed: bool },
    ToInteger { signed: bool, to_zero: bool },
    FromFixed { signed: bool, bits: u32, fraction: i32 },
    ToFixed { signed: bool, bits: u32, fraction: i32 },
}

/// An instruction; registers by their numbers.
#[derive(Clone, Copy, Debug)]
pub enum Float {
    Binary {
        operation: Arithmetic,
        to: usize,
        first: usize,
        second: usize,
    },
    Unary {
        operation: Unary,
        to: usize,
        from: usize,
    },
    Constant {
        to: usize,
        value: u32,
    },
    /// Compare with a register or with zero.
    Compare {
        first: usize,
        second: Option<usize>,
    },
    ToCore {
        to: RegisterIndex,
        from: usize,
    },
    FromCore {
        to: usize,
        from: RegisterIndex,
    },
    TwoToCore {
        to: [RegisterIndex; 2],
        from: usize,
    },
    TwoFromCore {
        to: usize,
        from: [RegisterIndex; 2],
    },
    ReadStatus {
        to: RegisterIndex,
    },
    WriteStatus {
        from: RegisterIndex,
    },
    One {
        load: bool,
        at: usize,
        words: usize,
        base: RegisterIndex,
        offset: i32,
    },
    Many {
        load: bool,
        at: usize,
        words: usize,
        base: RegisterIndex,
        up: bool,
        writes_back: bool,
    },
    /// Double precision, or what later processors have.
    Unknown(u32),
}

impl Float {
    /// What an instruction does, if it is one for this unit.
    pub fn decode(code: u32) -> Option<Self> {
        let ours = code >> 26 & 0x3b == 0x3b && field(code, 9, 3) == 0b101;
        if !ours {
            return None;
        }
        let known = match field(code, 24, 4) {
            _ if bit(code, 28) => None,
            0b1110 if bit(code, 4) => transfer(code),
            0b1110 => arithmetic(code),
            _ => access(code),
        };
        Some(known.unwrap_or(Self::Unknown(code)))
    }

    /// Carry it out.
    pub fn execute(
        &self,
        float: &mut FloatRegisters,
        registers: &mut CoreRegisters,
        chip: &mut Chip,
    ) -> Result<Flow, Fault> {
        if chip.system.coprocessors >> 20 & 0xf != 0xf {
            return Err(Fault::NoFloat);
        }
        if !float.used && chip.system.float_control >> 31 != 0 {
            float.status = float.status & !MODES | chip.system.float_default & MODES;
            float.used = true;
        }
        match *self {
            Self::Binary { operation, to, first, second } => {
                let operands = [first, second, to].map(|at| float.operand(at));
                float.single[to] = float.binary(operation, operands).to_bits();
            }
            Self::Unary { operation, to, from } => {
                float.single[to] = float.unary(operation, float.single[from], float.single[to]);
            }
            Self::Constant { to, value } => float.single[to] = value,
            Self::Compare { first, second } => {
                let first = float.operand(first);
                let second = second.map_or(0.0, |second| float.operand(second));
                float.status = float.status & 0x0fff_ffff | compare(first, second);
            }
            Self::One { load, at, words, base, offset } => {
                let start = if base.is_pc() { registers.pc & !3 } else { registers[base] };
                float.copy(chip, load, at, words, start.wrapping_add_signed(offset))?;
            }
            Self::Many { load, at, words, base, up, writes_back } => {
                let (start, length) = (registers[base], 4 * words as u32);
                let end = if up { start.wrapping_add(length) } else { start.wrapping_sub(length) };
                float.copy(chip, load, at, words, if up { start } else { end })?;
                if writes_back {
                    registers.set(base, end);
                }
            }
            Self::Unknown(code) => return Err(Fault::Undefined(code)),
            transfer => transfer.between(float, registers),
        }
        Ok(Flow::Next)
    }

    /// Between the registers of the core and those of this unit.
    fn between(self, float: &mut FloatRegisters, registers: &mut CoreRegisters) {
        match self {
            Self::ToCore { to, from } => registers.set(to, float.single[from]),
            Self::FromCore { to, from } => float.single[to] = registers[from],
            Self::TwoToCore { to, from } => {
                registers.set(to[0], float.single[from]);
                registers.set(to[1], float.single[from + 1]);
            }
            Self::TwoFromCore { to, from } => {
                float.single[to] = registers[from[0]];
                float.single[to + 1] = registers[from[1]];
            }
            Self::ReadStatus { to } if to.is_pc() => {
                registers.psr.set(registers.psr.get() & 0x0fff_ffff | float.status & 0xf000_0000);
            }
            Self::ReadStatus { to } => registers.set(to, float.status),
            Self::WriteStatus { from } => float.status = registers[from] & 0xf7c0_009f,
            _ => {}
        }
    }
}

impl FloatRegisters {
    /// Copy registers to or from memory.
    pub fn copy(
        &mut self,
        chip: &mut Chip,
        load: bool,
        from: usize,
        words: usize,
        address: u32,
    ) -> Result<(), Fault> {
        aligned(address, 4)?;
        for (at, place) in self.single.iter_mut().skip(from).take(words).enumerate() {
            let address = address.wrapping_add(4 * at as u32);
            if load {
                *place = chip.read(address, 4)?;
            } else {
                chip.write(address, *place, 4)?;
            }
        }
        Ok(())
    }

    fn flushed(&self, value: f32) -> f32 {
        if self.status & FLUSH != 0 && value.is_subnormal() {
            0.0_f32.copysign(value)
        } else {
            value
        }
    }

    fn operand(&self, at: usize) -> f32 {
        self.flushed(f32::from_bits(self.single[at]))
    }

    /// A result; of what is not a number, the processor's own choice.
    fn finish(&self, value: f32, operands: &[f32]) -> f32 {
        if !value.is_nan() {
            return self.flushed(value);
        }
        let nans = operands.iter().map(|operand| operand.to_bits());
        let nans: Vec<u32> = nans.filter(|bits| bits << 1 > 0xff00_0000).collect();
        let signalling = nans.iter().find(|bits| *bits & 1 << 22 == 0);
        f32::from_bits(match signalling.or(nans.first()) {
            Some(bits) if self.status & DEFAULT_NANS == 0 => bits | 1 << 22,
            _ => DEFAULT_NAN,
        })
    }

    /// Operands are the first, the second and the destination.
    fn binary(&self, operation: Arithmetic, [first, second, sum]: [f32; 3]) -> f32 {
        let two = |value| self.finish(value, &[first, second]);
        match operation {
            Arithmetic::MultiplyAdd { negate_product, negate_sum, fused: true } => {
                let first = if negate_product { -first } else { first };
                let sum = if negate_sum { -sum } else { sum };
                self.finish(first.mul_add(second, sum), &[sum, first, second])
            }
            Arithmetic::MultiplyAdd { negate_product, negate_sum, fused: false } => {
                let product = two(first * second);
                let product = if negate_product { -product } else { product };
                let sum = if negate_sum { -sum } else { sum };
                self.finish(sum + product, &[sum, product])
            }
            Arithmetic::Multiply { negate: true } => -two(first * second),
            Arithmetic::Multiply { negate: false } => two(first * second),
            Arithmetic::Add => two(first + second),
            Arithmetic::Subtract => two(first - second),
            Arithmetic::Divide => two(first / second),
        }
    }

    fn unary(&self, operation: Unary, bits: u32, old: u32) -> u32 {
        let value = self.flushed(f32::from_bits(bits));
        match operation {
            Unary::Move => bits,
            Unary::Absolute => bits & !(1 << 31),
            Unary::Negate => bits ^ 1 << 31,
            Unary::Root => self.finish(value.sqrt(), &[value]).to_bits(),
            Unary::FromHalf { upper } => self.widened(if upper { bits >> 16 } else { bits }),
            Unary::ToHalf { upper: true } => old & 0xffff | self.narrowed(value) << 16,
            Unary::ToHalf { upper: false } => old & 0xffff_0000 | self.narrowed(value),
            Unary::FromInteger { signed: true } => (bits as i32 as f32).to_bits(),
            Unary::FromInteger { signed: false } => (bits as f32).to_bits(),
            Unary::ToInteger { signed, to_zero } => {
                let rounded = if to_zero { value.trunc() } else { self.rounded(value) };
                integer(rounded.into(), signed, 32)
            }
            Unary::FromFixed { signed, bits: width, fraction } => {
                let shift = 32 - width;
                let integer = if signed {
                    f64::from((bits << shift) as i32 >> shift)
                } else {
                    f64::from(bits << shift >> shift)
                };
                ((integer * (-f64::from(fraction)).exp2()) as f32).to_bits()
            }
            Unary::ToFixed { signed, bits: width, fraction } => {
                integer((f64::from(value) * f64::from(fraction).exp2()).trunc(), signed, width)
            }
        }
    }

    fn rounded(&self, value: f32) -> f32 {
        match self.status >> 22 & 3 {
            0 => value.round_ties_even(),
            1 => value.ceil(),
            2 => value.floor(),
            _ => value.trunc(),
        }
    }

    fn widened(&self, bits: u32) -> u32 {
        let (sign, exponent, fraction) = (bits >> 15 & 1, bits >> 10 & 0x1f, bits & 0x3ff);
        let magnitude = match exponent {
            0 => (fraction as f32 * (-24.0_f32).exp2()).to_bits(),
            31 if fraction == 0 => 0x7f80_0000,
            31 if self.status & DEFAULT_NANS != 0 => return DEFAULT_NAN,
            31 => 0x7fc0_0000 | fraction << 13,
            _ => (exponent + 112) << 23 | fraction << 13,
        };
        sign << 31 | magnitude
    }

    fn narrowed(&self, value: f32) -> u32 {
        let bits = value.to_bits();
        let sign = bits >> 16 & 0x8000;
        let magnitude = f64::from(value.abs());
        if value.is_nan() {
            let quiet = if self.status & DEFAULT_NANS != 0 { 0 } else { bits >> 13 & 0x1ff };
            return sign | 0x7e00 | quiet;
        }
        // The largest number that does not round to infinity, and the spacing of numbers this large.
        if magnitude >= 65_520.0 {
            return sign | 0x7c00;
        }
        let exponent = (bits >> 23 & 0xff) as i32 - 127;
        let spacing = f64::from(exponent.max(-14) - 10).exp2();
        let steps = (magnitude / spacing).round_ties_even() as u32;
        sign | if exponent < -14 { steps } else { (((exponent + 14) as u32) << 10) + steps }
    }
}

/// The nearest integer of this width that there is; 0 for what is not a number.
fn integer(value: f64, signed: bool, bits: u32) -> u32 {
    if signed {
        let top = (bits as f64 - 1.0).exp2();
        value.clamp(-top, top - 1.0) as i32 as u32
    } else {
        value.clamp(0.0, (bits as f64).exp2() - 1.0) as u32
    }
}

/// The flags N, Z, C, V of a comparison.
fn compare(first: f32, second: f32) -> u32 {
    match first.partial_cmp(&second) {
        Some(std::cmp::Ordering::Less) => 0x8000_0000,
        Some(std::cmp::Ordering::Equal) => 0x6000_0000,
        Some(std::cmp::Ordering::Greater) => 0x2000_0000,
        None => 0x3000_0000,
    }
}

// ---- encodings -----------------------------------------------------------------------------

/// A single register: four bits and one more below them.
fn single(code: u32, upper: u32, lowest: u32) -> usize {
    (field(code, upper, 4) << 1 | field(code, lowest, 1)) as usize
}

fn arithmetic(code: u32) -> Option<Float> {
    if bit(code, 8) {
        return None;
    }
    let (to, first, second) = (single(code, 12, 22), single(code, 16, 7), single(code, 0, 5));
    let flag = bit(code, 6);
    let multiply_add = |negate_product, negate_sum, fused| {
        Some(Arithmetic::MultiplyAdd { negate_product, negate_sum, fused })
    };
    let operation = match field(code, 23, 1) << 2 | field(code, 20, 2) {
        0 => multiply_add(flag, false, false),
        1 => multiply_add(flag, true, false),
        2 => Some(Arithmetic::Multiply { negate: flag }),
        3 if flag => Some(Arithmetic::Subtract),
        3 => Some(Arithmetic::Add),
        4 if !flag => Some(Arithmetic::Divide),
        5 => multiply_add(flag, true, true),
        6 => multiply_add(flag, false, true),
        7 if !flag => return Some(Float::Constant { to, value: constant(code) }),
        7 => return one_operand(code, to, second),
        _ => None,
    };
    operation.map(|operation| Float::Binary { operation, to, first, second })
}

/// A constant of eight bits: sign, three bits of exponent, four of fraction.
fn constant(code: u32) -> u32 {
    let value = field(code, 16, 4) << 4 | field(code, 0, 4);
    let exponent = if bit(value, 6) { 0x3e00_0000 } else { 0x4000_0000 };
    (value & 0x80) << 24 | exponent | (value & 0x3f) << 19
}

fn one_operand(code: u32, to: usize, from: usize) -> Option<Float> {
    let flag = bit(code, 7);
    let operation = match field(code, 16, 4) {
        0 if flag => Unary::Absolute,
        0 => Unary::Move,
        1 if flag => Unary::Root,
        1 => Unary::Negate,
        2 => Unary::FromHalf { upper: flag },
        3 => Unary::ToHalf { upper: flag },
        4 => return Some(Float::Compare { first: to, second: Some(from) }),
        5 => return Some(Float::Compare { first: to, second: None }),
        8 => Unary::FromInteger { signed: flag },
        12 | 13 => Unary::ToInteger { signed: bit(code, 16), to_zero: flag },
        10 | 11 | 14 | 15 => {
            let bits = if flag { 32 } else { 16 };
            let fraction = bits as i32 - (field(code, 0, 4) << 1 | field(code, 5, 1)) as i32;
            let signed = !bit(code, 16);
            let operation = if bit(code, 18) {
                Unary::ToFixed { signed, bits, fraction }
            } else {
                Unary::FromFixed { signed, bits, fraction }
            };
            return Some(Float::Unary { operation, to, from: to });
        }
        _ => return None,
    };
    Some(Float::Unary { operation, to, from })
}

/// Between one core register and one of this unit.
fn transfer(code: u32) -> Option<Float> {
    let (to_core, core) = (bit(code, 20), register(code, 12));
    let at = if bit(code, 8) {
        // Half of a double register.
        if bit(code, 23) || bit(code, 22) || field(code, 5, 2) != 0 || bit(code, 7) {
            return None;
        }
        (field(code, 16, 4) << 1 | field(code, 21, 1)) as usize
    } else {
        match field(code, 21, 3) {
            0 => single(code, 16, 7),
            7 if field(code, 16, 4) == 1 && to_core => {
                return Some(Float::ReadStatus { to: core });
            }
            7 if field(code, 16, 4) == 1 => return Some(Float::WriteStatus { from: core }),
            _ => return None,
        }
    };
    Some(if to_core {
        Float::ToCore { to: core, from: at }
    } else {
        Float::FromCore { to: at, from: core }
    })
}

/// Between memory, or two core registers, and this unit.
fn access(code: u32) -> Option<Float> {
    let (before, up, writes_back) = (bit(code, 24), bit(code, 23), bit(code, 21));
    let (load, base, double) = (bit(code, 20), register(code, 16), bit(code, 8));
    if !before && !up && !writes_back {
        return two(code);
    }
    let at = if double {
        (field(code, 22, 1) << 5 | field(code, 12, 4) << 1) as usize
    } else {
        single(code, 12, 22)
    };
    let constant = (code & 0xff) as i32;
    if before && !writes_back {
        let offset = if up { 4 * constant } else { -4 * constant };
        let words = if double { 2 } else { 1 };
        return (at + words <= 32).then_some(Float::One { load, at, words, base, offset });
    }
    let words = if double { code & 0xfe } else { code & 0xff } as usize;
    let valid = before != up && words != 0 && at + words <= 32;
    valid.then_some(Float::Many { load, at, words, base, up, writes_back })
}

fn two(code: u32) -> Option<Float> {
    let double = bit(code, 8);
    let at = if double { 2 * field(code, 0, 4) as usize } else { single(code, 0, 5) };
    let core = [register(code, 12), register(code, 16)];
    let valid = bit(code, 22) && field(code, 6, 2) == 0 && bit(code, 4) && at < 31;
    valid.then_some(if bit(code, 20) {
        Float::TwoToCore { to: core, from: at }
    } else {
        Float::TwoFromCore { to: at, from: core }
    })
}

#[cfg(test)]
mod tests {
    use super::{Arithmetic, FloatRegisters, Unary};

    #[test]
    fn what_is_not_a_number_has_the_processors_bits() {
        let float = FloatRegisters::default();
        let zero = [0.0, 0.0, 7.0];
        assert_eq!(float.binary(Arithmetic::Divide, zero).to_bits(), 0x7fc0_0000);
        let signalling = f32::from_bits(0xff80_1234);
        let sum = float.binary(Arithmetic::Add, [f32::NAN, signalling, 0.0]);
        assert_eq!(sum.to_bits(), 0xffc0_1234);
    }

    #[test]
    fn conversions_saturate_and_round() {
        let float = FloatRegisters::default();
        let convert = |signed, to_zero, value: f32| {
            float.unary(Unary::ToInteger { signed, to_zero }, value.to_bits(), 0) as i32
        };
        assert_eq!(convert(true, true, -2.7), -2);
        assert_eq!(convert(true, false, 2.5), 2);
        assert_eq!(convert(true, true, 3e9), i32::MAX);
        assert_eq!(convert(false, true, -1.0), 0);
        assert_eq!(convert(true, true, f32::NAN), 0);
    }

    #[test]
    fn half_precision_there_and_back() {
        let float = FloatRegisters::default();
        for bits in [0, 1, 0x3ff, 0x400, 0x3c00, 0x7bff, 0x7c00, 0x8001, 0xfc00] {
            let wide = float.unary(Unary::FromHalf { upper: false }, bits, 0);
            assert_eq!(float.unary(Unary::ToHalf { upper: false }, wide, 0), bits);
        }
    }
}
