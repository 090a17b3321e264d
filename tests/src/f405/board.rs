//! The board.

use super::chip::{Chip, Planned, RAM_START, Unknown};
use super::clocks::Reset;
use super::exceptions::{COUNT, Waited};
use super::image::{Image, ImageError};
use super::pin::{Pin, PinEdge};
use super::processor::Processor;
use super::serial::SentByte;
use super::{CYCLES_PER_TICK, TICKS_PER_SECOND};
use armagnac::registers::CoreRegisters;
use std::path::Path;

/// What the core does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It executes instructions.
    Running,
    /// It sleeps until an interrupt.
    Sleeping,
    /// It met a fault in the handler of a fault: here is why. Only a reset ends this.
    Crashed(String),
}

/// A part of the program that hangs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hang {
    /// What runs outside of all handlers; interrupts are still served.
    Main,
    /// The same, and no interrupt is served any more.
    Deaf,
    /// The handler of an exception, by its number; more urgent ones are still served.
    Handler(u8),
}

/// A reset that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Happened {
    /// When.
    pub tick: u64,
    /// Why.
    pub cause: Reset,
}

/// How long an exception waited at worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Latency {
    /// Its number: 16 and above are the chip's interrupts, from 0 on.
    pub exception: u8,
    /// Processor cycles from its cause (a timer's match, the end of a byte, an edge) to the first
    /// instruction of its handler, at worst.
    pub worst: u64,
    /// How often it was served.
    pub served: u64,
}

/// A board with an STM32F405 at 168 MHz.
pub struct F405 {
    chip: Chip,
    processor: Processor,
    image: Image,
    resets: Vec<Happened>,
}

impl F405 {
    /// Flash an image (ELF) and switch the power on, the safety loop closed.
    ///
    /// # Errors
    /// If it cannot be read, or is none for this board.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        Ok(Self::flashed(Image::read(path)?))
    }

    /// The same, of an image in memory.
    #[must_use]
    pub fn flashed(image: Image) -> Self {
        let chip = Chip::new(image.flash.clone());
        let mut board = Self { chip, processor: Processor::default(), image, resets: Vec::new() };
        board.processor.restart(&mut board.chip);
        board.drive(Pin::INTERLOCK, false);
        board
    }

    // ---- time ------------------------------------------------------------------------------

    /// Ticks of the timers since power-on. Resets do not set it back.
    #[must_use]
    pub fn tick(&self) -> u64 {
        self.chip.cycle / CYCLES_PER_TICK
    }

    /// Cycles of the processor since power-on.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.chip.cycle
    }

    /// Whether it runs, sleeps or has crashed.
    #[must_use]
    pub fn state(&self) -> State {
        match &self.processor.crashed {
            Some(reason) => State::Crashed(match self.processor.last_fault {
                Some((fault, at)) => format!("{reason} (before: {fault}, at {at:#010x})"),
                None => reason.clone(),
            }),
            None if self.processor.asleep => State::Sleeping,
            None => State::Running,
        }
    }

    /// Run to a tick, and on to the end of the instruction then executed.
    pub fn run_until(&mut self, tick: u64) -> State {
        let end = tick.saturating_mul(CYCLES_PER_TICK);
        while self.chip.cycle < end {
            self.go(end);
        }
        self.state()
    }

    /// Run for so many ticks.
    pub fn run_for(&mut self, ticks: u64) -> State {
        self.run_until(self.tick().saturating_add(ticks))
    }

    /// Run instruction by instruction while the predicate holds, to a tick at most.
    pub fn run_while(&mut self, limit: u64, mut holds: impl FnMut(&mut Self) -> bool) -> State {
        let end = limit.saturating_mul(CYCLES_PER_TICK);
        while self.chip.cycle < end && holds(self) {
            self.go(end);
        }
        self.state()
    }

    /// One instruction, or the entry of one exception; asleep, to the next event.
    pub fn step(&mut self) -> State {
        self.go(u64::MAX);
        self.state()
    }

    /// One step, to this cycle at most while nothing is executed.
    fn go(&mut self, limit: u64) {
        if self.chip.cycle >= self.chip.next_event {
            self.chip.catch_up();
            if let Some(cause) = self.chip.take_reset() {
                return self.reset(cause);
            }
        }
        let (exceptions, processor) = (&mut self.chip.exceptions, &mut self.processor);
        if processor.crashed.is_none() {
            if let Some(number) = exceptions.next {
                processor.enter(number, &mut self.chip);
                return;
            }
            if !processor.asleep || exceptions.wakes {
                processor.asleep = false;
                return processor.step(&mut self.chip);
            }
        }
        let to = self.chip.next_event.min(limit).max(self.chip.cycle);
        if to < u64::MAX {
            exceptions.slept(to - self.chip.cycle);
            self.chip.cycle = to;
        }
    }

    // ---- serial line -----------------------------------------------------------------------

    /// Queue bytes to the board. They follow each other without a gap, at the rate the program has
    /// set; while its receiver is off they wait.
    pub fn send(&mut self, bytes: &[u8]) {
        self.chip.catch_up();
        self.chip.serial.line.extend(bytes);
        self.chip.serial.listen(self.chip.cycle);
        self.chip.settle();
    }

    /// Bytes from the board since the last call.
    pub fn received(&mut self) -> Vec<u8> {
        self.received_with_ticks().into_iter().map(|byte| byte.value).collect()
    }

    /// The same, with the ticks at which they ended.
    pub fn received_with_ticks(&mut self) -> Vec<SentByte> {
        std::mem::take(&mut self.chip.serial.sent)
    }

    /// Bytes that wait on the line to the board.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.chip.serial.line.len()
    }

    /// Bytes that the board's receiver lost because the program did not fetch them.
    #[must_use]
    pub fn overruns(&self) -> u64 {
        self.chip.serial.overruns
    }

    /// Length of a byte on the line, in ticks, at the rate the program has set.
    #[must_use]
    pub fn ticks_per_byte(&self) -> Option<u64> {
        self.chip.serial.cycles_per_byte().map(|cycles| cycles / CYCLES_PER_TICK)
    }

    // ---- wires -----------------------------------------------------------------------------

    fn change(&mut self, change: impl FnOnce(&mut Chip)) {
        self.chip.catch_up();
        change(&mut self.chip);
        self.chip.settle();
    }

    /// Drive a pin from outside. An output of the board is stronger.
    pub fn drive(&mut self, pin: Pin, level: bool) {
        self.change(|chip| chip.wires.outside(pin, Some(level), chip.cycle));
    }

    /// Drive it no longer.
    pub fn release(&mut self, pin: Pin) {
        self.change(|chip| chip.wires.outside(pin, None, chip.cycle));
    }

    /// Drive a pin at exactly this tick, which must not have passed.
    pub fn drive_at(&mut self, tick: u64, pin: Pin, level: bool) {
        let cycle = tick.saturating_mul(CYCLES_PER_TICK).max(self.chip.cycle);
        self.change(|chip| chip.plan(Planned { cycle, pin, drive: Some(level) }));
    }

    /// A jumper: the wire of `to` follows the wire of `from`.
    pub fn connect(&mut self, from: Pin, to: Pin) {
        self.change(|chip| chip.wires.connect(Some(from), to, chip.cycle));
    }

    /// Take the jumper to `to` off.
    pub fn disconnect(&mut self, to: Pin) {
        self.change(|chip| chip.wires.connect(None, to, chip.cycle));
    }

    /// A fault: the wire, and what the program reads of it, stay at a level whatever drives it.
    pub fn stick(&mut self, pin: Pin, level: bool) {
        self.change(|chip| chip.wires.stick(pin, Some(level), chip.cycle));
    }

    /// The fault is gone.
    pub fn unstick(&mut self, pin: Pin) {
        self.change(|chip| chip.wires.stick(pin, None, chip.cycle));
    }

    /// Level of the wire. One that nothing drives is low, or as the chip's resistor pulls it.
    #[must_use]
    pub fn level(&self, pin: Pin) -> bool {
        self.chip.wires.level(pin)
    }

    /// Whether the chip itself drives the pin, high or low.
    #[must_use]
    pub fn is_driven(&self, pin: Pin) -> bool {
        self.chip.wires.is_driven(pin)
    }

    /// All edges on all wires since power-on or [`Self::forget_edges`]. Those of one pin are in
    /// order. Before the first a wire is low.
    #[must_use]
    pub fn edges(&self) -> &[PinEdge] {
        &self.chip.wires.edges
    }

    /// The edges of one pin.
    pub fn edges_of(&self, pin: Pin) -> impl Iterator<Item = PinEdge> {
        self.edges().iter().copied().filter(move |edge| edge.pin == pin)
    }

    /// Forget the edges up to now.
    pub fn forget_edges(&mut self) {
        self.chip.wires.edges.clear();
    }

    // ---- memory ----------------------------------------------------------------------------

    /// Value of a symbol of the image: an address.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.image.symbol(name)
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// A byte of memory or flash; 0 where there is none.
    #[must_use]
    pub fn peek(&self, address: u32) -> u8 {
        self.chip.peek(address).unwrap_or(0)
    }

    /// Four bytes, low byte first.
    #[must_use]
    pub fn peek_u32(&self, address: u32) -> u32 {
        u32::from_le_bytes([0, 1, 2, 3].map(|at| self.peek(address + at)))
    }

    /// Overwrite a byte of memory or flash as a disturbance would.
    pub fn poke(&mut self, address: u32, value: u8) {
        let _ = self.chip.poke(address, value);
    }

    /// A peripheral's register, read as the program reads it, with the effects of that.
    pub fn register(&mut self, address: u32) -> u32 {
        self.chip.read(address, 4).unwrap_or(0)
    }

    /// Write a peripheral's register, as the program or a disturbance does.
    pub fn set_register(&mut self, address: u32, value: u32) {
        let _ = self.chip.write(address, value, 4);
    }

    /// The core's registers.
    #[must_use]
    pub fn core(&self) -> &CoreRegisters {
        self.processor.registers()
    }

    /// Registers of the floating point unit, as bits.
    #[must_use]
    pub fn singles(&self) -> &[u32; 32] {
        self.processor.singles()
    }

    /// Go on elsewhere. The answer is the address at which the program was.
    pub fn set_pc(&mut self, pc: u32) -> u32 {
        self.processor.asleep = false;
        std::mem::replace(&mut self.processor.registers_mut().pc, pc)
    }

    /// Move the main stack elsewhere.
    pub fn set_stack(&mut self, pointer: u32) {
        self.processor.registers_mut().msp = pointer & !3;
    }

    /// A part of the program hangs from here on: it goes round an endless loop in flash that the
    /// image does not use. A reset ends it. The answer is the address at which it was, for
    /// [`Self::set_pc`].
    ///
    /// # Errors
    /// If that part does not run within a second, or if the image fills the flash.
    pub fn hang(&mut self, what: Hang) -> Result<u32, &'static str> {
        let limit = self.tick() + TICKS_PER_SECOND;
        let _ = self.run_while(limit, |board| !board.is_in(what));
        if self.tick() >= limit {
            return Err("this part of the program does not run");
        }
        let place = self.chip.erased().ok_or("the program fills the flash")?;
        self.poke(place, 0xfe);
        self.poke(place + 1, 0xe7);
        if what == Hang::Deaf {
            self.chip.exceptions.primask = true;
            self.chip.exceptions.masks_changed(self.chip.cycle);
        }
        let _ = self.processor.registers_mut().psr.set_ici_it(0);
        Ok(self.set_pc(place))
    }

    fn is_in(&self, what: Hang) -> bool {
        let exceptions = &self.chip.exceptions;
        let open = !exceptions.primask && exceptions.basepri == 0;
        let running = self.core().psr.ipsr();
        match what {
            Hang::Main => running == 0 && open,
            Hang::Deaf => running == 0,
            Hang::Handler(number) => running == u32::from(number) && open,
        }
    }

    /// Reset. Memory is kept except at power-on; pins become inputs.
    pub fn reset(&mut self, cause: Reset) {
        self.resets.push(Happened { tick: self.tick(), cause });
        self.chip.restart(cause);
        self.processor.restart(&mut self.chip);
    }

    /// Resets since power-on, those of the watchdog with them.
    #[must_use]
    pub fn resets(&self) -> &[Happened] {
        &self.resets
    }

    // ---- what the board is like --------------------------------------------------------------

    /// How many cycles an instruction takes: 1 unless told otherwise.
    pub fn set_cycles_per_instruction(&mut self, cycles: u64) {
        self.processor.cycles_per_instruction = cycles.max(1);
    }

    /// The watchdog's clock, over its nominal 32 kHz; the data sheet gives 0.53 to 1.47. It counts
    /// from the next time the watchdog is fed.
    pub fn set_watchdog_tolerance(&mut self, factor: f64) {
        self.chip.watchdog.tolerance = factor;
    }

    /// What the chip says it is: DBGMCU_IDCODE.
    pub fn set_identity(&mut self, identity: u32) {
        self.chip.identity = identity;
    }

    /// A fault: the crystal does not start.
    pub fn break_crystal(&mut self) {
        self.chip.clocks.crystal_broken = true;
    }

    // ---- figures ---------------------------------------------------------------------------

    /// Instructions carried out since power-on.
    #[must_use]
    pub fn instructions(&self) -> u64 {
        self.processor.instructions
    }

    /// Longest time for which PRIMASK, FAULTMASK or BASEPRI held interrupts back, in processor
    /// cycles; time asleep does not count.
    #[must_use]
    pub fn longest_masked(&self) -> u64 {
        self.chip.exceptions.longest_masked
    }

    /// How long each exception that was served had to wait at worst.
    #[must_use]
    pub fn max_interrupt_latency(&self) -> Vec<Latency> {
        let waited = (0..COUNT as u8).zip(self.chip.exceptions.waited);
        let told = |(exception, waited): (u8, Waited)| Latency {
            exception,
            worst: waited.worst,
            served: waited.served,
        };
        waited.map(told).filter(|latency| latency.served > 0).collect()
    }

    /// Measure latencies and masked time anew, as after start-up.
    pub fn forget_latency(&mut self) {
        self.chip.exceptions.waited = [Waited::default(); COUNT];
        self.chip.exceptions.longest_masked = 0;
    }

    /// Lowest main stack pointer since power-on; memory begins at 0x20000000.
    #[must_use]
    pub fn stack_low_water(&self) -> u32 {
        self.processor.stack_low.max(RAM_START)
    }

    /// Registers that were accessed and are not modelled, or have no clock, with their addresses.
    pub fn unknown_registers(&self) -> impl Iterator<Item = (u32, Unknown)> {
        self.chip.unknown.iter().map(|(&address, &unknown)| (address, unknown))
    }
}
