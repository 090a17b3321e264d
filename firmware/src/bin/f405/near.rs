//! What passes and interrupts share: near edges, and what went wrong.
//!
//! While one of these functions runs, interrupts wait: they are short.

use crate::shared::Shared;
use crate::timers::{self, WINDOW};
use crate::{pins, registers};
use phasewalk_firmware::arming::{Arming, Counter, NearEdge, Output};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::clock::Extended;
use phasewalk_firmware::fault::Fault;
use registers::exti;

/// An edge that was due so many ticks ago and has not interrupted is found by the next pass: 2 us.
const MISSED: u32 = 168;

/// A pin has followed its edge after so many ticks, 0.5 us: its driver, and its synchroniser.
const SETTLED: u32 = 42;

/// Edges from being near until they are made.
pub struct Near {
    outputs: [Output<u32>; Channel::ALL.len()],
    /// The pins follow the timer: the chip is real.
    connected: bool,
    /// The camera's trigger whose first exposure is awaited.
    trigger: u32,
    awaits_exposure: bool,
    exposed: Option<u32>,
    fault: Option<Fault>,
    clock: Extended,
    /// When the start input rose.
    pub start: Option<u64>,
    /// Passes begun, wrapping.
    pub passes: u16,
    /// Ticks that passes have taken, wrapping.
    pub in_passes: u32,
}

/// The one there is.
pub static NEAR: Shared<Near> = Shared::new(Near {
    outputs: [Output::new(), Output::new(), Output::new()],
    connected: false,
    trigger: 0,
    awaits_exposure: false,
    exposed: None,
    fault: None,
    clock: Extended::new(),
    start: None,
    passes: 0,
    in_passes: 0,
});

impl Near {
    /// From now on the pins are looked at.
    pub fn connect(&mut self) {
        self.connected = true;
    }

    /// Ticks since the start. Asked in every pass, so no wrap is missed.
    #[inline(always)]
    pub fn now(&mut self) -> u64 {
        self.clock.ticks(timers::counter())
    }

    /// Take an edge, and arm it if it is the next; false when one is ready already.
    pub fn put(&mut self, channel: Channel, edge: NearEdge<u32>) -> bool {
        let taken = self.output(channel).is_some_and(|output| output.put(edge));
        if taken {
            self.arm(channel, timers::counter());
        }
        taken
    }

    #[inline(always)]
    fn output(&mut self, channel: Channel) -> Option<&mut Output<u32>> {
        self.outputs.get_mut(channel.index())
    }

    #[inline(always)]
    fn arm(&mut self, channel: Channel, now: u32) {
        let arming = self.output(channel).map(|output| output.arm(now, WINDOW));
        match arming {
            Some(Arming::Set(edge)) if self.fault.is_none() => {
                timers::arm(channel, edge);
                if channel == Channel::Camera && edge.high {
                    timers::forget_capture();
                }
            }
            Some(Arming::Late) => self.stop(Fault::Late),
            _ => {}
        }
    }

    /// Edges made are read back and followed by the next: by the interrupt of a match.
    #[inline(always)]
    pub fn matches(&mut self) {
        timers::forget_matches();
        for channel in Channel::ALL {
            self.matched(channel, timers::counter());
        }
    }

    /// The same, by a pass, for edges whose interrupt has not come.
    pub fn missed_matches(&mut self) {
        for channel in Channel::ALL {
            self.matched(channel, timers::counter().wrapping_sub(MISSED));
        }
    }

    // An edge that repeats the level before it cannot be the plan's: the memory has changed.
    #[inline(always)]
    fn matched(&mut self, channel: Channel, now: u32) {
        let connected = self.connected;
        let Some(output) = self.output(channel) else { return };
        let before = output.level();
        let Some(edge) = output.matched(now) else { return };
        while connected && timers::counter().since(edge.tick) < SETTLED {}
        let read_back = !connected || timers::level(channel) == edge.high;
        if !read_back || edge.high == before {
            return self.stop(Fault::ReadBack);
        }
        // Where there are no pins there are no matches either: think that this one came in time.
        self.arm(channel, if connected { timers::counter() } else { edge.tick });
        if channel == Channel::Camera && edge.high {
            self.trigger = edge.tick;
            self.await_exposure(true);
        }
    }

    #[inline(always)]
    fn await_exposure(&mut self, on: bool) {
        self.awaits_exposure = on;
        timers::await_capture(on);
    }

    /// EXPOSE may have risen; the first time after the trigger counts. Captures are forgotten when the
    /// trigger is armed, but one may have come before it was made.
    #[inline(always)]
    pub fn captured(&mut self) {
        if !self.awaits_exposure {
            return;
        }
        let Some(capture) = timers::capture() else { return };
        if capture.since(self.trigger) <= timers::counter().since(self.trigger) {
            self.exposed = Some(capture);
            self.await_exposure(false);
        }
    }

    /// How many edges an output has made, wrapping.
    pub fn made(&self, channel: Channel) -> u8 {
        self.outputs.get(channel.index()).map_or(0, Output::made)
    }

    /// The first exposure after a trigger.
    pub fn exposed(&mut self) -> Option<u32> {
        self.exposed.take()
    }

    /// Whether the pins are what the edges made so far say. A pin whose edge has been made but not
    /// noted is not looked at: its interrupt does.
    pub fn read_back(&self) -> bool {
        let levels = Channel::ALL.map(timers::level);
        // After the pins: an edge between the two reads counts as passed.
        let now = timers::counter();
        let mut outputs = self.outputs.iter().zip(levels);
        !self.connected
            || outputs.all(|(output, level)| output.level() == level || output.has_passed(now))
    }

    /// All outputs low for a reason; nothing is armed until [`Near::all_low`] forgets it.
    #[inline(always)]
    pub fn stop(&mut self, fault: Fault) {
        timers::all_low();
        if self.fault.is_none() {
            self.fault = Some(fault);
        }
    }

    /// What has gone wrong since [`Near::all_low`].
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// All outputs low; edges and faults forgotten.
    pub fn all_low(&mut self) {
        timers::all_low();
        self.await_exposure(false);
        for output in &mut self.outputs {
            output.stop();
        }
        self.exposed = None;
        self.fault = None;
    }

    /// An output low; its edges forgotten but for one that was just made.
    pub fn low(&mut self, channel: Channel) {
        self.matched(channel, timers::counter());
        timers::low(channel);
        if let Some(output) = self.output(channel) {
            output.stop();
        }
    }

    /// The start input rose. One rise is enough, and a bouncing or open wire would have many.
    pub fn started(&mut self) {
        let now = self.now();
        self.start = self.start.or(Some(now));
        registers::change!(exti().imr(), pins::START, 0);
    }
}
