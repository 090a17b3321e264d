//! The line to the board: numbered requests, repeated until answered, and events in order.
//!
//! ```text
//! request ─► frame ─► line ─► board          number n, again with n while no answer comes
//!   ▲                                        (the board then repeats its answer)
//!   └── answer n ◄── listener ◄── line ◄──┘
//! events ◄── 0, 1, 2, … a jump in their numbers is a loss
//! ```

use super::failure::{Failure, Result};
use super::reader::{Arrived, Listener};
use crate::progress;
use phasewalk_firmware::frame;
use phasewalk_firmware::message::{Answer, Command, Event, Hello, Reply, Request, Status};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// How long an answer is waited for before the request is repeated.
const REPEAT: Duration = Duration::from_millis(300);

/// How long it is repeated.
const PATIENCE: Duration = Duration::from_secs(3);

/// Ctrl-C is looked for so often.
const SLICE: Duration = Duration::from_millis(20);

/// An Uno resets when its port is opened, and its boot loader listens first: for up to 2 s.
pub const BOOT_PATIENCE: Duration = Duration::from_secs(5);

/// A jump of the event numbers by this much or more is a restart of the board.
const RESTART: u16 = 0x8000;

/// The line to one board.
pub struct Link {
    writer: Box<dyn Write + Send>,
    inbox: Receiver<Arrived>,
    number: u8,
    events: VecDeque<Heard>,
    expected_event: Option<u16>,
    garbled: u32,
    repeated: u32,
    interruptible: bool,
    _listener: Listener,
}

/// An event, as it came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Heard {
    /// What happened.
    pub event: Event,
    /// When the host read it.
    pub at: Instant,
    /// Events lost directly before it.
    pub missing: u16,
}

/// A status, and when it was asked and answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Told {
    /// How the board is.
    pub status: Status,
    /// When the request was written.
    pub asked: Instant,
    /// When the answer was read.
    pub answered: Instant,
    /// The request went once: the two times belong together.
    pub at_once: bool,
}

/// An answer and its circumstances.
struct Replied {
    reply: Reply,
    asked: Instant,
    answered: Instant,
    at_once: bool,
}

impl Link {
    /// Talk over a line; `reader` must return with `TimedOut` after some tens of milliseconds
    /// without a byte.
    #[must_use]
    pub fn new(reader: Box<dyn Read + Send>, writer: Box<dyn Write + Send>) -> Self {
        let (listener, inbox) = Listener::start(reader);
        Self {
            writer,
            inbox,
            number: 0,
            events: VecDeque::new(),
            expected_event: None,
            garbled: 0,
            repeated: 0,
            interruptible: true,
            _listener: listener,
        }
    }

    /// From now on Ctrl-C does not end requests: it has been seen, and what follows brings the
    /// board to rest.
    pub fn ignore_interrupt(&mut self) {
        self.interruptible = false;
    }

    /// Frames that could not be understood so far.
    #[must_use]
    pub fn garbled(&self) -> u32 {
        self.garbled
    }

    /// Requests that had to be repeated so far.
    #[must_use]
    pub fn repeated(&self) -> u32 {
        self.repeated
    }

    /// Who the board is, asked again and again for `patience`. Events from before are dropped.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn hello(&mut self, patience: Duration) -> Result<Hello> {
        let replied = self.ask(Command::Hello, patience)?;
        self.events.clear();
        match replied.reply {
            Reply::Hello(hello) => Ok(hello),
            other => Err(unexpected(other)),
        }
    }

    /// How the board is; its heartbeat.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn status(&mut self) -> Result<Told> {
        let Replied { reply, asked, answered, at_once } = self.ask(Command::Status, PATIENCE)?;
        match reply {
            Reply::Status(status) => Ok(Told { status, asked, answered, at_once }),
            other => Err(unexpected(other)),
        }
    }

    /// All outputs low, now; asked for `patience`.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn abort(&mut self, patience: Duration) -> Result<()> {
        done(self.ask(Command::Abort, patience)?.reply)
    }

    /// A request that the board answers with "done".
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn order(&mut self, command: Command<'_>) -> Result<()> {
        done(self.ask(command, PATIENCE)?.reply)
    }

    /// A request that the board answers with the hash of a plan.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn hash(&mut self, command: Command<'_>) -> Result<u32> {
        match self.ask(command, PATIENCE)?.reply {
            Reply::Hash(hash) => Ok(hash),
            other => Err(unexpected(other)),
        }
    }

    /// First step of arming the plan with this hash; the nonce for the second.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn nonce(&mut self, hash: u32) -> Result<u32> {
        match self.ask(Command::Arm(hash), PATIENCE)?.reply {
            Reply::Nonce(nonce) => Ok(nonce),
            other => Err(unexpected(other)),
        }
    }

    /// The next event; waits for one until `until`.
    ///
    /// # Errors
    /// [`Failure::Gone`] once all events were handed out, and [`Failure::Interrupted`].
    pub fn event(&mut self, until: Instant) -> Result<Option<Heard>> {
        while self.events.is_empty() {
            let Some(arrived) = self.arrival(until)? else { return Ok(None) };
            let _ = self.sort(arrived)?;
        }
        Ok(self.events.pop_front())
    }

    /// Say it with the next number, and again until it is answered.
    fn ask(&mut self, command: Command<'_>, patience: Duration) -> Result<Replied> {
        self.number = self.number.wrapping_add(1);
        let garbled = self.garbled;
        let begin = Instant::now();
        let give_up = begin + patience;
        let mut at_once = true;
        loop {
            let asked = Instant::now();
            self.say(command)?;
            if let Some((reply, answered)) = self.reply((asked + REPEAT).min(give_up))? {
                return Ok(Replied { reply, asked, answered, at_once });
            }
            if Instant::now() >= give_up {
                let garbled = self.garbled - garbled;
                return Err(Failure::Silent { waited: begin.elapsed(), garbled });
            }
            at_once = false;
            self.repeated += 1;
        }
    }

    fn say(&mut self, command: Command<'_>) -> Result<()> {
        let request = Request { number: self.number, command };
        // The longest request, a plan, fits.
        let frame = frame::encode(&request).unwrap_or_default();
        // A zero first: what the line has caught before does not become part of the frame.
        let mut bytes = vec![0];
        bytes.extend_from_slice(&frame);
        match self.writer.write_all(&bytes) {
            // Nobody takes the bytes: the board will be found silent.
            Err(error) if error.kind() == std::io::ErrorKind::TimedOut => Ok(()),
            other => other.map_err(|error| Failure::Gone(error.to_string())),
        }
    }

    /// The answer to the last request, if it comes in time.
    fn reply(&mut self, until: Instant) -> Result<Option<(Reply, Instant)>> {
        while let Some(arrived) = self.arrival(until)? {
            if let Some((number, reply, at)) = self.sort(arrived)?
                && number == self.number
            {
                return Ok(Some((reply, at)));
            }
        }
        Ok(None)
    }

    /// What comes next, if it comes in time.
    fn arrival(&mut self, until: Instant) -> Result<Option<Arrived>> {
        loop {
            if self.interruptible && progress::check().is_err() {
                return Err(Failure::Interrupted);
            }
            let left = until.saturating_duration_since(Instant::now());
            match self.inbox.recv_timeout(left.min(SLICE)) {
                Ok(arrived) => return Ok(Some(arrived)),
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(Failure::Gone("it was closed".to_owned()));
                }
                Err(RecvTimeoutError::Timeout) if Instant::now() >= until => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
            }
        }
    }

    /// Answers are returned, events are kept.
    fn sort(&mut self, arrived: Arrived) -> Result<Option<(u8, Reply, Instant)>> {
        match arrived {
            Arrived::Gone(why) => return Err(Failure::Gone(why)),
            Arrived::Garbled => self.garbled = self.garbled.saturating_add(1),
            Arrived::Message(Answer::Reply { number, reply }, at) => {
                return Ok(Some((number, reply, at)));
            }
            Arrived::Message(Answer::Event { number, event }, at) => {
                let gap = number.wrapping_sub(self.expected_event.unwrap_or(number));
                let missing = if gap < RESTART { gap } else { 0 };
                self.expected_event = Some(number.wrapping_add(1));
                self.events.push_back(Heard { event, at, missing });
            }
        }
        Ok(None)
    }
}

fn done(reply: Reply) -> Result<()> {
    match reply {
        Reply::Done => Ok(()),
        other => Err(unexpected(other)),
    }
}

fn unexpected(reply: Reply) -> Failure {
    match reply {
        Reply::Refused(refusal) => Failure::Refused(refusal),
        other => Failure::Unexpected(other),
    }
}
