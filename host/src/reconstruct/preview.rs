//! A B-scan of one sweep with any dispersion: what the diagnostic pictures compare.

use super::background::{Background, Fit};
use super::dispersion::Dispersion;
use super::grid::{BLOCK, Grid};
use super::preparation::Preparation;
use super::spectrum::{Direction, Input, Transform};
use super::strips::StripCounts;
use super::window::Window;
use crate::error::Result;
use crate::io::RawImages;

/// Rows of the strip that is read; the B-scan is the mean of their intensities.
pub const ROWS: usize = 2 * BLOCK;

/// Amplitude (z, x) over all positive depths, the root of the mean intensity over eight rows in the
/// middle of the first usable sweep, with each of the `dispersions` corrected.
///
/// # Errors
/// When the recording cannot be read.
pub fn bscans(
    raw: &dyn RawImages,
    plan: &Preparation,
    dispersions: &[Dispersion],
) -> Result<Vec<Vec<f32>>> {
    let (height, width) = (raw.format().height, raw.format().width);
    let images = plan.images;
    let rows = first_row(height)..first_row(height) + ROWS;
    let Some(sweep) = plan.sweeps.iter().find(|sweep| sweep.is_ok()) else {
        return Ok(Vec::new());
    };
    let first = sweep.first_image;
    let light = &plan.illumination.pixels[rows.start * width..rows.end * width];
    let grid = Grid::new(ROWS, width);
    let fit = Fit::new(grid, light)?;
    let mut counts = StripCounts::new(images, grid)?;
    let images_fitted = counts.load(
        |m, image| raw.read(first + m..first + m + 1, rows.clone(), image),
        |image| fit.image(image),
    )?;
    let source = Background::of(images_fitted).source;
    let fixed = vec![0.0; images * grid.blocks()];
    let input = Input { counts: &counts, source: &source, illumination: light, fixed: &fixed };
    let scan = |dispersion: &Dispersion| -> Result<Vec<f32>> {
        let transform =
            Transform::new(grid, &Window::Hann.weights(images), dispersion, Direction::Up)?;
        let mut volume = vec![0.0; images / 2 * ROWS * width];
        transform.amplitudes(input, 0..images / 2, &mut volume)?;
        let mean = |plane: &[f32], x: usize| {
            let column = plane[x..].iter().step_by(width);
            (column.map(|u| u * u).sum::<f32>() / ROWS as f32).sqrt()
        };
        let planes = volume.chunks_exact(ROWS * width);
        Ok(planes.flat_map(|plane| (0..width).map(|x| mean(plane, x))).collect())
    };
    dispersions.iter().map(scan).collect()
}

/// First of the rows that a preview shows.
#[must_use]
pub fn first_row(height: usize) -> usize {
    height.saturating_sub(ROWS) / 2
}
