//! Which pixels a region is made of, and in what order.

use super::leakage::{Outside, Surroundings};
use crate::error::{Error, Result};
use crate::looks::{Block, PointSpread, SpatialCoherence};
use num_complex::Complex32;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;

/// Share of the looks that must be left where light is taken off, and their number.
const LEAST_SHARE: f64 = 0.5;
const LEAST_LOOKS: f64 = 8.0;

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
    /// pixels that move with it, but are not used. `valid` as in [`Self::new`]. Where that would leave less than half of
    /// the looks that there are by `coherence`, or fewer than eight, in regions that are small or thin, nothing is taken
    /// off.
    #[must_use]
    pub fn without_leakage(
        self,
        spread: &PointSpread,
        coherence: &SpatialCoherence,
        drawn: &[bool],
        valid: &[bool],
    ) -> Self {
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
        if light == 0.0 {
            return self;
        }
        let mut without = Self { leakage: Some(light), ..self.clone() };
        for (window, around) in without.windows.iter_mut().zip(around) {
            let start = without.inside.len() + without.outside.len();
            without.outside.extend(around.pixels);
            window.outside = start..without.inside.len() + without.outside.len();
        }
        let least = LEAST_LOOKS.max(LEAST_SHARE * self.looks(coherence, 1.0));
        if without.looks(coherence, 1.0) > least { without } else { self }
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

    /// Effective looks of the averages, where the surroundings are so many times as bright as the mask.
    #[must_use]
    pub fn looks(&self, coherence: &SpatialCoherence, brightness: f64) -> f64 {
        let mut weights = vec![0.0; self.image];
        for &place in &self.inside {
            weights[place] = 1.0;
        }
        for outside in &self.outside {
            weights[outside.place] -= brightness * outside.weight;
        }
        coherence.looks_of_weights(&weights, self.width)
    }

    /// How bright the pixels outside are beside those of the mask, from the powers of what is held of all images.
    pub(crate) fn brightness(&self, held: impl Fn(usize) -> f64) -> f64 {
        let power = |of: Range<usize>| of.map(&held).sum::<f64>();
        let inside = power(0..self.inside.len()) / self.inside.len() as f64;
        let weight: f64 = self.outside.iter().map(|of| of.weight).sum();
        let outside = power(self.inside.len()..self.held()) / weight;
        if inside > 0.0 && outside.is_finite() { outside / inside } else { 1.0 }
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

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 30;

    fn disc(radius: f64) -> Vec<bool> {
        let from_middle = |at: usize| at as f64 - 15.0;
        let inside = |i: usize| from_middle(i / SIDE).hypot(from_middle(i % SIDE)) < radius;
        (0..SIDE * SIDE).map(inside).collect()
    }

    fn without_leakage(mask: &[bool], valid: &[bool]) -> [Selection; 2] {
        let coherence = SpatialCoherence::from_function(6, |dy, dx| {
            (-((dy * dy + dx * dx) as f64) / 2.0).exp()
        });
        let all = Selection::new(valid, mask, SIDE, None).unwrap();
        let spread = PointSpread::of(&coherence);
        let without = all.clone().without_leakage(&spread, &coherence, mask, valid);
        let [before, after] = [&all, &without].map(|of| of.looks(&coherence, 1.0));
        assert!(after > 0.5 * before, "{before} {after}");
        [all, without]
    }

    #[test]
    fn light_is_taken_off_where_enough_looks_are_left() {
        let everywhere = vec![true; SIDE * SIDE];
        for radius in [6.0, 10.0] {
            let [all, without] = without_leakage(&disc(radius), &everywhere);
            assert!(without.leakage().is_some_and(|light| light > 0.05), "{radius}");
            assert!(without.held() > all.held() && without.pixels() == all.pixels());
        }
        // A pixel or two; a region without surroundings that can be used; one that fills the image.
        let mask = disc(6.0);
        for (mask, valid) in [(&disc(1.2), &everywhere), (&mask, &mask), (&everywhere, &everywhere)]
        {
            let [all, without] = without_leakage(mask, valid);
            assert!(without.leakage().is_none() && without.held() == all.held());
        }
    }

    /// Light of bright surroundings is noise, too, that is taken off.
    #[test]
    fn bright_surroundings_leave_fewer_looks() {
        let coherence = SpatialCoherence::from_function(0, |_, _| 1.0);
        let [all, without] = without_leakage(&disc(8.0), &[true; SIDE * SIDE]);
        assert_eq!(all.looks(&coherence, 5.0), all.pixels() as f64);
        let looks = [0.0, 1.0, 5.0].map(|brightness| without.looks(&coherence, brightness));
        assert!(looks[0] > looks[1] && looks[1] > looks[2], "{looks:?}");
        let held = |i: usize| if i < all.pixels() { 2.0 } else { 6.0 };
        assert_eq!(all.brightness(held), 1.0);
        assert!(without.brightness(held) > 1.0);
    }
}
