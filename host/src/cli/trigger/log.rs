//! `phasewalk trigger log`: what a run log says.

use super::outcome;
use crate::cli::{Common, check_output, print};
use crate::error::Result;
use crate::io::write_atomic;
use crate::trigger::log::RunLog;
use crate::trigger::log::phase::Phase;
use crate::trigger::log::statistics::{Spread, Statistics};
use crate::trigger::log::table::csv;
use crate::trigger::{units, words};
use serde_json::json;
use std::path::PathBuf;

/// Options of `trigger log`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The log of a run
    file: PathBuf,
    /// Write the edges as a table, too
    #[arg(long, value_name = "EDGES.csv")]
    csv: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, common: &Common) -> Result<()> {
    let log = RunLog::read(&arguments.file)?;
    if let Some(path) = &arguments.csv {
        check_output("--csv", path, &[&arguments.file])?;
        write_atomic(path, csv(&log).as_bytes())?;
    }
    if common.json {
        print(&summary(&log));
        return Ok(());
    }
    let parts = [what(&log), result(&log), regularity(&log), phases(&log), remarks(&log)];
    print(&parts.concat().join("\n"));
    if let Some(path) = &arguments.csv {
        print(&format!("wrote {}", path.display()));
    }
    Ok(())
}

fn summary(log: &RunLog) -> String {
    json!({
        "header": log.header,
        "summary": log.summary,
        "comparison": log.comparison(),
        "statistics": Statistics::of(log),
        "clock": log.fit(),
        "times": log.times().ok(),
        "phases": log.phases,
        "crossed": log.crossed,
        "fault": log.fault.map(|(fault, tick)| json!({ "fault": fault, "tick": tick })),
        "notes": log.notes,
        "truncated": log.truncated,
        "defect": outcome::defect(log),
    })
    .to_string()
}

fn what(log: &RunLog) -> Vec<String> {
    let header = &log.header;
    let subject = header.subject.as_ref();
    let subject = subject.map_or(String::new(), |subject| format!(", subject {subject}"));
    vec![
        format!("{} ({}) on {}{subject}", header.name, header.plan_hash, header.utc),
        format!(
            "{} with firmware {}, image {}; {}",
            words::model(header.board.model),
            header.board.version,
            header.board.image,
            header.software
        ),
    ]
}

fn result(log: &RunLog) -> Vec<String> {
    if let Some(summary) = &log.summary {
        return vec![outcome::words(summary, log)];
    }
    let made = log.edges.len();
    let end = match &log.fault {
        Some((fault, _)) => format!("stopped by the board: {}", words::advice(*fault)),
        None => "the log has no end: the program was killed during the run".to_owned(),
    };
    let edges = match log.comparison().deviation {
        Some(deviation) => format!("{made} edges, not on plan: {deviation}"),
        None => format!("{made} edges, those on plan"),
    };
    let mut lines = vec![end, edges];
    lines.extend(outcome::crossing(log));
    lines.push(outcome::clock(log.fit().as_ref()));
    lines
}

fn regularity(log: &RunLog) -> Vec<String> {
    let per_second = log.header.ticks_per_second;
    let statistics = Statistics::of(log);
    let mut lines: Vec<String> = statistics
        .intervals
        .iter()
        .map(|interval| {
            let planned = words::ticks(interval.planned, per_second);
            spread(&format!("interval of {planned}"), &interval.made, per_second)
        })
        .collect();
    let named = [
        ("camera after laser", statistics.camera_minus_laser),
        ("EXPOSE after camera trigger", statistics.exposure_delay),
    ];
    for (name, found) in named {
        lines.extend(found.map(|found| spread(name, &found, per_second)));
    }
    lines
}

fn spread(name: &str, spread: &Spread, per_second: u32) -> String {
    let seconds = |ticks: f64| units::rounded(ticks / f64::from(per_second));
    let peak_to_peak = spread.peak_to_peak();
    format!(
        "{name}: {} times, mean {} ({:.3} ticks), peak to peak {peak_to_peak} ticks ({})",
        spread.count,
        seconds(spread.mean),
        spread.mean,
        seconds(peak_to_peak as f64),
    )
}

/// What the on-line solver has said.
fn phases(log: &RunLog) -> Vec<String> {
    let Some(last) = log.phases.last() else { return Vec::new() };
    let larger = |a: &&Phase, b: &&Phase| a.phase_rad.abs().total_cmp(&b.phase_rad.abs());
    let largest = log.phases.iter().max_by(larger).unwrap_or(last);
    let said = |phase: &Phase| {
        let Phase { volume, phase_rad, sigma_rad, .. } = phase;
        format!("{phase_rad:.4} ± {sigma_rad:.4} rad (volume {volume})")
    };
    let (count, last, largest) = (log.phases.len(), said(last), said(largest));
    vec![format!("on-line phase: {count} volumes, last {last}, largest {largest}")]
}

fn remarks(log: &RunLog) -> Vec<String> {
    let warnings = log.header.warnings.iter().map(|warning| format!("warning: {warning}"));
    let notes = log.notes.iter().map(|note| format!("note: {note}"));
    let truncated = log.truncated.then(|| "note: the last line is cut off".to_owned());
    warnings.chain(notes).chain(truncated).collect()
}
