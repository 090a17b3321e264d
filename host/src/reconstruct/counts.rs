//! Raw images in memory, from any places of a recording.

use crate::allocate::zeros;
use crate::error::Result;
use crate::io::RawImages;
use rayon::prelude::*;
use std::ops::Range;

/// Images that one task decodes.
const IMAGES_PER_TASK: usize = 8;

/// Counts of K images, (m, y, x).
pub struct SweepCounts {
    /// K.
    pub images: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// The counts.
    pub counts: Vec<u16>,
}

impl SweepCounts {
    /// Room for a sweep.
    ///
    /// # Errors
    /// When the memory is not there.
    pub fn new(images: usize, height: usize, width: usize) -> Result<Self> {
        let counts = zeros(images * height * width, "the counts of one sweep")?;
        Ok(Self { images, height, width, counts })
    }

    /// Read images that are not neighbours: the m-th is image `place(m)` of the recording.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read(
        &mut self,
        raw: &dyn RawImages,
        place: impl Fn(usize) -> usize + Sync,
    ) -> Result<()> {
        let (pixels, rows) = (self.height * self.width, 0..self.height);
        let tasks = self.counts.par_chunks_mut(IMAGES_PER_TASK * pixels).enumerate();
        tasks.try_for_each(|(task, counts)| {
            let images = counts.len() / pixels;
            let first = task * IMAGES_PER_TASK;
            for Range { start, end } in runs(images, |m| place(first + m)) {
                let from = place(first + start);
                let target = &mut counts[start * pixels..end * pixels];
                raw.read(from..from + (end - start), rows.clone(), target)?;
            }
            Ok(())
        })
    }
}

/// Runs of consecutive images, read in one go.
fn runs(images: usize, place: impl Fn(usize) -> usize) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for m in 0..images {
        match runs.last_mut() {
            Some(run) if place(m) == place(run.start) + (m - run.start) => run.end = m + 1,
            _ => runs.push(m..m + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_read_in_one_go() {
        assert_eq!(runs(4, |m| 10 + m).as_slice(), std::slice::from_ref(&(0..4)));
        assert_eq!(runs(4, |m| 10 * m), [0..1, 1..2, 2..3, 3..4]);
        assert_eq!(runs(5, |m| if m < 2 { m } else { m + 7 }), [0..2, 2..5]);
    }
}
