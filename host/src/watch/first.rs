//! What the first usable frame tells: which pixels there are, how bright they are, and how many of them count.

use crate::curve::Selection;
use crate::error::Result;
use crate::image::Kernel;
use crate::io::{Series, Shape};
use crate::looks::{PointSpread, SpatialCoherence};
use crate::series::{HeldSeries, Survey, survey};
use num_complex::Complex32;

/// Does the frame hold a number other than 0? The others are left out: nothing is to be learnt from them.
#[must_use]
pub fn is_usable(field: &[Complex32]) -> bool {
    field.iter().any(|u| (u.re != 0.0 || u.im != 0.0) && is_finite(u))
}

/// Are both parts finite?
pub(super) fn is_finite(u: &Complex32) -> bool {
    u.re.is_finite() && u.im.is_finite()
}

/// The field scaled, 0 where it is not finite.
pub(super) fn scaled(u: Complex32, scale: f32) -> Complex32 {
    if is_finite(&u) { u * scale } else { Complex32::default() }
}

/// What is taken from the first usable frame and holds for all that follow.
pub struct First {
    series: HeldSeries,
    survey: Survey,
}

impl First {
    /// Look at the first usable frame of so many rows and columns.
    ///
    /// # Errors
    /// When it is not usable, or the user interrupts.
    pub fn of(field: &[Complex32], height: usize, width: usize) -> Result<Self> {
        let shape = Shape { frames: 1, depth: 1, height, width };
        let series = HeldSeries::new(shape, field.to_vec())?;
        let survey = survey(&series, &[0])?;
        Ok(Self { series, survey })
    }

    /// A power of two that brings amplitudes near 1, see [`Survey::scale`].
    #[must_use]
    pub fn scale(&self) -> f32 {
        self.survey.scale
    }

    /// Numbers of the pixels of the mask (y, x) that are finite and not zero.
    #[must_use]
    pub fn chosen(&self, mask: &[bool]) -> Vec<usize> {
        let usable = mask.iter().zip(&self.survey.valid).enumerate();
        usable.filter(|&(_, (&m, &v))| m && v).map(|(i, _)| i).collect()
    }

    /// Independent looks of the mean over the mask.
    ///
    /// # Errors
    /// When the user interrupts.
    pub fn looks_of(&self, mask: &[bool]) -> Result<f64> {
        let within = self.survey.within(mask);
        let coherence = SpatialCoherence::estimate(&self.series, &within, &[0])?;
        Ok(coherence.looks_of_mask(&within.valid, self.series.shape().width))
    }

    /// The pixels of the mask, with the light from outside of it taken off or left in, and how many independent looks
    /// they are.
    ///
    /// # Errors
    /// When none is usable, or the user interrupts.
    pub fn select(&self, mask: &[bool], keep_leakage: bool) -> Result<(Selection, f64)> {
        let valid = &self.survey.valid;
        let mut selection = Selection::new(valid, mask, self.series.shape().width, None)?;
        let coherence = SpatialCoherence::estimate(&self.series, &self.survey.within(mask), &[0])?;
        if !keep_leakage {
            let image = SpatialCoherence::estimate(&self.series, &self.survey, &[0])?;
            let spread = PointSpread::of(&image);
            selection = selection.without_leakage(&spread, &coherence, mask, valid);
        }
        let held: Vec<Complex32> =
            selection.of_image(self.series.frame(0), self.survey.scale).collect();
        let brightness = selection.brightness(|i| f64::from(held[i].norm_sqr()));
        let looks = selection.looks(&coherence, brightness);
        Ok((selection, looks))
    }

    /// Independent looks of the mean under a Gaussian.
    ///
    /// # Errors
    /// When the user interrupts.
    pub fn looks_of_kernel(&self, kernel: &Kernel) -> Result<f64> {
        let coherence = SpatialCoherence::estimate(&self.series, &self.survey, &[0])?;
        Ok(coherence.looks_of_kernel(kernel))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_usable_where_one_number_is() {
        let (zero, one) = (Complex32::default(), Complex32::new(0.0, 1e-30));
        let nan = Complex32::new(f32::NAN, 1.0);
        for (field, expected) in [
            (vec![], false),
            (vec![zero, zero], false),
            (vec![zero, nan], false),
            (vec![nan, one], true),
        ] {
            assert_eq!(is_usable(&field), expected, "{field:?}");
        }
    }

    #[test]
    fn dead_pixels_of_the_first_frame_are_not_chosen() {
        let mut field = vec![Complex32::new(3e-9, 4e-9); 12];
        field[1] = Complex32::default();
        field[2].im = f32::INFINITY;
        let first = First::of(&field, 3, 4).unwrap();
        let mask: Vec<bool> = (0..12).map(|i| i < 4).collect();
        assert_eq!(first.chosen(&mask), [0, 3]);
        assert!((0.5..=2.0).contains(&(5e-9 * first.scale())));
        assert!(First::of(&[Complex32::default(); 4], 2, 2).is_err());
    }
}
