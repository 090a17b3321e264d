//! The same program without hardware: a board whose clock is a number.
//!
//! It serves the host (what will the board do with these bytes, and how much time is left for each
//! edge when every pass is as long as it may be?) and the tests of this crate.

use crate::arming::DEPTH;
use crate::board::{Board, Identity, Inputs, Life, Line, Offer, Outputs, Solve};
use crate::channel::{Channel, Edge};
use crate::compiled::Compiled;
use crate::fault::{Fault, ResetCause};
use crate::limits::Limits;
use crate::message::{Estimate, Model};
use crate::sequencer::{Remaining, START_PASSES, Sequencer};
use core::marker::PhantomData;
use heapless::Deque;

/// Bytes in flight in either direction.
const LINE: usize = 512;

/// Edges made and not yet collected.
const MADE: usize = 3 * DEPTH;

/// The board that is rehearsed.
pub trait Rehearses {
    /// What it can do.
    const LIMITS: Limits;
}

/// The Arduino Uno.
#[derive(Debug, Clone, Copy)]
pub struct AsUno;

/// The STM32F405.
#[derive(Debug, Clone, Copy)]
pub struct AsF405;

impl Rehearses for AsUno {
    const LIMITS: Limits = Limits::UNO;
}

impl Rehearses for AsF405 {
    const LIMITS: Limits = Limits::F405;
}

/// A board whose clock is a number.
///
/// Its outputs are perfect: edges are made at their tick. What a person or a fault would change is
/// public.
#[derive(Debug)]
pub struct Rehearsal<M = AsUno> {
    /// The clock.
    pub now: u64,
    /// The safety loop is closed.
    pub interlock_closed: bool,
    /// The safety loop's input is stuck at "closed".
    pub interlock_stuck: bool,
    /// The camera is ready.
    pub camera_ready: bool,
    /// A rise at the start input that has not been told.
    pub start_edge: Option<u64>,
    /// An output is stuck at this level.
    pub stuck: Option<(Channel, bool)>,
    /// The hardware takes the edges of this output and never makes them.
    pub lose_edges_of: Option<Channel>,
    /// The stack has overflowed.
    pub stack_overflow: bool,
    /// The clock's interrupt does not come.
    pub no_interrupts: bool,
    /// What an interrupt has found.
    pub latched: Option<Fault>,
    /// How often the watchdog was fed.
    pub fed: u32,
    /// How often the dynamic enable changed.
    pub enabled: u32,
    /// What the on-line solver will say; it is taken from here, whatever the speckles are.
    pub estimate: Option<Estimate>,
    /// The phase line is high.
    pub phase_line: bool,
    /// Period of the frame clock.
    pub frame: u32,
    /// From the host.
    pub inward: Deque<u8, LINE>,
    /// To the host.
    pub outward: Deque<u8, LINE>,
    awaits_start: bool,
    queues: [Deque<Handed, DEPTH>; Channel::ALL.len()],
    levels: [bool; Channel::ALL.len()],
    made: Deque<Handed, MADE>,
    interrupts: u16,
    rehearses: PhantomData<M>,
}

/// An edge and when it was handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Handed {
    /// The edge.
    pub edge: Edge,
    /// In ticks.
    pub at: u64,
}

impl<M> Default for Rehearsal<M> {
    fn default() -> Self {
        Self {
            now: 0,
            interlock_closed: true,
            interlock_stuck: false,
            camera_ready: true,
            start_edge: None,
            stuck: None,
            lose_edges_of: None,
            stack_overflow: false,
            no_interrupts: false,
            latched: None,
            fed: 0,
            enabled: 0,
            estimate: None,
            phase_line: false,
            frame: 0,
            inward: Deque::new(),
            outward: Deque::new(),
            awaits_start: false,
            queues: [Deque::new(), Deque::new(), Deque::new()],
            levels: [false; 3],
            made: Deque::new(),
            interrupts: 0,
            rehearses: PhantomData,
        }
    }
}

impl<M> Rehearsal<M> {
    /// The clock goes on; edges that fall due are made.
    pub fn advance(&mut self, ticks: u32) {
        self.now += u64::from(ticks);
        let now = self.now;
        if !self.no_interrupts {
            self.interrupts = (self.now >> 16) as u16;
        }
        if let Some(lost) = self.lose_edges_of.and_then(|c| self.queues.get_mut(c.index())) {
            lost.clear();
        }
        for (queue, level) in self.queues.iter_mut().zip(&mut self.levels) {
            while let Some(handed) = queue.front().copied().filter(|next| next.edge.tick <= now) {
                let _ = queue.pop_front();
                *level = handed.edge.high;
                // There is room: the device collects as many per pass as can fall due.
                let _ = self.made.push_back(handed);
            }
        }
    }

    /// An edge made, with the time at which it was handed over.
    pub fn collect(&mut self) -> Option<Handed> {
        self.made.pop_front()
    }

    /// What an output is.
    #[must_use]
    pub fn level(&self, channel: Channel) -> bool {
        self.levels.get(channel.index()).copied().unwrap_or(false)
    }
}

impl<M: Rehearses> Outputs for Rehearsal<M> {
    fn now(&mut self) -> u64 {
        self.now
    }

    fn offer(&mut self, edge: Edge) -> Offer {
        let limits = Self::LIMITS;
        let left = edge.tick.saturating_sub(self.now);
        if edge.tick < self.now || left < u64::from(limits.lead) {
            return Offer::Late;
        }
        if left > u64::from(limits.reach) {
            return Offer::Later;
        }
        if self.lose_edges_of == Some(edge.channel) {
            return Offer::Taken;
        }
        let Some(queue) = self.queues.get_mut(edge.channel.index()) else { return Offer::Late };
        if queue.push_back(Handed { edge, at: self.now }).is_ok() {
            Offer::Taken
        } else {
            Offer::Later
        }
    }

    fn made(&mut self) -> Option<Edge> {
        self.collect().map(|handed| handed.edge)
    }

    fn exposed(&mut self) -> Option<u64> {
        None
    }

    fn all_low(&mut self) {
        self.queues.iter_mut().for_each(Deque::clear);
        self.levels = [false; 3];
        self.latched = None;
    }

    fn stimulus_low(&mut self) {
        let stimulus = Channel::Stimulus.index();
        if let (Some(queue), Some(level)) =
            (self.queues.get_mut(stimulus), self.levels.get_mut(stimulus))
        {
            queue.clear();
            *level = false;
        }
    }

    fn frame_clock(&mut self, period: u32) {
        self.frame = period;
    }

    fn read_back(&mut self) -> bool {
        self.stuck.is_none_or(|(channel, level)| self.level(channel) == level)
    }

    fn latched(&mut self) -> Option<Fault> {
        self.latched
    }

    fn interrupts(&mut self) -> u16 {
        self.interrupts
    }
}

impl<M> Inputs for Rehearsal<M> {
    fn interlock_closed(&mut self) -> bool {
        self.interlock_closed
    }

    fn interlock_passes_pulse(&mut self) -> bool {
        !self.interlock_stuck
    }

    fn guard_interlock(&mut self, _on: bool) {}

    fn await_start(&mut self, on: bool) {
        self.awaits_start = on;
    }

    fn camera_ready(&mut self) -> bool {
        self.camera_ready
    }

    fn start_edge(&mut self) -> Option<u64> {
        self.start_edge.take().filter(|_| self.awaits_start)
    }
}

impl<M> Line for Rehearsal<M> {
    fn read(&mut self) -> Option<u8> {
        self.inward.pop_front()
    }

    fn write(&mut self, byte: u8) -> bool {
        self.outward.push_back(byte).is_ok()
    }

    fn overrun(&mut self) -> u16 {
        0
    }
}

impl<M> Life for Rehearsal<M> {
    fn feed_watchdog(&mut self) {
        self.fed += 1;
    }

    fn toggle_enable(&mut self) {
        self.enabled += 1;
    }

    fn rest_enable(&mut self) {}

    fn stack_intact(&mut self) -> bool {
        !self.stack_overflow
    }
}

impl<M> Solve for Rehearsal<M> {
    fn begin_series(&mut self, _speckles: u16, _looks: u32) -> bool {
        true
    }

    fn samples(&mut self, _first: u16, _bytes: &[u8]) -> bool {
        true
    }

    fn solved(&mut self) -> Option<Estimate> {
        self.estimate.take()
    }

    fn phase_line(&mut self, high: bool) {
        self.phase_line = high;
    }
}

impl<M: Rehearses> Board for Rehearsal<M> {
    const LIMITS: Limits = M::LIMITS;

    fn identity(&mut self) -> Identity {
        Identity {
            model: Model::Rehearsal,
            build: 0,
            image: 0,
            image_bytes: 0,
            reset: ResetCause::PowerOn,
        }
    }
}

/// An edge that a rehearsal made, with what was left of the time for arming it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rehearsed {
    /// The edge, its tick counted from the run's time zero.
    pub edge: Edge,
    /// Ticks between handing it over and the last moment for that, in the worst case.
    pub slack: u64,
}

/// Run a compiled plan through the sequencer, with every pass as long as [`Limits::pass`] of the board
/// allows (see [`rehearsed`]), and show each edge: of each channel in the order of time.
///
/// The slack of an edge is what remains at its hand-over, less a whole pass (for the grid of the
/// passes can lie anywhere against the plan), or for edges that follow each other closely, what
/// remains after the interrupt of the first has armed the second, whichever is less.
///
/// # Errors
/// The fault that would end the run: [`Fault::Late`] if the plan is too dense for the board.
pub fn rehearse(
    limits: &Limits,
    compiled: &Compiled,
    show: impl FnMut(Rehearsed),
) -> Result<(), Fault> {
    if rehearsed(limits) == Limits::F405 {
        rehearse_as::<AsF405>(compiled, show)
    } else {
        rehearse_as::<AsUno>(compiled, show)
    }
}

/// The limits that [`rehearse`] keeps for a board with these: its own if it is known, the Uno's if not.
#[must_use]
pub fn rehearsed(limits: &Limits) -> Limits {
    if *limits == Limits::F405 { Limits::F405 } else { Limits::UNO }
}

fn rehearse_as<M: Rehearses>(
    compiled: &Compiled,
    mut show: impl FnMut(Rehearsed),
) -> Result<(), Fault> {
    let limits = M::LIMITS;
    let start = u64::from(limits.pass * START_PASSES);
    let mut board = Rehearsal::<M>::default();
    let mut sequencer = Sequencer::default();
    if !sequencer.load(compiled) {
        return Err(Fault::PlanMemory);
    }
    sequencer.begin(start);
    let mut last = [None; Channel::ALL.len()];
    loop {
        while let Some(handed) = board.collect() {
            sequencer.made(handed.edge.channel);
            let last = last.get_mut(handed.edge.channel.index());
            let last = last.and_then(|last| last.replace(handed.edge.tick));
            let slack = slack(&limits, handed, last).ok_or(Fault::Late)?;
            let tick = handed.edge.tick.saturating_sub(start);
            show(Rehearsed { edge: Edge { tick, ..handed.edge }, slack });
        }
        let now = board.now();
        if sequencer.pass(&mut board, compiled, now)? == Remaining::Nothing {
            return Ok(());
        }
        board.advance(limits.pass);
    }
}

/// What was left of the time for arming an edge, `last` being the tick of its channel's edge before;
/// `None`: in the worst case it would be late.
fn slack(limits: &Limits, handed: Handed, last: Option<u64>) -> Option<u64> {
    let latest = handed.edge.tick.checked_sub(u64::from(limits.lead))?;
    let handed_over = latest.checked_sub(handed.at + u64::from(limits.pass))?;
    let Some(last) = last else { return Some(handed_over) };
    let armed = latest.checked_sub(last + u64::from(limits.interrupt))?;
    Some(handed_over.min(armed))
}
