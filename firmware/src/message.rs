//! What host and board say to each other.
//!
//! Every frame (see [`crate::frame`]) holds one [`Request`] or one [`Answer`], in postcard's
//! encoding. Numbers have fixed widths, never `usize`.

use crate::channel::Edge;
use crate::check::Violation;
use crate::compiled::hash;
use crate::fault::{Fault, ResetCause};
use crate::limits::Limits;
use serde::{Deserialize, Serialize};

/// Changes whenever the text of a definition that travels changes.
pub const PROTOCOL: u32 = hash(include_bytes!("message.rs"))
    ^ hash(include_bytes!("layout.rs")).rotate_left(1)
    ^ hash(include_bytes!("check.rs")).rotate_left(2)
    ^ hash(include_bytes!("channel.rs")).rotate_left(3)
    ^ hash(include_bytes!("fault.rs")).rotate_left(4)
    ^ hash(include_bytes!("limits.rs")).rotate_left(5);

/// Speckles that a request holds.
pub const SPECKLES_PER_REQUEST: usize = 16;

/// Bytes of a speckle.
pub const SPECKLE_BYTES: usize = 8;

/// What the host says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request<'a> {
    /// One more than the last request's, wrapping; the same again when it is repeated because no
    /// answer came. `Hello` may start anywhere.
    pub number: u8,
    /// What is wanted.
    #[serde(borrow)]
    pub command: Command<'a>,
}

/// What the host wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Command<'a> {
    /// Who are you? Not during a run.
    Hello,
    /// How are you? Also the heartbeat.
    Status,
    /// Keep these bytes of a compiled plan aside and say their hash.
    Upload(&'a [u8]),
    /// Check the plan set aside and make it the board's, if its hash is this one.
    Commit(u32),
    /// First step of arming: the hash of the plan; the answer is a nonce.
    Arm(u32),
    /// Second step of arming: hash and nonce.
    Confirm {
        /// Hash of the plan.
        hash: u32,
        /// What [`Reply::Nonce`] said.
        nonce: u32,
    },
    /// Start the armed run.
    Start,
    /// All outputs low, now. Accepted at any time, whatever the number.
    Abort,
    /// Forget a fault or a finished run.
    Clear,
    #[cfg(feature = "extended")]
    /// The on-line solver begins anew. Not while the board is armed or runs.
    Series {
        /// Speckles of each volume.
        speckles: u16,
        /// Effective looks of the speckles: the bits of an `f32`.
        looks: u32,
    },
    #[cfg(feature = "extended")]
    /// Speckles of a volume; with the last one it is solved.
    Samples {
        /// Number of the first of them.
        first: u16,
        /// Real and imaginary part of each, as `f32`, low bytes first.
        bytes: &'a [u8],
    },
}

/// What the board says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Answer {
    /// To a request.
    Reply {
        /// Number of the request.
        number: u8,
        /// The answer proper.
        reply: Reply,
    },
    /// What happened by itself.
    Event {
        /// Counts the events since the board started, wrapping: a gap shows a loss.
        number: u16,
        /// What happened.
        event: Event,
    },
}

/// Answer to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reply {
    /// To [`Command::Hello`].
    Hello(Hello),
    /// To [`Command::Status`].
    Status(Status),
    /// Done.
    Done,
    /// The hash of the bytes that the board has set aside or made its own.
    Hash(u32),
    /// To be sent back within [`Command::Confirm`].
    Nonce(u32),
    /// Not done.
    Refused(Refusal),
}

/// Why a request was not done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// Not the number that was expected: a request was lost or came too late.
    Number {
        /// What was expected.
        expected: u8,
    },
    /// Not in this state.
    State(State),
    /// Not the hash of the plan on the board.
    Hash {
        /// The board's.
        ours: u32,
    },
    /// Not the nonce.
    Nonce,
    /// The bytes are not those of a plan, or too many.
    NotAPlan,
    /// The plan breaks a rule.
    Plan(Violation),
    /// Something is not as it must be for a run.
    Unsafe(Fault),
    /// The board cannot solve, not so many speckles, or not these next: a volume's come in order, and
    /// not while a whole one waits for the solver.
    Solver,
}

/// Who the board is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello {
    /// Which board.
    pub model: Model,
    /// Version of the firmware: major, minor, patch.
    pub version: [u8; 3],
    /// [`PROTOCOL`] as the firmware was built.
    pub protocol: u32,
    /// Hash of the firmware's sources.
    pub build: u32,
    /// Hash of the program memory as the board reads it.
    pub image: u32,
    /// Bytes of program memory that hash covers.
    pub image_bytes: u32,
    /// Why it started.
    pub reset: ResetCause,
    /// What it can do.
    pub limits: Limits,
}

/// Which board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Model {
    /// Arduino Uno, ATmega328P.
    Uno,
    /// STM32F405.
    F405,
    /// No hardware: the same program against a simulated clock.
    Rehearsal,
}

/// How the board is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// What it is doing.
    pub state: State,
    /// Its clock, in ticks, when it answered.
    pub tick: u64,
    /// Hash of the plan it holds; 0: none.
    pub plan: u32,
    /// The interlock's loop is closed.
    pub interlock_closed: bool,
    /// The camera says that it is ready.
    pub camera_ready: bool,
    /// Sweeps handed to the hardware since the start of the run.
    pub sweeps: u32,
    /// Events that were lost because the host did not listen.
    pub lost: u16,
    /// Frames that could not be understood.
    pub garbled: u16,
    /// Bytes that came faster than they could be taken.
    pub overrun: u16,
    /// The longest pass of the main loop during the run, in ticks.
    pub longest_pass: u32,
}

/// What the board is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Disarmed.
    Idle,
    /// A nonce has been given out.
    Asked,
    /// Waiting for the start.
    Armed,
    /// Making edges.
    Running,
    /// All edges made; outputs low.
    Finished,
    /// Ended early; outputs low.
    Faulted(Fault),
}

/// What happened by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Event {
    /// The run's time zero: the plan's times count from here.
    Started {
        /// In ticks.
        tick: u64,
    },
    /// An output changed and was read back.
    Made(Edge),
    /// The first edge of the camera's EXPOSE output after its trigger.
    Exposed {
        /// In ticks.
        tick: u64,
    },
    /// All edges were made.
    Finished {
        /// In ticks.
        tick: u64,
    },
    /// The run ended early; all outputs are low.
    Stopped {
        /// Why.
        fault: Fault,
        /// In ticks.
        tick: u64,
    },
    #[cfg(feature = "extended")]
    /// The on-line solver has solved a volume.
    Solved(Estimate),
    #[cfg(feature = "extended")]
    /// The phase has left its bounds, and the plan says that the run goes on.
    Crossed {
        /// In ticks.
        tick: u64,
    },
}

/// What the on-line solver says of a volume. The bits of floating-point numbers travel, so that they
/// can be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Estimate {
    /// Number of the volume in its series, from 0.
    pub volume: u32,
    /// Phase against the mean of the reference volumes so far, in radians: the bits of an `f32`.
    pub phase: u32,
    /// Standard deviation of the phase, in radians: the bits of an `f32`.
    pub sigma: u32,
    /// How long the solver took, in ticks.
    pub took: u32,
}
