//! What is heard in a run becomes lines of its log.

use crate::error::Result;
use crate::trigger::clock::Sample;
use crate::trigger::expected::Expected;
use crate::trigger::link::{Heard, Told};
use crate::trigger::log::phase::Phase;
use crate::trigger::log::write::Writer;
use crate::trigger::log::{Record, RunLog, Summary};
use phasewalk_firmware::channel::Edge;
use phasewalk_firmware::message::{Event, State, Status};
use std::time::Instant;

/// Turns events and statuses into records.
pub struct Recorder {
    writer: Writer,
    expected: Expected,
    /// Events the board had lost when the run began.
    lost_before: Option<u16>,
}

impl Recorder {
    /// Record with `writer`.
    #[must_use]
    pub fn new(writer: Writer) -> Self {
        let expected = Expected::of(&writer.log().header.plan);
        Self { writer, expected, lost_before: None }
    }

    /// The board has answered how it is.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn told(&mut self, told: &Told) -> Result<()> {
        self.lost_before.get_or_insert(told.status.lost);
        if !told.at_once {
            return Ok(());
        }
        let (asked, answered) = (self.writer.host_s(told.asked), self.writer.host_s(told.answered));
        self.writer.record(&Record::Clock(Sample {
            host_s: f64::midpoint(asked, answered),
            round_trip_s: answered - asked,
            tick: told.status.tick,
        }))
    }

    /// Something has happened on the board.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn heard(&mut self, heard: &Heard) -> Result<()> {
        let host_s = self.writer.host_s(heard.at);
        if heard.missing > 0 {
            self.writer.record(&Record::Lost { events: u32::from(heard.missing), host_s })?;
        }
        let start = self.log().start.unwrap_or(0);
        let record = match heard.event {
            Event::Started { tick } => Record::Started { tick, host_s },
            Event::Made(edge) => Record::Edge {
                channel: edge.channel,
                high: edge.high,
                tick: edge.tick,
                volume: self.volume(edge),
            },
            Event::Exposed { tick } => {
                Record::Exposed { tick, volume: self.expected.exposed_volume(tick, start) }
            }
            Event::Solved(estimate) => Record::Phase(Phase::new(&estimate, host_s)),
            Event::Crossed { tick } => Record::Crossed { tick },
            Event::Finished { tick } => Record::Finished { tick },
            Event::Stopped { fault, tick } => {
                Record::Fault { fault, words: fault.to_string(), tick }
            }
        };
        self.writer.record(&record)
    }

    /// The volume of an edge.
    #[must_use]
    pub fn volume(&self, edge: Edge) -> Option<u32> {
        self.expected.volume(edge, self.log().start.unwrap_or(0))
    }

    /// The board has said that the run is over; if the event of it has not come, it was lost.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn last_event_missing(&mut self) -> Result<()> {
        if self.is_over() {
            return Ok(());
        }
        let host_s = self.writer.host_s(Instant::now());
        self.writer.record(&Record::Lost { events: 1, host_s })
    }

    /// Events that the board lost and no later number has shown.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn lost_by_board(&mut self, last: Option<&Status>) -> Result<()> {
        let Some(status) = last.filter(|status| status.state != State::Idle) else {
            return Ok(());
        };
        let lost = u32::from(status.lost.saturating_sub(self.lost_before.unwrap_or(0)));
        let unseen = lost.saturating_sub(self.log().lost);
        if unseen == 0 {
            return Ok(());
        }
        let host_s = self.writer.host_s(Instant::now());
        self.writer.record(&Record::Lost { events: unseen, host_s })
    }

    /// Write what a reader should know.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn note(&mut self, text: String) -> Result<()> {
        self.writer.note(text)
    }

    /// What was recorded so far.
    #[must_use]
    pub fn log(&self) -> &RunLog {
        self.writer.log()
    }

    /// The run's last event has come.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.log().finished.is_some() || self.log().fault.is_some()
    }

    /// The last line.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn finish(self, summary: Summary) -> Result<RunLog> {
        self.writer.finish(&Record::Summary(Box::new(summary)))
    }
}
