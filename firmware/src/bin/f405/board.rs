//! The STM32F405 as a pass sees it.

use crate::chip::{self, Chip};
use crate::near::{NEAR, Near};
use crate::pins::{self, Enable, Interlock, LoopEnd, PhaseLine, Ready};
use crate::registers::{change, exti, set};
use crate::{memory, serial, solver, timers};
use embedded_hal::digital::{InputPin, OutputPin};
use heapless::Deque;
use phasewalk_core::online::{LAGS, SPECKLES};
use phasewalk_firmware::arming::{DEPTH, NearEdge};
use phasewalk_firmware::board::{Board, Identity, Inputs, Life, Line, Offer, Outputs, Solve};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Estimate, Model};

/// How long a test pulse of the safety loop is held, 10 us: its wires may be metres long.
const LOOP_CYCLES: u32 = chip::PROCESSOR_HZ / 100_000;

/// Edges that were taken and not told of: the near ones, and as many made since the last pass.
const TAKEN: usize = 2 * DEPTH;

/// The board.
pub struct Stm32 {
    identity: Identity,
    enabled: bool,
    /// Of each channel, the edges that were taken and not told of.
    taken: [Deque<Edge, TAKEN>; Channel::ALL.len()],
    /// Of each channel, how many made edges were told, wrapping.
    told: [u8; Channel::ALL.len()],
}

impl Stm32 {
    /// Everything set up, interrupts still off.
    pub fn start(chip: Chip) -> Self {
        const { assert!(Self::LIMITS.speckles as usize == SPECKLES) };
        const { assert!(Self::LIMITS.lags as usize == LAGS) };
        // Some milliseconds; before the clock starts, whose passes would be missed.
        let identity = Identity {
            model: if chip.real { Model::F405 } else { Model::Rehearsal },
            build: BUILD,
            image: memory::image_hash(),
            image_bytes: memory::image_bytes(),
            reset: chip.reset,
        };
        timers::start(chip.prescaler());
        defmt::info!(
            "Phasewalk's trigger board: NOT WITH A SUBJECT (its timing was never measured)"
        );
        defmt::info!("build {=u32:08x}, image {=u32:08x}", identity.build, identity.image);
        pins::start(chip.real);
        if chip.real {
            NEAR.with(Near::connect);
        } else {
            defmt::warn!("this is no STM32F405: outputs stay disconnected");
        }
        serial::start();
        let taken = [Deque::new(), Deque::new(), Deque::new()];
        Self { identity, enabled: false, taken, told: [0; 3] }
    }
}

/// Hash of the firmware's sources, from the build.
const BUILD: u32 = match option_env!("PHASEWALK_BUILD") {
    Some(text) => match u32::from_str_radix(text, 16) {
        Ok(hash) => hash,
        Err(_) => panic!("PHASEWALK_BUILD must be a hexadecimal number"),
    },
    None => 0,
};

/// A tick of the last wrap, from its low bits.
fn recent(tick: u32) -> u64 {
    let now = NEAR.with(Near::now);
    now.wrapping_sub((now as u32).wrapping_sub(tick).into())
}

impl Outputs for Stm32 {
    fn now(&mut self) -> u64 {
        NEAR.with(Near::now)
    }

    fn offer(&mut self, edge: Edge) -> Offer {
        let limits = Self::LIMITS;
        let left = edge.tick.saturating_sub(self.now());
        if left < limits.lead.into() {
            return Offer::Late;
        }
        if left > limits.reach.into() {
            return Offer::Later;
        }
        let Some(taken) = self.taken.get_mut(edge.channel.index()) else { return Offer::Late };
        // If it has become late by now, arming finds out.
        let near_edge = NearEdge { tick: edge.tick as u32, high: edge.high };
        if taken.is_full() || !NEAR.with(|near| near.put(edge.channel, near_edge)) {
            return Offer::Later;
        }
        defmt::debug!("offer {=u8} {=bool} {=u64}", edge.channel as u8, edge.high, edge.tick);
        let _ = taken.push_back(edge);
        Offer::Taken
    }

    fn made(&mut self) -> Option<Edge> {
        NEAR.with(Near::missed_matches);
        for channel in Channel::ALL {
            let told = self.told.get_mut(channel.index())?;
            if *told != NEAR.with(|near| near.made(channel)) {
                *told = told.wrapping_add(1);
                let edge = self.taken.get_mut(channel.index())?.pop_front()?;
                defmt::debug!("made {=u8} {=bool} {=u64}", channel as u8, edge.high, edge.tick);
                return Some(edge);
            }
        }
        None
    }

    fn exposed(&mut self) -> Option<u64> {
        NEAR.with(Near::exposed).map(recent)
    }

    fn all_low(&mut self) {
        defmt::debug!("all low");
        NEAR.with(Near::all_low);
        for channel in Channel::ALL {
            self.forget(channel);
        }
        self.rest_enable();
    }

    fn stimulus_low(&mut self) {
        defmt::debug!("stimulus low");
        let channel = Channel::Stimulus;
        let made = NEAR.with(|near| {
            near.low(channel);
            near.made(channel)
        });
        let index = channel.index();
        if let (Some(taken), Some(told)) = (self.taken.get_mut(index), self.told.get(index)) {
            taken.truncate(made.wrapping_sub(*told).into());
        }
    }

    fn frame_clock(&mut self, period: u32) {
        timers::frame_clock(period);
    }

    fn read_back(&mut self) -> bool {
        NEAR.with(|near| near.read_back())
    }

    fn latched(&mut self) -> Option<Fault> {
        NEAR.with(|near| near.fault())
    }

    fn interrupts(&mut self) -> u16 {
        NEAR.with(|near| near.passes)
    }
}

impl Stm32 {
    /// Nothing is expected of an output any more.
    fn forget(&mut self, channel: Channel) {
        let index = channel.index();
        if let (Some(taken), Some(told)) = (self.taken.get_mut(index), self.told.get_mut(index)) {
            taken.clear();
            *told = NEAR.with(|near| near.made(channel));
        }
    }

    /// An external interrupt on or off; what it has seen before is forgotten.
    fn await_interrupt(line: u32, on: bool) {
        NEAR.with(|_| {
            set!(exti().pr(), line);
            change!(exti().imr(), line, if on { line } else { 0 });
        });
    }
}

impl Inputs for Stm32 {
    fn interlock_closed(&mut self) -> bool {
        Interlock {}.is_low().unwrap_or(false)
    }

    fn interlock_passes_pulse(&mut self) -> bool {
        let guarded = exti().imr().read().bits() & pins::INTERLOCK != 0;
        Self::await_interrupt(pins::INTERLOCK, false);
        let _ = LoopEnd {}.set_high();
        cortex_m::asm::delay(LOOP_CYCLES);
        let passed = !self.interlock_closed();
        let _ = LoopEnd {}.set_low();
        cortex_m::asm::delay(LOOP_CYCLES);
        let closed = self.interlock_closed();
        Self::await_interrupt(pins::INTERLOCK, guarded);
        passed && closed
    }

    fn guard_interlock(&mut self, on: bool) {
        Self::await_interrupt(pins::INTERLOCK, on);
    }

    fn camera_ready(&mut self) -> bool {
        Ready {}.is_high().unwrap_or(false)
    }

    fn await_start(&mut self, on: bool) {
        Self::await_interrupt(pins::START, on);
    }

    fn start_edge(&mut self) -> Option<u64> {
        NEAR.with(|near| near.start.take())
    }
}

impl Line for Stm32 {
    fn read(&mut self) -> Option<u8> {
        serial::read()
    }

    fn write(&mut self, byte: u8) -> bool {
        serial::write(byte)
    }

    fn overrun(&mut self) -> u16 {
        serial::overrun()
    }
}

impl Life for Stm32 {
    fn feed_watchdog(&mut self) {
        chip::feed_watchdog();
    }

    fn toggle_enable(&mut self) {
        self.enabled = !self.enabled;
        let _ = if self.enabled { Enable {}.set_high() } else { Enable {}.set_low() };
    }

    fn rest_enable(&mut self) {
        self.enabled = false;
        let _ = Enable {}.set_low();
    }

    fn stack_intact(&mut self) -> bool {
        memory::stack_intact()
    }
}

impl Solve for Stm32 {
    fn begin_series(&mut self, speckles: u16, looks: u32) -> bool {
        solver::begin(speckles, f32::from_bits(looks))
    }

    fn samples(&mut self, first: u16, bytes: &[u8]) -> bool {
        solver::samples(first, bytes)
    }

    fn solved(&mut self) -> Option<Estimate> {
        solver::solved()
    }

    fn phase_line(&mut self, high: bool) {
        let _ = if high { PhaseLine {}.set_high() } else { PhaseLine {}.set_low() };
    }
}

impl Board for Stm32 {
    const LIMITS: Limits = Limits::F405;

    fn identity(&mut self) -> Identity {
        self.identity
    }
}
