//! The dose ledger: one line of JSON per run, never changed, only added to.
//!
//! ```text
//! {"date":"2026-01-31T09:30:00Z","subject":"S07","plan":"paper","plan_hash":"1a2b3c4d",
//!  "doses_j_cm2":{"retina, laser":1.99,"retina, stimulus":0.0074}}
//! ```
//!
//! A day is the 24 hours before now: midnight forgives nothing.

use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

const DAY: Duration = Duration::from_secs(24 * 60 * 60);

/// Radiant exposures in J/cm2, by plane and source (`retina, laser`).
pub type Doses = BTreeMap<String, f64>;

/// One run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// When it began: RFC 3339, UTC.
    pub date: String,
    /// A label of whoever's eye it was; no name.
    pub subject: String,
    /// Name of the plan.
    pub plan: String,
    /// Hash of the compiled plan, eight hexadecimal digits.
    pub plan_hash: String,
    /// What it brought, in J/cm2.
    pub doses_j_cm2: Doses,
}

impl Entry {
    /// A run that begins now.
    #[must_use]
    pub fn now(subject: &str, plan: &str, plan_hash: u32, doses_j_cm2: Doses) -> Self {
        let date = humantime::format_rfc3339_seconds(SystemTime::now()).to_string();
        let (subject, plan) = (subject.to_owned(), plan.to_owned());
        Self { date, subject, plan, plan_hash: format!("{plan_hash:08x}"), doses_j_cm2 }
    }
}

/// A ledger file.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    entries: Vec<(SystemTime, Entry)>,
}

impl Ledger {
    /// Read a ledger; one that does not exist yet is empty.
    ///
    /// # Errors
    /// When it cannot be read, or any line is damaged: a dose that cannot be read is not zero.
    pub fn open(path: &Path) -> Result<Self> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(Error::file(path, format!("cannot be read: {error}"))),
        };
        let mut entries = Vec::new();
        for (number, line) in text.lines().enumerate() {
            let entry = parse(line).map_err(|what| {
                Error::file(path, format!("line {}: {what}: correct the ledger", number + 1))
            })?;
            entries.push(entry);
        }
        Ok(Self { path: path.to_owned(), entries })
    }

    /// What a subject has got in the last 24 hours; entries dated in the future count, too.
    #[must_use]
    pub fn today(&self, subject: &str) -> Doses {
        self.since(subject, SystemTime::now().checked_sub(DAY).unwrap_or(SystemTime::UNIX_EPOCH))
    }

    fn since(&self, subject: &str, from: SystemTime) -> Doses {
        let mut sums = Doses::new();
        for (date, entry) in &self.entries {
            if entry.subject == subject && *date >= from {
                for (name, dose) in &entry.doses_j_cm2 {
                    *sums.entry(name.clone()).or_default() += dose;
                }
            }
        }
        sums
    }

    /// Add a run: the whole line or nothing, on the disk when this returns.
    ///
    /// # Errors
    /// When the entry is none that could be read again, or the file cannot be written.
    pub fn append(&mut self, entry: &Entry) -> Result<()> {
        let line = serde_json::to_string(entry).map_err(|e| Error::failed(e.to_string()))?;
        let parsed = parse(&line).map_err(|what| Error::file(&self.path, what))?;
        self.write(&format!("{line}\n")).map_err(|error| {
            Error::file(&self.path, format!("the run's dose cannot be written: {error}"))
        })?;
        self.entries.push(parsed);
        Ok(())
    }

    /// Locked, so that two programs do not mix their lines; what a failed write left is taken back.
    fn write(&self, line: &str) -> std::io::Result<()> {
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&self.path)?;
        file.lock()?;
        let before = file.metadata()?.len();
        let separator = if ends_within_a_line(&mut file, before)? { "\n" } else { "" };
        let written = file.write_all(format!("{separator}{line}").as_bytes());
        if written.and_then(|()| file.sync_all()).is_err() {
            file.set_len(before)?;
            return Err(std::io::Error::other("the disk did not take it"));
        }
        Ok(())
    }
}

/// Somebody's editor may have left out the last line break.
fn ends_within_a_line(file: &mut File, length: u64) -> std::io::Result<bool> {
    if length == 0 {
        return Ok(false);
    }
    let mut last = [0];
    file.seek(SeekFrom::Start(length - 1))?;
    file.read_exact(&mut last)?;
    Ok(last != *b"\n")
}

fn parse(line: &str) -> std::result::Result<(SystemTime, Entry), String> {
    let entry: Entry = serde_json::from_str(line).map_err(|error| error.to_string())?;
    let date = humantime::parse_rfc3339(&entry.date)
        .map_err(|_| format!("'{}' is no date such as 2026-01-31T09:30:00Z", entry.date))?;
    if entry.doses_j_cm2.values().any(|dose| !dose.is_finite() || *dose < 0.0) {
        return Err("a dose is negative or no number".to_owned());
    }
    Ok((date, entry))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn doses(retina: f64) -> Doses {
        Doses::from([("retina, laser".to_owned(), retina)])
    }

    #[test]
    fn doses_add_up_by_subject_and_day() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("L.ndjson");
        let mut ledger = Ledger::open(&path).unwrap();
        assert!(ledger.today("A").is_empty() && !path.exists());
        for (subject, dose) in [("A", 1.0), ("B", 10.0), ("A", 0.5)] {
            ledger.append(&Entry::now(subject, "paper", 0xab, doses(dose))).unwrap();
        }
        let old = Entry {
            date: "2001-01-01T00:00:00Z".to_owned(),
            ..Entry::now("A", "p", 1, doses(7.0))
        };
        ledger.append(&old).unwrap();
        for ledger in [ledger, Ledger::open(&path).unwrap()] {
            assert_eq!(ledger.today("A"), doses(1.5));
            assert_eq!(ledger.today("B"), doses(10.0));
            assert!(ledger.today("C").is_empty());
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 4);
        assert!(text.contains("\"plan_hash\":\"000000ab\""), "{text}");
    }

    #[test]
    fn a_damaged_ledger_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("L.ndjson");
        let line = serde_json::to_string(&Entry::now("A", "p", 1, doses(1.0))).unwrap();
        for (damaged, word) in [
            (format!("{line}\n{}", &line[..20]), "line 2"),
            (line.replace("1.0", "-1.0"), "negative"),
            (line.replace("20", "2x"), "no date"),
            (line.replace("subject", "object"), "object"),
        ] {
            std::fs::write(&path, damaged).unwrap();
            let message = Ledger::open(&path).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        std::fs::write(&path, &line).unwrap();
        Ledger::open(&path).unwrap().append(&Entry::now("A", "p", 1, doses(2.0))).unwrap();
        assert_eq!(Ledger::open(&path).unwrap().today("A"), doses(3.0));
    }
}
