//! Acquisition times from a file of their own.

use super::{InputKind, Series, Shape, kind_of_input, npy};
use crate::error::{Error, Result};
use crate::trigger::log::{FORMAT, RunLog};
use num_complex::Complex32;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Where a table's header has this column, it holds the times.
const TIME_COLUMN: &str = "time_s";

/// Read one time per frame, seconds: an `.npy` array of one axis, a text file with a number per line, a table with
/// commas between its columns and a header (the column `time_s`), or the run log of the trigger board,
/// which has a time for each volume that was taken.
///
/// # Errors
/// When the file cannot be read, a line is no number or has other columns than the header, events of the run were lost,
/// there are not `frames` times, or they do not ascend.
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
        let what = "times must be finite and strictly ascending, no interval 1e12 times another";
        Error::file(
            path,
            format!("frame {frame} is at {after}, the one before at {before}: {what}"),
        )
    })?;
    Ok(times)
}

/// An interval so many times as long as another is a slip. (From 1e19 on the square of the ratio would overflow single
/// precision.)
const LONGEST: f64 = 1e12;

/// The first frame whose time is not above the one before, or is further from it than times can be from each other.
///
/// # Errors
/// Its number.
pub fn check_times(times: &[f64]) -> std::result::Result<(), usize> {
    let interval = |pair: &[f64]| pair[1] - pair[0];
    let ascends = |pair: &[f64]| interval(pair) > 0.0 && interval(pair).is_finite();
    if let Some(frame) = times.windows(2).position(|pair| !ascends(pair)) {
        return Err(frame + 1);
    }
    let longest = LONGEST * times.windows(2).map(interval).fold(f64::INFINITY, f64::min);
    match times.windows(2).position(|pair| interval(pair) > longest) {
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
    // Spreadsheets begin their tables with a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).peekable();
    let header = lines.next_if(|(_, line)| columns(line)[0].parse::<f64>().is_err());
    let names = header.map(|(_, line)| columns(line.trim_start_matches('#')));
    let named = |names: &Vec<&str>| names.iter().position(|&name| is_time_column(name));
    let time = match &names {
        Some(names) if names.len() > 1 => named(names).ok_or_else(|| {
            let (all, wanted) = (names.join(", "), TIME_COLUMN);
            Error::file(path, format!("has the columns {all}: call that of the times {wanted}"))
        })?,
        _ => 0,
    };
    let read = |(number, line): (usize, &str)| {
        let about = |what: String| Error::file(path, format!("line {}: {what}", number + 1));
        let fields = columns(line);
        check_columns(line, fields.len(), names.as_ref().map(Vec::len)).map_err(about)?;
        fields[time].parse().map_err(|_| about(format!("'{}' is no time", fields[time])))
    };
    lines.map(read).collect()
}

/// Whatever the case, and in quotes or not.
fn is_time_column(name: &str) -> bool {
    name.trim_matches(['"', '\'', ' ']).eq_ignore_ascii_case(TIME_COLUMN)
}

/// The fields of a line; at least one.
fn columns(line: &str) -> Vec<&str> {
    line.split(',').map(str::trim).collect()
}

/// Every column needs a name: the half of a number behind a decimal comma would be lost in silence.
fn check_columns(
    line: &str,
    count: usize,
    named: Option<usize>,
) -> std::result::Result<(), String> {
    let what = match named {
        None if count > 1 => "no header says which holds the times".to_owned(),
        Some(named) if named != count => format!("the header names {named}"),
        _ => return Ok(()),
    };
    let plural = if count == 1 { "" } else { "s" };
    Err(format!(
        "'{}' has {count} column{plural}, {what}: write decimals with a point, and name the columns of a table in its first \
         line, that of the times {TIME_COLUMN}",
        line.trim()
    ))
}

/// The file that holds the times of the series `F.npy`, where there is one: `F.times.npy`.
#[must_use]
pub fn times_beside(series: &Path) -> Option<PathBuf> {
    let is_npy = series.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("npy"));
    let path = npy::sibling(series, "times");
    (is_npy && path.is_file()).then_some(path)
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
    fn the_column_of_the_times_is_found_by_its_name() {
        let curve = "frame,time_s,phase_rad\n0,0.25,nan\n1,0.75,1.5\n";
        assert_eq!(read(curve, 2).unwrap(), [0.25, 0.75]);
        let saved = "\u{feff}# n, time_s\r\n0, 2\r\n1, 4\r\n";
        assert_eq!(read(saved, 2).unwrap(), [2.0, 4.0]);
        assert_eq!(read("\"frame\",\"Time_S\"\n0,3\n1,5\n", 2).unwrap(), [3.0, 5.0]);
        assert_eq!(read("t\n3\n5\n", 2).unwrap(), [3.0, 5.0]);
    }

    #[test]
    fn decimal_commas_are_no_columns() {
        for (text, words) in [
            ("0,5\n1,5\n", ["line 1: '0,5' has 2 columns", "no header", "time_s"]),
            ("0\n1,5\n", ["line 2: '1,5' has 2 columns", "no header", "point"]),
            ("time_s\n0,5\n1,5\n", ["line 2: '0,5' has 2 columns", "names 1", "point"]),
            ("frame,ms\n0,5\n1,6\n", ["columns frame, ms", "call that", "time_s"]),
            ("frame,time_s\n0\n1\n", ["line 2: '0' has 1 column,", "names 2", "time_s"]),
        ] {
            let error = read(text, 2).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, frames, words) in [
            ("0\n1\n", 3, ["2 times", "3 frames"]),
            ("0\n1\n1\n", 3, ["frame 2", "ascending"]),
            ("0\n1\n1e300\n", 3, ["frame 2", "no interval 1e12 times another"]),
            ("0\nnan\n2\n", 3, ["frame 1", "finite"]),
            ("0\nx\n2\n", 3, ["line 2", "'x'"]),
        ] {
            let error = read(text, frames).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
    }
}
