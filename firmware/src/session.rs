//! What the host may ask when: numbering of the requests, upload, commit, arming in two steps.

use crate::board::Board;
use crate::check::check;
use crate::compiled::{Bytes, Compiled};
use crate::device::Device;
use crate::fault::Fault;
use crate::guard::Guard;
use crate::message::{Command, Event, Hello, PROTOCOL, Refusal, Reply, Request, State, Status};
use crate::plan::{Plan, Start};

/// The numbering of requests, so that what is repeated is done once.
#[derive(Debug, Default)]
pub(crate) struct Numbering {
    /// Last request that was done, with its answer.
    last: Option<(u8, Reply)>,
}

/// What to do with a request.
enum Turn {
    Do,
    Repeat(Reply),
    Refuse(Refusal),
}

impl Numbering {
    fn turn(&self, request: &Request) -> Turn {
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

impl<B: Board> Device<B> {
    /// A request has arrived.
    #[inline(never)]
    pub(crate) fn request(&mut self, request: &Request, now: u64) {
        if let Some(guard) = &mut self.guard {
            guard.heard(now);
        }
        let reply = match self.numbering.turn(request) {
            Turn::Do => {
                let reply = self.serve(&request.command, now);
                self.numbering.last = Some((request.number, reply));
                reply
            }
            Turn::Repeat(reply) => reply,
            Turn::Refuse(refusal) => Reply::Refused(refusal),
        };
        self.outbox.reply(request.number, reply);
    }

    #[inline(never)]
    fn serve(&mut self, command: &Command, now: u64) -> Reply {
        let outcome = match *command {
            Command::Hello => Ok(Reply::Hello(self.hello())),
            Command::Status => Ok(Reply::Status(self.status(now))),
            Command::Upload(ref bytes) => self.upload(bytes),
            Command::Commit(hash) => self.commit(hash),
            Command::Arm(hash) => self.arm(hash, now),
            Command::Confirm { hash, nonce } => self.confirm(hash, nonce, now),
            Command::Start => self.start(now),
            Command::Abort => {
                self.abort(now);
                Ok(Reply::Done)
            }
            Command::Clear => self.clear(),
        };
        outcome.unwrap_or_else(Reply::Refused)
    }

    #[inline(never)]
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

    #[inline(never)]
    fn status(&mut self, now: u64) -> Status {
        Status {
            state: self.state,
            tick: now,
            plan: self.plan.as_ref().map_or(0, Compiled::hash),
            interlock_closed: self.board.interlock_closed(),
            camera_ready: self.board.camera_ready(),
            sweeps: self.sequencer.as_ref().map_or(self.sweeps, |sequencer| sequencer.begun()),
            lost: self.outbox.lost(),
            garbled: self.garbled,
            overrun: self.board.overrun(),
            longest_pass: self.longest.ticks(),
        }
    }

    /// Set a plan aside; the board's plan stays as it is.
    #[inline(never)]
    fn upload(&mut self, bytes: &Bytes) -> Result<Reply, Refusal> {
        self.at_rest()?;
        let compiled = Compiled::from_bytes(bytes.clone());
        let hash = compiled.hash();
        self.staged = Some(compiled);
        Ok(Reply::Hash(hash))
    }

    /// The plan set aside becomes the board's: as a whole, checked, or not at all.
    #[inline(never)]
    fn commit(&mut self, hash: u32) -> Result<Reply, Refusal> {
        self.at_rest()?;
        let ours = self.staged.as_ref().map_or(0, Compiled::hash);
        if ours != hash {
            return Err(Refusal::Hash { ours });
        }
        let plan = self.staged.as_ref().and_then(Compiled::plan);
        let plan = plan.ok_or(Refusal::NotAPlan)?;
        check(&plan, &B::LIMITS).map_err(Refusal::Plan)?;
        self.plan = self.staged.take();
        Ok(Reply::Hash(hash))
    }

    #[inline(never)]
    fn arm(&mut self, hash: u32, now: u64) -> Result<Reply, Refusal> {
        self.at_rest()?;
        let plan = self.the_plan(hash)?;
        self.preflight(&plan)?;
        // It need not be secret, only different from one arming to the next.
        self.nonce = (now as u32).wrapping_mul(0x9E37_79B9) ^ self.nonce.rotate_left(7) ^ hash;
        self.state = State::Asked;
        Ok(Reply::Nonce(self.nonce))
    }

    #[inline(never)]
    fn confirm(&mut self, hash: u32, nonce: u32, now: u64) -> Result<Reply, Refusal> {
        if self.state != State::Asked {
            return Err(Refusal::State(self.state));
        }
        self.state = State::Idle;
        if nonce != self.nonce {
            return Err(Refusal::Nonce);
        }
        let plan = self.the_plan(hash)?;
        self.preflight(&plan)?;
        self.armed(&plan, now);
        Ok(Reply::Done)
    }

    #[inline(never)]
    fn start(&mut self, now: u64) -> Result<Reply, Refusal> {
        let plan = self.plan.as_ref().and_then(Compiled::plan);
        let plan = plan.ok_or(Refusal::Unsafe(Fault::PlanMemory))?;
        if self.state != State::Armed || plan.inputs.start != Start::Command {
            return Err(Refusal::State(self.state));
        }
        self.preflight(&plan)?;
        self.run(plan, now);
        Ok(Reply::Done)
    }

    fn abort(&mut self, now: u64) {
        match self.state {
            State::Asked | State::Armed | State::Running => self.stop(Fault::Abort, now),
            State::Idle | State::Finished | State::Faulted(_) => self.board.all_low(),
        }
    }

    #[inline(never)]
    fn clear(&mut self) -> Result<Reply, Refusal> {
        match self.state {
            State::Asked | State::Armed | State::Running => Err(Refusal::State(self.state)),
            State::Idle | State::Finished | State::Faulted(_) => {
                self.board.all_low();
                self.state = State::Idle;
                Ok(Reply::Done)
            }
        }
    }

    /// Plans change only while nothing runs and no fault waits to be seen.
    fn at_rest(&self) -> Result<(), Refusal> {
        match self.state {
            State::Idle | State::Finished | State::Asked => Ok(()),
            State::Armed | State::Running | State::Faulted(_) => Err(Refusal::State(self.state)),
        }
    }

    #[inline(never)]
    fn the_plan(&self, hash: u32) -> Result<Plan, Refusal> {
        let Some(compiled) = &self.plan else { return Err(Refusal::Hash { ours: 0 }) };
        if compiled.hash() != hash {
            return Err(Refusal::Hash { ours: compiled.hash() });
        }
        compiled.plan().ok_or(Refusal::Unsafe(Fault::PlanMemory))
    }

    #[inline(never)]
    fn preflight(&mut self, plan: &Plan) -> Result<(), Refusal> {
        Guard::preflight(&plan.inputs, &mut self.board).map_err(Refusal::Unsafe)
    }

    /// All outputs low, and say why.
    #[inline(never)]
    pub(crate) fn stop(&mut self, fault: Fault, now: u64) {
        self.board.all_low();
        self.leave(State::Faulted(fault));
        self.outbox.tell(Event::Stopped { fault, tick: now });
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
