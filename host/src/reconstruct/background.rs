//! The background of a sweep: what the camera would see without the sample.
//!
//! ```text
//! I(m,y,x) = S(m) v(y,x) + B(m,y,x) + fringes of the sample
//! ```
//! S(m) is fitted to every sweep, because the source's power drifts; v is the illumination. B holds
//! the fixed fringes of the optics: they are laterally smooth, speckle is not, so B is kept on a grid
//! of blocks of 4 x 4 pixels and smoothed with sigma = 5 px. Averaged over the sweeps without that
//! smoothing, a still sample would be in B and be removed with it. (The paper says "a background
//! removal", line 693.)

use super::counts::SweepCounts;
use super::illumination::Illumination;
use rayon::prelude::*;
use std::ops::Range;

/// Pixels along a side of a block.
pub const BLOCK: usize = 4;
/// Lateral smoothing of the fixed fringes, standard deviation in pixels.
const SIGMA_PX: f64 = 5.0;
/// The smoothing reaches so many standard deviations.
const REACH: f64 = 3.0;

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

/// The source term of one sweep and what it leaves.
pub struct Background {
    /// S(m), counts.
    pub source: Vec<f32>,
    /// Block means of I - S v, (m, row of blocks, column of blocks).
    pub residual: Vec<f32>,
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

    /// Fit S(m) = sum(v I) / sum(v^2) and give the block means of the rest.
    #[must_use]
    pub fn measure(&self, sweep: &SweepCounts, illumination: &Illumination) -> Background {
        let v = &illumination.pixels;
        let power: f64 = v.iter().map(|&v| f64::from(v).powi(2)).sum();
        let v_blocks = self.block_means(v.iter().copied());
        let pixels = self.height * self.width;
        let images: Vec<(f32, Vec<f32>)> = sweep
            .counts
            .par_chunks_exact(pixels)
            .map(|image| {
                let source = (dot(image, v, self.width) / power) as f32;
                let mut blocks = self.block_means(image.iter().map(|&count| f32::from(count)));
                blocks.iter_mut().zip(&v_blocks).for_each(|(b, v)| *b -= source * v);
                (source, blocks)
            })
            .collect();
        let (source, blocks): (Vec<f32>, Vec<Vec<f32>>) = images.into_iter().unzip();
        Background { source, residual: blocks.concat() }
    }

    fn block_means(&self, values: impl Iterator<Item = f32>) -> Vec<f32> {
        let mut sums = vec![0.0_f32; self.blocks()];
        let mut counts = vec![0.0_f32; self.columns];
        let mut values = values;
        for y in 0..self.height {
            let row = &mut sums[y / BLOCK * self.columns..][..self.columns];
            for (column, sum) in row.iter_mut().enumerate() {
                let width = BLOCK.min(self.width - column * BLOCK);
                *sum += values.by_ref().take(width).sum::<f32>();
                counts[column] = width as f32;
            }
        }
        for (row, line) in sums.chunks_exact_mut(self.columns).enumerate() {
            let rows = BLOCK.min(self.height - row * BLOCK) as f32;
            line.iter_mut().zip(&counts).for_each(|(sum, count)| *sum /= count * rows);
        }
        sums
    }

    /// Smooth every image of blocks with the Gaussian of sigma = 5 px; edges are mirrored.
    pub fn smooth(&self, images: &mut [f32]) {
        let half = half_gaussian(SIGMA_PX / BLOCK as f64);
        images.par_chunks_exact_mut(self.blocks()).for_each(|image| {
            let mut line = Vec::new();
            for row in image.chunks_exact_mut(self.columns) {
                line.clear();
                line.extend_from_slice(row);
                convolve(&line, &half, row.iter_mut());
            }
            for column in 0..self.columns {
                line.clear();
                line.extend(image[column..].iter().step_by(self.columns));
                convolve(&line, &half, image[column..].iter_mut().step_by(self.columns));
            }
        });
    }

    /// Some columns of one row of pixels of a smoothed image of blocks, by linear interpolation
    /// between the centres of the blocks. They begin at [`Self::offset`] of `row`, which needs room
    /// for `4 * columns + 4` values.
    #[inline(always)]
    pub fn interpolate_row(
        &self,
        image: &[f32],
        y: usize,
        columns: &Range<usize>,
        between: &mut [f32],
        row: &mut [f32],
    ) {
        let position = (y as f32 - CENTER) / BLOCK as f32;
        let below = position.floor();
        let share = position - below;
        let last = self.rows as isize - 1;
        let line =
            |row: isize| &image[row.clamp(0, last) as usize * self.columns..][..self.columns];
        let (upper, lower) = (line(below as isize), line(below as isize + 1));
        let first = first_block(columns);
        let blocks = (columns.end + BLOCK / 2).div_ceil(BLOCK) + 1 - first;
        let last = self.columns - 1;
        for (i, value) in between[..blocks].iter_mut().enumerate() {
            let block = (first + i).saturating_sub(1).min(last);
            *value = upper[block] + share * (lower[block] - upper[block]);
        }
        let pairs = between[..blocks].windows(2);
        for (four, pair) in row.as_chunks_mut::<BLOCK>().0.iter_mut().zip(pairs) {
            for (value, share) in four.iter_mut().zip(SHARES) {
                *value = pair[0] + share * (pair[1] - pair[0]);
            }
        }
    }

    /// Where the columns begin in the row that [`Self::interpolate_row`] fills.
    #[must_use]
    pub fn offset(&self, columns: &Range<usize>) -> usize {
        columns.start + BLOCK / 2 - BLOCK * first_block(columns)
    }
}

/// The block before the first column, counted from 1 (0 is the mirror of the first block).
fn first_block(columns: &Range<usize>) -> usize {
    (columns.start + BLOCK / 2) / BLOCK
}

/// Centre of a block from its first pixel.
const CENTER: f32 = (BLOCK as f32 - 1.0) / 2.0;
/// Where the four pixels between two centres lie.
const SHARES: [f32; BLOCK] = [0.125, 0.375, 0.625, 0.875];

/// Sum of image times illumination, rows in `f32`, their sum in `f64`.
fn dot(image: &[u16], v: &[f32], width: usize) -> f64 {
    let rows = image.chunks_exact(width).zip(v.chunks_exact(width));
    rows.map(|(counts, v)| {
        const LANES: usize = 16;
        let mut sums = [0.0_f32; LANES];
        let (counts, counts_rest) = counts.as_chunks::<LANES>();
        let (v, v_rest) = v.as_chunks::<LANES>();
        for (counts, v) in counts.iter().zip(v) {
            for lane in 0..LANES {
                sums[lane] += f32::from(counts[lane]) * v[lane];
            }
        }
        let rest = counts_rest.iter().zip(v_rest).map(|(&c, &v)| f32::from(c) * v);
        f64::from(sums.iter().copied().chain(rest).sum::<f32>())
    })
    .sum()
}

/// Taps from the middle outwards, normalised to sum 1 with both sides.
fn half_gaussian(sigma: f64) -> Vec<f32> {
    let reach = (REACH * sigma).ceil() as usize;
    let taps: Vec<f64> = (0..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * taps.iter().sum::<f64>() - taps[0];
    taps.iter().map(|tap| (tap / sum) as f32).collect()
}

/// Symmetric filter with mirrored ends.
fn convolve<'a>(line: &[f32], half: &[f32], out: impl Iterator<Item = &'a mut f32>) {
    let last = line.len() as isize - 1;
    let mirrored = |i: isize| {
        let period = 2 * (last + 1);
        let i = i.rem_euclid(period);
        line[(if i > last { period - 1 - i } else { i }) as usize]
    };
    for (i, value) in out.enumerate() {
        let i = i as isize;
        let sides = half[1..].iter().zip(1..);
        *value = half[0] * line[i as usize]
            + sides.map(|(tap, d)| tap * (mirrored(i - d) + mirrored(i + d))).sum::<f32>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_image_survives_blocks_and_interpolation() {
        let grid = Grid::new(22, 30);
        let smooth = |y: usize, x: usize| 3.0 + 0.2 * y as f32 - 0.1 * x as f32;
        let values = (0..22 * 30).map(|i| smooth(i / 30, i % 30));
        let blocks = grid.block_means(values);
        let (mut between, mut row) = (vec![0.0; 10], vec![0.0; 36]);
        for columns in [0..30, 3..17, 16..26] {
            for y in 2..18 {
                grid.interpolate_row(&blocks, y, &columns, &mut between, &mut row);
                let from = grid.offset(&columns);
                for x in columns.clone().filter(|x| (2..26).contains(x)) {
                    let value = row[from + x - columns.start];
                    assert!((value - smooth(y, x)).abs() < 1e-4, "{columns:?} {y} {x}");
                }
            }
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

    #[test]
    fn the_source_is_found_and_the_rest_left() {
        let (images, height, width) = (8, 8, 12);
        let mut sweep = SweepCounts::new(images, height, width).unwrap();
        for (i, count) in sweep.counts.iter_mut().enumerate() {
            *count = 1000 + 50 * (i / (height * width)) as u16;
        }
        let light = Illumination::measure(&sweep, 4095).unwrap();
        let background = Grid::new(height, width).measure(&sweep, &light);
        for (m, source) in background.source.iter().enumerate() {
            assert!((source - (1000.0 + 50.0 * m as f32)).abs() < 1e-2, "{source}");
        }
        assert!(background.residual.iter().all(|r| r.abs() < 1e-2));
    }
}
