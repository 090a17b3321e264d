//! Any depths of a group of pixels, where K is a multiple of 256.
//!
//! With K = 256 Q, R = 16 Q, r = Q s + t and z = k + 16 l
//! ```text
//! U(z) = sum over t of exp(-2 pi i t l/R) [sum over s of exp(-2 pi i r k/K) Y(r, k) exp(-2 pi i s l/16)]
//! ```
//! with Y of `pairs`: two rounds of transforms of 16 points, then Q terms for each depth that is wanted.

use super::pairs::{GROUP, Group, POINTS, Pair, Rounds, Samples, sixteen, unit};
use crate::lanes::{LaneTask, Lanes};
use num_complex::Complex32;
use std::ops::Range;

/// What is the same for all pixels.
pub struct Whole {
    images: usize,
    depths: Range<usize>,
    /// exp(-2 pi i r k/K), (r, k).
    inner: Vec<[Complex32; POINTS]>,
    /// exp(-2 pi i t l/R), (t, l).
    outer: Vec<Vec<Complex32>>,
}

impl Whole {
    /// None where K is no multiple of 256.
    pub fn new(images: usize, depths: Range<usize>) -> Option<Self> {
        if !images.is_multiple_of(POINTS * POINTS) {
            return None;
        }
        let rows = images / POINTS;
        let inner = (0..rows).map(|r| std::array::from_fn(|k| unit(r * k, images)));
        let outer = |t: usize| (0..rows).map(|l| unit(t * l, rows)).collect();
        let terms = 0..rows / POINTS;
        Some(Self { images, depths, inner: inner.collect(), outer: terms.map(outer).collect() })
    }

    /// Depths k + 16 l that are wanted, as values of l.
    fn wanted(&self, k: usize) -> Range<usize> {
        let from = |z: usize| z.saturating_sub(k).div_ceil(POINTS);
        from(self.depths.start)..from(self.depths.end)
    }
}

/// Phases and transform of a group of pixels.
pub struct WholeTask<'a> {
    /// What is the same for all pixels.
    pub whole: &'a Whole,
    /// Their samples.
    pub samples: Samples<'a>,
    /// Y, (k, r): K of them.
    pub middle: &'a mut [Group],
    /// U at each depth.
    pub depths: &'a mut [Group],
}

impl LaneTask for WholeTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Self { whole, samples, middle, depths } = self;
        let rows = whole.images / POINTS;
        for part in (0..GROUP).step_by(L::WIDTH) {
            let mut rounds = Rounds::<L>::new(samples, part);
            for (r, twiddles) in whole.inner.iter().enumerate() {
                let points = rounds.next(r);
                for k in 0..POINTS {
                    points[k].times(twiddles[k]).store(&mut middle[k * rows + r], part);
                }
            }
            for (k, middle) in middle.chunks_exact(rows).enumerate() {
                for (t, outer) in whole.outer.iter().enumerate() {
                    let mut column = [Pair::<L>::zero(); POINTS];
                    for (s, point) in column.iter_mut().enumerate() {
                        *point = Pair::load(&middle[s * whole.outer.len() + t], part);
                    }
                    let column = sixteen(&column);
                    for l in whole.wanted(k) {
                        let depth = &mut depths[k + POINTS * l - whole.depths.start];
                        let mut sum = column[l % POINTS];
                        if t > 0 {
                            sum = Pair::load(depth, part).plus(sum.times(outer[l]));
                        }
                        sum.store(depth, part);
                    }
                }
            }
        }
    }
}
