//! The pixels of a mask, all frames, in memory, and the ensemble averages over them.

use crate::allocate::{reserve, zeros};
use crate::error::{Error, Result};
use crate::io::{Series, Shape};
use crate::looks::Block;
use crate::method::Plan;
use crate::planes::Layers;
use crate::progress::Progress;
use crate::series::Survey;
use num_complex::{Complex, Complex32, Complex64};
use phasewalk_core::cross_spectrum::cross_spectrum;
use phasewalk_core::ensemble::{Ensemble, PairMean};
use rayon::prelude::*;
use std::ops::Range;

/// Averages of one pair of frames.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WindowedPair {
    /// ⟨C⟩ over the region.
    pub mean: Complex64,
    /// Sum of |C_w|^2 over the full sub-windows, by layer.
    pub squares: [f64; 2],
}

/// The fields of the pixels of a mask, all frames and recordings, in memory.
pub struct Region {
    /// (frame, depth, pixel).
    fields: Vec<Complex32>,
    pixels: usize,
    depths: usize,
    /// What the sub-windows are.
    window: Option<Block>,
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

    /// Read the usable pixels of `mask` (y, x), ordered by sub-windows, or row by row without.
    ///
    /// # Errors
    /// When none is usable, the series cannot be read, or the user interrupts.
    pub fn read(
        series: &dyn Series,
        survey: &Survey,
        mask: &[bool],
        plan: &Plan,
        window: Option<Block>,
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
        let square = |&i: &usize| {
            window.map(|Block { sides, .. }| (i / width / sides[0], i % width / sides[1]))
        };
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
            window,
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

    /// Averages of the pair over the sub-windows of all recordings: of one layer ⟨C⟩; of two layers the mean over the
    /// sub-windows, each with its number of pixels as weight, of C_w^{Z1} conj C_w^{Z2}, where C_w is a layer's mean
    /// cross-spectrum in the sub-window.
    #[must_use]
    pub fn windowed_pair(&self, t: usize, s: usize) -> WindowedPair {
        let mut pair = WindowedPair::default();
        for window in self.windows() {
            let pixels = window.len() as f64;
            for layers in &self.layers {
                let both = layers.both().map(|planes| self.sum_of_layer(t, s, planes, &window));
                if self.is_full(&window) {
                    for (square, layer) in pair.squares.iter_mut().zip(both) {
                        *square += (layer / pixels).norm_sqr();
                    }
                }
                let one = layers.second.is_empty();
                let combined = layers.combine(both);
                pair.mean += if one { combined } else { combined / pixels };
            }
        }
        pair.mean /= self.members();
        pair
    }

    /// ⟨|U(t)|^2⟩ of a layer in each full sub-window of each recording.
    #[must_use]
    pub fn window_powers(&self, t: usize, layer: usize) -> Vec<f64> {
        let full = self.windows().filter(|window| self.is_full(window));
        full.flat_map(|window| {
            let power = move |layers: &Layers| {
                let planes = layers.both()[layer].clone();
                self.sum_of_layer(t, t, planes, &window).re / window.len() as f64
            };
            self.layers.iter().map(power)
        })
        .collect()
    }

    /// The sub-windows that the region was read with; without any, the whole region as one.
    #[must_use]
    pub fn window(&self) -> Option<Block> {
        self.window
    }

    /// Has the sub-window at least half of its pixels?
    fn is_full(&self, pixels: &Range<usize>) -> bool {
        self.window.is_none_or(|window| 2 * pixels.len() >= window.pixels())
    }

    /// The pixels of each sub-window.
    fn windows(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let starts = std::iter::once(&0).chain(&self.window_ends);
        starts.zip(&self.window_ends).map(|(&start, &end)| start..end)
    }

    /// Sum of U(t) conj U(s) over pixels and depths of a layer.
    fn sum_of_layer(
        &self,
        t: usize,
        s: usize,
        zs: Range<usize>,
        pixels: &Range<usize>,
    ) -> Complex64 {
        zs.map(|z| self.sum_of_pixels(t, s, z, pixels.clone())).sum()
    }

    /// Sum of U(t) conj U(s) over pixels of one depth.
    fn sum_of_pixels(&self, t: usize, s: usize, z: usize, pixels: Range<usize>) -> Complex64 {
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

    /// Of a pixel, summed over the depths of each layer. Loops, not iterators: it is the innermost step, and what the
    /// compiler keeps as calls costs as much as the rest.
    #[inline(always)]
    fn cross_spectrum(&self, layers: &Layers, t: usize, s: usize, pixel: usize) -> Complex64 {
        let mut sums = [Complex64::default(); 2];
        for (sum, planes) in sums.iter_mut().zip(layers.both()) {
            for z in planes {
                *sum += cross_spectrum(self.field(t, z, pixel), self.field(s, z, pixel));
            }
        }
        layers.combine(sums)
    }

    #[inline(always)]
    fn field(&self, frame: usize, z: usize, pixel: usize) -> Complex64 {
        let u = self.fields[(frame * self.depths + z) * self.pixels + pixel];
        Complex { re: f64::from(u.re), im: f64::from(u.im) }
    }
}
