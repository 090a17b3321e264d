//! A series reduced to some of its frames, and its results spread back over all of them.
//!
//! Sweeps that a recording has lost (saturated, missing, short, during a blink) are left out before
//! anything is computed: what remains is an ordinary series whose frames keep their times.

use crate::error::{Error, Result};
use crate::io::{CurveRow, Series, Shape};
use crate::progress;
use num_complex::Complex32;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Some frames of a series.
pub struct ChosenFrames<'a> {
    series: &'a dyn Series,
    /// Their numbers in the whole series.
    chosen: Vec<usize>,
    times_s: Option<Vec<f64>>,
}

impl<'a> ChosenFrames<'a> {
    /// The given frames, in the given order.
    ///
    /// # Errors
    /// When a frame does not exist.
    pub fn new(series: &'a dyn Series, chosen: Vec<usize>) -> Result<Self> {
        let frames = series.shape().frames;
        if let Some(frame) = chosen.iter().find(|&&frame| frame >= frames) {
            return Err(Error::failed(format!("frame {frame}: the series has {frames}")));
        }
        let times_s = series.times_s().map(|times| chosen.iter().map(|&t| times[t]).collect());
        Ok(Self { series, chosen, times_s })
    }

    /// The frames that can be used: not marked as bad (`sweep_ok`), and not without any finite
    /// number at one of the `depths`.
    ///
    /// # Errors
    /// When fewer than two of several are left, the series cannot be read, or the user interrupts.
    pub fn good(series: &'a dyn Series, depths: &[usize]) -> Result<Self> {
        let frames = series.shape().frames;
        let marked = |frame: usize| series.sweep_ok().is_some_and(|flags| !flags[frame]);
        let good: Vec<bool> = (0..frames)
            .into_par_iter()
            .map(|frame| Ok(!marked(frame) && holds_numbers(series, frame, depths)?))
            .collect::<Result<_>>()?;
        let chosen: Vec<usize> = (0..frames).filter(|&frame| good[frame]).collect();
        // One frame in all is a series too short, with or without bad ones.
        if chosen.len() < frames.min(2) {
            let bad = (0..frames).filter(|&frame| marked(frame)).count();
            return Err(Error::failed(format!(
                "{} of {frames} frames can be used, a phase change needs at least 2: {bad} are bad \
                 sweeps (sweep_ok) and {} are not finite",
                chosen.len(),
                frames - chosen.len() - bad
            )));
        }
        Self::new(series, chosen)
    }

    /// Numbers of the chosen frames in the whole series.
    #[must_use]
    pub fn numbers(&self) -> &[usize] {
        &self.chosen
    }

    /// Number of frames in the whole series.
    #[must_use]
    pub fn in_all(&self) -> usize {
        self.series.shape().frames
    }

    /// Numbers of the frames that were not chosen.
    #[must_use]
    pub fn left_out(&self) -> Vec<usize> {
        (0..self.in_all()).filter(|frame| !self.chosen.contains(frame)).collect()
    }

    /// Which of the chosen frames frame `number` of the whole series is; `flag` asked for it.
    ///
    /// # Errors
    /// When the series has no such frame, or it was not chosen.
    pub fn position(&self, number: usize, flag: &str) -> Result<usize> {
        let frames = self.in_all();
        if number >= frames {
            let last = frames - 1;
            return Err(Error::usage(format!("{flag} {number}: the frames are 0 ..= {last}")));
        }
        let position = self.chosen.iter().position(|&frame| frame == number);
        position.ok_or_else(|| {
            Error::usage(format!(
                "{flag} {number}: that frame is left out (a bad sweep or not finite): take another"
            ))
        })
    }

    /// Acquisition time of a frame of the whole series, seconds; its number where none is known.
    #[must_use]
    pub fn time_of(&self, number: usize) -> f64 {
        let known = self.series.times_s().and_then(|times| times.get(number));
        known.copied().unwrap_or(number as f64)
    }

    /// One row for every frame of the whole series: NaN with an infinite standard deviation for those not chosen.
    #[must_use]
    pub fn rows_of_all(&self, rows: &[CurveRow]) -> Vec<CurveRow> {
        let missing = |frame| CurveRow::missing(frame, self.time_of(frame));
        let mut all: Vec<_> = (0..self.in_all()).map(missing).collect();
        for (&frame, row) in self.chosen.iter().zip(rows) {
            all[frame] = CurveRow { frame, ..*row };
        }
        all
    }

    /// A matrix of the chosen frames as one of all: NaN for the others.
    #[must_use]
    pub fn matrix_of_all(&self, matrix: &[f64]) -> Vec<f64> {
        let frames = self.in_all();
        let mut all = vec![f64::NAN; frames * frames];
        for (&i, row) in self.chosen.iter().zip(matrix.chunks_exact(self.chosen.len().max(1))) {
            for (&j, &value) in self.chosen.iter().zip(row) {
                all[i * frames + j] = value;
            }
        }
        all
    }

    /// Images (time, ...) of the chosen frames as images of all: `missing` for the others.
    #[must_use]
    pub fn images_of_all<'b>(&self, images: &'b [f32], missing: f32) -> Cow<'b, [f32]> {
        if self.chosen.len() == self.in_all() {
            return Cow::Borrowed(images);
        }
        let pixels = images.len() / self.chosen.len().max(1);
        let mut all = vec![missing; self.in_all() * pixels];
        for (&frame, image) in self.chosen.iter().zip(images.chunks_exact(pixels.max(1))) {
            all[frame * pixels..][..pixels].copy_from_slice(image);
        }
        Cow::Owned(all)
    }
}

impl Series for ChosenFrames<'_> {
    fn shape(&self) -> Shape {
        Shape { frames: self.chosen.len(), ..self.series.shape() }
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        let outside = || Error::failed(format!("frame {frame} is not among those chosen"));
        let &number = self.chosen.get(frame).ok_or_else(outside)?;
        self.series.read_rows(number, depth, rows, out)
    }

    fn times_s(&self) -> Option<&[f64]> {
        self.times_s.as_deref()
    }

    fn attribute(&self, name: &str) -> Option<&serde_json::Value> {
        self.series.attribute(name)
    }
}

/// Whether each of the depths has a finite number; of a good frame the first rows tell.
fn holds_numbers(series: &dyn Series, frame: usize, depths: &[usize]) -> Result<bool> {
    const ROWS: usize = 16;
    let Shape { height, width, .. } = series.shape();
    let mut field = vec![Complex32::default(); ROWS * width];
    let is_finite = |u: &Complex32| u.re.is_finite() && u.im.is_finite();
    for &depth in depths {
        let mut found = false;
        for y in (0..height).step_by(ROWS) {
            progress::check()?;
            let rows = y..(y + ROWS).min(height);
            let part = &mut field[..rows.len() * width];
            series.read_rows(frame, depth, rows, part)?;
            found = part.iter().any(is_finite);
            if found {
                break;
            }
        }
        if !found {
            return Ok(false);
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::HeldSeries;

    const SHAPE: Shape = Shape { frames: 5, depth: 2, height: 1, width: 2 };

    /// U = t + i z; frame 3 has no number at depth 1, frame 4 one number only.
    fn series() -> HeldSeries {
        let value = |i: usize| Complex32::new((i / 4) as f32, (i / 2 % 2) as f32);
        let mut field: Vec<_> = (0..20).map(value).collect();
        for i in [14, 15, 18] {
            field[i].im = f32::NAN;
        }
        HeldSeries::new(SHAPE, field).unwrap()
    }

    #[test]
    fn frames_without_numbers_are_left_out() {
        let series = series();
        let good = ChosenFrames::good(&series, &[0, 1]).unwrap();
        assert_eq!((good.numbers(), good.left_out()), (&[0, 1, 2, 4][..], vec![3]));
        assert_eq!(good.position(4, "--at").unwrap(), 3);
        for (number, word) in [(3, "left out"), (5, "0 ..= 4")] {
            let error = good.position(number, "--at").unwrap_err();
            assert!(error.to_string().contains(word) && error.exit_status() == 2, "{error}");
        }
        assert_eq!(good.shape(), Shape { frames: 4, ..SHAPE });
        let mut out = [Complex32::default(); 2];
        good.read_rows(3, 0, 0..1, &mut out).unwrap();
        assert_eq!(out[0], Complex32::new(4.0, 0.0));
        assert!(good.read_rows(4, 0, 0..1, &mut out).is_err());
        assert_eq!(ChosenFrames::good(&series, &[0]).unwrap().numbers().len(), 5);
    }

    #[test]
    fn results_are_spread_over_all_frames() {
        let series = series();
        let chosen = ChosenFrames::new(&series, vec![1, 4]).unwrap();
        let row =
            CurveRow { phase_rad: 0.5, sigma_rad: 0.1, quality: 1.0, ..CurveRow::missing(0, 4.0) };
        let all = chosen.rows_of_all(&[row, row]);
        assert_eq!(all[4], CurveRow { frame: 4, ..row });
        assert!(
            all[3].phase_rad.is_nan() && all[3].sigma_rad == f64::INFINITY && all[3].time_s == 3.0
        );
        let images = chosen.images_of_all(&[1.0, 2.0, 3.0, 4.0], f32::NAN);
        assert_eq!((&images[2..4], &images[8..]), (&[1.0, 2.0][..], &[3.0, 4.0][..]));
        assert_eq!(images.iter().filter(|value| value.is_nan()).count(), 6);
        let sigmas = chosen.images_of_all(&[0.1; 4], f32::INFINITY);
        assert_eq!(sigmas.iter().filter(|&&sigma| sigma == f32::INFINITY).count(), 6);
        let whole = ChosenFrames::new(&series, (0..5).collect()).unwrap();
        assert!(matches!(whole.images_of_all(&[0.0; 10], f32::NAN), Cow::Borrowed(_)));
    }

    #[test]
    fn too_few_frames_are_refused() {
        let field = vec![Complex32::new(f32::NAN, 0.0); 20];
        let dead = HeldSeries::new(SHAPE, field).unwrap();
        let error = ChosenFrames::good(&dead, &[0]).err().unwrap().to_string();
        assert!(error.contains("0 of 5 frames") && error.contains("5 are not finite"), "{error}");
        assert!(ChosenFrames::new(&dead, vec![5]).is_err());
    }
}
