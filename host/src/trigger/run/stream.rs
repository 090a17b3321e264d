//! Volumes for the board's on-line solver while a run goes on: each when its sweep is over, one
//! request at a time, so that the board is asked how it is in between.

use crate::trigger::expected::Expected;
use crate::trigger::failure::{Failure, Result};
use crate::trigger::link::{Heard, Link};
use crate::trigger::solve;
use crate::trigger::speckles::Speckles;
use phasewalk_firmware::channel::Channel;
use phasewalk_firmware::message::{Event, Refusal, Status};
use phasewalk_firmware::plan::Plan;
use std::time::{Duration, Instant};

/// A volume is solved, or its speckles are taken, within this time.
const PATIENCE: Duration = Duration::from_secs(2);

/// What became of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Sent {
    /// The board has taken it.
    Taken,
    /// The board is busy: it is asked again.
    NotYet,
    /// No more are sent, for this reason.
    Ended(String),
}

/// Streams the volumes of a run.
pub struct Stream<'a> {
    speckles: &'a Speckles,
    /// When the sweeps are over, in ticks after time zero.
    ends: Vec<u64>,
    /// Sweeps that are over.
    over: usize,
    /// Volume and request that are next.
    next: (usize, usize),
    /// Since when the board has not solved the volume before, or not taken the next request.
    waits: Option<Instant>,
    /// The next volume may be sent only when the one before is solved.
    unsolved: bool,
    /// It takes no more.
    ended: bool,
}

impl<'a> Stream<'a> {
    /// Nothing has been sent.
    #[must_use]
    pub fn new(speckles: &'a Speckles, plan: &Plan) -> Self {
        let edges = Expected::of(plan);
        let falls = edges.channel(Channel::Camera).iter().filter(|edge| !edge.high);
        let ends = falls.map(|edge| edge.tick).collect();
        Self { speckles, ends, over: 0, next: (0, 0), waits: None, unsolved: false, ended: false }
    }

    /// What is streamed, for the log.
    #[must_use]
    pub fn words(&self) -> String {
        let Speckles { source, looks, .. } = self.speckles;
        let (count, source) = (self.speckles.count(), source.display());
        format!("volumes of {source} are streamed to the solver: {count} speckles, {looks} looks")
    }

    /// The board's solver begins anew.
    ///
    /// # Errors
    /// Any [`Failure`].
    pub fn begin(&self, link: &mut Link) -> Result<()> {
        solve::begin(link, self.speckles)
    }

    /// The board has told how it is; `start` is the tick of time zero.
    pub fn told(&mut self, status: &Status, start: Option<u64>) {
        let Some(start) = start else { return };
        let begun = status.sweeps as usize;
        let past = |end: &&u64| start.saturating_add(**end) <= status.tick;
        let over = self.ends.iter().take(begun).take_while(past).count();
        self.over = self.over.max(over);
    }

    /// Something has happened; `volume` is that of an edge.
    pub fn heard(&mut self, heard: &Heard, volume: Option<u32>) {
        match heard.event {
            Event::Made(edge) if edge.channel == Channel::Camera && !edge.high => {
                self.over = self.over.max(volume.map_or(0, |volume| volume as usize + 1));
            }
            Event::Solved(estimate) if estimate.volume as usize + 1 >= self.next.0 => {
                (self.unsolved, self.waits) = (false, None);
            }
            _ => {}
        }
    }

    /// All sweeps are over.
    pub fn finished(&mut self) {
        self.over = self.ends.len();
    }

    /// Whether there is something to send now.
    #[must_use]
    pub fn is_due(&self) -> bool {
        !self.ended && !self.unsolved && self.next.0 < self.over
    }

    /// Whether something is still to come from the board, or to be sent.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        !self.ended && (self.unsolved || self.next.0 < self.over)
    }

    /// Send the next request.
    ///
    /// # Errors
    /// Any [`Failure`] but a refusal by the solver.
    pub fn send(&mut self, link: &mut Link) -> Result<Sent> {
        let (number, request) = self.next;
        let Some(volume) = self.speckles.volume(number) else {
            self.ended = true;
            return Ok(Sent::Ended(format!("the series has no volume {number}: no more are sent")));
        };
        match solve::send(link, volume, request) {
            Ok(()) => {
                self.taken(request + 1 >= solve::requests(volume));
                Ok(Sent::Taken)
            }
            // It is still busy with the volume before, whose event was lost.
            Err(Failure::Refused(Refusal::Solver)) => Ok(self.refused(number)),
            Err(failure) => Err(failure),
        }
    }

    fn taken(&mut self, last: bool) {
        let (number, request) = self.next;
        self.next = if last { (number + 1, 0) } else { (number, request + 1) };
        self.unsolved = last;
        self.waits = last.then(Instant::now);
    }

    fn refused(&mut self, number: usize) -> Sent {
        let since = *self.waits.get_or_insert_with(Instant::now);
        self.ended = since.elapsed() > PATIENCE;
        if self.ended {
            return Sent::Ended(format!(
                "the solver does not take volume {number}: no more are sent"
            ));
        }
        Sent::NotYet
    }

    /// A volume whose phase does not come is waited for no longer.
    pub fn hurry(&mut self) -> Option<String> {
        let late = self.unsolved && self.waits.is_some_and(|since| since.elapsed() > PATIENCE);
        if !late {
            return None;
        }
        (self.unsolved, self.waits) = (false, None);
        let number = self.next.0.saturating_sub(1);
        Some(format!("the phase of volume {number} was not told"))
    }
}
