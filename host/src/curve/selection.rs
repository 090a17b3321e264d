//! Which pixels a region is made of, and in what order.

use super::leakage::{Outside, Surroundings};
use crate::error::{Error, Result};
use crate::looks::{Block, PointSpread, SpatialCoherence};
use num_complex::Complex32;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Most of the light that is taken off.
const MOST_LIGHT: f64 = 1.0 / 3.0;

/// Pixels of a sub-window; without any, the whole region is one.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Window {
    /// Of the mask.
    pub inside: Range<usize>,
    /// Those around it whose light is taken off.
    pub outside: Range<usize>,
}

/// The sub-window that a place belongs to.
fn square(place: usize, width: usize, window: Option<Block>) -> Option<(usize, usize)> {
    window.map(|Block { sides, .. }| (place / width / sides[0], place % width / sides[1]))
}

/// The pixels of a mask, sub-window after sub-window (each row by row), and behind them what is taken off.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Places in the image.
    inside: Vec<usize>,
    outside: Vec<Outside>,
    pub(super) windows: Vec<Window>,
    /// Pixels of the image, and of a row of it.
    image: usize,
    width: usize,
    /// What the sub-windows are.
    pub(super) window: Option<Block>,
    /// Pixels of the mask that cannot be used.
    left_out: usize,
    /// Share of the light of the region that comes from outside, if it is taken off.
    leakage: Option<f64>,
}

impl Selection {
    /// The usable ones of the pixels of `mask` (y, x).
    ///
    /// # Errors
    /// When there are none.
    pub fn new(valid: &[bool], mask: &[bool], width: usize, window: Option<Block>) -> Result<Self> {
        let mut inside: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] && valid[i]).collect();
        let asked = mask.iter().filter(|&&m| m).count();
        if inside.is_empty() {
            return Err(Error::failed(format!(
                "none of the {asked} pixels of the mask is usable (not finite, or zero in all frames)"
            )));
        }
        let square = |&place: &usize| square(place, width, window);
        inside.sort_by_key(square);
        let same = |a: &usize, b: &usize| square(a) == square(b);
        let windows = inside.chunk_by(same).scan(0, |end, square| {
            let start = *end;
            *end += square.len();
            Some(Window { inside: start..*end, outside: 0..0 })
        });
        let windows = windows.collect();
        let left_out = asked - inside.len();
        let (image, outside) = (mask.len(), Vec::new());
        Ok(Self { inside, outside, windows, image, width, window, left_out, leakage: None })
    }

    /// The same, with the light that the point spread brings from outside of `drawn` taken off: of the mask with the
    /// pixels that move with it, but are not used. `valid` as in [`Self::new`]. If more than a third of the light is from
    /// there, the region is too small or too thin to tell it, and nothing is taken off.
    #[must_use]
    pub fn without_leakage(mut self, spread: &PointSpread, drawn: &[bool], valid: &[bool]) -> Self {
        let surroundings = Surroundings { spread, mask: drawn, valid, width: self.width };
        let square = |place: usize| square(place, self.width, self.window);
        let mut parts = BTreeMap::<_, Vec<usize>>::new();
        for place in (0..drawn.len()).filter(|&place| drawn[place]) {
            parts.entry(square(place)).or_default().push(place);
        }
        let of = |window: &Window| {
            let pixels = &self.inside[window.inside.clone()];
            let part = pixels.first().and_then(|&place| parts.get(&square(place)));
            surroundings.around(pixels, part.map_or(&[], Vec::as_slice))
        };
        let around: Vec<_> = self.windows.par_iter().map(of).collect();
        let light = around.iter().map(|around| around.light).sum::<f64>() / self.pixels() as f64;
        if light > MOST_LIGHT {
            return self;
        }
        self.leakage = Some(light);
        self.outside.clear();
        for (window, around) in self.windows.iter_mut().zip(around) {
            let start = self.inside.len() + self.outside.len();
            self.outside.extend(around.pixels);
            window.outside = start..self.inside.len() + self.outside.len();
        }
        self
    }

    /// Number of pixels of the mask that are used.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.inside.len()
    }

    /// Number of pixels that are held: some around the mask are, for each sub-window.
    #[must_use]
    pub fn held(&self) -> usize {
        self.inside.len() + self.outside.len()
    }

    /// Pixels of the mask that had to be left out.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Share of the light of the region that comes from outside, if it is taken off.
    #[must_use]
    pub fn leakage(&self) -> Option<f64> {
        self.leakage
    }

    /// Bytes that a region of these pixels takes.
    #[must_use]
    pub fn bytes(&self, frames: usize, depths: usize) -> u64 {
        (self.held() * frames * depths * size_of::<Complex32>()) as u64
    }

    /// Effective looks of the averages.
    #[must_use]
    pub fn looks(&self, coherence: &SpatialCoherence) -> f64 {
        coherence.looks_of_weights(&self.weights(), self.width)
    }

    /// The weight of every pixel of the image (y, x) in the averages: 1 inside, 0 or less outside.
    fn weights(&self) -> Vec<f64> {
        let mut weights = vec![0.0; self.image];
        for &place in &self.inside {
            weights[place] = 1.0;
        }
        for outside in &self.outside {
            weights[outside.place] -= outside.weight;
        }
        weights
    }

    /// Of an image (y, x), what is held of it: fields times the root of their weight.
    pub(crate) fn of_image<'a>(
        &'a self,
        image: &'a [Complex32],
        scale: f32,
    ) -> impl Iterator<Item = Complex32> + 'a {
        let inside = self.inside.iter().map(move |&place| image[place] * scale);
        let outside = self.outside.iter();
        inside.chain(
            outside.map(move |of| image[of.place] * (f64::from(scale) * of.weight.sqrt()) as f32),
        )
    }
}
