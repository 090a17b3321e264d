//! The runs of Figure 3 on disk: each is added as soon as it is there, so that work that was
//! interrupted goes on where it ended.
//!
//! The first line holds the settings, which must be those of the next call; the second names the columns;
//! then come one line per frame of each run. A run is added in one write, and what an interruption
//! may have left of a last one is taken off.

use super::methods::METHODS;
use super::run::Run;
use super::settings::{SIGMAS, Settings};
use crate::error::{Error, Result};
use crate::io::write_atomic;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// σ, an index into [`SIGMAS`], and number of the run.
pub type Key = (usize, usize);

const TITLE: &str = "# phasewalk paper, runs of Figure 3:";
const COLUMNS: &str = "sigma_wavelengths,run,frame,direct_rad,one_step_rad,paper_rad,linked_rad,\
                       autocorrelation";

/// All runs there are, in memory and in a file.
pub struct Store {
    path: PathBuf,
    file: File,
    runs: BTreeMap<Key, Run>,
}

impl Store {
    /// Begin a file of runs, or take one up.
    ///
    /// # Errors
    /// When the file holds runs of other settings or anything else, is in use, or cannot be written.
    pub fn open(path: &Path, settings: &Settings) -> Result<Self> {
        let head = format!("{TITLE} {}\n{COLUMNS}\n", settings.of_runs());
        if !path.exists() {
            write_atomic(path, head.as_bytes())?;
        }
        let failed = |error| Error::file(path, format!("cannot be used: {error}"));
        let file = OpenOptions::new().append(true).open(path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::file(
                    path,
                    "is in use by another run: wait, or give another --out",
                ));
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let text = std::fs::read_to_string(path).map_err(failed)?;
        check_settings(path, &text, settings)?;
        let (runs, length) = read_runs(path, &text, head.len(), settings.setup.scene.frames)?;
        file.set_len(length as u64).map_err(failed)?;
        Ok(Self { path: path.to_owned(), file, runs })
    }

    /// The run, if it is there.
    #[must_use]
    pub fn get(&self, key: Key) -> Option<&Run> {
        self.runs.get(&key)
    }

    /// How many runs are there.
    #[must_use]
    pub fn len(&self) -> usize {
        self.runs.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.runs.is_empty()
    }

    /// Keep a run.
    ///
    /// # Errors
    /// When the disk is full.
    pub fn add(&mut self, key: Key, run: Run) -> Result<()> {
        let failed = |error| {
            Error::file(&self.path, format!("cannot be written: {error}; earlier runs are kept"))
        };
        self.file.write_all(lines(key, &run).as_bytes()).map_err(failed)?;
        self.runs.insert(key, run);
        Ok(())
    }
}

/// A run as lines. Numbers are written so that reading gives the same number again.
fn lines((sigma, number): Key, run: &Run) -> String {
    let mut text = String::new();
    for (frame, autocorrelation) in run.autocorrelation.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{},{number},{frame}", SIGMAS[sigma]);
        for phases in &run.phases {
            let _ = write!(text, ",{}", phases[frame]);
        }
        let _ = writeln!(text, ",{autocorrelation}");
    }
    text
}

/// The first line must be that of these settings; what differs is named.
fn check_settings(path: &Path, text: &str, settings: &Settings) -> Result<()> {
    let Some(found) = text.lines().next().and_then(|line| line.strip_prefix(TITLE)) else {
        return Err(Error::file(path, "holds no runs of phasewalk paper: give another --out"));
    };
    let wanted = settings.of_runs();
    let both = found.split_whitespace().zip(wanted.split_whitespace());
    let different: Vec<String> = both
        .filter(|(found, wanted)| found != wanted)
        .map(|(found, wanted)| format!("{found}, not {wanted}"))
        .collect();
    if different.is_empty() && found.trim() == wanted {
        return Ok(());
    }
    Err(Error::usage(format!(
        "{}: holds runs with {}: give the same settings, or another folder with --out",
        path.display(),
        different.join("; ")
    )))
}

/// The whole runs behind the head, and where they end.
fn read_runs(
    path: &Path,
    text: &str,
    head: usize,
    frames: usize,
) -> Result<(BTreeMap<Key, Run>, usize)> {
    let (mut runs, mut end) = (BTreeMap::new(), head.min(text.len()));
    let whole: Vec<&str> =
        text[end..].split_inclusive('\n').filter(|line| line.ends_with('\n')).collect();
    for (block, lines) in whole.chunks_exact(frames).enumerate() {
        let (key, run) = read_run(lines).ok_or_else(|| {
            let line = 3 + block * frames;
            let what = format!("lines {line} to {} are not a run", line + frames - 1);
            Error::file(path, format!("{what}: remove the file, or give another --out"))
        })?;
        runs.insert(key, run);
        end += lines.iter().map(|line| line.len()).sum::<usize>();
    }
    Ok((runs, end))
}

/// The run that consists of these lines; none if they are anything else.
fn read_run(lines: &[&str]) -> Option<(Key, Run)> {
    let mut key = None;
    let mut run = Run {
        phases: METHODS.map(|_| Vec::new()),
        autocorrelation: Vec::with_capacity(lines.len()),
    };
    for (expected, line) in lines.iter().enumerate() {
        let mut cells = line.trim_end().split(',');
        let sigma: f64 = cells.next()?.parse().ok()?;
        let sigma = SIGMAS.iter().position(|&known| known == sigma)?;
        let number: usize = cells.next()?.parse().ok()?;
        let frame: usize = cells.next()?.parse().ok()?;
        if frame != expected || *key.get_or_insert((sigma, number)) != (sigma, number) {
            return None;
        }
        for phases in &mut run.phases {
            phases.push(cells.next()?.parse().ok()?);
        }
        run.autocorrelation.push(cells.next()?.parse().ok()?);
        if cells.next().is_some() {
            return None;
        }
    }
    Some((key?, run))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn settings(width: usize) -> Settings {
        Settings::new([width, 92], 1, 2, 3.0, 1).unwrap()
    }

    fn run(start: f64) -> Run {
        let values = |n: usize| (0..70).map(|t| start + 0.1 * (n * t) as f64).collect();
        Run { phases: [values(1), values(2), values(3), values(4)], autocorrelation: values(5) }
    }

    #[test]
    fn runs_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        let mut store = Store::open(&path, &settings(160)).unwrap();
        assert!(Store::open(&path, &settings(160)).err().unwrap().to_string().contains("in use"));
        store.add((3, 0), run(1.0 / 3.0)).unwrap();
        store.add((0, 1), run(-1e-17)).unwrap();
        drop(store);
        let store = Store::open(&path, &settings(160)).unwrap();
        assert_eq!((store.len(), store.get((3, 0))), (2, Some(&run(1.0 / 3.0))));
        assert_eq!((store.get((0, 1)), store.get((1, 0))), (Some(&run(-1e-17)), None));
    }

    #[test]
    fn half_a_run_is_taken_off() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        let mut store = Store::open(&path, &settings(160)).unwrap();
        store.add((1, 0), run(0.5)).unwrap();
        let whole = fs::read_to_string(&path).unwrap();
        store.add((1, 1), run(0.7)).unwrap();
        drop(store);
        let both = fs::read_to_string(&path).unwrap();
        for cut in [both.len() - 1, whole.len() + 100, whole.len() + 3] {
            fs::write(&path, &both[..cut]).unwrap();
            assert_eq!(Store::open(&path, &settings(160)).unwrap().len(), 1);
            assert_eq!(fs::read_to_string(&path).unwrap(), whole);
        }
    }

    #[test]
    fn other_settings_and_other_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.csv");
        let mut store = Store::open(&path, &settings(160)).unwrap();
        store.add((1, 0), run(0.5)).unwrap();
        drop(store);
        let refused = |width| Store::open(&path, &settings(width)).err().unwrap();
        let error = refused(100);
        assert!(error.to_string().contains("width=160, not width=100"), "{error}");
        assert_eq!(error.exit_status(), 2);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, text.replace(",69,", ",70,")).unwrap();
        assert!(refused(160).to_string().contains("lines 3 to 72 are not a run"));
        fs::write(&path, "mine\n").unwrap();
        assert!(refused(160).to_string().contains("holds no runs"));
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine\n");
    }
}
