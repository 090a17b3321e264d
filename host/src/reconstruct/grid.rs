//! What is laterally smooth, on blocks of 4 x 4 pixels: their means, smoothing, and values between.

use rayon::prelude::*;
use std::ops::Range;

/// Pixels along a side of a block.
pub const BLOCK: usize = 4;
/// Columns that are worked on together.
pub const STRIP: usize = 64;
/// Lateral smoothing, standard deviation in pixels.
const SIGMA_PX: f64 = 5.0;
/// The smoothing reaches so many standard deviations.
const REACH: f64 = 3.0;
/// Centre of a block from its first pixel.
const CENTER: f32 = (BLOCK as f32 - 1.0) / 2.0;
/// Weight of its own block at the four pixels of a block; the rest is its nearer neighbour's.
const OWN_SHARES: [f32; BLOCK] = [0.625, 0.875, 0.875, 0.625];
/// Blocks along a strip.
const BLOCKS: usize = STRIP / BLOCK;

/// The blocks of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Rows of the image.
    pub height: usize,
    /// Columns of the image.
    pub width: usize,
    /// Rows of blocks; the last may be lower.
    pub rows: usize,
    /// Columns of blocks; the last may be narrower.
    pub columns: usize,
}

impl Grid {
    /// The blocks of an image of this size.
    #[must_use]
    pub fn new(height: usize, width: usize) -> Self {
        Self { height, width, rows: height.div_ceil(BLOCK), columns: width.div_ceil(BLOCK) }
    }

    /// Number of blocks.
    #[must_use]
    pub fn blocks(&self) -> usize {
        self.rows * self.columns
    }

    /// One over the number of pixels of each block.
    #[must_use]
    pub fn block_weights(&self) -> Vec<f32> {
        let side = |block: usize, length: usize| BLOCK.min(length - block * BLOCK);
        let weight = |i: usize| {
            let (row, column) = (i / self.columns, i % self.columns);
            1.0 / (side(row, self.height) * side(column, self.width)) as f32
        };
        (0..self.blocks()).map(weight).collect()
    }

    /// Mean over each block, given [`Self::block_weights`].
    #[must_use]
    pub fn block_means(&self, values: &[f32], weights: &[f32]) -> Vec<f32> {
        let mut blocks = vec![0.0; self.blocks()];
        for (y, row) in values.chunks_exact(self.width).enumerate() {
            let line = &mut blocks[y / BLOCK * self.columns..][..self.columns];
            for (block, part) in line.iter_mut().zip(row.chunks(BLOCK)) {
                *block += part.iter().sum::<f32>();
            }
        }
        blocks.iter_mut().zip(weights).for_each(|(block, weight)| *block *= weight);
        blocks
    }

    /// Smooth every image of blocks with the Gaussian of sigma = 5 px; edges are mirrored.
    pub fn smooth(&self, images: &mut [f32]) {
        let half = half_gaussian(SIGMA_PX / BLOCK as f64);
        images.par_chunks_exact_mut(self.blocks()).for_each_init(Vec::new, |copy, image| {
            self.smooth_rows(image, &half, copy);
            self.smooth_columns(image, &half, copy);
        });
    }

    fn smooth_rows(&self, image: &mut [f32], half: &[f32], copy: &mut Vec<f32>) {
        let reach = half.len() - 1;
        for row in image.chunks_exact_mut(self.columns) {
            copy.clear();
            let places = 0..self.columns + 2 * reach;
            copy.extend(places.map(|i| row[mirrored(i as isize - reach as isize, self.columns)]));
            weigh(row, half, |d| [&copy[reach - d..], &copy[reach + d..]]);
        }
    }

    fn smooth_columns(&self, image: &mut [f32], half: &[f32], copy: &mut Vec<f32>) {
        copy.clear();
        copy.extend_from_slice(image);
        let line = |y: isize| &copy[mirrored(y, self.rows) * self.columns..][..self.columns];
        for (y, row) in (0..).zip(image.chunks_exact_mut(self.columns)) {
            weigh(row, half, |d| [line(y - d as isize), line(y + d as isize)]);
        }
    }

    /// Rows of pixels that lie between the same two rows of blocks, in order.
    pub fn bands(&self) -> impl Iterator<Item = Range<usize>> {
        let first = BLOCK / 2;
        let ends = (first..self.height).step_by(BLOCK).chain([self.height]);
        let starts = [0].into_iter().chain((first..self.height).step_by(BLOCK));
        starts.zip(ends).map(|(start, end)| start..end).filter(|band| !band.is_empty())
    }

    /// The columns from `first` on, a multiple of a block, of the two rows of blocks around a band of
    /// [`Self::bands`], linear between the centres of the blocks.
    #[inline(always)]
    pub fn interpolate(
        &self,
        image: &[f32],
        band: &Range<usize>,
        first: usize,
        rows: [&mut [f32; STRIP]; 2],
    ) {
        let above = (band.start + BLOCK / 2) / BLOCK;
        for (row, target) in rows.into_iter().enumerate() {
            let block = (above + row).saturating_sub(1).min(self.rows - 1);
            expand(&around(&image[block * self.columns..][..self.columns], first / BLOCK), target);
        }
    }

    /// Where row `y` lies between the rows of blocks above and below it, 0 to 1.
    #[must_use]
    pub fn share_below(&self, y: usize) -> f32 {
        let position = (y as f32 - CENTER) / BLOCK as f32;
        position - position.floor()
    }
}

/// The blocks of a strip and one on either side; the edges go on.
#[inline(always)]
fn around(line: &[f32], first: usize) -> [f32; BLOCKS + 2] {
    let inner = first.checked_sub(1).and_then(|before| line.get(before..)?.first_chunk());
    inner.copied().unwrap_or_else(|| {
        std::array::from_fn(|i| line[(first + i).saturating_sub(1).min(line.len() - 1)])
    })
}

/// Linear between the centres of blocks.
#[inline(always)]
fn expand(blocks: &[f32; BLOCKS + 2], target: &mut [f32; STRIP]) {
    let mut parts = [[0.0; BLOCKS]; BLOCK];
    for i in 0..BLOCKS {
        let [before, own, behind] = [blocks[i], blocks[i + 1], blocks[i + 2]];
        let sides = [before, before, behind, behind];
        for part in 0..BLOCK {
            parts[part][i] = sides[part] + OWN_SHARES[part] * (own - sides[part]);
        }
    }
    for i in 0..BLOCKS {
        for part in 0..BLOCK {
            target[BLOCK * i + part] = parts[part][i];
        }
    }
}

/// Taps from the middle outwards, normalised to sum 1 with both sides.
fn half_gaussian(sigma: f64) -> Vec<f32> {
    let reach = (REACH * sigma).ceil() as usize;
    let taps: Vec<f64> = (0..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * taps.iter().sum::<f64>() - taps[0];
    taps.iter().map(|tap| (tap / sum) as f32).collect()
}

/// A place in a line of `length` whose ends are mirrors.
fn mirrored(place: isize, length: usize) -> usize {
    let period = 2 * length;
    let place = place.rem_euclid(period as isize) as usize;
    place.min(period - 1 - place)
}

/// The middle times half[0] and what lies at a distance d on both sides times half[d], summed.
fn weigh<'a>(out: &mut [f32], half: &[f32], sides: impl Fn(usize) -> [&'a [f32]; 2]) {
    let [middle, _] = sides(0);
    out.iter_mut().zip(middle).for_each(|(sum, value)| *sum = half[0] * value);
    for (d, tap) in half.iter().enumerate().skip(1) {
        let [before, behind] = sides(d);
        for ((sum, a), b) in out.iter_mut().zip(before).zip(behind) {
            *sum += tap * (a + b);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_image_survives_blocks_and_interpolation() {
        let grid = Grid::new(22, 150);
        let smooth = |y: usize, x: usize| 3.0 + 0.2 * y as f32 - 0.1 * x as f32;
        let values: Vec<f32> = (0..22 * 150).map(|i| smooth(i / 150, i % 150)).collect();
        let blocks = grid.block_means(&values, &grid.block_weights());
        let (mut upper, mut lower) = ([0.0; STRIP], [0.0; STRIP]);
        for first in [0, 64, 128] {
            for band in grid.bands() {
                grid.interpolate(&blocks, &band, first, [&mut upper, &mut lower]);
                for y in band.filter(|y| (2..18).contains(y)) {
                    let share = grid.share_below(y);
                    for x in (first..first + STRIP).filter(|x| (2..146).contains(x)) {
                        let [a, b] = [upper, lower].map(|row| row[x - first]);
                        let value = a + share * (b - a);
                        assert!((value - smooth(y, x)).abs() < 1e-4, "{first} {y} {x}");
                    }
                }
            }
        }
    }

    #[test]
    fn bands_cover_all_rows() {
        for height in 1..20 {
            let rows: Vec<usize> = Grid::new(height, 4).bands().flatten().collect();
            assert_eq!(rows, (0..height).collect::<Vec<_>>());
        }
    }

    #[test]
    fn smoothing_keeps_constants_and_removes_speckle() {
        let grid = Grid::new(64, 64);
        let mut constant = vec![2.5; grid.blocks()];
        grid.smooth(&mut constant);
        assert!(constant.iter().all(|v| (v - 2.5).abs() < 1e-5));
        let mut rough: Vec<f32> =
            (0..grid.blocks()).map(|i| if (i / 16 + i) % 2 == 0 { 1.0 } else { -1.0 }).collect();
        grid.smooth(&mut rough);
        // Mirrored edges break the pattern: they are looked at apart.
        let inner = |i: &usize| (4..12).contains(&(i / 16)) && (4..12).contains(&(i % 16));
        assert!((0..256).filter(inner).all(|i| rough[i].abs() < 0.02));
        assert!(rough.iter().all(|v| v.abs() < 0.3));
    }
}
