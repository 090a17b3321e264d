//! What the host may ask when: numbering of the requests, upload, commit, arming in two steps.

use crate::board::Board;
use crate::check::check;
use crate::device::Program;
use crate::fault::Fault;
use crate::guard::Guard;
use crate::message::{Command, Hello, PROTOCOL, Refusal, Reply, Request, State, Status};
use crate::outbox::Pending;
use crate::plan::Start;

/// The numbering of requests, so that what is repeated is done once.
#[derive(Debug, Default)]
pub(crate) struct Numbering {
    /// Last request that was done, with its answer.
    last: Option<(u8, Pending)>,
}

/// What to do with a request.
enum Turn {
    Do,
    Repeat(Pending),
    Refuse(Refusal),
}

impl Numbering {
    fn turn(&self, request: &Request<'_>) -> Turn {
        let in_order = match self.last {
            None => Turn::Do,
            Some((last, reply)) if request.number == last => Turn::Repeat(reply),
            Some((last, _)) if request.number == last.wrapping_add(1) => Turn::Do,
            Some((last, _)) => Turn::Refuse(Refusal::Number { expected: last.wrapping_add(1) }),
        };
        match request.command {
            // Asked twice, they say the newest; and these may always be asked.
            Command::Hello | Command::Abort => Turn::Do,
            Command::Status if matches!(in_order, Turn::Repeat(_)) => Turn::Do,
            _ => in_order,
        }
    }
}

impl<B: Board> Program<B> {
    /// A request has arrived.
    #[inline(never)]
    pub(crate) fn request(&mut self, request: &Request<'_>, now: u64) {
        self.guard.heard(now);
        let reply = match self.numbering.turn(request) {
            Turn::Do => {
                let reply = self.serve(&request.command, now);
                self.numbering.last = Some((request.number, reply));
                reply
            }
            Turn::Repeat(reply) => reply,
            Turn::Refuse(refusal) => Pending::Refused(refusal),
        };
        self.outbox.reply(request.number, reply);
    }

    #[inline(never)]
    fn serve(&mut self, command: &Command<'_>, now: u64) -> Pending {
        let outcome = match *command {
            // Its answer takes longer than a pass may during a run.
            Command::Hello if self.state == State::Running => Err(Refusal::State(self.state)),
            Command::Hello => Ok(Pending::Hello),
            Command::Status => Ok(Pending::Status),
            Command::Upload(bytes) => self.upload(bytes),
            Command::Commit(hash) => self.commit(hash),
            Command::Arm(hash) => self.arm(hash, now),
            Command::Confirm { hash, nonce } => self.confirm(hash, nonce, now),
            Command::Start => self.start(now),
            Command::Abort => {
                self.abort(now);
                Ok(Pending::Done)
            }
            Command::Clear => self.clear(),
            #[cfg(feature = "extended")]
            Command::Series { speckles, looks } => self.series(speckles, looks),
            #[cfg(feature = "extended")]
            Command::Samples { first, bytes } => self.samples(first, bytes),
        };
        outcome.unwrap_or_else(Pending::Refused)
    }

    /// The answer proper.
    pub(crate) fn compose(&mut self, pending: Pending) -> Reply {
        match pending {
            Pending::Hello => Reply::Hello(self.hello()),
            Pending::Status => Reply::Status(self.status()),
            Pending::Done => Reply::Done,
            Pending::Hash(hash) => Reply::Hash(hash),
            Pending::Nonce(nonce) => Reply::Nonce(nonce),
            Pending::Refused(refusal) => Reply::Refused(refusal),
        }
    }

    fn hello(&mut self) -> Hello {
        let identity = self.board.identity();
        Hello {
            model: identity.model,
            version: VERSION,
            protocol: PROTOCOL,
            build: identity.build,
            image: identity.image,
            image_bytes: identity.image_bytes,
            reset: identity.reset,
            limits: B::LIMITS,
        }
    }

    fn status(&mut self) -> Status {
        Status {
            state: self.state,
            tick: self.board.now(),
            plan: self.plan.hash(),
            interlock_closed: self.board.interlock_closed(),
            camera_ready: self.board.camera_ready(),
            sweeps: self.sequencer.begun(),
            lost: self.outbox.lost(),
            garbled: self.garbled,
            overrun: self.board.overrun(),
            longest_pass: self.longest.ticks(),
        }
    }

    /// Set a plan aside; the board's plan stays as it is.
    #[inline(never)]
    fn upload(&mut self, bytes: &[u8]) -> Result<Pending, Refusal> {
        self.at_rest()?;
        self.disarm();
        let stored = self.staged.store(bytes);
        if stored { Ok(Pending::Hash(self.staged.hash())) } else { Err(Refusal::NotAPlan) }
    }

    /// The plan set aside becomes the board's: as a whole, checked, or not at all.
    #[inline(never)]
    fn commit(&mut self, hash: u32) -> Result<Pending, Refusal> {
        self.at_rest()?;
        self.disarm();
        let ours = self.staged.hash();
        if ours != hash {
            return Err(Refusal::Hash { ours });
        }
        if !self.sequencer.load(&self.staged) {
            return Err(Refusal::NotAPlan);
        }
        check(self.sequencer.plan(), &B::LIMITS).map_err(Refusal::Plan)?;
        self.plan.clone_from(&self.staged);
        Ok(Pending::Hash(hash))
    }

    #[inline(never)]
    fn arm(&mut self, hash: u32, now: u64) -> Result<Pending, Refusal> {
        self.at_rest()?;
        self.load(hash)?;
        self.preflight()?;
        // It need not be secret, only different from one arming to the next.
        self.nonce = (now as u32).wrapping_mul(0x9E37_79B9) ^ self.nonce.rotate_left(7) ^ hash;
        self.state = State::Asked;
        Ok(Pending::Nonce(self.nonce))
    }

    #[inline(never)]
    fn confirm(&mut self, hash: u32, nonce: u32, now: u64) -> Result<Pending, Refusal> {
        if self.state != State::Asked {
            return Err(Refusal::State(self.state));
        }
        self.state = State::Idle;
        if nonce != self.nonce {
            return Err(Refusal::Nonce);
        }
        self.load(hash)?;
        self.preflight()?;
        self.armed(now);
        Ok(Pending::Done)
    }

    #[inline(never)]
    fn start(&mut self, now: u64) -> Result<Pending, Refusal> {
        let by_command = self.sequencer.plan().inputs.start == Start::Command;
        if self.state != State::Armed || !by_command {
            return Err(Refusal::State(self.state));
        }
        self.preflight()?;
        self.run(now).map_err(Refusal::Unsafe)?;
        Ok(Pending::Done)
    }

    fn abort(&mut self, now: u64) {
        match self.state {
            State::Asked | State::Armed | State::Running => self.stop(Fault::Abort, now),
            State::Idle | State::Finished | State::Faulted(_) => self.board.all_low(),
        }
    }

    #[inline(never)]
    fn clear(&mut self) -> Result<Pending, Refusal> {
        match self.state {
            State::Asked | State::Armed | State::Running => Err(Refusal::State(self.state)),
            State::Idle | State::Finished | State::Faulted(_) => {
                self.board.all_low();
                self.state = State::Idle;
                Ok(Pending::Done)
            }
        }
    }

    /// Plans change only while nothing runs and no fault waits to be seen.
    pub(crate) fn at_rest(&self) -> Result<(), Refusal> {
        match self.state {
            State::Idle | State::Finished | State::Asked => Ok(()),
            State::Armed | State::Running | State::Faulted(_) => Err(Refusal::State(self.state)),
        }
    }

    /// A nonce that was given out is for the plan of then.
    fn disarm(&mut self) {
        if self.state == State::Asked {
            self.state = State::Idle;
        }
    }

    /// Load the board's plan, if it has this hash.
    #[inline(never)]
    fn load(&mut self, hash: u32) -> Result<(), Refusal> {
        let ours = self.plan.hash();
        if ours != hash {
            return Err(Refusal::Hash { ours });
        }
        if self.sequencer.load(&self.plan) {
            Ok(())
        } else {
            Err(Refusal::Unsafe(Fault::PlanMemory))
        }
    }

    #[inline(never)]
    fn preflight(&mut self) -> Result<(), Refusal> {
        let inputs = &self.sequencer.plan().inputs;
        Guard::preflight(inputs, &mut self.board).map_err(Refusal::Unsafe)
    }
}

/// Of this crate: major, minor, patch.
const VERSION: [u8; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(text: &str) -> u8 {
    match u8::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => u8::MAX,
    }
}
