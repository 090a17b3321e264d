//! A few neighbouring depths of a group of pixels: the part of the FFT that they need.
//!
//! ```text
//! U(z) = sum over r of exp(-2 pi i r z/K) Y(r, z)
//! ```
//! with Y of `pairs`, which repeats when z grows by 16: up to 16 neighbouring depths take K/16
//! transforms of 16 points.

use super::pairs::{GROUP, Group, POINTS, Pair, Rounds, Samples, unit};
use crate::lanes::{LaneTask, Lanes};
use num_complex::Complex32;
use std::ops::Range;

/// What is the same for all pixels.
pub struct Zoom {
    depths: Range<usize>,
    /// exp(-2 pi i r z/K), (r, depth).
    twiddles: Vec<[Complex32; POINTS]>,
}

impl Zoom {
    /// None where the depths are too many, or K is no multiple of 16.
    pub fn new(images: usize, depths: Range<usize>) -> Option<Self> {
        if depths.len() > POINTS || !images.is_multiple_of(POINTS) {
            return None;
        }
        let rows = 0..images / POINTS;
        let twiddle = |r: usize| {
            let depths = depths.clone();
            std::array::from_fn(move |i| unit(r * (depths.start + i), images))
        };
        Some(Self { twiddles: rows.map(twiddle).collect(), depths })
    }
}

/// Phases and transform of a group of pixels.
pub struct ZoomTask<'a> {
    /// What is the same for all pixels.
    pub zoom: &'a Zoom,
    /// Their samples.
    pub samples: Samples<'a>,
    /// U at each depth; 16 at least.
    pub depths: &'a mut [Group],
}

impl LaneTask for ZoomTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Zoom { depths: Range { start, .. }, twiddles } = self.zoom;
        for part in (0..GROUP).step_by(L::WIDTH) {
            let mut sums = [Pair::<L>::zero(); POINTS];
            let mut rounds = Rounds::<L>::new(self.samples, part);
            for (r, twiddles) in twiddles.iter().enumerate() {
                let points = rounds.next(r);
                for i in 0..POINTS {
                    sums[i] = sums[i].plus(points[(start + i) % POINTS].times(twiddles[i]));
                }
            }
            for (group, sum) in self.depths.iter_mut().zip(sums) {
                sum.store(group, part);
            }
        }
    }
}
