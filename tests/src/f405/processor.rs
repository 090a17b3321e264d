//! The processor core: one instruction after the other, and the ways into and out of exceptions.
//!
//! The library decodes and carries out arithmetic and jumps. It always takes itself to be outside of
//! exceptions: its own are left alone, because they know no priorities and no floating point.

use super::cache::Cache;
use super::chip::Chip;
use super::exceptions::HARD_FAULT;
use super::fault::Fault;
use super::float::FloatRegisters;
use super::instruction::{Flow, Operation, unknown};
use armagnac::core::{Config, Effect, Processor as Library};
use armagnac::registers::CoreRegisters;

/// Cycles from an exception's request to its first instruction, from memory without wait states.
const ENTRY_CYCLES: u64 = 12;
/// Cycles of a return from an exception.
const RETURN_CYCLES: u64 = 10;
/// The bits of xPSR that hold the state of an IT block.
const IT: u32 = 0x0600_fc00;
/// Addresses from here on end an exception when they are jumped to.
const RETURNS: u32 = 0xf000_0000;

/// The processor.
pub struct Processor {
    library: Library,
    float: FloatRegisters,
    cache: Cache,
    /// Address of the last exclusive load.
    mark: Option<u32>,
    /// It waits for an interrupt.
    pub asleep: bool,
    /// It has stopped for good: why.
    pub crashed: Option<String>,
    /// The fault that led to a hard fault last, and where.
    pub last_fault: Option<(Fault, u32)>,
    /// Cycles of an instruction.
    pub cycles_per_instruction: u64,
    /// Instructions carried out since power-on.
    pub instructions: u64,
    /// Lowest stack pointer.
    pub stack_low: u32,
}

impl Default for Processor {
    fn default() -> Self {
        Self {
            library: Library::new(Config::v7em()),
            float: FloatRegisters::default(),
            cache: Cache::default(),
            mark: None,
            asleep: false,
            crashed: None,
            last_fault: None,
            cycles_per_instruction: 1,
            instructions: 0,
            stack_low: u32::MAX,
        }
    }
}

impl Processor {
    /// Begin as after a reset.
    pub fn restart(&mut self, chip: &mut Chip) {
        self.library.registers = CoreRegisters::new();
        self.float = FloatRegisters::default();
        (self.mark, self.asleep, self.crashed) = (None, false, None);
        match (chip.read(0, 4), chip.read(4, 4)) {
            (Ok(stack), Ok(start)) => {
                let registers = &mut self.library.registers;
                registers.msp = stack & !3;
                registers.lr = u32::MAX;
                registers.pc = start & !1;
                let _ = registers.psr.set_t(start & 1 != 0);
            }
            _ => self.crashed = Some("no vectors".into()),
        }
    }

    /// The core's registers.
    pub fn registers(&self) -> &CoreRegisters {
        &self.library.registers
    }

    /// The same, to be disturbed.
    pub fn registers_mut(&mut self) -> &mut CoreRegisters {
        &mut self.library.registers
    }

    /// Registers of the floating point unit, as bits.
    pub fn singles(&self) -> &[u32; 32] {
        &self.float.single
    }

    fn handles(&self) -> bool {
        self.library.registers.psr.ipsr() != 0
    }

    /// One instruction.
    pub fn step(&mut self, chip: &mut Chip) {
        let (address, state) = (self.library.registers.pc, self.library.registers.psr);
        chip.cycle += self.cycles_per_instruction;
        self.instructions += 1;
        let done = self.instruction(chip).and_then(|flow| self.go_on(flow, chip));
        let registers = &mut self.library.registers;
        registers.msp &= !3;
        self.stack_low = self.stack_low.min(registers.msp);
        if let Err(fault) = done {
            (registers.pc, registers.psr) = (address, state);
            self.fail(fault, chip);
        }
    }

    fn instruction(&mut self, chip: &mut Chip) -> Result<Flow, Fault> {
        let registers = &mut self.library.registers;
        let address = registers.pc;
        let code = chip.fetch(address)?;
        if !registers.psr.t() {
            return Err(Fault::NotThumb);
        }
        let block = registers.psr.it_state();
        let decoder = &*self.library.instruction_decoder;
        let decoded = self.cache.find(decoder, address, code, block);
        let end = address.wrapping_add(decoded.bytes);
        let mut condition = decoded.condition;
        if registers.psr.get() & IT != 0 {
            condition = condition.or(block.current_condition());
            let mut next = block;
            next.advance();
            registers.psr.set_it_state(next);
        }
        let mut flow = Flow::Next;
        if condition.is_none_or(|condition| registers.psr.test(condition)) {
            // To an instruction the program counter is 4 ahead.
            registers.pc = address.wrapping_add(4);
            let parts = (&mut self.library, &mut self.float, &mut self.mark);
            flow = carry_out(&decoded.operation, code, parts, chip)?;
        }
        if flow != Flow::Jump {
            self.library.registers.pc = end;
        }
        Ok(flow)
    }

    fn go_on(&mut self, flow: Flow, chip: &mut Chip) -> Result<(), Fault> {
        self.asleep = flow == Flow::Sleep;
        let target = self.library.registers.pc;
        if flow == Flow::Jump && target >= RETURNS && self.handles() {
            return self.leave(target | 1, chip);
        }
        Ok(())
    }

    // ---- exceptions ------------------------------------------------------------------------

    /// A fault: its exception, or the hard fault, or the end.
    fn fail(&mut self, fault: Fault, chip: &mut Chip) {
        let address = self.library.registers.pc;
        self.last_fault = Some((fault, address));
        let number = chip.record(fault);
        let number = if chip.exceptions.interrupts(number) {
            number
        } else if chip.exceptions.running() > -1 {
            chip.system.hard_fault_status |= 1 << 30;
            HARD_FAULT
        } else {
            self.crashed = Some(format!("{fault}, at {address:#010x}, in the handler of a fault"));
            return;
        };
        chip.exceptions.pend(number, chip.cycle);
        self.enter(number, chip);
    }

    /// Begin to serve an exception.
    pub fn enter(&mut self, number: u8, chip: &mut Chip) {
        self.asleep = false;
        let number = match self.push_frame(chip) {
            // A hard fault instead; and one is served whether or not there is a stack.
            Err(fault) if number > HARD_FAULT => {
                self.last_fault = Some((fault, self.library.registers.pc));
                chip.record(fault);
                chip.system.hard_fault_status |= 1 << 30;
                chip.exceptions.pend(HARD_FAULT, chip.cycle);
                HARD_FAULT
            }
            _ => number,
        };
        let vector = chip.system.vectors.wrapping_add(4 * u32::from(number));
        let Ok(handler) = chip.read(vector, 4) else {
            self.crashed = Some(format!("no vector at {vector:#010x}"));
            return;
        };
        let registers = &mut self.library.registers;
        registers.pc = handler & !1;
        registers.psr.set_ipsr(number.into());
        let _ = registers.psr.set_t(handler & 1 != 0).set_ici_it(0);
        registers.control.set_spsel(false);
        registers.event = true;
        self.float.used = false;
        self.mark = None;
        self.stack_low = self.stack_low.min(registers.msp);
        chip.cycle += ENTRY_CYCLES;
        chip.exceptions.begin(number, chip.cycle);
    }

    /// Keep what a handler may change. The registers of the floating point unit go with the others
    /// at once if they have been used: a later, lazy copy would hold the same.
    fn push_frame(&mut self, chip: &mut Chip) -> Result<(), Fault> {
        let registers = &mut self.library.registers;
        let size = if self.float.used { 0x68 } else { 0x20 };
        let stack = registers.sp();
        let frame = stack.wrapping_sub(size) & !7;
        let padded = stack & 4;
        let core = [registers.r0, registers.r1, registers.r2, registers.r3, registers.r12];
        let state = registers.psr.get() & !(1 << 9) | padded << 7;
        let words = core.into_iter().chain([registers.lr, registers.pc, state]);
        let mut places = (0..).map(|word| frame.wrapping_add(4 * word)).zip(words);
        let pushed = places.try_for_each(|(at, word)| chip.write(at, word, 4));
        let back = match (registers.psr.ipsr() != 0, registers.control.spsel()) {
            (true, _) => 0xffff_fff1,
            (false, false) => 0xffff_fff9,
            (false, true) => 0xffff_fffd,
        };
        *registers.sp_mut() = frame;
        registers.lr = if self.float.used { back & !0x10 } else { back };
        pushed?;
        if self.float.used {
            self.float.copy(chip, false, 0, 16, frame + 0x20)?;
            chip.write(frame + 0x60, self.float.status, 4)?;
        }
        Ok(())
    }

    /// End an exception.
    fn leave(&mut self, code: u32, chip: &mut Chip) -> Result<(), Fault> {
        let number = self.library.registers.psr.ipsr() as u8;
        let to_handler = code & 0xf == 1;
        let valid = matches!(code & 0xf, 1 | 9 | 13) && code >> 5 == 0x07ff_ffff;
        let last = chip.exceptions.active & !(1 << number) == 0;
        if !valid || chip.exceptions.active >> number & 1 == 0 || to_handler == last {
            return Err(Fault::WrongReturn(code));
        }
        chip.exceptions.end(number);
        chip.exceptions.masks_changed(chip.cycle);
        self.library.registers.control.set_spsel(code & 0xf == 13);
        self.float.used = code & 0x10 == 0;
        self.pop_frame(chip)?;
        self.library.registers.event = true;
        self.mark = None;
        chip.cycle += RETURN_CYCLES;
        Ok(())
    }

    fn pop_frame(&mut self, chip: &mut Chip) -> Result<(), Fault> {
        let registers = &mut self.library.registers;
        let frame = registers.sp();
        let mut words = [0; 8];
        for (at, word) in (frame..).step_by(4).zip(&mut words) {
            *word = chip.read(at, 4)?;
        }
        [registers.r0, registers.r1, registers.r2, registers.r3, registers.r12] =
            [words[0], words[1], words[2], words[3], words[4]];
        (registers.lr, registers.pc) = (words[5], words[6] & !1);
        let mut size = 0x20;
        if self.float.used {
            self.float.copy(chip, true, 0, 16, frame + 0x20)?;
            self.float.status = chip.read(frame + 0x60, 4)?;
            size = 0x68;
        }
        *registers.sp_mut() = frame.wrapping_add(size) | (words[7] >> 9 & 1) << 2;
        registers.psr.set(words[7]);
        Ok(())
    }
}

/// Carry out an instruction, with the core's registers, those of the floating point unit, and the
/// mark of the exclusive accesses.
fn carry_out(
    operation: &Operation,
    code: u32,
    (library, float, mark): (&mut Library, &mut FloatRegisters, &mut Option<u32>),
    chip: &mut Chip,
) -> Result<Flow, Fault> {
    let registers = &mut library.registers;
    match operation {
        Operation::Library(instruction) => match instruction.execute(library) {
            Ok(Effect::None) => Ok(Flow::Next),
            Ok(Effect::Branch) => Ok(Flow::Jump),
            Ok(Effect::WaitForInterrupt | Effect::WaitForEvent) => Ok(Flow::Sleep),
            Ok(Effect::Break(_) | Effect::DebugHint(_)) | Err(_) => Err(unknown(code)),
        },
        Operation::Access(access) => access.execute(registers, chip, mark),
        Operation::Float(operation) => operation.execute(float, registers, chip),
        Operation::Dsp(operation) => operation.execute(registers, chip).map(|()| Flow::Next),
        Operation::Shift(shift) => {
            shift.execute(registers);
            Ok(Flow::Next)
        }
        Operation::Special(special) => special.execute(registers, float, chip, mark),
        Operation::Unknown => Err(unknown(code)),
    }
}
