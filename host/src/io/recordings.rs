//! Several recordings of one scene with the same timing, as one series.

use super::{Series, Shape, Timed, open_series, times_beside};
use crate::error::{Error, Result};
use num_complex::Complex32;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Part of an interval between frames by which it may differ between recordings: far more than clocks are off, and too
/// little for the coherence to notice.
const SAME_INTERVAL: f64 = 0.01;

/// What must be the same where two recordings know it.
const SAME_ATTRIBUTES: [&str; 2] = ["wavelength_nm", "stimulus_sweep"];

/// The recordings one behind the other: depth z of recording r is depth r D + z of the series, for D depths each.
/// A frame that one of them marks as bad is bad; times and attributes are those of the first.
pub struct Recordings {
    parts: Vec<(PathBuf, Box<dyn Series>)>,
    sweep_ok: Option<Vec<bool>>,
    times_from: Option<PathBuf>,
}

impl Recordings {
    /// Open all; times are not read from other files nor compared yet ([`Self::own_times`]).
    ///
    /// # Errors
    /// When there is none, one cannot be opened, is given twice, or differs in shape, wavelength or first sweep with
    /// stimulus.
    pub fn open(paths: &[PathBuf]) -> Result<Self> {
        let open = |path: &PathBuf| Ok((path.clone(), open_series(path)?));
        let parts: Vec<_> = paths.iter().map(open).collect::<Result<_>>()?;
        let ((first, reference), others) =
            parts.split_first().ok_or_else(|| Error::usage("no recording is given"))?;
        for (number, (path, series)) in others.iter().enumerate() {
            if paths[..=number].contains(path) {
                let path = path.display();
                return Err(Error::usage(format!(
                    "{path}: given twice: the same speckle tells nothing new"
                )));
            }
            same_shape((first, reference.shape()), (path, series.shape()))?;
            for name in SAME_ATTRIBUTES {
                same_attribute(name, (first, reference.as_ref()), (path, series.as_ref()))?;
            }
        }
        let sweep_ok = parts.iter().filter_map(|(_, series)| series.sweep_ok()).fold(None, both_ok);
        Ok(Self { parts, sweep_ok, times_from: None })
    }

    /// Every recording with its file.
    pub fn each(&self) -> impl Iterator<Item = (&Path, &dyn Series)> {
        self.parts.iter().map(|(path, series)| (path.as_path(), series.as_ref()))
    }

    /// Give every `F.npy` the times of the `F.times.npy` beside it, and see that all recordings have the same intervals
    /// between frames.
    ///
    /// # Errors
    /// When such a file is damaged or does not fit, or the intervals differ: which, and where.
    pub fn own_times(mut self) -> Result<Self> {
        self.parts = self.parts.into_iter().map(with_times_beside).collect::<Result<_>>()?;
        let first = self.parts.first().filter(|(_, series)| series.times_s().is_some());
        self.times_from = first.map(|(path, _)| times_beside(path).unwrap_or_else(|| path.clone()));
        self.check_times()?;
        Ok(self)
    }

    /// See that all have the same intervals between frames.
    fn check_times(&self) -> Result<()> {
        let mut each = self.each().map(|(path, series)| (path, series.times_s()));
        let Some(first) = each.next() else { return Ok(()) };
        each.try_for_each(|other| same_times(first, other))
    }

    /// The file or group that [`Self::own_times`] come from, where they are known.
    #[must_use]
    pub fn times_from(&self) -> Option<&Path> {
        self.times_from.as_deref()
    }
}

fn with_times_beside(
    (path, series): (PathBuf, Box<dyn Series>),
) -> Result<(PathBuf, Box<dyn Series>)> {
    match times_beside(&path) {
        Some(times) => Ok((path, Box::new(Timed::read(series, &times)?))),
        None => Ok((path, series)),
    }
}

/// A frame is fine if it is in both.
fn both_ok(so_far: Option<Vec<bool>>, flags: &[bool]) -> Option<Vec<bool>> {
    let all = so_far.unwrap_or_else(|| vec![true; flags.len()]);
    Some(all.iter().zip(flags).map(|(&a, &b)| a && b).collect())
}

fn same_shape((first, expected): (&Path, Shape), (path, shape): (&Path, Shape)) -> Result<()> {
    let lengths = |shape: Shape| {
        let Shape { frames, depth, height, width } = shape;
        [("frames", frames), ("depth pixels", depth), ("rows", height), ("columns", width)]
    };
    let differing = lengths(shape).into_iter().zip(lengths(expected)).find(|(a, b)| a != b);
    let Some(((axis, length), (_, wanted))) = differing else { return Ok(()) };
    let first = first.display();
    Err(Error::file(
        path,
        format!(
            "has {length} {axis}, {first} has {wanted}: recordings that are combined must have the same \
             shape"
        ),
    ))
}

fn same_attribute(
    name: &str,
    (first, reference): (&Path, &dyn Series),
    (path, series): (&Path, &dyn Series),
) -> Result<()> {
    let number = |series: &dyn Series| series.attribute(name).and_then(serde_json::Value::as_f64);
    match (number(series), number(reference)) {
        (Some(own), Some(expected)) if own != expected => {
            let first = first.display();
            let what = "recordings that are combined must agree: correct one or leave it out";
            let text = format!("attribute {name} is {own}, that of {first} is {expected}: {what}");
            Err(Error::file(path, text))
        }
        _ => Ok(()),
    }
}

type Times<'a> = (&'a Path, Option<&'a [f64]>);

fn same_times((first, expected): Times<'_>, (path, times): Times<'_>) -> Result<()> {
    let name = first.display();
    let (expected, times) = match (expected, times) {
        (None, None) => return Ok(()),
        (Some(expected), Some(times)) => (expected, times),
        (own, _) => {
            let (lacks, has) = if own.is_none() { (first, path) } else { (path, first) };
            let text = format!("has no times, {} has: give --times for both", has.display());
            return Err(Error::file(lacks, text));
        }
    };
    let intervals = |times: &[f64]| -> Vec<f64> {
        times.array_windows().map(|[before, after]| after - before).collect()
    };
    let mut both = intervals(times).into_iter().zip(intervals(expected)).enumerate();
    // A time that is no number is not the same.
    let is_same = |own: f64, wanted: f64| (own - wanted).abs() <= SAME_INTERVAL * wanted.abs();
    match both.find(|&(_, (own, wanted))| !is_same(own, wanted)) {
        None => Ok(()),
        Some((index, (own, wanted))) => Err(Error::file(
            path,
            format!(
                "frame {} comes {own:.6} s after the one before, {wanted:.6} s in {name}: recordings that are \
                 combined must have the same intervals to {:.0} % (or give --times)",
                index + 1,
                100.0 * SAME_INTERVAL
            ),
        )),
    }
}

impl Series for Recordings {
    fn shape(&self) -> Shape {
        let none = Shape { frames: 0, depth: 0, height: 0, width: 0 };
        let one = self.parts.first().map_or(none, |(_, series)| series.shape());
        Shape { depth: one.depth * self.parts.len(), ..one }
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        let depths = self.shape().depth / self.parts.len().max(1);
        let part = depth.checked_div(depths).and_then(|recording| self.parts.get(recording));
        let outside = || Error::failed(format!("depth {depth} of all recordings does not exist"));
        let (path, series) = part.ok_or_else(outside)?;
        let read = series.read_rows(frame, depth % depths, rows, out);
        read.map_err(|error| error.about(path))
    }

    fn times_s(&self) -> Option<&[f64]> {
        self.parts.first()?.1.times_s()
    }

    fn sweep_ok(&self) -> Option<&[bool]> {
        self.sweep_ok.as_deref()
    }

    fn attribute(&self, name: &str) -> Option<&serde_json::Value> {
        self.parts.first()?.1.attribute(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_compared_whenever_the_recordings_began() {
        let (a, b) = (Path::new("A.zarr"), Path::new("B.zarr"));
        let own = [0.0, 1.0, 3.0];
        let compare = |other: &[f64]| same_times((a, Some(&own)), (b, Some(other)));
        compare(&[7.0, 8.009, 10.02]).unwrap();
        for (other, words) in [
            ([7.0, 8.02, 10.0], "frame 1"),
            ([0.0, 1.0, 3.03], "frame 2"),
            ([0.0, f64::NAN, 3.0], "frame 1"),
        ] {
            let error = compare(&other).unwrap_err().to_string();
            assert!(error.starts_with("B.zarr") && error.contains("A.zarr"), "{error}");
            assert!(error.contains(words), "{error}");
        }
        let error = same_times((a, None), (b, Some(&own))).unwrap_err().to_string();
        assert!(error.starts_with("A.zarr: has no times, B.zarr has"), "{error}");
        same_times((a, None), (b, None)).unwrap();
    }
}
