//! One phase per frame.

use super::npy::{NpyWriter, sibling};
use super::zarr::GroupWriter;
use super::{Attributes, Format, write_atomic};
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// The phase of one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CurveRow {
    /// Frame number, from 0.
    pub frame: usize,
    /// Acquisition time in seconds; the frame number where no times are known.
    pub time_s: f64,
    /// Phase in radians; NaN for a frame that could not be measured.
    pub phase_rad: f64,
    /// Standard deviation of the phase in radians; infinite for a frame that could not be measured.
    pub sigma_rad: f64,
    /// Quality of the frame, 0..=1; NaN where the method does not tell.
    pub quality: f64,
}

impl CurveRow {
    /// A frame that has not been measured.
    #[must_use]
    pub const fn missing(frame: usize, time_s: f64) -> Self {
        Self { frame, time_s, phase_rad: f64::NAN, sigma_rad: f64::INFINITY, quality: f64::NAN }
    }
}

/// Which columns a table has beside frame, time, phase and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Columns {
    /// The optical path length of one radian: path lengths, too.
    pub(crate) nm_per_rad: Option<f64>,
    /// The quality of the frame.
    pub(crate) quality: bool,
}

impl Columns {
    /// Names and numbers of a row, in order, behind the number of its frame.
    pub(crate) fn numbers(&self, row: &CurveRow) -> Vec<(&'static str, f64)> {
        let &CurveRow { time_s, phase_rad, sigma_rad, quality, .. } = row;
        let mut numbers =
            vec![("time_s", time_s), ("phase_rad", phase_rad), ("sigma_rad", sigma_rad)];
        if let Some(nm) = self.nm_per_rad {
            numbers.extend([("opl_nm", phase_rad * nm), ("sigma_nm", sigma_rad * nm)]);
        }
        numbers.extend(self.quality.then_some(("quality", quality)));
        numbers
    }

    /// The first line of the table.
    pub(crate) fn header(&self) -> String {
        let numbers = self.numbers(&CurveRow::missing(0, 0.0));
        let names: Vec<&str> = numbers.into_iter().map(|(name, _)| name).collect();
        format!("frame,{}\n", names.join(","))
    }

    /// The line of a row.
    pub(crate) fn line(&self, row: &CurveRow) -> String {
        let numbers = self.numbers(row).into_iter().map(|(_, number)| shortest(number));
        format!("{},{}\n", row.frame, numbers.collect::<Vec<_>>().join(","))
    }

    /// The row as a line of JSON; what is no number is null.
    pub(crate) fn json_line(&self, row: &CurveRow) -> String {
        let mut object = serde_json::Map::new();
        object.insert("frame".to_owned(), row.frame.into());
        for (name, number) in self.numbers(row) {
            object.insert(name.to_owned(), number.into());
        }
        format!("{}\n", serde_json::Value::Object(object))
    }
}

/// Write a curve: a `.csv` table `frame,time_s,phase_rad,sigma_rad`; float64 `F.npy` with
/// `F.sigma.npy`; or a `.zarr` group of `phase_rad`, `sigma_rad` and `time_s` with `attributes`.
/// With `nm_per_rad`, the optical path length of one radian, table and group hold the same as
/// `opl_nm` and `sigma_nm`, too; and where the method tells the frames' `quality`, all three do
/// (`F.quality.npy`). The group holds `coherence` between the frames, N x N, where there is one. The paths
/// written are returned.
///
/// # Errors
/// When there are no rows, the extension of `path` is unknown, or the file cannot be written.
pub fn write_curve(
    path: &Path,
    rows: &[CurveRow],
    nm_per_rad: Option<f64>,
    coherence: Option<&[f64]>,
    attributes: Attributes,
) -> Result<Vec<PathBuf>> {
    if rows.is_empty() {
        return Err(Error::file(path, "no frame to write"));
    }
    match Format::of(path)? {
        Format::Csv => write_csv(path, rows, nm_per_rad),
        Format::Npy => write_npy(path, rows),
        Format::Zarr => write_zarr(path, rows, nm_per_rad, coherence, attributes),
    }
}

fn column(rows: &[CurveRow], value: impl Fn(&CurveRow) -> f64) -> Vec<f64> {
    rows.iter().map(value).collect()
}

fn write_csv(path: &Path, rows: &[CurveRow], nm_per_rad: Option<f64>) -> Result<Vec<PathBuf>> {
    let columns = Columns { nm_per_rad, quality: tells_quality(rows) };
    let lines: String = rows.iter().map(|row| columns.line(row)).collect();
    write_atomic(path, (columns.header() + &lines).as_bytes())?;
    Ok(vec![path.to_owned()])
}

/// The shortest text that reads back as the same number.
fn shortest(number: f64) -> String {
    if number.is_nan() { "nan".to_owned() } else { format!("{number:?}") }
}

fn write_npy(path: &Path, rows: &[CurveRow]) -> Result<Vec<PathBuf>> {
    let phase = NpyWriter::create(path, &[rows.len()])?;
    let sigma = NpyWriter::create(&sibling(path, "sigma"), &[rows.len()])?;
    phase.write_at(0, &column(rows, |row| row.phase_rad))?;
    sigma.write_at(0, &column(rows, |row| row.sigma_rad))?;
    let mut files = vec![sigma.finish()?];
    if tells_quality(rows) {
        let quality = NpyWriter::create(&sibling(path, "quality"), &[rows.len()])?;
        quality.write_at(0, &column(rows, |row| row.quality))?;
        files.push(quality.finish()?);
    }
    files.insert(0, phase.finish()?);
    Ok(files)
}

fn write_zarr(
    path: &Path,
    rows: &[CurveRow],
    nm_per_rad: Option<f64>,
    coherence: Option<&[f64]>,
    attributes: Attributes,
) -> Result<Vec<PathBuf>> {
    let bytes = (size_of_val(rows) + coherence.map_or(0, size_of_val)) as u64;
    let group = GroupWriter::create(path, attributes, bytes)?;
    let write = |name, values: Vec<f64>| group.write_whole(name, &["time"], &[rows.len()], &values);
    write("time_s", column(rows, |row| row.time_s))?;
    write("phase_rad", column(rows, |row| row.phase_rad))?;
    write("sigma_rad", column(rows, |row| row.sigma_rad))?;
    if let Some(nm) = nm_per_rad {
        write("opl_nm", column(rows, |row| row.phase_rad * nm))?;
        write("sigma_nm", column(rows, |row| row.sigma_rad * nm))?;
    }
    if tells_quality(rows) {
        write("quality", column(rows, |row| row.quality))?;
    }
    if let Some(coherence) = coherence {
        let (axes, frames) = (["time", "other_time"], rows.len());
        group.write_whole("coherence", &axes, &[frames, frames], coherence)?;
    }
    Ok(vec![group.finish()?])
}

fn tells_quality(rows: &[CurveRow]) -> bool {
    rows.iter().any(|row| !row.quality.is_nan())
}
