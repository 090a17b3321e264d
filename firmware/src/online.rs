//! What the board does with the phase of its on-line solver: tells it, and keeps the plan's limit.
//!
//! ```text
//! Series, Samples ─► solver (the board's) ─► Solved event
//!                                        └─► |phase| above the limit ─► line high
//!                                                                       stimulus ends
//!                                                                       run ends
//! ```
//!
//! Nothing here makes light. A phase that is not a number counts as outside of the bounds.

use crate::board::Board;
use crate::channel::{Channel, Edge};
use crate::device::Program;
use crate::fault::Fault;
use crate::message::{Estimate, Event, Refusal, State};
use crate::outbox::Pending;
use crate::plan::{Action, PhaseLimit};

/// What is remembered of the phase during a run.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Online {
    /// Low bits of the tick at which the last volume was solved, or the run began.
    heard: u32,
    /// The limit was crossed.
    crossed: bool,
}

impl<B: Board> Program<B> {
    /// Whether the board has a solver; what follows is left out where it has none.
    pub(crate) const SOLVES: bool = B::LIMITS.speckles > 0;

    /// The solver begins a series. Not while a limit on its phase may be kept: it would begin at 0.
    pub(crate) fn series(&mut self, speckles: u16, looks: u32) -> Result<Pending, Refusal> {
        if !Self::SOLVES || speckles == 0 || speckles > B::LIMITS.speckles {
            return Err(Refusal::Solver);
        }
        self.at_rest()?;
        if self.board.begin_series(speckles, looks) {
            Ok(Pending::Done)
        } else {
            Err(Refusal::Solver)
        }
    }

    /// Speckles for the solver.
    pub(crate) fn samples(&mut self, first: u16, bytes: &[u8]) -> Result<Pending, Refusal> {
        if Self::SOLVES && self.board.samples(first, bytes) {
            Ok(Pending::Done)
        } else {
            Err(Refusal::Solver)
        }
    }

    /// A run begins at the tick `start`.
    pub(crate) fn begin_online(&mut self, start: u64) {
        self.online = Online { heard: start as u32, crossed: false };
        self.board.phase_line(false);
    }

    /// One pass: the newest phase, and its limit.
    ///
    /// # Errors
    /// [`Fault::Phase`], [`Fault::NoPhase`].
    #[inline(never)]
    pub(crate) fn solved(&mut self, now: u64) -> Result<(), Fault> {
        let estimate = self.board.solved();
        if let Some(estimate) = estimate {
            self.outbox.tell(Event::Solved(estimate));
        }
        let Some(limit) = self.sequencer.plan().phase_limit else { return Ok(()) };
        if self.state != State::Running {
            return Ok(());
        }
        match estimate {
            Some(estimate) => {
                self.online.heard = now as u32;
                if within(limit, estimate) { Ok(()) } else { self.crossed(limit.action, now) }
            }
            None => self.patient(limit.silence, now),
        }
    }

    fn crossed(&mut self, action: Action, now: u64) -> Result<(), Fault> {
        self.board.phase_line(true);
        if action == Action::Stop {
            return Err(Fault::Phase);
        }
        if self.online.crossed {
            return Ok(());
        }
        self.online.crossed = true;
        let tick = if action == Action::Stimulus { self.end_stimulus() } else { now };
        self.outbox.tell(Event::Crossed { tick });
        Ok(())
    }

    /// The light goes off now and does not come back; says when that was.
    fn end_stimulus(&mut self) -> u64 {
        self.board.stimulus_low();
        let now = self.board.now();
        // What was made before is told first: of each output at most two edges since the last pass.
        for _ in 0..2 * Channel::ALL.len() {
            self.collect();
        }
        self.sequencer.end_light();
        if self.guard.is_high(Channel::Stimulus) {
            let edge = Edge::fall(Channel::Stimulus, now);
            self.guard.made(edge);
            self.outbox.tell(Event::Made(edge));
        }
        now
    }

    /// Time zero lies ahead: until then, and `silence` ticks after it, no phase is needed.
    fn patient(&self, silence: u32, now: u64) -> Result<(), Fault> {
        let since = (now as u32).wrapping_sub(self.online.heard);
        // Before the start the difference is a long way forwards.
        let ahead = since > u32::MAX / 2;
        if silence > 0 && since > silence && !ahead { Err(Fault::NoPhase) } else { Ok(()) }
    }
}

/// Whether the phase is within its bounds.
fn within(limit: PhaseLimit, estimate: Estimate) -> bool {
    let milliradians = f32::from_bits(estimate.phase) * 1000.0;
    milliradians.abs() <= limit.milliradians as f32
}
