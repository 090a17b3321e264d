//! Reading a run log, and refusing what is none.

use super::{FORMAT, Header, Record, RunLog, VERSION};
use crate::error::{Error, Result};
use phasewalk_firmware::compiled::Compiled;
use serde_json::Value;
use std::io::ErrorKind;
use std::path::Path;

impl RunLog {
    /// Read and validate a run log. A last line that was cut off is left out and marked
    /// ([`RunLog::truncated`]).
    ///
    /// # Errors
    /// When the file cannot be read or is no run log; the message names the line.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => Error::file(path, "no such file: check the name"),
            _ => Error::file(path, format!("cannot be read: {error}")),
        })?;
        // A cut can fall within a character.
        let text = String::from_utf8_lossy(&bytes);
        parse(&text).map_err(|what| Error::file(path, what))
    }
}

type Parsed<T> = std::result::Result<T, String>;

fn parse(text: &str) -> Parsed<RunLog> {
    let whole = text.is_empty() || text.ends_with('\n');
    let lines: Vec<&str> = text.lines().collect();
    let (first, rest) = lines.split_first().ok_or("empty: not a run log")?;
    let mut log = RunLog::new(header(first)?);
    for (index, line) in rest.iter().enumerate() {
        let number = index + 2;
        match serde_json::from_str::<Record>(line) {
            Ok(record) => take(&mut log, &record).map_err(|what| at(number, &what))?,
            Err(_) if number == lines.len() && !whole => log.truncated = true,
            Err(error) => return Err(at(number, &error.to_string())),
        }
    }
    Ok(log)
}

fn at(line: usize, what: &str) -> String {
    format!("line {line}: {what}")
}

fn header(line: &str) -> Parsed<Header> {
    let value: Value =
        serde_json::from_str(line).map_err(|_| "line 1: no JSON: not a run log".to_owned())?;
    if value.get("format").and_then(Value::as_str) != Some(FORMAT) {
        return Err(format!("line 1: not a run log (no \"format\":\"{FORMAT}\")"));
    }
    let version = value.get("version").and_then(Value::as_u64);
    if version != Some(u64::from(VERSION)) {
        let found = version.map_or("none".to_owned(), |version| version.to_string());
        return Err(format!(
            "line 1: version {found} of the run log, this program reads {VERSION}: use the \
             program that wrote it"
        ));
    }
    let record = serde_json::from_value(value).map_err(|error| at(1, &error.to_string()))?;
    let Record::Header(header) = record else {
        return Err("line 1: not the header of a run log".to_owned());
    };
    same_plan(&header)?;
    Ok(*header)
}

/// The plan in words and the bytes that were sent mean the same.
fn same_plan(header: &Header) -> Parsed<()> {
    let compiled = Compiled::new(&header.plan).ok_or("line 1: the plan is too long")?;
    if hexadecimal(compiled.bytes()) != header.compiled
        || crate::trigger::words::hex(compiled.hash()) != header.plan_hash
    {
        return Err("line 1: plan, its compiled bytes and its hash do not agree: the log was \
                    changed or written by another version"
            .to_owned());
    }
    if header.ticks_per_second == 0 {
        return Err("line 1: ticks_per_second is 0".to_owned());
    }
    Ok(())
}

/// Bytes as pairs of hexadecimal digits.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Records come in an order that makes sense.
fn take(log: &mut RunLog, record: &Record) -> Parsed<()> {
    if log.summary.is_some() {
        return Err("a record after the summary".to_owned());
    }
    match record {
        Record::Header(_) => return Err("a second header".to_owned()),
        Record::Started { .. } if log.start.is_some() => return Err("a second start".to_owned()),
        Record::Edge { channel, tick, .. } => {
            let last = log.edges.iter().rev().find(|edge| edge.channel == *channel);
            if last.is_some_and(|last| last.tick >= *tick) {
                return Err(format!("tick {tick} is not after the channel's edge before"));
            }
        }
        _ => {}
    }
    log.push(record);
    Ok(())
}
