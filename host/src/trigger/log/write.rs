//! Writing a run log while the run goes on.

use super::{Record, RunLog};
use crate::error::{Error, Result};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// A run log on disk and in memory. Every line is handed to the operating system at once, so that
/// what was recorded survives the program.
#[derive(Debug)]
pub struct Writer {
    file: File,
    path: PathBuf,
    begin: Instant,
    log: RunLog,
}

impl Writer {
    /// Begin the log at `path`; an existing file is replaced only if `overwrite`.
    ///
    /// # Errors
    /// When the file exists or cannot be created.
    pub fn create(path: &Path, overwrite: bool, log: RunLog, begin: Instant) -> Result<Self> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(true).create_new(!overwrite);
        let file = options.open(path).map_err(|error| cannot_create(path, &error))?;
        let mut writer = Self { file, path: path.to_owned(), begin, log };
        let header = Record::Header(Box::new(writer.log.header.clone()));
        writer.record(&header)?;
        Ok(writer)
    }

    /// Write one line.
    ///
    /// # Errors
    /// When the disk is full or gone.
    pub fn record(&mut self, record: &Record) -> Result<()> {
        let line = serde_json::to_string(record)
            .map_err(|error| Error::file(&self.path, format!("cannot be written: {error}")))?;
        // In one piece: a crash cuts at most the last line.
        self.file
            .write_all(format!("{line}\n").as_bytes())
            .map_err(|error| Error::file(&self.path, format!("cannot be written: {error}")))?;
        self.log.push(record);
        Ok(())
    }

    /// Write what a reader should know.
    ///
    /// # Errors
    /// As [`Self::record`].
    pub fn note(&mut self, text: impl Into<String>) -> Result<()> {
        let host_s = self.host_s(Instant::now());
        self.record(&Record::Note { host_s, text: text.into() })
    }

    /// A time in seconds since the log began.
    #[must_use]
    pub fn host_s(&self, at: Instant) -> f64 {
        at.saturating_duration_since(self.begin).as_secs_f64()
    }

    /// What was recorded so far.
    #[must_use]
    pub fn log(&self) -> &RunLog {
        &self.log
    }

    /// Where.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The last line; returns the whole log once the disk has it.
    ///
    /// # Errors
    /// As [`Self::record`].
    pub fn finish(mut self, last: &Record) -> Result<RunLog> {
        self.record(last)?;
        self.file
            .sync_all()
            .map_err(|error| Error::file(&self.path, format!("cannot be written: {error}")))?;
        Ok(self.log)
    }
}

/// Whether a run may be recorded there.
///
/// # Errors
/// When there is a file already.
pub fn check_absent(path: &Path, overwrite: bool) -> Result<()> {
    if !overwrite && path.exists() { Err(exists(path)) } else { Ok(()) }
}

fn exists(path: &Path) -> Error {
    Error::usage(format!(
        "--log {}: exists; give another name, or --overwrite to lose what is in it",
        path.display()
    ))
}

fn cannot_create(path: &Path, error: &std::io::Error) -> Error {
    match error.kind() {
        ErrorKind::AlreadyExists => exists(path),
        ErrorKind::NotFound => Error::file(path, "the folder does not exist: create it"),
        _ => Error::file(path, format!("cannot be created: {error}")),
    }
}
