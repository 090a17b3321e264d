//! Some A-lines of some sweeps, free of background: what the dispersion is estimated from.
//!
//! They are taken before the sweeps are read whole, so S(m) is fitted row by row, and fixed fringes
//! (laterally smooth) are removed by a lateral high-pass along the row.

use super::illumination::Illumination;
use super::sweeps::Sweep;
use crate::error::Result;
use crate::io::RawImages;
use crate::progress;
use rayon::prelude::*;

/// Sweeps that lines are taken from.
const SWEEPS: usize = 6;
/// Rows of each.
const ROWS: usize = 8;
/// Lines of each row, at most.
const LINES: usize = 24;
/// The lateral high-pass: pixels to either side that are averaged.
const REACH: usize = 10;

/// Where a line was taken: sweep, y, x.
pub type Place = (usize, usize, usize);

/// Spectra with their places.
pub struct Lines {
    /// (line, m), K samples each.
    pub spectra: Vec<f32>,
    /// Of each line.
    pub places: Vec<Place>,
}

/// Lines of up to six of the sweeps (numbers into `all`), evenly spread.
///
/// # Errors
/// When the recording cannot be read or the user interrupts.
pub fn read(
    raw: &dyn RawImages,
    all: &[Sweep],
    good: &[usize],
    images: usize,
    illumination: &Illumination,
) -> Result<Lines> {
    let format = raw.format();
    let (height, width) = (format.height, format.width);
    let chosen = spread(good.len(), SWEEPS).map(|i| good[i]);
    let rows: Vec<usize> = spread(height, ROWS).collect();
    let jobs: Vec<(usize, usize)> =
        chosen.flat_map(|sweep| rows.iter().map(move |&y| (sweep, y))).collect();
    let columns: Vec<usize> = spread(width, LINES).collect();
    let parts: Vec<Lines> = jobs
        .par_iter()
        .map(|&(sweep, y)| {
            progress::check()?;
            let first = all[sweep].first_image;
            let mut counts = vec![0; images * width];
            raw.read(first..first + images, y..y + 1, &mut counts)?;
            let pixels = y * width..(y + 1) * width;
            let dead = &illumination.dead[pixels.clone()];
            let rest = free_of_background(&counts, &illumination.pixels[pixels], dead, images);
            let live = |&&x: &&usize| !dead[x];
            let columns: Vec<usize> = columns.iter().filter(live).copied().collect();
            let spectrum = |&x: &usize| (0..images).map(move |m| m * width + x);
            Ok(Lines {
                spectra: columns.iter().flat_map(|x| spectrum(x).map(|i| rest[i])).collect(),
                places: columns.iter().map(|&x| (sweep, y, x)).collect(),
            })
        })
        .collect::<Result<_>>()?;
    let mut all = Lines { spectra: Vec::new(), places: Vec::new() };
    for part in parts {
        all.spectra.extend(part.spectra);
        all.places.extend(part.places);
    }
    Ok(all)
}

/// At most `count` of `0..length`, evenly spread, ends left out.
pub fn spread(length: usize, count: usize) -> impl Iterator<Item = usize> + Clone {
    let count = count.min(length);
    (0..count).map(move |i| (2 * i + 1) * length / (2 * count))
}

/// (m, x) of one row: source term and laterally smooth fringes removed. A dead pixel has the
/// illumination of its neighbours and tells nothing: it is left out of both.
fn free_of_background(counts: &[u16], light: &[f32], dead: &[bool], images: usize) -> Vec<f32> {
    let width = light.len();
    let live: Vec<f32> = dead.iter().map(|&dead| if dead { 0.0 } else { 1.0 }).collect();
    let power: f32 = light.iter().zip(&live).map(|(v, live)| live * v * v).sum();
    let around = |x: usize| x.saturating_sub(REACH)..(x + REACH + 1).min(width);
    let mean = |values: &[f32], x: usize| values[around(x)].iter().sum::<f32>();
    let neighbours: Vec<f32> = (0..width).map(|x| mean(&live, x).max(1.0)).collect();
    let mut rest = Vec::with_capacity(images * width);
    for line in counts.chunks_exact(width) {
        let lit = line.iter().zip(light).zip(&live);
        let source = lit.map(|((&c, v), live)| live * f32::from(c) * v).sum::<f32>() / power;
        let lit = line.iter().zip(light).zip(&live);
        let flat: Vec<f32> =
            lit.map(|((&c, v), live)| live * (f32::from(c) - source * v)).collect();
        rest.extend((0..width).map(|x| flat[x] - mean(&flat, x) / neighbours[x]));
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_spread() {
        assert_eq!(spread(100, 4).collect::<Vec<_>>(), [12, 37, 62, 87]);
        assert_eq!(spread(3, 8).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(spread(0, 8).count(), 0);
    }

    #[test]
    fn source_and_smooth_fringes_go_and_speckle_stays() {
        let (images, width) = (16, 64);
        let light: Vec<f32> = (0..width).map(|x| 1.0 + 0.002 * x as f32).collect();
        let speckle = |x: usize| if x.is_multiple_of(2) { 40.0 } else { -40.0 };
        let counts: Vec<u16> = (0..images * width)
            .map(|i| {
                let (m, x) = (i / width, i % width);
                if x == 20 {
                    return 4095;
                }
                let fringe = 30.0 * (m as f32 + 0.002 * x as f32).cos();
                (light[x] * (1500.0 + 20.0 * m as f32) + fringe + speckle(x)).round() as u16
            })
            .collect();
        let dead: Vec<bool> = (0..width).map(|x| x == 20).collect();
        let rest = free_of_background(&counts, &light, &dead, images);
        let inner = |i: &usize| (12..52).contains(&(i % width)) && i % width != 20;
        for (i, value) in rest.iter().enumerate().filter(|(i, _)| inner(i)) {
            let error = value - speckle(i % width);
            // The mean of 21 columns keeps 1/21 of the speckle, the source fit as much; counts are whole.
            assert!(error.abs() < 5.0, "{i}: {error}");
        }
    }
}
