//! The raw counts of one sweep in memory, cut into the strips of pixels that are transformed together.
//!
//! A strip needs a few of every image's pixels. Where images lay whole, each would be far from the
//! last; here some images of a strip lie beside each other.

use super::grid::{BLOCK, Grid, STRIP};
use super::illumination::Illumination;
use crate::allocate::zeros;
use crate::error::Result;
use crate::io::RawImages;
use rayon::prelude::*;

/// Images that one task decodes, and that lie beside each other.
const IMAGES: usize = 8;

/// Counts of one image in a strip, (row, x).
pub type Piece = [u16; BLOCK * STRIP];

/// Counts of K images, (m / 8, band, strip, m % 8, row, x).
pub struct StripCounts {
    grid: Grid,
    images: usize,
    counts: Vec<u16>,
}

impl StripCounts {
    /// Room for a sweep of K images.
    ///
    /// # Errors
    /// When the memory is not there.
    pub fn new(images: usize, grid: Grid) -> Result<Self> {
        let counts = zeros(Self::counts(images, &grid), "the counts of one sweep")?;
        Ok(Self { grid, images, counts })
    }

    /// Bytes that [`Self::new`] takes.
    #[must_use]
    pub fn bytes(images: usize, grid: &Grid) -> usize {
        size_of::<u16>() * Self::counts(images, grid)
    }

    fn counts(images: usize, grid: &Grid) -> usize {
        images.div_ceil(IMAGES) * counts_per_task(grid)
    }

    /// Read the K images from `first` on, dead pixels replaced by their neighbours; what `inspect`
    /// makes of each.
    ///
    /// # Errors
    /// When the file cannot be read, or `inspect` fails.
    pub fn load_sweep<T: Send>(
        &mut self,
        raw: &dyn RawImages,
        first: usize,
        illumination: &Illumination,
        inspect: impl Fn(&[u16]) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let height = self.grid.height;
        let read = |m: usize, image: &mut [u16]| {
            raw.read(first + m..first + m + 1, 0..height, image)?;
            illumination.repair(image);
            Ok(())
        };
        self.load(read, inspect)
    }

    /// Fill with the images (y, x) that `read` puts into a buffer; what `inspect` makes of each.
    ///
    /// # Errors
    /// Those of `read` and `inspect`.
    pub fn load<T: Send>(
        &mut self,
        read: impl Fn(usize, &mut [u16]) -> Result<()> + Sync,
        inspect: impl Fn(&[u16]) -> Result<T> + Sync,
    ) -> Result<Vec<T>> {
        let (grid, images) = (self.grid, self.images);
        let tasks = self.counts.par_chunks_exact_mut(counts_per_task(&grid)).enumerate();
        let inspected = tasks.map_init(
            || vec![0; grid.height * grid.width],
            |image, (task, counts)| {
                let own = task * IMAGES..((task + 1) * IMAGES).min(images);
                own.map(|m| {
                    read(m, image)?;
                    cut(&grid, image, m % IMAGES, counts);
                    inspect(image)
                })
                .collect()
            },
        );
        let inspected: Vec<Vec<T>> = inspected.collect::<Result<_>>()?;
        Ok(inspected.into_iter().flatten().collect())
    }

    /// All images of a strip; a row that the band does not have, or a column beyond the last, holds
    /// what it will.
    pub fn strip(&self, band: usize, strip: usize) -> impl Iterator<Item = &Piece> {
        let pieces = IMAGES * BLOCK * STRIP;
        let place = (band * strips(&self.grid) + strip) * pieces;
        let tasks = self.counts.chunks_exact(counts_per_task(&self.grid));
        let own = tasks.flat_map(move |counts| counts[place..place + pieces].as_chunks().0);
        own.take(self.images)
    }
}

/// Strips of a band.
fn strips(grid: &Grid) -> usize {
    grid.width.div_ceil(STRIP)
}

fn counts_per_task(grid: &Grid) -> usize {
    grid.bands().count() * strips(grid) * IMAGES * BLOCK * STRIP
}

/// Put the i-th image of a task where it belongs.
fn cut(grid: &Grid, image: &[u16], i: usize, counts: &mut [u16]) {
    let mut pieces = counts.as_chunks_mut::<{ BLOCK * STRIP }>().0.chunks_exact_mut(IMAGES);
    for band in grid.bands() {
        for from in (0..grid.width).step_by(STRIP) {
            let Some(piece) = pieces.next().and_then(|pieces| pieces.get_mut(i)) else { return };
            for (y, target) in band.clone().zip(piece.chunks_exact_mut(STRIP)) {
                let row = &image[y * grid.width..][from..(from + STRIP).min(grid.width)];
                target[..row.len()].copy_from_slice(row);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::RawFormat;
    use std::ops::Range;

    const HEIGHT: usize = 7;
    const WIDTH: usize = 70;

    /// Every pixel of every image counts differently.
    struct Numbered;

    fn count(image: usize, y: usize, x: usize) -> u16 {
        (image * HEIGHT * WIDTH + y * WIDTH + x) as u16
    }

    impl RawImages for Numbered {
        fn format(&self) -> RawFormat {
            RawFormat { images: 40, height: HEIGHT, width: WIDTH, bits: 16, rate_hz: None }
        }

        fn read(&self, images: Range<usize>, rows: Range<usize>, out: &mut [u16]) -> Result<()> {
            let pixels = images.flat_map(|image| {
                let rows = rows.clone();
                rows.flat_map(move |y| (0..WIDTH).map(move |x| count(image, y, x)))
            });
            out.iter_mut().zip(pixels).for_each(|(out, count)| *out = count);
            Ok(())
        }
    }

    #[test]
    fn strips_hold_every_pixel_of_every_image() {
        let grid = Grid::new(HEIGHT, WIDTH);
        let light = Illumination::default();
        let mut counts = StripCounts::new(13, grid).unwrap();
        let firsts = counts.load_sweep(&Numbered, 5, &light, |image| Ok(image[0])).unwrap();
        assert_eq!(firsts, (5..18).map(|image| count(image, 0, 0)).collect::<Vec<_>>());
        for (b, band) in grid.bands().enumerate() {
            for s in 0..2 {
                let pieces: Vec<&Piece> = counts.strip(b, s).collect();
                assert_eq!(pieces.len(), 13);
                for (m, piece) in pieces.iter().enumerate() {
                    for (row, y) in band.clone().enumerate() {
                        for x in 64 * s..(64 * s + 64).min(WIDTH) {
                            assert_eq!(piece[row * STRIP + x - 64 * s], count(5 + m, y, x));
                        }
                    }
                }
            }
        }
    }
}
