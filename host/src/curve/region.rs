//! The pixels of a mask, all frames, in memory, and the ensemble averages over them.

use crate::allocate::{reserve, zeros};
use crate::error::{Error, Result};
use crate::io::{Series, Shape};
use crate::method::Plan;
use crate::planes::Layers;
use crate::progress::Progress;
use crate::series::Survey;
use num_complex::{Complex, Complex32, Complex64};
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::{Ensemble, PairMean};
use rayon::prelude::*;

/// The fields of the pixels of a mask, all frames and recordings, in memory.
pub struct Region {
    /// (frame, depth, pixel).
    fields: Vec<Complex32>,
    pixels: usize,
    depths: usize,
    /// Of every recording.
    layers: Vec<Layers>,
    /// Where each sub-window ends in the order of the pixels.
    window_ends: Vec<usize>,
    /// Pixels of the mask that had to be left out.
    pub left_out: usize,
}

impl Region {
    /// Bytes a region of so many pixels takes.
    #[must_use]
    pub fn bytes(pixels: usize, frames: usize, depths: usize) -> u64 {
        (pixels * frames * depths * size_of::<Complex32>()) as u64
    }

    /// Read the usable pixels of `mask` (y, x), ordered by squares of `window` pixels' side, or row by
    /// row without.
    ///
    /// # Errors
    /// When none is usable, the series cannot be read, or the user interrupts.
    pub fn read(
        series: &dyn Series,
        survey: &Survey,
        mask: &[bool],
        plan: &Plan,
        window: Option<usize>,
        progress: &Progress,
    ) -> Result<Self> {
        let Shape { frames, height, width, .. } = series.shape();
        let mut chosen: Vec<usize> =
            (0..height * width).filter(|&i| mask[i] && survey.valid[i]).collect();
        let asked = mask.iter().filter(|&&m| m).count();
        if chosen.is_empty() {
            return Err(Error::failed(format!(
                "none of the {asked} pixels of the mask is usable (not finite, or zero in all frames)"
            )));
        }
        let square = |&i: &usize| window.map(|side| (i / width / side, i % width / side));
        chosen.sort_by_key(square);
        let same = |a: &usize, b: &usize| square(a) == square(b);
        let window_ends = chosen.chunk_by(same).scan(0, |end, square| {
            *end += square.len();
            Some(*end)
        });
        let depths = plan.depths.all();
        let mut fields = reserve(chosen.len() * frames * depths.len(), "the pixels of the mask")?;
        let mut image = zeros(height * width, "one frame")?;
        for frame in 0..frames {
            for &depth in &depths {
                series.read_rows(frame, depth, 0..height, &mut image)?;
                fields.extend(chosen.iter().map(|&i| image[i] * survey.scale));
            }
            progress.advance(1)?;
        }
        Ok(Self {
            fields,
            pixels: chosen.len(),
            depths: depths.len(),
            layers: plan.depths.layers(),
            window_ends: window_ends.collect(),
            left_out: asked - chosen.len(),
        })
    }

    /// Number of pixels used.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// ⟨C(t,s-t)⟩ and ⟨C/|C|⟩ over pixels and recordings; `powers` as [`Self::powers`] gives them.
    #[must_use]
    pub fn pair_mean(&self, t: usize, s: usize, powers: &[f64]) -> PairMean<f64> {
        let mut ensemble = Ensemble::new();
        for layers in &self.layers {
            for pixel in 0..self.pixels {
                ensemble.add(self.cross_spectrum(layers, t, s, pixel));
            }
        }
        ensemble.mean(powers[t], powers[s])
    }

    /// ⟨C(t,0)⟩ of every frame.
    #[must_use]
    pub fn powers(&self) -> Vec<f64> {
        let frames = self.fields.len() / (self.pixels * self.depths);
        let mean = |t: usize| {
            let power = |layers: &Layers| -> f64 {
                (0..self.pixels).map(|pixel| self.cross_spectrum(layers, t, t, pixel).re).sum()
            };
            self.layers.iter().map(power).sum::<f64>() / self.members()
        };
        (0..frames).into_par_iter().map(mean).collect()
    }

    /// Pixels of all recordings: what the averages are taken over.
    fn members(&self) -> f64 {
        (self.pixels * self.layers.len()) as f64
    }

    /// ⟨C⟩ of one layer; of two layers the mean over the sub-windows of all recordings, each with its number of pixels
    /// as weight, of C_w^{Z1} conj C_w^{Z2}, where C_w is a layer's mean cross-spectrum in the sub-window.
    #[must_use]
    pub fn windowed_mean(&self, t: usize, s: usize) -> Complex64 {
        let mut sum = Complex64::default();
        let mut start = 0;
        for &end in &self.window_ends {
            for layers in &self.layers {
                let of_planes = |planes: std::ops::Range<usize>| -> Complex64 {
                    planes.map(|z| self.sum_of_pixels(t, s, z, start..end)).sum()
                };
                let combined = layers.combine(layers.both().map(of_planes));
                let one = layers.second.is_empty();
                sum += if one { combined } else { combined / (end - start) as f64 };
            }
            start = end;
        }
        sum / self.members()
    }

    /// Sum of U(t) conj U(s) over pixels of one depth.
    fn sum_of_pixels(
        &self,
        t: usize,
        s: usize,
        z: usize,
        pixels: std::ops::Range<usize>,
    ) -> Complex64 {
        let of = |frame: usize| {
            let start = (frame * self.depths + z) * self.pixels;
            &self.fields[start + pixels.start..start + pixels.end]
        };
        let (mut re, mut im) = (0.0, 0.0);
        for (u, v) in of(t).iter().zip(of(s)) {
            let (a, b) = (f64::from(u.re), f64::from(u.im));
            let (c, d) = (f64::from(v.re), f64::from(v.im));
            re += a * c + b * d;
            im += b * c - a * d;
        }
        Complex64::new(re, im)
    }

    fn cross_spectrum(&self, layers: &Layers, t: usize, s: usize, pixel: usize) -> Complex64 {
        let field = |frame: usize, z: usize| {
            let u = self.fields[(frame * self.depths + z) * self.pixels + pixel];
            Complex { re: f64::from(u.re), im: f64::from(u.im) }
        };
        let sum = |planes: std::ops::Range<usize>| -> Complex64 {
            planes.map(|z| cross_spectrum(field(t, z), field(s, z))).sum()
        };
        layers.combine(layers.both().map(sum))
    }
}
