//! The pixels of a mask, all frames, in memory, and the ensemble averages over them.

use super::selection::{Selection, Window};
use crate::allocate::{reserve, zeros};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::looks::{Block, SpatialCoherence};
use crate::method::Plan;
use crate::planes::Layers;
use crate::progress::Progress;
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

/// The fields of the selected pixels, all frames and recordings, in memory.
pub struct Region {
    /// (frame, depth, pixel).
    fields: Vec<Complex32>,
    selection: Selection,
    depths: usize,
    /// Of every recording.
    layers: Vec<Layers>,
}

impl Region {
    /// Read the selected pixels.
    ///
    /// # Errors
    /// When the series cannot be read, memory is short, or the user interrupts.
    pub fn read(
        series: &dyn Series,
        scale: f32,
        selection: Selection,
        plan: &Plan,
        progress: &Progress,
    ) -> Result<Self> {
        let Shape { frames, height, width, .. } = series.shape();
        let depths = plan.depths.all();
        let numbers = selection.held() * frames * depths.len();
        let mut fields = reserve(numbers, "the pixels of the mask")?;
        let mut image = zeros(height * width, "one frame")?;
        for frame in 0..frames {
            for &depth in &depths {
                series.read_rows(frame, depth, 0..height, &mut image)?;
                fields.extend(selection.of_image(&image, scale));
            }
            progress.advance(1)?;
        }
        Ok(Self { fields, selection, depths: depths.len(), layers: plan.depths.layers() })
    }

    /// Number of pixels used.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.selection.pixels()
    }

    /// Effective looks of the averages.
    #[must_use]
    pub fn looks(&self, coherence: &SpatialCoherence) -> f64 {
        let held = self.selection.held();
        let power = |pixel: usize| -> f64 {
            let of = self.fields[pixel..].iter().step_by(held);
            of.map(|u| f64::from(u.norm_sqr())).sum()
        };
        self.selection.looks(coherence, self.selection.brightness(power))
    }

    /// ⟨C(t,s-t)⟩ and ⟨C/|C|⟩ over pixels and recordings; `powers` as [`Self::powers`] gives them.
    #[must_use]
    pub fn pair_mean(&self, t: usize, s: usize, powers: &[f64]) -> PairMean<f64> {
        let mut ensemble = Ensemble::new();
        for layers in &self.layers {
            for pixel in 0..self.pixels() {
                ensemble.add(self.cross_spectrum(layers, t, s, pixel));
            }
        }
        ensemble.mean(powers[t], powers[s])
    }

    /// ⟨C(t,0)⟩ of every frame.
    #[must_use]
    pub fn powers(&self) -> Vec<f64> {
        let frames = self.fields.len() / (self.selection.held() * self.depths);
        let mean = |t: usize| {
            let power = |layers: &Layers| -> f64 {
                (0..self.pixels()).map(|pixel| self.cross_spectrum(layers, t, t, pixel).re).sum()
            };
            self.layers.iter().map(power).sum::<f64>() / self.members()
        };
        (0..frames).into_par_iter().map(mean).collect()
    }

    /// Pixels of all recordings: what the averages are taken over.
    fn members(&self) -> f64 {
        (self.pixels() * self.layers.len()) as f64
    }

    /// Averages of the pair over the sub-windows of all recordings: of one layer ⟨C⟩; of two layers the mean over the
    /// sub-windows, each with its number of pixels as weight, of C_w^{Z1} conj C_w^{Z2}, where C_w is a layer's mean
    /// cross-spectrum in the sub-window.
    #[must_use]
    pub fn windowed_pair(&self, t: usize, s: usize) -> WindowedPair {
        let mut pair = WindowedPair::default();
        for window in &self.selection.windows {
            let pixels = window.inside.len() as f64;
            for layers in &self.layers {
                let both = layers.both().map(|planes| self.sum_of_layer(t, s, planes, window));
                if self.is_full(window) {
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
        let full = self.selection.windows.iter().filter(|window| self.is_full(window));
        full.flat_map(|window| {
            let power = move |layers: &Layers| {
                let planes = layers.both()[layer].clone();
                self.sum_of_layer(t, t, planes, window).re / window.inside.len() as f64
            };
            self.layers.iter().map(power)
        })
        .collect()
    }

    /// The sub-windows that the region was read with; without any, the whole region as one.
    #[must_use]
    pub fn window(&self) -> Option<Block> {
        self.selection.window
    }

    /// Has the sub-window at least half of its pixels?
    fn is_full(&self, Window { inside, .. }: &Window) -> bool {
        self.window().is_none_or(|window| 2 * inside.len() >= window.pixels())
    }

    /// Sum of U(t) conj U(s) over pixels and depths of a layer, less that over what is outside.
    fn sum_of_layer(&self, t: usize, s: usize, zs: Range<usize>, of: &Window) -> Complex64 {
        let sum = |z: usize| {
            self.sum_of_pixels(t, s, z, of.inside.clone())
                - self.sum_of_pixels(t, s, z, of.outside.clone())
        };
        zs.map(sum).sum()
    }

    /// Sum of U(t) conj U(s) over pixels of one depth.
    fn sum_of_pixels(&self, t: usize, s: usize, z: usize, pixels: Range<usize>) -> Complex64 {
        let of = |frame: usize| {
            let start = (frame * self.depths + z) * self.selection.held();
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
        let u = self.fields[(frame * self.depths + z) * self.selection.held() + pixel];
        Complex { re: f64::from(u.re), im: f64::from(u.im) }
    }
}
