//! The Uno as the main loop sees it.

use crate::memory;
use crate::near::{NEAR, Near};
use crate::pins::{Enable, Interlock, LoopEnd, Ready};
use crate::registers::{change, exint, set};
use crate::serial::{self, INWARD};
use crate::{pins, reset, timers};
use avr_device::interrupt::free;
use embedded_hal::digital::{InputPin, OutputPin};
use heapless::Deque;
use phasewalk_firmware::arming::{DEPTH, NearEdge};
use phasewalk_firmware::board::{Board, Identity, Inputs, Life, Line, Offer, Outputs, Solve};
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::clock;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::Model;

/// Both external interrupts on their rising edge.
const RISING: u8 = 0b1111;
const INT0: u8 = 1 << 0;
const INT1: u8 = 1 << 1;

/// How long a test pulse of the safety loop is held: its wires may be metres long.
const LOOP_CYCLES: u32 = 160;

/// The Uno.
pub struct Uno {
    identity: Identity,
    enabled: bool,
    /// Of each channel, the edges that were taken and not told of: low bits of the tick, level.
    taken: [Deque<(u32, bool), TAKEN>; Channel::ALL.len()],
    /// Of each channel, how many made edges were told, wrapping.
    told: [u8; Channel::ALL.len()],
}

/// Edges that were taken and not told of: the near ones, and as many made since the last pass.
const TAKEN: usize = 2 * DEPTH;

impl Uno {
    /// Everything set up, interrupts still off.
    pub fn start() -> Self {
        pins::start();
        // A quarter of a second; before the clock starts, whose interrupts would be missed.
        let identity = Identity {
            model: Model::Uno,
            build: BUILD,
            image: memory::image_hash(),
            image_bytes: u32::from(memory::image_bytes()),
            reset: reset::cause(),
        };
        let phases = timers::start();
        free(|cs| NEAR.with(cs, |near| near.phases = phases));
        set!(exint().eicra, RISING);
        set!(exint().eimsk, 0);
        serial::start();
        Self {
            identity,
            enabled: false,
            taken: [Deque::new(), Deque::new(), Deque::new()],
            told: [0; 3],
        }
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

// Interrupts wait while one of these runs, so each is short.

fn near<R>(use_it: impl FnOnce(&mut Near) -> R) -> R {
    free(|cs| NEAR.with(cs, use_it))
}

#[inline(never)]
fn now() -> u64 {
    let (overflows, counter, pending) =
        near(|near| (near.overflows, timers::counter(), timers::overflow_pending()));
    clock::extend(overflows, counter, pending)
}

/// A tick of the last minutes, from its low bits.
#[inline(never)]
fn recent(tick: u32) -> u64 {
    let now = now();
    now.wrapping_sub(u64::from((now as u32).wrapping_sub(tick)))
}

impl Outputs for Uno {
    fn now(&mut self) -> u64 {
        now()
    }

    #[inline(never)]
    fn offer(&mut self, edge: Edge) -> Offer {
        let limits = Self::LIMITS;
        let left = edge.tick.saturating_sub(now());
        if left < u64::from(limits.lead) {
            return Offer::Late;
        }
        if left > u64::from(limits.reach) {
            return Offer::Later;
        }
        let Some(taken) = self.taken.get_mut(edge.channel.index()) else { return Offer::Late };
        // If it has become late by now, arming finds out.
        let near_edge = NearEdge { tick: edge.tick as u16, high: edge.high };
        if taken.is_full() || !near(|near| near.put(edge.channel, near_edge)) {
            return Offer::Later;
        }
        let _ = taken.push_back((edge.tick as u32, edge.high));
        Offer::Taken
    }

    #[inline(never)]
    fn made(&mut self) -> Option<Edge> {
        for channel in Channel::ALL {
            let told = self.told.get_mut(channel.index())?;
            if *told != near(|near| near.made(channel)) {
                *told = told.wrapping_add(1);
                let (tick, high) = self.taken.get_mut(channel.index())?.pop_front()?;
                return Some(Edge { channel, high, tick: recent(tick) });
            }
        }
        None
    }

    #[inline(never)]
    fn exposed(&mut self) -> Option<u64> {
        let capture = near(Near::exposed)?;
        let now = now();
        Some(now.wrapping_sub(u64::from((now as u16).wrapping_sub(capture))))
    }

    #[inline(never)]
    fn all_low(&mut self) {
        near(Near::all_low);
        for channel in Channel::ALL {
            let index = channel.index();
            if let (Some(taken), Some(told)) = (self.taken.get_mut(index), self.told.get_mut(index))
            {
                taken.clear();
                *told = near(|near| near.made(channel));
            }
        }
        self.rest_enable();
    }

    #[inline(never)]
    fn read_back(&mut self) -> bool {
        near(|near| near.read_back())
    }

    fn latched(&mut self) -> Option<Fault> {
        near(|near| near.fault())
    }

    fn interrupts(&mut self) -> u16 {
        near(|near| near.overflows as u16)
    }
}

impl Inputs for Uno {
    fn interlock_closed(&mut self) -> bool {
        Interlock {}.is_low().unwrap_or(false)
    }

    #[inline(never)]
    fn interlock_passes_pulse(&mut self) -> bool {
        let guarded = exint().eimsk.read().bits() & INT0 != 0;
        free(|_| change!(exint().eimsk, INT0, 0));
        let _ = LoopEnd {}.set_high();
        avr_device::asm::delay_cycles(LOOP_CYCLES);
        let passed = !self.interlock_closed();
        let _ = LoopEnd {}.set_low();
        avr_device::asm::delay_cycles(LOOP_CYCLES);
        let closed = self.interlock_closed();
        self.guard_interlock(guarded);
        passed && closed
    }

    fn guard_interlock(&mut self, on: bool) {
        set!(exint().eifr, INT0);
        free(|_| change!(exint().eimsk, INT0, if on { INT0 } else { 0 }));
    }

    fn await_start(&mut self, on: bool) {
        set!(exint().eifr, INT1);
        free(|_| change!(exint().eimsk, INT1, if on { INT1 } else { 0 }));
    }

    fn camera_ready(&mut self) -> bool {
        Ready {}.is_high().unwrap_or(false)
    }

    fn start_edge(&mut self) -> Option<u64> {
        near(|near| near.start.take())
    }
}

impl Line for Uno {
    fn read(&mut self) -> Option<u8> {
        free(|cs| INWARD.with(cs, |inward| inward.pop()))
    }

    fn write(&mut self, byte: u8) -> bool {
        serial::write(byte)
    }

    fn overrun(&mut self) -> u16 {
        free(|cs| INWARD.with(cs, |inward| inward.overrun()))
    }
}

impl Life for Uno {
    fn feed_watchdog(&mut self) {
        avr_device::asm::wdr();
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

impl Solve for Uno {}

impl Board for Uno {
    const LIMITS: Limits = Limits::UNO;

    fn identity(&mut self) -> Identity {
        self.identity
    }
}
