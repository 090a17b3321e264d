//! `phasewalk trigger selftest`: the board measures its own edges.

use super::line::Line;
use super::{confirm, outcome};
use crate::cli::{Common, print};
use crate::error::{Error, Result};
use crate::progress;
use crate::trigger::connection::Connection;
use crate::trigger::log::write::{Writer, check_absent};
use crate::trigger::log::{Ending, RunLog};
use crate::trigger::run::Run;
use crate::trigger::run::job::Job;
use crate::trigger::run::recorder::Recorder;
use crate::trigger::selftest::{Verdict, plan};
use crate::trigger::words;
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::message::Hello;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Options of `trigger selftest`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    line: Line,
    /// Number of sweeps, 25 ms apart
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u16).range(1..=10_000))]
    sweeps: u16,
    /// Keep the log of the run
    #[arg(long, value_name = "RUN.ndjson")]
    log: Option<PathBuf>,
    /// Start without asking
    #[arg(long)]
    yes: bool,
}

/// The jumper of the emulated Uno.
const EMULATED_JUMPER: &str = "D9-D8";

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    if let Some(log) = &arguments.log {
        check_absent(log, false)?;
    }
    if !arguments.yes {
        confirm::check_terminal()?;
    }
    let mut connection = open(arguments)?;
    let hello = connection.greet()?;
    let Some(jumper) = words::jumper(&hello) else {
        let port = &connection.port;
        return Err(Error::failed(format!(
            "{port}: this board runs without outputs to be measured"
        )));
    };
    if !arguments.yes {
        confirm::confirm(&before(jumper))?;
    }
    let folder = tempfile::tempdir();
    let folder = folder.map_err(|e| Error::failed(format!("no temporary folder: {e}")))?;
    let nowhere = folder.path().join("selftest.ndjson");
    let path = arguments.log.as_deref().unwrap_or(&nowhere);
    let log = make(arguments, path, &mut connection, &hello, jumper)?;
    if log.summary.as_ref().is_some_and(|summary| summary.ending == Ending::Aborted) {
        progress::check()?;
    }
    if let Some(defect) = outcome::defect(&log) {
        return Err(Error::failed(defect));
    }
    report(&Verdict::of(&log), common)
}

/// An emulated Uno gets its jumper; the emulated STM32F405 has no pins for one.
fn open(arguments: &Arguments) -> Result<Connection> {
    match arguments.line.port.as_deref() {
        Some("sim:f405") => arguments.line.open(),
        _ => arguments.line.open_with(&[EMULATED_JUMPER]),
    }
}

/// What must be done by hand before.
fn before((output, input): (&str, &str)) -> String {
    format!(
        "Unplug laser, camera and LED from the board, then put a jumper from {output} to {input}."
    )
}

fn make(
    arguments: &Arguments,
    path: &Path,
    connection: &mut Connection,
    hello: &Hello,
    (output, input): (&str, &str),
) -> Result<RunLog> {
    let per_second = hello.limits.ticks_per_second;
    let plan = plan(arguments.sweeps, per_second);
    let compiled = Compiled::new(&plan).ok_or_else(|| Error::failed("the plan is too long"))?;
    let header = Job {
        port: &connection.port,
        baud: arguments.line.baud,
        hello,
        source: "selftest",
        name: "selftest",
        settings: &[],
        subject: None,
        plan: &plan,
        compiled: &compiled,
        solves: false,
        warnings: &[format!(
            "interlock and READY are off: a jumper from {output} to {input}, nothing else"
        )],
    }
    .header();
    let run = Run {
        link: &mut connection.link,
        compiled: &compiled,
        plan: &plan,
        ticks_per_second: per_second,
        recorder: Recorder::new(Writer::create(path, false, RunLog::new(header), Instant::now())?),
        stream: None,
        armed: &mut || Ok(()),
    };
    run.make(&mut |_| ())
}

fn report(verdict: &Verdict, common: &Common) -> Result<()> {
    if common.json {
        print(&json!(verdict).to_string());
    } else {
        print(&table(verdict));
    }
    match &verdict.defect {
        None => Ok(()),
        Some(defect) => Err(Error::failed(defect.clone())),
    }
}

fn table(verdict: &Verdict) -> String {
    let Verdict { made, captured, .. } = verdict;
    let mut lines = vec![format!("{captured} of {made} edges captured")];
    let row = |(delay, count): (&i64, &usize)| format!("{delay:>8} ticks after: {count} times");
    lines.extend(verdict.histogram.iter().map(row));
    if let Some(jitter) = verdict.peak_to_peak {
        lines.push(format!("peak to peak: {jitter} ticks"));
    }
    if verdict.defect.is_none() {
        lines.push("good: every edge lies where it was asked for".to_owned());
    }
    lines.join("\n")
}
