//! The board's program: one pass of the main loop, again and again.
//!
//! ```text
//! edges made ─► guard ─► sequencer ─► requests ─► answers and events ─► watchdog, enable
//! ```
//!
//! The same code runs on every board and, against a simulated clock, on the desktop.

use crate::board::Board;
use crate::channel::Channel;
use crate::compiled::Compiled;
use crate::fault::Fault;
use crate::frame::{Received, Receiver};
use crate::guard::{Guard, Longest, Pulse};
use crate::message::{Answer, Event, Request, State};
#[cfg(feature = "extended")]
use crate::online::Online;
use crate::outbox::Outbox;
use crate::plan::{Interlock, Start};
use crate::sequencer::{Remaining, START_PASSES, Sequencer};
use crate::session::Numbering;

/// Bytes of the line taken in a pass at most: so its length has a bound.
const BYTES: usize = 16;

/// A board with its program.
pub struct Device<B> {
    receiver: Receiver,
    /// This pass listens, the next speaks.
    listens: bool,
    program: Program<B>,
}

/// What the program keeps in mind.
pub(crate) struct Program<B> {
    pub(crate) board: B,
    pub(crate) state: State,
    pub(crate) staged: Compiled,
    pub(crate) plan: Compiled,
    pub(crate) nonce: u32,
    pub(crate) numbering: Numbering,
    pub(crate) guard: Guard,
    pub(crate) sequencer: Sequencer,
    pub(crate) outbox: Outbox,
    pulse: Pulse,
    pub(crate) garbled: u16,
    pub(crate) longest: Longest,
    #[cfg(feature = "extended")]
    pub(crate) online: Online,
}

impl<B: Board> Device<B> {
    /// A board just started: disarmed, all outputs low.
    #[must_use]
    pub fn new(mut board: B) -> Self {
        board.all_low();
        let program = Program {
            board,
            state: State::Idle,
            staged: Compiled::EMPTY,
            plan: Compiled::EMPTY,
            nonce: 0,
            numbering: Numbering::default(),
            guard: Guard::default(),
            sequencer: Sequencer::default(),
            outbox: Outbox::default(),
            pulse: Pulse::default(),
            garbled: 0,
            longest: Longest::default(),
            #[cfg(feature = "extended")]
            online: Online::default(),
        };
        Self { receiver: Receiver::default(), listens: false, program }
    }

    /// The board.
    pub fn board(&mut self) -> &mut B {
        &mut self.program.board
    }

    /// What it is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.program.state
    }

    /// One pass of the main loop.
    pub fn pass(&mut self) {
        let now = self.program.board.now();
        self.program.work(now);
        // One thing that takes long per pass, so that its length has a bound.
        let laboured = self.program.state == State::Running && self.program.sequencer.laboured();
        if !laboured {
            self.listens = !self.listens;
            if self.listens { self.listen(now) } else { self.program.speak() }
        }
        self.program.outbox.pass(&mut self.program.board);
        self.program.live(now);
    }

    #[inline(never)]
    fn listen(&mut self, now: u64) {
        for _ in 0..BYTES {
            let Some(byte) = self.program.board.read() else { return };
            match self.receiver.take::<Request<'_>>(byte) {
                Received::Nothing => {}
                Received::Garbled => self.program.garbled = self.program.garbled.saturating_add(1),
                // One request per pass.
                Received::Message(request) => return self.program.request(&request, now),
            }
        }
    }
}

impl<B: Board> Program<B> {
    /// Watch and go on.
    fn work(&mut self, now: u64) {
        self.longest.pass(now, self.state == State::Running);
        self.collect();
        if let Err(fault) = self.watch(now).and_then(|()| self.advance(now)) {
            self.stop(fault, now);
        }
    }

    /// What the hardware has made: one edge per pass, as many as are handed over.
    #[inline(never)]
    pub(crate) fn collect(&mut self) {
        if let Some(edge) = self.board.made() {
            self.guard.made(edge);
            self.sequencer.made(edge.channel);
            self.outbox.tell(Event::Made(edge));
        }
        if let Some(tick) = self.board.exposed() {
            self.outbox.tell(Event::Exposed { tick });
        }
    }

    /// While armed or running.
    fn watch(&mut self, now: u64) -> Result<(), Fault> {
        match self.state {
            State::Armed | State::Running => {
                self.guard.pass(&mut self.board, self.sequencer.plan(), now)
            }
            State::Idle | State::Asked | State::Finished | State::Faulted(_) => Ok(()),
        }
    }

    #[inline(never)]
    fn advance(&mut self, now: u64) -> Result<(), Fault> {
        #[cfg(feature = "extended")]
        self.solved(now)?;
        if self.state == State::Running {
            if self.sequencer.pass(&mut self.board, &self.plan, now)? == Remaining::Nothing {
                self.finish(now);
            }
        } else if self.state == State::Armed
            && self.sequencer.plan().inputs.start == Start::External
            && let Some(edge) = self.board.start_edge()
        {
            self.run(edge)?;
        }
        Ok(())
    }

    #[inline(never)]
    fn speak(&mut self) {
        if self.outbox.is_free() {
            let answer = match self.outbox.next_reply() {
                Some((number, pending)) => {
                    Some(Answer::Reply { number, reply: self.compose(pending) })
                }
                None => self.outbox.next_event(),
            };
            if let Some(answer) = answer {
                self.outbox.say(&answer);
            }
        }
    }

    fn live(&mut self, now: u64) {
        let light = matches!(self.state, State::Armed | State::Running);
        if let Err(fault) = self.pulse.pass(&mut self.board, now, light)
            && !matches!(self.state, State::Faulted(_))
        {
            self.stop(fault, now);
        }
    }

    /// Armed: from here on everything is watched.
    pub(crate) fn armed(&mut self, now: u64) {
        // A start edge from before does not count.
        let _ = self.board.start_edge();
        self.board.await_start(self.sequencer.plan().inputs.start == Start::External);
        let interlock = self.sequencer.plan().inputs.interlock;
        self.board.guard_interlock(interlock != Interlock::Off);
        self.guard.begin(now);
        self.state = State::Armed;
    }

    /// Run: time zero lies a fixed time after `edge`.
    ///
    /// # Errors
    /// [`Fault::PlanMemory`].
    #[inline(never)]
    pub(crate) fn run(&mut self, edge: u64) -> Result<(), Fault> {
        // The plan may have waited for hours.
        if !self.sequencer.load(&self.plan) {
            return Err(Fault::PlanMemory);
        }
        let start = edge.saturating_add(u64::from(B::LIMITS.pass * START_PASSES));
        self.sequencer.begin(start);
        self.board.frame_clock(self.sequencer.plan().frame);
        #[cfg(feature = "extended")]
        self.begin_online(start);
        self.state = State::Running;
        self.longest = Longest::default();
        self.outbox.tell(Event::Started { tick: start });
        Ok(())
    }

    fn finish(&mut self, now: u64) {
        self.board.guard_interlock(false);
        // Nothing that an interrupt has found since the guard looked is forgotten.
        if let Some(fault) = self.board.latched() {
            return self.stop(fault, now);
        }
        self.board.all_low();
        self.leave(State::Finished);
        self.outbox.tell(Event::Finished { tick: now });
    }

    /// All outputs low, and say why.
    #[inline(never)]
    pub(crate) fn stop(&mut self, fault: Fault, now: u64) {
        self.board.guard_interlock(false);
        // What an interrupt has found came first, and may be why the pins are not as expected.
        let fault = self.board.latched().unwrap_or(fault);
        // Of each output at most two edges have been made since the last pass.
        for _ in 0..2 * Channel::ALL.len() {
            self.collect();
        }
        self.board.all_low();
        self.leave(State::Faulted(fault));
        self.outbox.tell(Event::Stopped { fault, tick: now });
    }

    /// Nothing runs any more.
    #[inline(never)]
    fn leave(&mut self, state: State) {
        self.board.await_start(false);
        self.board.frame_clock(0);
        self.state = state;
    }
}
