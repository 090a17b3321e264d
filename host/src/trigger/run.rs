//! A run: from a board at rest over upload and arming to the last event.
//!
//! ```text
//! Clear ─► Upload ─► Commit ─► Arm ─► Confirm ─► Start ─► Status, Status, … ─► Finished
//!           hash =    hash =   nonce             or edge     heartbeat          Stopped
//! ```
//!
//! Whatever ends it early on the host's side (Ctrl-C, a full disk) aborts the board, and the run
//! is over only when the board has said that its outputs are low, or cannot be reached.

pub mod job;
pub mod recorder;
pub mod stream;

use super::failure::{self, Failure};
use super::link::{Heard, Link};
use super::log::{Ending, RunLog, Summary};
use super::words;
use crate::error::{Error, Result};
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::message::{Command, Event, Refusal, State, Status};
use phasewalk_firmware::plan::{Plan, Start};
use recorder::Recorder;
use std::time::{Duration, Instant};
use stream::{Sent, Stream};

/// The board is asked how it is at least so often.
const SLOWEST: Duration = Duration::from_millis(250);

/// And at most so often.
const FASTEST: Duration = Duration::from_millis(20);

/// So many questions within the time after which a silent host ends the run.
const PER_HEARTBEAT: f64 = 5.0;

/// The last events come within this time after the board has said that the run is over.
const LAST_EVENTS: Duration = Duration::from_secs(1);

/// The board must be at rest within this time after it was told.
const REST: Duration = Duration::from_secs(3);

/// A run about to be made.
pub struct Run<'a> {
    /// The line to a board that has said who it is.
    pub link: &'a mut Link,
    /// What is sent.
    pub compiled: &'a Compiled,
    /// What it means.
    pub plan: &'a Plan,
    /// Ticks of the board's clock per second.
    pub ticks_per_second: u32,
    /// Where everything is written.
    pub recorder: Recorder,
    /// The volumes that are streamed to the on-line solver.
    pub stream: Option<Stream<'a>>,
    /// Called with the board armed and no light made yet; its failure ends the run.
    pub armed: &'a mut dyn FnMut() -> Result<()>,
}

/// Why watching ended.
enum Stop {
    /// The board said so.
    Board(Status),
    /// The board has not taken the plan.
    NotTaken(Refusal),
    /// The line or the user, or the board does not arm or start.
    Link(Failure),
    /// The log or the ledger.
    Log(Error),
}

impl Stop {
    fn before_arming(failure: Failure) -> Self {
        match failure {
            Failure::Refused(refusal) => Self::NotTaken(refusal),
            other => Self::Link(other),
        }
    }
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Link(failure)
    }
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Log(error)
    }
}

/// What is known at the end.
struct End {
    ending: Ending,
    words: String,
    last: Option<Status>,
}

impl Run<'_> {
    /// Make it; `tell` hears what is to be done by hand and how many sweeps have begun.
    ///
    /// # Errors
    /// Only when log or ledger cannot be written; the board is at rest then, too. All other ways to
    /// end are in the summary of the log that is returned.
    pub fn make(mut self, tell: &mut dyn FnMut(Progress)) -> Result<RunLog> {
        let begun = self.begin(tell);
        let stop = match begun {
            Ok(()) => self.watch(tell),
            Err(stop) => stop,
        };
        let unwritten = match &stop {
            Stop::Log(error) => Some(error.to_string()),
            _ => None,
        };
        let end = self.end(stop);
        let closed = self.close(&end);
        match unwritten {
            Some(error) => Err(Error::failed(format!("{error}; {}", end.words))),
            None => closed,
        }
    }

    fn begin(&mut self, tell: &mut dyn FnMut(Progress)) -> std::result::Result<(), Stop> {
        // What the board has lost before is not lost in this run.
        let before = self.link.status()?;
        self.recorder.told(&before)?;
        upload(self.link, self.compiled).map_err(Stop::before_arming)?;
        if let Some(stream) = &self.stream {
            stream.begin(self.link).map_err(Stop::before_arming)?;
            self.recorder.note(stream.words())?;
        }
        arm(self.link, self.compiled)?;
        (self.armed)()?;
        match self.plan.inputs.start {
            Start::Command => self.link.order(Command::Start)?,
            Start::External => tell(Progress::WaitsForEdge),
        }
        Ok(())
    }

    /// Ask and listen until something ends it.
    fn watch(&mut self, tell: &mut dyn FnMut(Progress)) -> Stop {
        let period = self.heartbeat();
        loop {
            match self.beat(period, tell) {
                Ok(None) => {}
                Ok(Some(status)) => return Stop::Board(status),
                Err(stop) => return stop,
            }
        }
    }

    /// One question and the events until the next.
    fn beat(
        &mut self,
        period: Duration,
        tell: &mut dyn FnMut(Progress),
    ) -> std::result::Result<Option<Status>, Stop> {
        let told = self.link.status()?;
        self.recorder.told(&told)?;
        tell(Progress::Sweeps(told.status.sweeps));
        if !matches!(told.status.state, State::Armed | State::Running) {
            return Ok(Some(told.status));
        }
        if let Some(stream) = &mut self.stream {
            stream.told(&told.status, self.recorder.log().start);
        }
        let next = told.asked + period;
        loop {
            let sent = self.stream()?;
            // What has come in the meantime is heard before more is sent.
            let until = if sent { Instant::now() } else { next };
            match self.link.event(until)? {
                Some(heard) if self.hear(heard)? => break,
                None if !sent || Instant::now() >= next => break,
                _ => {}
            }
        }
        Ok(None)
    }

    /// Send a request of the next volume that is due; whether one went.
    fn stream(&mut self) -> std::result::Result<bool, Stop> {
        let Some(stream) = &mut self.stream else { return Ok(false) };
        if let Some(words) = stream.hurry() {
            self.recorder.note(words)?;
        }
        if !stream.is_due() {
            return Ok(false);
        }
        let sent = stream.send(self.link)?;
        Ok(match sent {
            Sent::Taken => true,
            Sent::NotYet => false,
            Sent::Ended(words) => {
                self.recorder.note(words)?;
                false
            }
        })
    }

    /// Whether the event is the run's last.
    fn hear(&mut self, heard: Heard) -> Result<bool> {
        self.recorder.heard(&heard)?;
        if let Some(stream) = &mut self.stream {
            let volume = match heard.event {
                Event::Made(edge) => self.recorder.volume(edge),
                _ => None,
            };
            stream.heard(&heard, volume);
        }
        Ok(matches!(heard.event, Event::Finished { .. } | Event::Stopped { .. }))
    }

    fn heartbeat(&self) -> Duration {
        let silence = f64::from(self.plan.caps.heartbeat) / f64::from(self.ticks_per_second);
        if silence == 0.0 {
            return SLOWEST;
        }
        Duration::from_secs_f64(silence / PER_HEARTBEAT).clamp(FASTEST, SLOWEST)
    }

    /// Bring the board to rest, if need be, and collect what it still has to say.
    fn end(&mut self, stop: Stop) -> End {
        match stop {
            Stop::Board(status) => self.ended(&status),
            Stop::Link(Failure::Interrupted) => {
                self.abort(Ending::Aborted, "stopped at your request")
            }
            Stop::Log(_) => self.abort(Ending::Unrecorded, "the run was aborted"),
            Stop::Link(Failure::Refused(refusal)) => {
                self.abort(Ending::Refused, &Failure::Refused(refusal).to_string())
            }
            Stop::NotTaken(refusal) => self.not_taken(refusal),
            Stop::Link(failure) => self.lose(&failure),
        }
    }

    /// Events until the last one or the end of patience. What the log does not take is not lost
    /// for the comparison, only for the disk; its failure is reported when it is closed.
    fn collect(&mut self, patience: Duration) {
        let until = Instant::now() + patience;
        while !self.recorder.is_over()
            && let Ok(Some(heard)) = self.link.event(until)
        {
            if self.recorder.heard(&heard).is_err() {
                return;
            }
        }
    }

    fn ended(&mut self, status: &Status) -> End {
        let (ending, words) = match status.state {
            State::Finished => (Ending::Finished, "all edges made".to_owned()),
            State::Faulted(Fault::Abort) => (Ending::Aborted, "aborted from elsewhere".to_owned()),
            State::Faulted(fault) => {
                (Ending::Fault, format!("stopped by the board: {}", words::advice(fault)))
            }
            _ => (Ending::Reset, self.reset()),
        };
        if ending != Ending::Reset {
            self.collect(LAST_EVENTS);
            let _ = self.recorder.last_event_missing();
        }
        if ending == Ending::Finished {
            self.stream_the_rest();
        }
        End { ending, words: format!("{words}; outputs low"), last: Some(*status) }
    }

    /// The last volumes come when all edges were made. Whatever fails here does not undo the run:
    /// their phases are missing in the log, which says so.
    fn stream_the_rest(&mut self) {
        if let Some(stream) = &mut self.stream {
            stream.finished();
        }
        while self.stream.as_ref().is_some_and(Stream::is_busy) {
            let Ok(sent) = self.stream() else { return };
            let until = Instant::now() + if sent { Duration::ZERO } else { FASTEST };
            match self.link.event(until) {
                Ok(Some(heard)) if self.hear(heard).is_err() => return,
                Ok(_) => {}
                Err(_) => return,
            }
        }
    }

    /// The board is not as we have left it.
    fn reset(&mut self) -> String {
        let cause = self.link.hello(REST).map(|hello| hello.reset.to_string());
        let cause = cause.unwrap_or_else(|_| "why is not known".to_owned());
        format!("the board has started anew during the run ({cause})")
    }

    /// What was not armed by us is left alone.
    fn not_taken(&mut self, refusal: Refusal) -> End {
        let last = self.link.status().ok().map(|told| told.status);
        let words = Failure::Refused(refusal).to_string();
        End { ending: Ending::Refused, words, last }
    }

    /// The board does not answer; it may still hear.
    fn lose(&mut self, failure: &Failure) -> End {
        self.link.ignore_interrupt();
        let last = match failure {
            Failure::Gone(_) => None,
            _ => at_rest(self.link).ok(),
        };
        self.collect(Duration::ZERO);
        let then = match last {
            Some(_) => "aborted, outputs low".to_owned(),
            None => goes_on(self.plan, self.ticks_per_second),
        };
        End { ending: Ending::LineLost, words: format!("{failure}; {then}"), last }
    }

    fn abort(&mut self, ending: Ending, why: &str) -> End {
        self.link.ignore_interrupt();
        let _ = self.recorder.note(format!("{why}: abort sent"));
        match at_rest(self.link) {
            Ok(status) => {
                if matches!(status.state, State::Faulted(_) | State::Finished) {
                    self.collect(LAST_EVENTS);
                }
                End { ending, words: format!("{why}; outputs low"), last: Some(status) }
            }
            Err(failure) => End {
                ending,
                words: format!(
                    "{why}, but the board did not confirm that its outputs are low ({failure}): \
                     cut its power"
                ),
                last: None,
            },
        }
    }

    fn close(mut self, end: &End) -> Result<RunLog> {
        let last = end.last.as_ref();
        self.recorder.lost_by_board(last)?;
        let (garbled, repeated) = (self.link.garbled(), self.link.repeated());
        let log = self.recorder.log();
        let edges = log.compare(end.ending == Ending::Finished);
        let times = log.times().ok();
        let summary = Summary {
            ending: end.ending,
            words: end.words.clone(),
            safe: last.is_some_and(|status| words::is_safe(&status.state)),
            edges,
            volumes: log.ticks(Channel::Camera, true).len() as u32,
            planned_volumes: self.plan.total_sweeps(),
            exposures: log.exposures.len() as u64,
            events_lost: log.lost,
            garbled,
            repeated,
            longest_pass_ticks: last.map_or(0, |status| status.longest_pass),
            clock: log.fit(),
            times,
        };
        self.recorder.finish(summary)
    }
}

/// What a user should see while a run goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Progress {
    /// The board is armed and waits for an edge at its start input.
    WaitsForEdge,
    /// So many sweeps have begun.
    Sweeps(u32),
}

/// Send a plan to a board at rest and make it the board's.
///
/// # Errors
/// Any [`Failure`]; a hash that differs is [`Refusal::Hash`].
pub fn upload(link: &mut Link, compiled: &Compiled) -> failure::Result<()> {
    link.order(Command::Clear)?;
    let staged = link.hash(Command::Upload(compiled.bytes()))?;
    same(staged, compiled)?;
    let committed = link.hash(Command::Commit(compiled.hash()))?;
    same(committed, compiled)
}

/// Arm the board's plan, in two steps.
///
/// # Errors
/// Any [`Failure`].
pub fn arm(link: &mut Link, compiled: &Compiled) -> failure::Result<()> {
    let hash = compiled.hash();
    let nonce = link.nonce(hash)?;
    link.order(Command::Confirm { hash, nonce })
}

fn same(ours: u32, compiled: &Compiled) -> failure::Result<()> {
    if ours == compiled.hash() { Ok(()) } else { Err(Failure::Refused(Refusal::Hash { ours })) }
}

/// Tell the board to abort and wait until it is at rest.
///
/// # Errors
/// When it does not answer or does not come to rest.
pub fn at_rest(link: &mut Link) -> failure::Result<Status> {
    link.abort(REST)?;
    let begin = Instant::now();
    loop {
        let status = link.status()?.status;
        if words::is_safe(&status.state) {
            return Ok(status);
        }
        if begin.elapsed() > REST {
            return Err(Failure::Refused(Refusal::State(status.state)));
        }
    }
}

/// What a board does that has lost its host.
fn goes_on(plan: &Plan, ticks_per_second: u32) -> String {
    if plan.caps.heartbeat == 0 {
        return "the plan has no heartbeat, so the board goes on to its end: cut its power to stop \
                it"
        .to_owned();
    }
    let after = words::ticks(plan.caps.heartbeat.into(), ticks_per_second);
    format!("the board ends the run by itself {after} after it last heard from us")
}
