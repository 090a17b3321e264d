//! `phasewalk trigger run`: run a plan on the board and record every edge.

use super::line::Line;
use super::speckles::SpeckleOptions;
use super::{confirm, outcome};
use crate::cli::{Common, print};
use crate::error::{Error, Result};
use crate::progress::{self, Progress as Bar};
use crate::trigger::connection::Connection;
use crate::trigger::ledger::{Doses, Entry, Ledger};
use crate::trigger::log::write::{Writer, check_absent};
use crate::trigger::log::{Ending, Header, RunLog};
use crate::trigger::plan_file::{self, Loaded};
use crate::trigger::run::job::Job;
use crate::trigger::run::recorder::Recorder;
use crate::trigger::run::stream::Stream;
use crate::trigger::run::{Progress, Run};
use crate::trigger::speckles::Speckles;
use crate::trigger::words;
use phasewalk_firmware::message::Hello;
use phasewalk_firmware::plan::Plan;
use ready::Ready;
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

mod ready;

/// Options of `trigger run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Plan file (TOML), or a preset: paper, pairs, triples
    plan: String,
    #[command(flatten)]
    line: Line,
    /// Where every edge and the whole plan are written, as one JSON object per line
    #[arg(long, value_name = "RUN.ndjson")]
    log: PathBuf,
    /// Replace an existing log
    #[arg(long)]
    overwrite: bool,
    /// Change a key, the value with its unit: interval=300s, volumes=10, stimulus.duration=2s
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// The laboratory's limits (TOML) [default: a built-in example, not certified]
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// Dose ledger: what the subject has got in the last 24 hours counts, and the run is entered
    #[arg(long, value_name = "FILE", requires = "subject")]
    ledger: Option<PathBuf>,
    /// Label of the subject in the ledger
    #[arg(long, value_name = "LABEL", requires = "ledger")]
    subject: Option<String>,
    /// Stream the volumes of this complex series to the board's on-line solver, each when its sweep
    /// is over
    #[arg(long, value_name = "FIELD")]
    solve: Option<PathBuf>,
    #[command(flatten)]
    speckles: SpeckleOptions,
    /// Start without asking
    #[arg(long)]
    yes: bool,
    /// Run although the timing certificate refuses the plan (for tests of the board)
    #[arg(long, conflicts_with = "ledger")]
    force: bool,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    check_absent(&arguments.log, arguments.overwrite)?;
    if let Some(option) = arguments.speckles.given().filter(|_| arguments.solve.is_none()) {
        return Err(Error::usage(format!(
            "{option}: chooses speckles for --solve, which is missing"
        )));
    }
    if !arguments.yes {
        confirm::check_terminal()?;
    }
    let mut connection = arguments.line.open()?;
    let hello = connection.greet()?;
    if let (Some(_), Some(caution)) = (&arguments.subject, words::caution(hello.model)) {
        return Err(Error::failed(format!("{}: {caution}; use an Arduino Uno", connection.port)));
    }
    let loaded = plan_file::load(&arguments.plan, &arguments.set, &hello.limits)?;
    let speckles = speckles(arguments, &hello, &loaded.plan)?;
    let mut book = Book::open(arguments)?;
    let ready = Ready::check(arguments, &loaded, book.before(), &hello.limits)?;
    let header = Job {
        port: &connection.port,
        baud: arguments.line.baud,
        hello: &hello,
        source: &loaded.source,
        name: &loaded.name,
        settings: &arguments.set,
        subject: arguments.subject.as_deref(),
        plan: &ready.plan,
        compiled: &ready.compiled,
        solves: speckles.is_some(),
        warnings: &ready.warnings,
    }
    .header();
    if !common.json {
        print(&announcement(&ready, &header));
    }
    if !arguments.yes {
        confirm::confirm("Start?")?;
    }
    let stream = speckles.as_ref().map(|speckles| Stream::new(speckles, &ready.plan));
    let mut armed = || book.enter(&loaded, &ready);
    let log = make(arguments, &ready, header, &mut connection, stream, &mut armed)?;
    report(&log, arguments, common)
}

/// What is streamed to the solver: a volume for each sweep.
fn speckles(arguments: &Arguments, hello: &Hello, plan: &Plan) -> Result<Option<Speckles>> {
    let Some(series) = &arguments.solve else { return Ok(None) };
    let sweeps = plan.total_sweeps();
    let most = usize::try_from(sweeps).ok();
    let speckles = arguments.speckles.read(series, &hello.limits, most)?;
    let volumes = speckles.volumes();
    if (volumes as u64) < sweeps {
        let what = format!("has {volumes} volumes, the plan {sweeps} sweeps: give a longer series");
        return Err(Error::file(series, what));
    }
    Ok(Some(speckles))
}

/// The ledger, if one is kept.
struct Book<'a> {
    ledger: Option<(Ledger, &'a str)>,
}

impl<'a> Book<'a> {
    fn open(arguments: &'a Arguments) -> Result<Self> {
        let (Some(path), Some(subject)) = (&arguments.ledger, &arguments.subject) else {
            return Ok(Self { ledger: None });
        };
        Ok(Self { ledger: Some((Ledger::open(path)?, subject)) })
    }

    fn before(&self) -> Option<Doses> {
        self.ledger.as_ref().map(|(ledger, subject)| ledger.today(subject))
    }

    /// The whole dose, before any of it: a run that ends early counts too much, never too little.
    fn enter(&mut self, loaded: &Loaded, ready: &Ready) -> Result<()> {
        let Some((ledger, subject)) = &mut self.ledger else { return Ok(()) };
        let doses = ready.doses.clone();
        ledger.append(&Entry::now(subject, &loaded.name, ready.compiled.hash(), doses))
    }
}

/// What will happen, for the person who starts it.
fn announcement(ready: &Ready, header: &Header) -> String {
    let mut lines = vec![ready.text.clone()];
    // Those of the checks are in the text.
    let late = header.warnings.iter().skip(ready.warnings.len());
    lines.extend(late.map(|warning| format!("warning: {warning}")));
    let (model, version) = (words::model(header.board.model), &header.board.version);
    lines.push(format!("board: {model} with firmware {version} at {}", header.port));
    lines.join("\n")
}

fn make(
    arguments: &Arguments,
    ready: &Ready,
    header: Header,
    connection: &mut Connection,
    stream: Option<Stream<'_>>,
    armed: &mut dyn FnMut() -> Result<()>,
) -> Result<RunLog> {
    let bar = Bar::new("run", ready.plan.total_sweeps());
    let ticks_per_second = header.ticks_per_second;
    let log = RunLog::new(header);
    let writer = Writer::create(&arguments.log, arguments.overwrite, log, Instant::now())?;
    let run = Run {
        link: &mut connection.link,
        compiled: &ready.compiled,
        plan: &ready.plan,
        ticks_per_second,
        recorder: Recorder::new(writer),
        stream,
        armed,
    };
    let mut begun = 0;
    run.make(&mut |progress| match progress {
        Progress::WaitsForEdge => {
            eprintln!("armed: waiting for a rising edge at the start input (Ctrl-C ends it)");
        }
        Progress::Sweeps(sweeps) => {
            // Ctrl-C is the run's business, not the bar's.
            let _ = bar.advance(u64::from(sweeps.saturating_sub(begun)));
            begun = sweeps;
        }
    })
}

fn report(log: &RunLog, arguments: &Arguments, common: &Common) -> Result<()> {
    let path = arguments.log.display();
    if common.json {
        print(&json!({ "log": arguments.log, "summary": log.summary }).to_string());
    } else if let Some(summary) = &log.summary {
        print(&outcome::words(summary, log));
        print(&format!("wrote {path}"));
    }
    // The user's own Ctrl-C, rather than an abort that came from elsewhere.
    if log.summary.as_ref().is_some_and(|summary| summary.ending == Ending::Aborted) {
        progress::check()?;
    }
    match outcome::defect(log) {
        None => Ok(()),
        Some(defect) => Err(Error::failed(format!("{defect} (recorded in {path})"))),
    }
}
