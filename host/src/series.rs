//! A series that is held in memory, and what must be known of any series before it is evaluated.

use crate::error::{Error, Result};
use crate::io::{Series, Shape};
use crate::lanes::{LaneTask, Lanes, Path};
use crate::progress;
use num_complex::Complex32;
use rayon::prelude::*;
use std::ops::Range;

/// Frames in memory, in C order (time, z, y, x).
pub struct HeldSeries {
    shape: Shape,
    field: Vec<Complex32>,
}

impl HeldSeries {
    /// Wrap `field` of the given shape.
    ///
    /// # Errors
    /// When the number of elements does not fit the shape.
    pub fn new(shape: Shape, field: Vec<Complex32>) -> Result<Self> {
        let expected = shape.frames * shape.depth * shape.height * shape.width;
        if field.len() != expected {
            let got = field.len();
            return Err(Error::failed(format!("{shape:?} needs {expected} elements, not {got}")));
        }
        Ok(Self { shape, field })
    }

    /// Frame t at depth 0, (y, x).
    #[must_use]
    pub fn frame(&self, t: usize) -> &[Complex32] {
        let pixels = self.shape.height * self.shape.width;
        let start = t * self.shape.depth * pixels;
        self.field.get(start..start + pixels).unwrap_or(&[])
    }
}

impl Series for HeldSeries {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read_rows(
        &self,
        frame: usize,
        depth: usize,
        rows: Range<usize>,
        out: &mut [Complex32],
    ) -> Result<()> {
        let Shape { depth: depths, height, width, .. } = self.shape;
        let start = ((frame * depths + depth) * height + rows.start) * width;
        let outside = || Error::failed(format!("rows {rows:?} of frame {frame} do not exist"));
        let held = self.field.get(start..start + rows.len() * width).ok_or_else(outside)?;
        if held.len() != out.len() {
            return Err(outside());
        }
        out.copy_from_slice(held);
        Ok(())
    }
}

/// Which pixels can be used, and how bright the series is.
#[derive(Clone, Debug)]
pub struct Survey {
    /// (y, x): every number finite, and not zero in all frames.
    pub valid: Vec<bool>,
    /// Pixels with a NaN or an infinity in some frame.
    pub not_finite: usize,
    /// Pixels that are zero in all frames.
    pub dark: usize,
    /// A power of two that brings the root-mean-square amplitude to 1..2, so that the squares of
    /// `f32` neither overflow nor vanish, whatever the unit; phases and coherences do not see it.
    pub scale: f32,
}

impl Survey {
    /// The same, of the pixels of a mask (y, x) only.
    #[must_use]
    pub fn within(&self, mask: &[bool]) -> Self {
        let valid = self.valid.iter().zip(mask).map(|(&v, &m)| v && m).collect();
        Self { valid, ..*self }
    }
}

/// Read the series once, all frames of the given depths.
///
/// # Errors
/// When it cannot be read, has no usable pixel, or the user interrupts.
pub fn survey(series: &dyn Series, depths: &[usize]) -> Result<Survey> {
    let Shape { frames, height, width, .. } = series.shape();
    const ROWS: usize = 16;
    let starts: Vec<usize> = (0..height).step_by(ROWS).collect();
    let blocks: Vec<BlockSurvey> = starts
        .into_par_iter()
        .map(|y| survey_block(series, depths, frames, y..(y + ROWS).min(height), width))
        .collect::<Result<_>>()?;
    let (mut valid, mut power, mut not_finite) = (Vec::with_capacity(height * width), 0.0, 0);
    for block in &blocks {
        valid.extend(block.finite.iter().zip(&block.lit).map(|(&f, &l)| f && l));
        power += block.power;
        not_finite += block.finite.iter().filter(|&&finite| !finite).count();
    }
    let usable = valid.iter().filter(|&&v| v).count();
    let dark = valid.len() - usable - not_finite;
    if usable == 0 {
        return Err(Error::failed(format!(
            "no usable pixel: {not_finite} are not finite and {dark} are zero in all frames"
        )));
    }
    let rms = (power / (usable * frames * depths.len()) as f64).sqrt();
    let scale = (-rms.log2().floor()).clamp(-126.0, 126.0).exp2() as f32;
    Ok(Survey { valid, not_finite, dark, scale })
}

struct BlockSurvey {
    finite: Vec<bool>,
    lit: Vec<bool>,
    /// Sum of |U|^2 over the finite pixels.
    power: f64,
}

fn survey_block(
    series: &dyn Series,
    depths: &[usize],
    frames: usize,
    rows: Range<usize>,
    width: usize,
) -> Result<BlockSurvey> {
    let pixels = rows.len() * width;
    let mut field = vec![Complex32::default(); pixels];
    let (mut powers, mut lit) = (vec![0.0; pixels], vec![false; pixels]);
    let path = Path::best()?;
    for frame in 0..frames {
        progress::check()?;
        for &depth in depths {
            series.read_rows(frame, depth, rows.clone(), &mut field)?;
            path.run(Powers { field: &field, powers: &mut powers, lit: &mut lit })?;
        }
    }
    // No finite f32 has a square whose sums overflow.
    let finite = powers.iter().map(|power| power.is_finite()).collect();
    let power = powers.iter().filter(|power| power.is_finite()).sum();
    Ok(BlockSurvey { finite, lit, power })
}

/// |U|^2 of a frame's pixels, to be added to those of the others, and whether they have any. In whatever vectors: the
/// compiler makes them of the loop.
struct Powers<'a> {
    field: &'a [Complex32],
    powers: &'a mut [f64],
    lit: &'a mut [bool],
}

impl LaneTask for Powers<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        for ((u, sum), lit) in self.field.iter().zip(self.powers).zip(self.lit) {
            let [re, im] = [f64::from(u.re), f64::from(u.im)];
            let power = re * re + im * im;
            *sum += power;
            *lit |= power > 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unusable_pixels_are_found_and_counted() {
        let shape = Shape { frames: 3, depth: 1, height: 2, width: 3 };
        let mut field = vec![Complex32::new(3e-9, 4e-9); 18];
        field[6 + 1].im = f32::NAN;
        field[12 + 2].re = f32::INFINITY;
        for t in 0..3 {
            field[6 * t + 4] = Complex32::default();
        }
        field[5] = Complex32::default();
        let survey = survey(&HeldSeries::new(shape, field).unwrap(), &[0]).unwrap();
        assert_eq!(survey.valid, [true, false, false, true, false, true]);
        assert_eq!((survey.not_finite, survey.dark), (2, 1));
        let rms = 5e-9 * survey.scale;
        assert!((0.5..=2.0).contains(&rms), "{rms}");
        assert_eq!(survey.scale.log2().fract(), 0.0);
    }

    #[test]
    fn nothing_usable_is_an_error() {
        let shape = Shape { frames: 2, depth: 1, height: 1, width: 1 };
        let series = HeldSeries::new(shape, vec![Complex32::default(); 2]).unwrap();
        assert!(survey(&series, &[0]).unwrap_err().to_string().contains("1 are zero"));
        assert!(HeldSeries::new(shape, vec![]).is_err());
    }
}
