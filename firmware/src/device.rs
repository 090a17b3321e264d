//! The board's program: one pass of the main loop, again and again.
//!
//! ```text
//! edges made ─► guard ─► sequencer ─► requests ─► answers and events ─► watchdog, enable
//! ```
//!
//! The same code runs on every board and, against a simulated clock, on the desktop.

use crate::board::Board;
use crate::compiled::Compiled;
use crate::fault::Fault;
use crate::frame::{Received, Receiver};
use crate::guard::{Guard, Longest, Pulse};
use crate::message::{Event, Request, State};
use crate::outbox::Outbox;
use crate::plan::{Interlock, Plan, Start};
use crate::sequencer::{Remaining, START_PASSES, Sequencer};
use crate::session::Numbering;

/// Bytes of the line taken in a pass at most: so its length has a bound.
const BYTES: usize = 8;

/// Events of the outputs taken in a pass at most.
const EDGES: usize = 12;

/// A board and all it keeps in mind.
pub struct Device<B> {
    pub(crate) board: B,
    pub(crate) state: State,
    pub(crate) staged: Option<Compiled>,
    pub(crate) plan: Option<Compiled>,
    pub(crate) nonce: u32,
    pub(crate) numbering: Numbering,
    pub(crate) guard: Option<Guard>,
    pub(crate) sequencer: Option<Sequencer>,
    pub(crate) outbox: Outbox,
    receiver: Receiver,
    pulse: Pulse,
    pub(crate) garbled: u16,
    pub(crate) longest: Longest,
    /// Sweeps of the last run.
    pub(crate) sweeps: u32,
}

impl<B: Board> Device<B> {
    /// A board just started: disarmed, all outputs low.
    #[must_use]
    pub fn new(mut board: B) -> Self {
        board.all_low();
        Self {
            board,
            state: State::Idle,
            staged: None,
            plan: None,
            nonce: 0,
            numbering: Numbering::default(),
            guard: None,
            sequencer: None,
            outbox: Outbox::default(),
            receiver: Receiver::default(),
            pulse: Pulse::default(),
            garbled: 0,
            longest: Longest::default(),
            sweeps: 0,
        }
    }

    /// The board.
    pub fn board(&mut self) -> &mut B {
        &mut self.board
    }

    /// What it is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.state
    }

    /// One pass of the main loop.
    pub fn pass(&mut self) {
        let now = self.board.now();
        self.longest.pass(now, self.state == State::Running);
        self.collect();
        if let Err(fault) = self.watch(now).and_then(|()| self.advance(now)) {
            self.stop(fault, now);
        }
        self.listen(now);
        self.outbox.pass(&mut self.board);
        self.live(now);
    }

    /// What the hardware has made.
    #[inline(never)]
    fn collect(&mut self) {
        for _ in 0..EDGES {
            let Some(edge) = self.board.made() else { break };
            if let Some(guard) = &mut self.guard {
                guard.made(edge);
            }
            if let Some(sequencer) = &mut self.sequencer {
                sequencer.made();
            }
            self.outbox.tell(Event::Made(edge));
        }
        if let Some(tick) = self.board.exposed() {
            self.outbox.tell(Event::Exposed { tick });
        }
    }

    #[inline(never)]
    fn watch(&mut self, now: u64) -> Result<(), Fault> {
        self.guard.as_mut().map_or(Ok(()), |guard| guard.pass(&mut self.board, now))
    }

    #[inline(never)]
    fn advance(&mut self, now: u64) -> Result<(), Fault> {
        let Some(memory) = &self.plan else { return Ok(()) };
        if let Some(sequencer) = &mut self.sequencer {
            if sequencer.pass(&mut self.board, memory, now)? == Remaining::Nothing {
                self.finish(now);
            }
        } else if self.state == State::Armed
            && let Some(edge) = self.board.start_edge()
        {
            let plan = memory.plan().ok_or(Fault::PlanMemory)?;
            if plan.inputs.start == Start::External {
                self.run(plan, edge);
            }
        }
        Ok(())
    }

    #[inline(never)]
    fn listen(&mut self, now: u64) {
        for _ in 0..BYTES {
            let Some(byte) = self.board.read() else { return };
            match self.receiver.take::<Request>(byte) {
                Received::Nothing => {}
                Received::Garbled => self.garbled = self.garbled.saturating_add(1),
                // One request per pass.
                Received::Message(request) => return self.request(&request, now),
            }
        }
    }

    #[inline(never)]
    fn live(&mut self, now: u64) {
        let light = matches!(self.state, State::Armed | State::Running);
        if let Err(fault) = self.pulse.pass(&mut self.board, now, light)
            && !matches!(self.state, State::Faulted(_))
        {
            self.stop(fault, now);
        }
    }

    /// Armed: from here on everything is watched.
    #[inline(never)]
    pub(crate) fn armed(&mut self, plan: &Plan, now: u64) {
        // A start edge from before does not count.
        let _ = self.board.start_edge();
        self.board.guard_interlock(plan.inputs.interlock != Interlock::Off);
        self.guard = Some(Guard::new(plan.inputs, plan.caps, now));
        self.state = State::Armed;
    }

    /// Run: time zero lies a fixed time after `edge`.
    #[inline(never)]
    pub(crate) fn run(&mut self, plan: Plan, edge: u64) {
        let start = edge.saturating_add(u64::from(B::LIMITS.pass * START_PASSES));
        self.sequencer = Some(Sequencer::new(plan, start));
        self.state = State::Running;
        self.longest = Longest::default();
        self.outbox.tell(Event::Started { tick: start });
    }

    #[inline(never)]
    fn finish(&mut self, now: u64) {
        self.board.all_low();
        self.leave(State::Finished);
        self.outbox.tell(Event::Finished { tick: now });
    }

    /// Nothing runs any more.
    #[inline(never)]
    pub(crate) fn leave(&mut self, state: State) {
        self.board.guard_interlock(false);
        self.guard = None;
        if let Some(sequencer) = self.sequencer.take() {
            self.sweeps = sequencer.begun();
        }
        self.state = state;
    }
}
