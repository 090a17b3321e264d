//! The background of a sweep: what the camera would see without the sample.
//!
//! ```text
//! I(m,y,x) = S(m) v(y,x) + B(m,y,x) + fringes of the sample
//! ```
//! S(m) is fitted to every sweep, because the source's power drifts; v is the illumination. B holds
//! the fixed fringes of the optics: they are laterally smooth, speckle is not, so B is kept on a grid
//! of blocks and smoothed. Averaged over the sweeps without that smoothing, a still sample would be in
//! B and be removed with it. (The paper says "a background removal", lines 701-702.)

use super::grid::{BLOCK, Grid};
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes, Path};

/// The source term of one sweep and what it leaves.
pub struct Background {
    /// S(m), counts.
    pub source: Vec<f32>,
    /// Block means of I - S v, (m, row of blocks, column of blocks).
    pub residual: Vec<f32>,
}

/// Fits the source term, image by image.
pub struct Fit<'a> {
    grid: Grid,
    /// v (y,x).
    v: &'a [f32],
    /// sum(v^2).
    power: f64,
    block_weights: Vec<f32>,
    v_blocks: Vec<f32>,
    path: Path,
}

/// S of one image and the block means of what it leaves.
pub type ImageFit = (f32, Vec<f32>);

impl<'a> Fit<'a> {
    /// For images under the illumination v (y, x).
    ///
    /// # Errors
    /// When `PHASEWALK_SIMD` names what this machine does not have.
    pub fn new(grid: Grid, v: &'a [f32]) -> Result<Self> {
        let block_weights = grid.block_weights();
        Ok(Self {
            grid,
            v,
            power: v.iter().map(|&v| f64::from(v).powi(2)).sum(),
            v_blocks: grid.block_means(v, &block_weights),
            block_weights,
            path: Path::best()?,
        })
    }

    /// S = sum(v I) / sum(v^2) and the block means of I - S v.
    ///
    /// # Errors
    /// When the machine lost its vector unit.
    pub fn image(&self, image: &[u16]) -> Result<ImageFit> {
        let grid = &self.grid;
        let (mut blocks, mut line) = (vec![0.0; grid.blocks()], vec![0.0; grid.width]);
        let task = MeasureTask { grid, image, v: self.v, line: &mut line, blocks: &mut blocks };
        let source = (self.path.run(task)? / self.power) as f32;
        let scaled = blocks.iter_mut().zip(&self.block_weights).zip(&self.v_blocks);
        scaled.for_each(|((block, weight), v)| *block = *block * weight - source * v);
        Ok((source, blocks))
    }
}

impl Background {
    /// Of all images of a sweep.
    #[must_use]
    pub fn of(images: Vec<ImageFit>) -> Self {
        let source = images.iter().map(|(source, _)| *source).collect();
        Self { source, residual: images.into_iter().flat_map(|(_, blocks)| blocks).collect() }
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

#[cfg(test)]
mod tests {
    use super::super::counts::SweepCounts;
    use super::super::illumination::Illumination;
    use super::*;

    #[test]
    fn the_source_is_found_and_the_rest_left() {
        let (images, height, width) = (8, 8, 12);
        let mut sweep = SweepCounts::new(images, height, width).unwrap();
        for (i, count) in sweep.counts.iter_mut().enumerate() {
            *count = 1000 + 50 * (i / (height * width)) as u16;
        }
        let light = Illumination::measure(&sweep, 4095).unwrap();
        let grid = Grid::new(height, width);
        let fit = Fit::new(grid, &light.pixels).unwrap();
        let images =
            sweep.counts.chunks_exact(height * width).map(|image| fit.image(image).unwrap());
        let background = Background::of(images.collect());
        for (m, source) in background.source.iter().enumerate() {
            assert!((source - (1000.0 + 50.0 * m as f32)).abs() < 1e-2, "{source}");
        }
        assert!(background.residual.iter().all(|r| r.abs() < 1e-2));
    }
}
