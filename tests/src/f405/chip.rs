//! The chip around the processor: memory, peripherals, and what happens when.

use super::clocks::{Clocks, Reset};
use super::exceptions::{Exceptions, SYS_TICK};
use super::external::External;
use super::fault::Fault;
use super::pin::Pin;
use super::ports::{Port, Use};
use super::serial::Serial;
use super::system_registers::SystemRegisters;
use super::systick::SysTick;
use super::timer::{Change, Timer};
use super::watchdog::Watchdog;
use super::wires::Wires;
use super::{CYCLES_PER_TICK, IDENTITY};
use std::collections::{BTreeMap, VecDeque};

/// Where the flash begins.
pub const FLASH_START: u32 = 0x0800_0000;
/// Size of the flash.
pub const FLASH_SIZE: usize = 0x10_0000;
/// Where the memory begins.
pub const RAM_START: u32 = 0x2000_0000;
/// Size of the memory.
pub const RAM_SIZE: usize = 0x2_0000;
/// Size of the memory that only the processor reaches.
const CCM_SIZE: usize = 0x1_0000;

/// Interrupt numbers, as exceptions.
const TIMER_2: u8 = 16 + 28;
const TIMER_3: u8 = 16 + 29;
const SERIAL_6: u8 = 16 + 71;
const EXTERNAL: [(u8, std::ops::RangeInclusive<usize>); 7] = [
    (16 + 6, 0..=0),
    (16 + 7, 1..=1),
    (16 + 8, 2..=2),
    (16 + 9, 3..=3),
    (16 + 10, 4..=4),
    (16 + 23, 5..=9),
    (16 + 40, 10..=15),
];

/// Accesses to a register that is not modelled, or has no clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unknown {
    /// How often it was read.
    pub reads: u64,
    /// How often it was written.
    pub writes: u64,
    /// What was written last.
    pub written: u32,
}

/// A change of what drives a pin from outside, later.
pub struct Planned {
    pub cycle: u64,
    pub pin: Pin,
    pub drive: Option<bool>,
}

/// Everything but the processor.
pub struct Chip {
    /// Cycles of the processor since power-on.
    pub cycle: u64,
    /// The next cycle at which a peripheral does something by itself.
    pub next_event: u64,
    pub flash: Vec<u8>,
    pub ram: Vec<u8>,
    pub ccm: Vec<u8>,
    pub exceptions: Exceptions,
    pub system: SystemRegisters,
    pub systick: SysTick,
    pub clocks: Clocks,
    ports: [Port; 4],
    pub wires: Wires,
    timer_2: Timer,
    timer_3: Timer,
    pub serial: Serial,
    external: External,
    pub watchdog: Watchdog,
    /// Flash interface and power control: memory, as far as a program can tell.
    plain: BTreeMap<u32, u32>,
    pub unknown: BTreeMap<u32, Unknown>,
    /// DBGMCU_IDCODE.
    pub identity: u32,
    /// In the order of time.
    planned: VecDeque<Planned>,
    reset: Option<Reset>,
}

impl Chip {
    pub fn new(flash: Vec<u8>) -> Self {
        let mut chip = Self {
            cycle: 0,
            next_event: u64::MAX,
            flash,
            ram: pattern(RAM_SIZE),
            ccm: pattern(CCM_SIZE),
            exceptions: Exceptions::default(),
            system: SystemRegisters::default(),
            systick: SysTick::default(),
            clocks: Clocks::default(),
            ports: [0, 1, 2, 3].map(Port::new),
            wires: Wires::default(),
            timer_2: Timer::new(u32::MAX),
            timer_3: Timer::new(0xffff),
            serial: Serial::default(),
            external: External::default(),
            watchdog: Watchdog::default(),
            plain: BTreeMap::new(),
            unknown: BTreeMap::new(),
            identity: IDENTITY,
            planned: VecDeque::new(),
            reset: None,
        };
        chip.clocks.reset(Reset::PowerOn);
        chip
    }

    /// Reset all but memory, clock, wires and figures.
    pub fn restart(&mut self, cause: Reset) {
        if cause == Reset::PowerOn {
            (self.ram, self.ccm) = (pattern(RAM_SIZE), pattern(CCM_SIZE));
        }
        self.exceptions.reset();
        self.system = SystemRegisters::default();
        self.systick = SysTick::default();
        self.clocks.reset(cause);
        self.ports = [0, 1, 2, 3].map(Port::new);
        self.timer_2 = Timer::new(u32::MAX);
        self.timer_3 = Timer::new(0xffff);
        self.serial.reset();
        self.external = External::default();
        self.watchdog.reset();
        self.plain.clear();
        self.reset = None;
        for port in 0..4 {
            self.refresh_port(port, self.cycle);
        }
        self.settle();
    }

    /// Change what drives a pin later.
    pub fn plan(&mut self, planned: Planned) {
        let place = self.planned.partition_point(|other| other.cycle <= planned.cycle);
        self.planned.insert(place, planned);
    }

    pub fn ask_reset(&mut self, cause: Reset) {
        self.reset = self.reset.or(Some(cause));
    }

    /// A reset that was asked for.
    pub fn take_reset(&mut self) -> Option<Reset> {
        self.reset.take()
    }

    // ---- time ------------------------------------------------------------------------------

    fn tick(&self) -> u64 {
        self.cycle / CYCLES_PER_TICK
    }

    /// Let the peripherals do what is due, in the order of time.
    pub fn catch_up(&mut self) {
        while let Some(at) = self.first_event().filter(|&at| at <= self.cycle) {
            self.happen(at);
        }
        self.settle();
    }

    fn catch_up_if_due(&mut self) {
        if self.next_event <= self.cycle {
            self.catch_up();
        }
    }

    fn first_event(&self) -> Option<u64> {
        let timers = [self.timer_2.next(), self.timer_3.next()];
        let timers = timers.map(|tick| tick.map(|tick| tick * CYCLES_PER_TICK));
        let planned = self.planned.front().map(|planned| planned.cycle);
        let others = [self.serial.next(), self.systick.next(), self.watchdog.due, planned];
        timers.into_iter().chain(others).flatten().min()
    }

    /// Everything that is due at this cycle.
    fn happen(&mut self, at: u64) {
        let tick = at / CYCLES_PER_TICK;
        while let Some(planned) = self.planned.pop_front_if(|planned| planned.cycle <= at) {
            let Planned { pin, drive, .. } = planned;
            self.wires.outside(pin, drive, at);
            self.see_edges();
        }
        self.timer_2.advance(tick);
        self.follow_timers();
        self.timer_3.advance(tick);
        self.follow_timers();
        self.serial.advance(at);
        if let Some(asked) = self.systick.advance(at) {
            self.exceptions.pend(SYS_TICK, asked);
        }
        if self.watchdog.due.is_some_and(|due| due <= at) {
            self.watchdog.due = None;
            self.ask_reset(Reset::Watchdog);
        }
        self.see_edges();
    }

    /// After anything has changed: the interrupts requested, and when to look again.
    pub fn settle(&mut self) {
        self.follow_timers();
        self.see_edges();
        for (number, timer) in [(TIMER_2, &self.timer_2), (TIMER_3, &self.timer_3)] {
            let since = timer.request().map(|tick| tick * CYCLES_PER_TICK);
            self.exceptions.set_line(number, since);
        }
        self.exceptions.set_line(SERIAL_6, self.serial.request());
        for (number, lines) in EXTERNAL {
            self.exceptions.set_line(number, self.external.request(lines));
        }
        let reset = self.reset.map(|_| self.cycle);
        self.next_event = reset.or(self.first_event()).unwrap_or(u64::MAX);
    }

    // ---- pins ------------------------------------------------------------------------------

    /// What the timers have changed: pins, and the slave's gate.
    fn follow_timers(&mut self) {
        for (change, tick) in std::mem::take(&mut self.timer_2.changes) {
            match change {
                Change::Output(channel) => {
                    self.refresh_pin(Pin::new(0, channel as u8), tick * CYCLES_PER_TICK);
                }
                Change::Trigger(level) => {
                    // TIM3 hears TIM2 as ITR1.
                    if self.timer_3.trigger_source() == 1 {
                        self.timer_3.triggered(level, tick);
                    }
                }
            }
        }
        for (change, tick) in std::mem::take(&mut self.timer_3.changes) {
            if change == Change::Output(0) {
                self.refresh_pin(Pin::FRAMES, tick * CYCLES_PER_TICK);
            }
        }
    }

    /// Show edges to the inputs that listen.
    fn see_edges(&mut self) {
        while let Some((pin, high, cycle)) = self.wires.take_unseen() {
            self.external.edge(pin.port(), pin.number(), high, cycle);
            let channel = usize::from(pin.number());
            if pin.port() == 0 && channel < 4 && self.usage(pin) == Use::Peripheral(1) {
                self.timer_2.input(channel, high, cycle / CYCLES_PER_TICK);
            }
        }
    }

    fn usage(&self, pin: Pin) -> Use {
        self.ports[pin.port()].usage(pin.number())
    }

    fn refresh_port(&mut self, port: u8, cycle: u64) {
        for number in 0..16 {
            self.refresh_pin(Pin::new(port, number), cycle);
        }
        let serial = |number| self.usage(Pin::new(2, number)) == Use::Peripheral(8);
        self.serial.wired = [6, 7].map(serial);
        self.serial.listen(self.cycle);
    }

    fn refresh_pin(&mut self, pin: Pin, cycle: u64) {
        let port = &self.ports[pin.port()];
        let drive = match port.usage(pin.number()) {
            Use::Output(level) => Some(level),
            Use::Peripheral(function) => self.peripheral(pin, function),
            Use::Input | Use::Analog => None,
        };
        let drive = drive.filter(|&level| !(level && port.open_drain(pin.number())));
        let pull = port.pull(pin.number()).filter(|_| port.usage(pin.number()) != Use::Analog);
        self.wires.chip(pin, drive, pull, cycle);
    }

    /// What a peripheral does to a pin. The serial line counts as idle: bytes are told otherwise.
    fn peripheral(&self, pin: Pin, function: u32) -> Option<bool> {
        match (pin.port(), pin.number(), function) {
            (0, channel @ 0..=3, 1) => self.timer_2.output(channel.into()),
            (0, 6, 2) => self.timer_3.output(0),
            (2, 6, 8) => Some(true),
            _ => None,
        }
    }

    // ---- peripherals' registers -------------------------------------------------------------

    /// Read a word of the peripherals' registers.
    pub(super) fn read_register(&mut self, address: u32) -> u32 {
        let (base, offset) = (address & !0x3ff, address & 0x3ff);
        if !self.clocks.feeds(base) {
            return self.note_read(address);
        }
        self.catch_up_if_due();
        let tick = self.tick();
        let value = match base {
            0x4000_0000 => {
                self.timer_2.advance(tick);
                self.timer_2.read(offset)
            }
            0x4000_0400 => {
                self.timer_3.advance(tick);
                self.timer_3.read(offset)
            }
            0x4000_3000 => self.watchdog.read(offset),
            0x4000_7000 | 0x4002_3c00 => Some(self.read_plain(address)),
            0x4001_1400 => self.serial.read(offset),
            0x4001_3800 => self.external.read_select(offset),
            0x4001_3c00 => self.external.read(offset),
            0x4002_0000..=0x4002_0c00 => self.read_port((base >> 10 & 3) as u8, offset),
            0x4002_3800 => self.clocks.read(offset),
            _ => None,
        };
        self.settle();
        value.unwrap_or_else(|| self.note_read(address))
    }

    /// Write a word of the peripherals' registers.
    pub(super) fn write_register(&mut self, address: u32, value: u32) {
        let (base, offset) = (address & !0x3ff, address & 0x3ff);
        if !self.clocks.feeds(base) {
            return self.note_write(address, value);
        }
        self.catch_up_if_due();
        let (tick, cycle) = (self.tick(), self.cycle);
        let known = match base {
            0x4000_0000 => {
                self.timer_2.advance(tick);
                self.timer_2.write(offset, value, tick).filter(|()| !self.timer_2.beyond())
            }
            0x4000_0400 => self.write_timer_3(offset, value),
            0x4000_3000 => self.watchdog.write(offset, value, cycle),
            0x4000_7000 | 0x4002_3c00 => {
                self.plain.insert(address, value).map_or(Some(()), |_| Some(()))
            }
            0x4001_1400 => {
                self.serial.write(offset, value, cycle).filter(|()| !self.serial.beyond())
            }
            0x4001_3800 => self.external.write_select(offset, value),
            0x4001_3c00 => self.external.write(offset, value, cycle),
            0x4002_0000..=0x4002_0c00 => {
                let port = (base >> 10 & 3) as u8;
                let known = self.ports[usize::from(port)].write(offset, value);
                self.refresh_port(port, cycle);
                known
            }
            0x4002_3800 => self.clocks.write(offset, value),
            _ => None,
        };
        self.settle();
        if known.is_none() {
            self.note_write(address, value);
        }
    }

    fn write_timer_3(&mut self, offset: u32, value: u32) -> Option<()> {
        let tick = self.tick();
        self.timer_3.advance(tick);
        self.timer_3.write(offset, value, tick)?;
        if offset == 0x08 {
            let level = self.timer_3.trigger_source() == 1 && self.timer_2.trigger_level();
            self.timer_3.triggered(level, tick);
        }
        (!self.timer_3.beyond()).then_some(())
    }

    fn read_port(&self, port: u8, offset: u32) -> Option<u32> {
        if offset != 0x10 {
            return self.ports[usize::from(port)].read(offset);
        }
        let pins = (0..16).map(|number| Pin::new(port, number));
        let high = |pin: &Pin| self.usage(*pin) != Use::Analog && self.wires.level(*pin);
        Some(pins.filter(high).fold(0, |levels, pin| levels | 1 << pin.number()))
    }

    fn read_plain(&self, address: u32) -> u32 {
        let value = self.plain.get(&address).copied();
        match address {
            // The regulator is always ready.
            0x4000_7000 => value.unwrap_or(0xc000),
            0x4000_7004 => value.unwrap_or(0) | 1 << 14,
            0x4002_3c14 => value.unwrap_or(0x0fff_aaed),
            _ => value.unwrap_or(0),
        }
    }

    pub(super) fn note_read(&mut self, address: u32) -> u32 {
        self.unknown.entry(address).or_default().reads += 1;
        0
    }

    pub(super) fn note_write(&mut self, address: u32, value: u32) {
        let unknown = self.unknown.entry(address).or_default();
        unknown.writes += 1;
        unknown.written = value;
    }
}

/// What memory holds when power comes on.
fn pattern(size: usize) -> Vec<u8> {
    vec![0xa5; size]
}

impl Chip {
    /// The two halfwords of an instruction, the first in the upper half.
    pub fn fetch(&self, address: u32) -> Result<u32, Fault> {
        let code = |memory: &[u8], at: usize| {
            let bytes = memory.get(at..at + 4)?;
            let word = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            Some(word.rotate_left(16))
        };
        let found = match address {
            0x0800_0000..0x0810_0000 => code(&self.flash, (address - FLASH_START) as usize),
            0x2000_0000..0x2002_0000 => code(&self.ram, (address - RAM_START) as usize),
            0..0x10_0000 => code(&self.flash, address as usize),
            _ => None,
        };
        found.ok_or(Fault::NoCode(address))
    }
}
