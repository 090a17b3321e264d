//! The board.

use super::image::{Image, ImageError};
use super::pin::{Pin, PinEdge};
use super::simavr::Core;
use super::vector::{Latency, Vector};
use std::path::Path;

/// How far [`Uno::flood`] and its like look ahead, in cycles.
const SLICE: u64 = 16_384;

/// Cause of a reset, as MCUSR keeps it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Reset {
    /// Power came on; memory holds a pattern.
    PowerOn = 1,
    /// The reset pin, as when a serial port is opened.
    External = 2,
    /// The supply was too low for a moment.
    BrownOut = 4,
}

/// What the core does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It executes instructions.
    Running,
    /// It sleeps until an interrupt.
    Sleeping,
    /// It met something it cannot execute: here is why.
    Crashed(String),
}

/// A byte from the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SentByte {
    /// The cycle at which its stop bit ended.
    pub cycle: u64,
    /// The byte.
    pub value: u8,
}

/// An Arduino Uno: ATmega328P at 16 MHz.
pub struct Uno {
    core: Core,
    image: Image,
    edges: Vec<PinEdge>,
    sent: Vec<SentByte>,
}

impl Uno {
    /// Flash an image (ELF or Intel HEX) and switch the power on.
    ///
    /// # Errors
    /// If it cannot be read, or is none for this board.
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        Self::flashed(Image::read(path)?)
    }

    /// The same, of an image in memory.
    ///
    /// # Errors
    /// If simavr does not know the processor.
    pub fn flashed(image: Image) -> Result<Self, ImageError> {
        let unknown = ImageError::Malformed("simavr does not know the ATmega328P");
        let core = Core::new(&image.flash).ok_or(unknown)?;
        Ok(Self { core, image, edges: Vec::new(), sent: Vec::new() })
    }

    // ---- time ------------------------------------------------------------------------------

    /// Cycles since power-on. Resets do not set it back.
    #[must_use]
    pub fn cycle(&self) -> u64 {
        self.core.cycle()
    }

    /// Whether it runs, sleeps or has crashed.
    #[must_use]
    pub fn state(&self) -> State {
        if !self.core.alive() {
            State::Crashed(self.core.message())
        } else if self.core.asleep() {
            State::Sleeping
        } else {
            State::Running
        }
    }

    /// Run to a cycle, and on to the end of the instruction then executed; or until it crashes.
    pub fn run_until(&mut self, cycle: u64) -> State {
        let _ = self.core.run(cycle);
        self.collect();
        self.state()
    }

    /// Run for so many cycles.
    pub fn run_for(&mut self, cycles: u64) -> State {
        self.run_until(self.cycle().saturating_add(cycles))
    }

    /// Run instruction by instruction while the predicate holds, to a cycle at most. Slow: some
    /// million instructions per second.
    pub fn run_while(&mut self, limit: u64, mut holds: impl FnMut(&mut Self) -> bool) -> State {
        while self.cycle() < limit && holds(self) && self.core.step() {
            self.collect();
        }
        self.state()
    }

    /// One instruction, or the entry of one interrupt.
    pub fn step(&mut self) -> State {
        let _ = self.core.step();
        self.collect();
        self.state()
    }

    fn collect(&mut self) {
        self.core.take_edges(&mut self.edges);
        let sent = self.core.take_sent().into_iter();
        self.sent.extend(sent.map(|(cycle, value)| SentByte { cycle, value }));
    }

    // ---- serial line -----------------------------------------------------------------------

    /// Queue bytes to the board. They follow each other without a gap, at the rate the program has
    /// set; while its receiver is off they wait.
    pub fn send(&mut self, bytes: &[u8]) {
        self.core.send(bytes);
    }

    /// Run to a cycle with the line to the board never idle.
    pub fn flood(&mut self, until: u64, mut byte: impl FnMut() -> u8) -> State {
        while self.cycle() < until && self.core.alive() {
            let wanted =
                usize::try_from(SLICE / self.core.cycles_per_byte().max(1)).unwrap_or(0) + 2;
            let missing = wanted.saturating_sub(self.core.unsent());
            let bytes: Vec<u8> = (0..missing).map(|_| byte()).collect();
            self.core.send(&bytes);
            let _ = self.run_until(until.min(self.cycle() + SLICE));
        }
        self.state()
    }

    /// Bytes from the board since the last call.
    pub fn received(&mut self) -> Vec<u8> {
        self.received_with_cycles().into_iter().map(|byte| byte.value).collect()
    }

    /// The same, with the cycles at which they ended.
    pub fn received_with_cycles(&mut self) -> Vec<SentByte> {
        std::mem::take(&mut self.sent)
    }

    /// Bytes that wait on the line to the board.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.core.unsent()
    }

    /// Bytes that the board's receiver lost because the program did not fetch them.
    #[must_use]
    pub fn overruns(&self) -> u64 {
        self.core.overruns()
    }

    /// Length of a byte on the line, in cycles, at the rate the program has set.
    #[must_use]
    pub fn cycles_per_byte(&self) -> u64 {
        self.core.cycles_per_byte()
    }

    // ---- wires -----------------------------------------------------------------------------

    /// Drive a pin from outside. An output of the board is stronger.
    pub fn drive(&mut self, pin: Pin, level: bool) {
        self.core.drive(pin, Some(level));
        self.collect();
    }

    /// Drive it no longer.
    pub fn release(&mut self, pin: Pin) {
        self.core.drive(pin, None);
        self.collect();
    }

    /// Drive a pin at exactly this cycle, which must not have passed.
    pub fn drive_at(&mut self, cycle: u64, pin: Pin, level: bool) {
        self.core.drive_at(cycle.max(self.cycle()), pin, Some(level));
    }

    /// A jumper: the wire of `to` follows the wire of `from`.
    pub fn connect(&mut self, from: Pin, to: Pin) {
        self.core.connect(Some(from), to);
        self.collect();
    }

    /// Take the jumper to `to` off.
    pub fn disconnect(&mut self, to: Pin) {
        self.core.connect(None, to);
        self.collect();
    }

    /// A fault: the wire, and what the program reads of it, stay at a level whatever the port does.
    pub fn stick(&mut self, pin: Pin, level: bool) {
        self.core.stick(pin, Some(level));
        self.collect();
    }

    /// The fault is gone.
    pub fn unstick(&mut self, pin: Pin) {
        self.core.stick(pin, None);
        self.collect();
    }

    /// Level of the wire. One that nothing drives is low, or high by the board's pull-up.
    #[must_use]
    pub fn level(&self, pin: Pin) -> bool {
        self.core.level(pin)
    }

    /// All edges on all wires since power-on or [`Self::forget_edges`], in order. Before the first
    /// a wire is low.
    #[must_use]
    pub fn edges(&self) -> &[PinEdge] {
        &self.edges
    }

    /// The edges of one pin.
    pub fn edges_of(&self, pin: Pin) -> impl Iterator<Item = PinEdge> {
        self.edges.iter().copied().filter(move |edge| edge.pin == pin)
    }

    /// Forget the edges up to now.
    pub fn forget_edges(&mut self) {
        self.edges.clear();
    }

    // ---- memory ----------------------------------------------------------------------------

    /// Value of a symbol of the image; for a variable, its address in memory.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.image.symbol(name)
    }

    /// The image.
    #[must_use]
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// A byte by its data address: registers below 0x20, I/O registers below 0x100, then memory.
    /// Reading it this way has no effect on the board.
    pub fn peek(&mut self, address: u16) -> u8 {
        self.core.peek(address)
    }

    /// Two bytes, low byte first.
    pub fn peek_u16(&mut self, address: u16) -> u16 {
        u16::from_le_bytes([self.peek(address), self.peek(address + 1)])
    }

    /// Four bytes, low byte first.
    pub fn peek_u32(&mut self, address: u16) -> u32 {
        u32::from(self.peek_u16(address)) | u32::from(self.peek_u16(address + 2)) << 16
    }

    /// Overwrite a byte as a disturbance would, without the effects of a program's write.
    pub fn poke(&mut self, address: u16, value: u8) {
        self.core.poke(address, value);
        self.collect();
    }

    /// Program counter, in bytes.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.core.pc()
    }

    /// Go on elsewhere.
    pub fn set_pc(&mut self, pc: u32) {
        self.core.set_pc(pc);
    }

    /// The main program hangs from here on: it goes round an endless loop in flash that the image
    /// does not use. Interrupts are still served, or with `deaf` not even those. A reset ends it.
    /// The answer is the address at which the main program was, for [`Self::set_pc`].
    ///
    /// # Errors
    /// If the program does not come out of its interrupts within a second, or fills the flash.
    pub fn hang(&mut self, deaf: bool) -> Result<u32, &'static str> {
        let limit = self.cycle() + super::CLOCK;
        let inside = |uno: &mut Self| uno.core.depth() > 0 || !(deaf || uno.core.interrupts_on());
        let _ = self.run_while(limit, inside);
        if self.cycle() >= limit {
            return Err("the program does not come out of its interrupts");
        }
        let place = self.endless_loop().ok_or("the program fills the flash")?;
        let before = self.pc();
        self.set_pc(place);
        if deaf {
            self.core.set_interrupts(false);
        }
        Ok(before)
    }

    /// Address of an endless loop, which is written to the last erased word of the flash.
    fn endless_loop(&mut self) -> Option<u32> {
        const LOOP: [u8; 2] = [0xff, 0xcf];
        let word = |at: u32| [self.core.flash(at), self.core.flash(at + 1)];
        let free = |at: &u32| word(*at) == LOOP || word(*at) == [0xff, 0xff];
        let place = (0..0x7ffe).step_by(2).rev().find(free)?;
        self.core.set_flash(place, LOOP[0]);
        self.core.set_flash(place + 1, LOOP[1]);
        Some(place)
    }

    /// Reset. Memory is kept except at power-on; pins become inputs.
    pub fn reset(&mut self, cause: Reset) {
        self.core.reset(cause as u8);
        self.collect();
    }

    /// Resets since power-on, those of the watchdog with them.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.core.resets()
    }

    /// The watchdog's clock, 128 kHz until set; the data sheet shows it to vary by ±10 %.
    pub fn set_watchdog_hz(&mut self, hz: f64) {
        self.core.set_watchdog_hz(hz);
    }

    // ---- figures ---------------------------------------------------------------------------

    /// How long each interrupt that was served had to wait at worst.
    #[must_use]
    pub fn max_interrupt_latency(&self) -> Vec<Latency> {
        let of = |vector| Latency {
            vector,
            worst: self.core.latency(vector),
            served: self.core.entries(vector),
        };
        Vector::ALL.into_iter().map(of).filter(|latency| latency.served > 0).collect()
    }

    /// Measure latencies anew, as after start-up.
    pub fn forget_latency(&mut self) {
        self.core.forget_latency();
    }

    /// Lowest stack pointer since power-on; the last byte of memory is 0x8FF.
    #[must_use]
    pub fn stack_low_water(&self) -> u16 {
        self.core.stack_low()
    }
}
