//! Acquisition times from a file of their own.

use super::{InputKind, Series, Shape, kind_of_input, npy};
use crate::error::{Error, Result};
use crate::trigger::log::{FORMAT, RunLog};
use num_complex::Complex32;
use std::ops::Range;
use std::path::Path;

/// Read one time per frame: an `.npy` array of one axis, a text file with a number per line (a line without a number
/// at the head, and everything behind a comma, are skipped), or the run log of the trigger board, which has a time in
/// seconds for each volume that was taken.
///
/// # Errors
/// When the file cannot be read, a line is no number, events of the run were lost, there are not `frames` times, or
/// they do not ascend.
pub fn read_times(path: &Path, frames: usize) -> Result<Vec<f64>> {
    let is_npy = path.extension().is_some_and(|extension| extension == "npy");
    let times = match is_npy.then(|| kind_of_input(path)).transpose()? {
        Some(InputKind::Npy) => npy::read_f64_1d(path)?,
        _ => read_text_or_log(path)?,
    };
    if times.len() != frames {
        let given = times.len();
        return Err(Error::file(
            path,
            format!("has {given} times; the series has {frames} frames"),
        ));
    }
    check_times(&times).map_err(|frame| {
        let (before, after) = (times[frame - 1], times[frame]);
        let what = "times must be finite and strictly ascending";
        Error::file(
            path,
            format!("frame {frame} is at {after}, the one before at {before}: {what}"),
        )
    })?;
    Ok(times)
}

/// The first frame whose time is not above the one before.
///
/// # Errors
/// Its number.
pub fn check_times(times: &[f64]) -> std::result::Result<(), usize> {
    let fine = |pair: &[f64]| pair[1] > pair[0] && pair[0].is_finite() && pair[1].is_finite();
    match times.windows(2).position(|pair| !fine(pair)) {
        Some(frame) => Err(frame + 1),
        None => Ok(()),
    }
}

fn read_text_or_log(path: &Path) -> Result<Vec<f64>> {
    let bytes = std::fs::read(path).map_err(|error| Error::file(path, error))?;
    // A run log may be cut off within a character.
    let text = String::from_utf8_lossy(&bytes);
    if text.lines().next().is_some_and(|line| line.contains(FORMAT)) {
        let log = RunLog::read(path)?;
        return log.volume_times_s().map_err(|error| error.about(path));
    }
    read_text(path, &text)
}

fn read_text(path: &Path, text: &str) -> Result<Vec<f64>> {
    let mut times = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let first = line.split(',').next().unwrap_or_default().trim();
        match first.parse() {
            Ok(time) => times.push(time),
            Err(_) if first.is_empty() || number == 0 => {}
            Err(_) => {
                let line = number + 1;
                return Err(Error::file(path, format!("line {line}: '{first}' is no time")));
            }
        }
    }
    Ok(times)
}

/// A series with other acquisition times than its file says.
pub struct Timed {
    series: Box<dyn Series>,
    times: Vec<f64>,
}

impl Timed {
    /// Give the frames of `series` the times of the file `path`.
    ///
    /// # Errors
    /// Those of [`read_times`].
    pub fn read(series: Box<dyn Series>, path: &Path) -> Result<Self> {
        let times = read_times(path, series.shape().frames)?;
        Ok(Self { series, times })
    }
}

impl Series for Timed {
    fn shape(&self) -> Shape {
        self.series.shape()
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        self.series.read_rows(frame, depth, rows, out)
    }

    fn times_s(&self) -> Option<&[f64]> {
        Some(&self.times)
    }

    fn sweep_ok(&self) -> Option<&[bool]> {
        self.series.sweep_ok()
    }

    fn attribute(&self, name: &str) -> Option<&serde_json::Value> {
        self.series.attribute(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, frames: usize) -> Result<Vec<f64>> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("times.txt");
        std::fs::write(&path, text).unwrap();
        read_times(&path, frames)
    }

    #[test]
    fn text_is_read_line_by_line() {
        assert_eq!(read("0\n1.5\n\n3e0\n", 3).unwrap(), [0.0, 1.5, 3.0]);
        assert_eq!(read("time_s,n\n0.5,7\n0.75,8\n", 2).unwrap(), [0.5, 0.75]);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, frames, words) in [
            ("0\n1\n", 3, ["2 times", "3 frames"]),
            ("0\n1\n1\n", 3, ["frame 2", "ascending"]),
            ("0\nnan\n2\n", 3, ["frame 1", "finite"]),
            ("0\nx\n2\n", 3, ["line 2", "'x'"]),
        ] {
            let error = read(text, frames).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }
}
