//! What a run log begins with: the plan, the board, and what is doubtful about the two together.

use crate::trigger::expected::{Expected, untold};
use crate::trigger::log::read::hexadecimal;
use crate::trigger::log::{Board, FORMAT, Header, VERSION};
use crate::trigger::{units, words};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::limits::Limits;
use phasewalk_firmware::message::Hello;
use phasewalk_firmware::plan::Plan;
use std::time::SystemTime;

/// Sooner than this the host cannot promise to speak.
const SOONEST_HEARTBEAT_S: f64 = 0.2;

/// A checked plan for one board.
pub struct Job<'a> {
    /// Where the board is.
    pub port: &'a str,
    /// Bits per second of the line.
    pub baud: u32,
    /// Who it is.
    pub hello: &'a Hello,
    /// File or preset the plan came from.
    pub source: &'a str,
    /// Its name.
    pub name: &'a str,
    /// How it was changed.
    pub settings: &'a [String],
    /// In whose ledger the doses are counted.
    pub subject: Option<&'a str>,
    /// The plan as it is sent.
    pub plan: &'a Plan,
    /// Its bytes.
    pub compiled: &'a Compiled,
    /// Volumes are streamed to the on-line solver.
    pub solves: bool,
    /// What the checks say.
    pub warnings: &'a [String],
}

impl Job<'_> {
    /// The first line of the log.
    #[must_use]
    pub fn header(&self) -> Header {
        let ticks_per_second = self.hello.limits.ticks_per_second;
        let mut warnings = self.warnings.to_vec();
        warnings.extend(doubts(self.plan, &self.hello.limits, self.baud));
        warnings.extend(words::caution(self.hello.model).map(str::to_owned));
        if self.plan.phase_limit.is_some() && !self.solves {
            let what = "the plan has a phase limit, but no volumes are streamed (--solve): another \
                        program must, or the limit is never reached";
            warnings.push(what.to_owned());
        }
        Header {
            format: FORMAT.to_owned(),
            version: VERSION,
            software: concat!("phasewalk ", env!("CARGO_PKG_VERSION")).to_owned(),
            utc: humantime::format_rfc3339_millis(SystemTime::now()).to_string(),
            port: self.port.to_owned(),
            source: self.source.to_owned(),
            name: self.name.to_owned(),
            settings: self.settings.to_vec(),
            subject: self.subject.map(str::to_owned),
            plan: *self.plan,
            plan_hash: words::hex(self.compiled.hash()),
            compiled: hexadecimal(self.compiled.bytes()),
            ticks_per_second,
            board: Board::from(self.hello),
            warnings,
        }
    }
}

/// What may go wrong although no rule is broken.
fn doubts(plan: &Plan, board: &Limits, baud: u32) -> Vec<String> {
    let mut doubts = Vec::new();
    let lost = untold(&Expected::of(plan), board, baud);
    if lost > 0 {
        doubts.push(format!(
            "edges come faster than the board can tell: about {lost} will not be recorded"
        ));
    }
    let heartbeat = units::seconds(plan.caps.heartbeat.into(), board.ticks_per_second);
    if heartbeat > 0.0 && heartbeat < SOONEST_HEARTBEAT_S {
        doubts.push(format!(
            "a heartbeat of {} is shorter than what a busy computer keeps: the board may stop the \
             run",
            units::rounded(heartbeat)
        ));
    }
    doubts
}
