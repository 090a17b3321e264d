//! The background of a sweep: what the camera would see without the sample.
//!
//! ```text
//! I(m,y,x) = S(m) v(y,x) + B(m,y,x) + fringes of the sample
//! ```
//! S(m) is fitted to every sweep, because the source's power drifts; v is the illumination. B holds
//! the fixed fringes of the optics: they are laterally smooth, speckle is not, so B is kept on a grid
//! of blocks of 4 x 4 pixels and smoothed with sigma = 5 px. Averaged over the sweeps without that
//! smoothing, a still sample would be in B and be removed with it. (The paper says "a background
//! removal", lines 701-702.)

use super::counts::SweepCounts;
use super::illumination::Illumination;
use crate::allocate::zeros;
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes, Path};
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
    ///
    /// # Errors
    /// When `PHASEWALK_SIMD` names what this machine does not have.
    pub fn measure(&self, sweep: &SweepCounts, illumination: &Illumination) -> Result<Background> {
        let (v, path) = (&illumination.pixels, Path::best()?);
        let power: f64 = v.iter().map(|&v| f64::from(v).powi(2)).sum();
        let weights = self.block_weights();
        let v_blocks = self.block_means(v, &weights);
        let pixels = self.height * self.width;
        let mut residual = zeros(sweep.images * self.blocks(), "block means of one sweep")?;
        let images = sweep.counts.par_chunks_exact(pixels);
        let source = images
            .zip(residual.par_chunks_exact_mut(self.blocks()))
            .map_init(
                || vec![0.0; self.width],
                |line, (image, blocks)| {
                    let sum = path.run(MeasureTask { grid: self, image, v, line, blocks })?;
                    let source = (sum / power) as f32;
                    let scaled = blocks.iter_mut().zip(&weights).zip(&v_blocks);
                    scaled.for_each(|((b, weight), v)| *b = *b * weight - source * v);
                    Ok(source)
                },
            )
            .collect::<Result<Vec<f32>>>()?;
        Ok(Background { source, residual })
    }

    /// One over the number of pixels of each block.
    fn block_weights(&self) -> Vec<f32> {
        let side = |block: usize, length: usize| BLOCK.min(length - block * BLOCK);
        let weight = |i: usize| {
            let (row, column) = (i / self.columns, i % self.columns);
            1.0 / (side(row, self.height) * side(column, self.width)) as f32
        };
        (0..self.blocks()).map(weight).collect()
    }

    fn block_means(&self, values: &[f32], weights: &[f32]) -> Vec<f32> {
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

    /// Rows of pixels that lie between the same two rows of blocks, in order.
    pub fn bands(&self) -> impl Iterator<Item = Range<usize>> {
        let first = BLOCK / 2;
        let ends = (first..self.height).step_by(BLOCK).chain([self.height]);
        let starts = [0].into_iter().chain((first..self.height).step_by(BLOCK));
        starts.zip(ends).map(|(start, end)| start..end).filter(|band| !band.is_empty())
    }

    /// Some columns of the two rows of blocks around a band of [`Self::bands`], linear between the
    /// centres of the blocks: upper and lower, `columns.len()` values each.
    #[inline(always)]
    pub fn interpolate(
        &self,
        image: &[f32],
        band: &Range<usize>,
        columns: &Range<usize>,
        rows: [&mut [f32]; 2],
    ) {
        let above = (band.start + BLOCK / 2) / BLOCK;
        for (row, target) in rows.into_iter().enumerate() {
            let block = (above + row).saturating_sub(1).min(self.rows - 1);
            let line = &image[block * self.columns..][..self.columns];
            let last = self.columns - 1;
            for (i, four) in target[..columns.len()].chunks_mut(BLOCK).enumerate() {
                let block = columns.start / BLOCK + i;
                let [before, own, behind] =
                    [block.saturating_sub(1), block, block + 1].map(|block| line[block.min(last)]);
                let sides = [before, before, behind, behind];
                for ((value, side), share) in four.iter_mut().zip(sides).zip(OWN_SHARES) {
                    *value = side + share * (own - side);
                }
            }
        }
    }

    /// Where row `y` lies between the rows of blocks above and below it, 0 to 1.
    #[must_use]
    pub fn share_below(&self, y: usize) -> f32 {
        let position = (y as f32 - CENTER) / BLOCK as f32;
        position - position.floor()
    }
}

/// Sum of counts times illumination over an image; the sums of its blocks on the way.
struct MeasureTask<'a> {
    grid: &'a Grid,
    image: &'a [u16],
    v: &'a [f32],
    line: &'a mut [f32],
    blocks: &'a mut [f32],
}

impl LaneTask for MeasureTask<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> f64 {
        let Self { grid: &Grid { width, columns, .. }, image, v, line, blocks } = self;
        let bands = image.chunks(BLOCK * width).zip(v.chunks(BLOCK * width));
        let mut sum = 0.0;
        for ((counts, v), blocks) in bands.zip(blocks.chunks_exact_mut(columns)) {
            line.fill(0.0);
            for (counts, v) in counts.chunks_exact(width).zip(v.chunks_exact(width)) {
                sum += f64::from(dot_and_add(counts, v, line));
            }
            let (fours, rest) = line.as_chunks::<BLOCK>();
            for (block, four) in blocks.iter_mut().zip(fours) {
                *block = (four[0] + four[1]) + (four[2] + four[3]);
            }
            if let (Some(block), false) = (blocks.last_mut(), rest.is_empty()) {
                *block = rest.iter().sum();
            }
        }
        sum
    }
}

/// Add a row of counts to a line, and give its sum times the illumination.
#[inline(always)]
fn dot_and_add(counts: &[u16], v: &[f32], line: &mut [f32]) -> f32 {
    const LANES: usize = 32;
    let mut sums = [0.0_f32; LANES];
    let (counts, counts_rest) = counts.as_chunks::<LANES>();
    let (v, v_rest) = v.as_chunks::<LANES>();
    let (line, line_rest) = line.as_chunks_mut::<LANES>();
    for ((counts, v), line) in counts.iter().zip(v).zip(line) {
        for lane in 0..LANES {
            let count = f32::from(counts[lane]);
            sums[lane] += count * v[lane];
            line[lane] += count;
        }
    }
    let mut rest = 0.0;
    for ((&count, v), line) in counts_rest.iter().zip(v_rest).zip(line_rest) {
        rest += f32::from(count) * v;
        *line += f32::from(count);
    }
    sums.iter().sum::<f32>() + rest
}

/// Centre of a block from its first pixel.
const CENTER: f32 = (BLOCK as f32 - 1.0) / 2.0;
/// Weight of its own block at the four pixels of a block; the rest is its nearer neighbour's.
const OWN_SHARES: [f32; BLOCK] = [0.625, 0.875, 0.875, 0.625];

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
        let values: Vec<f32> = (0..22 * 30).map(|i| smooth(i / 30, i % 30)).collect();
        let blocks = grid.block_means(&values, &grid.block_weights());
        let (mut upper, mut lower) = ([0.0; 30], [0.0; 30]);
        for columns in [0..30, 4..20, 16..26] {
            for band in grid.bands() {
                grid.interpolate(&blocks, &band, &columns, [&mut upper, &mut lower]);
                for y in band.filter(|y| (2..18).contains(y)) {
                    let share = grid.share_below(y);
                    for x in columns.clone().filter(|x| (2..26).contains(x)) {
                        let [a, b] = [upper, lower].map(|row| row[x - columns.start]);
                        let value = a + share * (b - a);
                        assert!((value - smooth(y, x)).abs() < 1e-4, "{columns:?} {y} {x}");
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

    #[test]
    fn the_source_is_found_and_the_rest_left() {
        let (images, height, width) = (8, 8, 12);
        let mut sweep = SweepCounts::new(images, height, width).unwrap();
        for (i, count) in sweep.counts.iter_mut().enumerate() {
            *count = 1000 + 50 * (i / (height * width)) as u16;
        }
        let light = Illumination::measure(&sweep, 4095).unwrap();
        let background = Grid::new(height, width).measure(&sweep, &light).unwrap();
        for (m, source) in background.source.iter().enumerate() {
            assert!((source - (1000.0 + 50.0 * m as f32)).abs() < 1e-2, "{source}");
        }
        assert!(background.residual.iter().all(|r| r.abs() < 1e-2));
    }
}
