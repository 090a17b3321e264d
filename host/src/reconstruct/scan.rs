//! A few rows of every image: enough to see where the sweeps begin.

use super::sweeps::Trace;
use crate::error::Result;
use crate::io::RawImages;
use crate::progress;
use rayon::prelude::*;

/// Rows that are read of every image.
const ROWS: usize = 4;
/// Pixels of a group, at least: some ten speckles.
const GROUP: usize = 32;
/// Most groups of a row.
const GROUPS: usize = 16;
/// Images that one task reads.
const IMAGES: usize = 64;

/// The trace of a recording.
///
/// # Errors
/// When it cannot be read or the user interrupts.
pub fn read(raw: &dyn RawImages) -> Result<Trace> {
    let format = raw.format();
    let rows: Vec<usize> = (0..ROWS).map(|i| (2 * i + 1) * format.height / (2 * ROWS)).collect();
    let channels = ROWS * (format.width / GROUP).clamp(1, GROUPS);
    let starts: Vec<usize> = (0..format.images).step_by(IMAGES).collect();
    let parts: Vec<Trace> = starts
        .par_iter()
        .map(|&start| {
            progress::check()?;
            let images = start..(start + IMAGES).min(format.images);
            part(raw, images, &rows, channels)
        })
        .collect::<Result<_>>()?;
    let mut whole = Trace::new(channels, format.bits)?;
    for part in parts {
        whole.append(part)?;
    }
    Ok(whole)
}

fn part(
    raw: &dyn RawImages,
    images: std::ops::Range<usize>,
    rows: &[usize],
    channels: usize,
) -> Result<Trace> {
    let (format, count) = (raw.format(), images.len());
    let mut lines = vec![vec![0; count * format.width]; rows.len()];
    for (line, &y) in lines.iter_mut().zip(rows) {
        raw.read(images.clone(), y..y + 1, line)?;
    }
    let mut trace = Trace::new(channels, format.bits)?;
    let mut pixels = Vec::with_capacity(rows.len() * format.width);
    for image in 0..count {
        pixels.clear();
        for line in &lines {
            pixels.extend_from_slice(&line[image * format.width..][..format.width]);
        }
        trace.push(&pixels);
    }
    Ok(trace)
}
