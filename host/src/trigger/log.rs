//! The run log: everything that happened in a run, one JSON object per line (NDJSON), each line
//! written when it happens.
//!
//! ```text
//! {"record":"header",  …}      once, first: plan, board, program
//! {"record":"started", …}      the plan's time zero
//! {"record":"edge",    …}      an output changed and was read back
//! {"record":"exposed", …}      the camera's EXPOSE output rose
//! {"record":"phase",   …}      the on-line solver has solved a volume
//! {"record":"crossed", …}      the phase has left its bounds, and the run goes on
//! {"record":"clock",   …}      the board's clock beside the host's
//! {"record":"lost",    …}      events that did not arrive
//! {"record":"note",    …}      what a reader should know
//! {"record":"fault", …} or {"record":"finished", …}
//! {"record":"summary", …}      once, last; missing if the program was killed
//! ```
//!
//! Each tick is one of the board's clock, 64 bits, since the board's start. `docs/run-log.md`
//! describes every field.

pub mod phase;
pub mod read;
pub mod statistics;
pub mod table;
pub mod times;
pub mod write;

use super::clock::{Fit, Sample};
use super::expected::{Comparison, Expected};
use super::words;
use phase::Phase;
use phasewalk_firmware::channel::{Channel, Edge};
use phasewalk_firmware::fault::Fault;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::{Hello, Model};
use phasewalk_firmware::plan::{Action, Plan};
use serde::{Deserialize, Serialize};
use times::VolumeTimes;

/// What the first line says it is.
pub const FORMAT: &str = "phasewalk-run-log";

/// Version of the format: raised when a reader of the last one would misunderstand it.
pub const VERSION: u32 = 1;

/// One line of a run log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "record", rename_all = "snake_case")]
pub enum Record {
    /// What was to be done, by whom, with what.
    Header(Box<Header>),
    /// The plan's time zero.
    Started {
        /// In ticks.
        tick: u64,
        /// When the host heard of it, in seconds since the log began.
        host_s: f64,
    },
    /// An output changed and was read back.
    Edge {
        /// Which.
        #[serde(with = "channel_names")]
        channel: Channel,
        /// What it became.
        high: bool,
        /// When, in ticks.
        tick: u64,
        /// Volume from 0; none for the stimulus.
        volume: Option<u32>,
    },
    /// The first edge of the camera's EXPOSE output after its trigger.
    Exposed {
        /// In ticks.
        tick: u64,
        /// Volume from 0; none before the first trigger.
        volume: Option<u32>,
    },
    /// The board's clock beside the host's.
    Clock(Sample),
    /// Events that did not arrive.
    Lost {
        /// How many.
        events: u32,
        /// When that was noticed, in seconds since the log began.
        host_s: f64,
    },
    /// What a reader should know.
    Note {
        /// In seconds since the log began.
        host_s: f64,
        /// What.
        text: String,
    },
    /// The run ended early.
    Fault {
        /// Its name.
        fault: Fault,
        /// In words.
        words: String,
        /// In ticks.
        tick: u64,
    },
    /// The board's on-line solver has solved a volume.
    Phase(Phase),
    /// The phase has left its bounds, and the run goes on.
    Crossed {
        /// In ticks.
        tick: u64,
    },
    /// All edges were made.
    Finished {
        /// In ticks.
        tick: u64,
    },
    /// What it amounts to.
    Summary(Box<Summary>),
}

/// What was to be done, by whom, with what.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Program and version.
    pub software: String,
    /// Date and time (RFC 3339, UTC) at which the log began: `host_s` = 0.
    pub utc: String,
    /// The port the board was at.
    pub port: String,
    /// File or preset the plan came from.
    pub source: String,
    /// The plan's name.
    pub name: String,
    /// `key=value` changes of the plan.
    pub settings: Vec<String>,
    /// In whose ledger the doses are counted.
    pub subject: Option<String>,
    /// The plan, times in ticks.
    pub plan: Plan,
    /// CRC-32 of the compiled plan, 8 hexadecimal digits.
    pub plan_hash: String,
    /// The bytes that were sent, in hexadecimal.
    pub compiled: String,
    /// Nominal ticks of the board's clock per second.
    pub ticks_per_second: u32,
    /// The board.
    pub board: Board,
    /// What was turned off, rounded or forced.
    pub warnings: Vec<String>,
}

/// Who the board is.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Board {
    /// Which board.
    pub model: Model,
    /// Version of its firmware.
    pub version: String,
    /// Hash of the protocol, 8 hexadecimal digits.
    pub protocol: String,
    /// Hash of the firmware's sources.
    pub build: String,
    /// Hash of the program memory as the board read it.
    pub image: String,
    /// Bytes of program memory that hash covers.
    pub image_bytes: u32,
    /// Why the board started.
    pub reset: String,
    /// What it can do, times in ticks.
    pub limits: Limits,
}

impl From<&Hello> for Board {
    fn from(hello: &Hello) -> Self {
        Self {
            model: hello.model,
            version: words::version(hello.version),
            protocol: words::hex(hello.protocol),
            build: words::hex(hello.build),
            image: words::hex(hello.image),
            image_bytes: hello.image_bytes,
            reset: hello.reset.to_string(),
            limits: hello.limits,
        }
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// All edges were made.
    Finished,
    /// The user stopped it.
    Aborted,
    /// The board stopped it.
    Fault,
    /// The board started anew during the run.
    Reset,
    /// The line was lost; what the board did then is not known.
    LineLost,
    /// The board did not take the plan or did not arm.
    Refused,
    /// Log or ledger could not be written: the run was aborted.
    Unrecorded,
}

/// What a run amounts to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// How it ended.
    pub ending: Ending,
    /// In words.
    pub words: String,
    /// The board has said, at the end, that its outputs are low.
    pub safe: bool,
    /// The edges beside those of the plan.
    pub edges: Comparison,
    /// Volumes whose camera trigger was made.
    pub volumes: u32,
    /// Volumes of the plan.
    pub planned_volumes: u64,
    /// EXPOSE edges.
    pub exposures: u64,
    /// Events lost, on the line or by the board.
    pub events_lost: u32,
    /// Frames from the board that could not be understood.
    pub garbled: u32,
    /// Requests that were repeated.
    pub repeated: u32,
    /// The longest pass of the board's main loop, in ticks.
    pub longest_pass_ticks: u32,
    /// The board's clock as the host's saw it.
    pub clock: Option<Fit>,
    /// When each volume was taken.
    pub times: Option<VolumeTimes>,
}

/// A run, as its log tells it.
#[derive(Debug, Clone, PartialEq)]
pub struct RunLog {
    /// What was to be done.
    pub header: Header,
    /// The plan's time zero, in ticks.
    pub start: Option<u64>,
    /// The edges made, in the order in which they were told.
    pub edges: Vec<Edge>,
    /// EXPOSE edges: tick and volume.
    pub exposures: Vec<(u64, Option<u32>)>,
    /// What the on-line solver said of the volumes.
    pub phases: Vec<Phase>,
    /// When the phase left its bounds and the run went on, in ticks.
    pub crossed: Option<u64>,
    /// The board's clock beside the host's.
    pub clock: Vec<Sample>,
    /// Events that did not arrive.
    pub lost: u32,
    /// What a reader should know.
    pub notes: Vec<String>,
    /// Why and when the board stopped the run.
    pub fault: Option<(Fault, u64)>,
    /// When the board finished, in ticks.
    pub finished: Option<u64>,
    /// The last line.
    pub summary: Option<Summary>,
    /// The last line was cut off: the program was killed or the disk was full.
    pub truncated: bool,
}

impl RunLog {
    /// A run of which nothing has happened yet.
    #[must_use]
    pub fn new(header: Header) -> Self {
        Self {
            header,
            start: None,
            edges: Vec::new(),
            exposures: Vec::new(),
            phases: Vec::new(),
            crossed: None,
            clock: Vec::new(),
            lost: 0,
            notes: Vec::new(),
            fault: None,
            finished: None,
            summary: None,
            truncated: false,
        }
    }

    /// One thing more has happened.
    pub fn push(&mut self, record: &Record) {
        match record {
            // The first line has been read to make the log.
            Record::Header(_) => {}
            Record::Started { tick, .. } => self.start = Some(*tick),
            Record::Edge { channel, high, tick, .. } => {
                self.edges.push(Edge { channel: *channel, high: *high, tick: *tick });
            }
            Record::Exposed { tick, volume } => self.exposures.push((*tick, *volume)),
            Record::Clock(sample) => self.clock.push(*sample),
            Record::Lost { events, .. } => self.lost = self.lost.saturating_add(*events),
            Record::Note { text, .. } => self.notes.push(text.clone()),
            Record::Phase(phase) => self.phases.push(*phase),
            Record::Crossed { tick } => self.crossed = Some(*tick),
            Record::Fault { fault, tick, .. } => self.fault = Some((*fault, *tick)),
            Record::Finished { tick } => self.finished = Some(*tick),
            Record::Summary(summary) => self.summary = Some((**summary).clone()),
        }
    }

    /// The board's clock as the host's saw it.
    #[must_use]
    pub fn fit(&self) -> Option<Fit> {
        Fit::of(&self.clock, self.header.ticks_per_second)
    }

    /// The edges beside those of the plan.
    #[must_use]
    pub fn comparison(&self) -> Comparison {
        let ending = self.summary.as_ref().map(|summary| summary.ending);
        self.compare(self.finished.is_some() || ending == Some(Ending::Finished))
    }

    /// The edges beside those of the plan: all of them, or those of a run that ended early. Light
    /// that the plan's phase limit has ended is not missed.
    #[must_use]
    pub fn compare(&self, whole: bool) -> Comparison {
        let start = self.start.unwrap_or(0);
        let mut expected = Expected::of(&self.header.plan);
        if let Some(tick) = self.light_ended() {
            expected.end_light(tick.saturating_sub(start));
        }
        expected.compare(&self.edges, start, whole)
    }

    /// When the plan's phase limit ended the stimulus, in ticks.
    #[must_use]
    pub fn light_ended(&self) -> Option<u64> {
        let limit = self.header.plan.phase_limit?;
        self.crossed.filter(|_| limit.action == Action::Stimulus)
    }

    /// Ticks of one kind of edge.
    #[must_use]
    pub fn ticks(&self, channel: Channel, high: bool) -> Vec<u64> {
        let edges = self.edges.iter();
        let wanted = edges.filter(|edge| edge.channel == channel && edge.high == high);
        wanted.map(|edge| edge.tick).collect()
    }
}

/// Channels by their lower-case names.
mod channel_names {
    use crate::trigger::summary::channel_name;
    use phasewalk_firmware::channel::Channel;
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(channel: &Channel, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(channel_name(*channel))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Channel, D::Error> {
        let name = String::deserialize(from)?;
        let found = Channel::ALL.into_iter().find(|channel| channel_name(*channel) == name);
        found.ok_or_else(|| D::Error::custom(format!("no channel is called '{name}'")))
    }
}
