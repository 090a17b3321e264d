//! Background off the pixels of a strip: I(m) - S(m) v - B(m).

use super::grid::{BLOCK, Grid, STRIP};
use super::pairs::Line;
use super::spectrum::Input;
use crate::lanes::{LaneTask, Lanes};
use std::ops::Range;

/// Neighbouring pixels that are worked on together.
pub struct Strip {
    /// Rows, a band of the grid.
    pub band: Range<usize>,
    /// Number of the band.
    pub number: usize,
    /// First column.
    pub first: usize,
}

/// Take the background off a strip.
pub struct RemoveTask<'a> {
    /// Of the image.
    pub grid: &'a Grid,
    /// Counts and background.
    pub input: Input<'a>,
    /// Where.
    pub strip: &'a Strip,
    /// (m, row).
    pub samples: &'a mut [Line],
}

impl RemoveTask<'_> {
    /// v of the strip; 0 beyond the last column.
    #[inline(always)]
    fn light(&self) -> [[f32; STRIP]; BLOCK] {
        let (Strip { band, first, .. }, width) = (self.strip, self.grid.width);
        let mut light = [[0.0; STRIP]; BLOCK];
        for (own, y) in light.iter_mut().zip(band.clone()) {
            let row = &self.input.illumination[y * width..][*first..(first + STRIP).min(width)];
            own[..row.len()].copy_from_slice(row);
        }
        light
    }
}

impl LaneTask for RemoveTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let light = self.light();
        let Self { grid, input, strip: Strip { band, number, first }, samples } = self;
        let mut shares = [0.0; BLOCK];
        shares.iter_mut().zip(band.clone()).for_each(|(share, y)| *share = grid.share_below(y));
        let (mut upper, mut lower) = ([0.0; STRIP], [0.0; STRIP]);
        let counts = input.counts.strip(*number, first / STRIP);
        let images = counts.zip(input.source).zip(input.fixed.chunks_exact(grid.blocks()));
        for (((counts, &source), fixed), lines) in images.zip(samples.chunks_exact_mut(BLOCK)) {
            grid.interpolate(fixed, band, *first, [&mut upper, &mut lower]);
            let (counts, _) = counts.as_chunks::<STRIP>();
            let rows = lines.iter_mut().zip(counts).zip(light.iter().zip(shares));
            for ((Line(line), counts), (light, share)) in rows.take(band.len()) {
                for x in 0..STRIP {
                    let fixed = upper[x] + share * (lower[x] - upper[x]);
                    line[x] = f32::from(counts[x]) - source * light[x] - fixed;
                }
            }
        }
    }
}
