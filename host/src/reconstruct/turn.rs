//! Window, dispersion and axial shift on pixels, as one spectral phase.
//!
//! Samples come image by image and leave pixel by pixel, as the FFT wants them: for numbers of images
//! that `zoom` and `whole` do not serve.

use super::dispersion::band_coordinate;
use super::pairs::{GROUP, Samples};
use crate::lanes::{LaneTask, Lanes};
use num_complex::Complex32;
use std::f64::consts::{PI, TAU};

/// Between the spectra of two pixels: at a distance of 4 KB they would share a set of the cache.
pub const PADDING: usize = 8;

/// Window, dispersion and axial shift on a group of pixels, and pixels first.
pub struct TurnTask<'a> {
    /// Their samples.
    pub samples: Samples<'a>,
    /// (pixel, m), each with its padding.
    pub spectra: &'a mut [Complex32],
}

impl LaneTask for TurnTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Self { samples, spectra } = self;
        match samples.shifts {
            Some(shifts) => turn_with_shifts(samples, shifts, spectra),
            None => turn(samples, spectra),
        }
    }
}

#[inline(always)]
fn turn(samples: Samples<'_>, spectra: &mut [Complex32]) {
    let mut tile = Tile::new(samples.table.len());
    for (m, factor) in samples.table.iter().enumerate() {
        let Some(group) = samples.at(m).first_chunk::<GROUP>() else { return };
        let (re, im) = tile.next();
        for p in 0..GROUP {
            re[p] = factor.re * group[p];
            im[p] = factor.im * group[p];
        }
        tile.store(m, spectra);
    }
}

/// The ramp exp(-i pi s q(m)) is turned on from image to image: exp(-2 pi i s/K) a step. Over K steps
/// of `f32` it drifts by less than 1e-4.
#[inline(always)]
fn turn_with_shifts(samples: Samples<'_>, shifts: &[f32; GROUP], spectra: &mut [Complex32]) {
    let images = samples.table.len();
    let (mut re, mut im) = ([0.0_f32; GROUP], [0.0_f32; GROUP]);
    let (mut step_re, mut step_im) = ([0.0_f32; GROUP], [0.0_f32; GROUP]);
    for (p, &shift) in shifts.iter().enumerate() {
        let start = -PI * f64::from(shift) * band_coordinate(0, images);
        let step = -TAU * f64::from(shift) / images as f64;
        (re[p], im[p]) = (start.cos() as f32, start.sin() as f32);
        (step_re[p], step_im[p]) = (step.cos() as f32, step.sin() as f32);
    }
    let mut tile = Tile::new(images);
    for (m, factor) in samples.table.iter().enumerate() {
        let Some(group) = samples.at(m).first_chunk::<GROUP>() else { return };
        let (out_re, out_im) = tile.next();
        for p in 0..GROUP {
            out_re[p] = (factor.re * re[p] - factor.im * im[p]) * group[p];
            out_im[p] = (factor.re * im[p] + factor.im * re[p]) * group[p];
            let next = re[p] * step_re[p] - im[p] * step_im[p];
            im[p] = re[p] * step_im[p] + im[p] * step_re[p];
            re[p] = next;
        }
        tile.store(m, spectra);
    }
}

/// Images that are collected before they are stored pixel by pixel: whole lines of the cache.
const TILE: usize = 8;

/// Some images of a group of pixels on their way from (m, pixel) to (pixel, m).
struct Tile {
    re: [[f32; GROUP]; TILE],
    im: [[f32; GROUP]; TILE],
    filled: usize,
    images: usize,
}

impl Tile {
    #[inline(always)]
    fn new(images: usize) -> Self {
        Self { re: [[0.0; GROUP]; TILE], im: [[0.0; GROUP]; TILE], filled: 0, images }
    }

    /// Real and imaginary parts of the next image.
    #[inline(always)]
    fn next(&mut self) -> (&mut [f32; GROUP], &mut [f32; GROUP]) {
        let at = self.filled % TILE;
        self.filled = at + 1;
        (&mut self.re[at], &mut self.im[at])
    }

    /// After image m: store the tile when it is full, or the last.
    #[inline(always)]
    fn store(&mut self, m: usize, spectra: &mut [Complex32]) {
        if self.filled < TILE && m + 1 < self.images {
            return;
        }
        let first = m + 1 - self.filled;
        let lines = spectra.chunks_exact_mut(self.images + PADDING);
        for (p, line) in lines.enumerate().take(GROUP) {
            match line[first..].first_chunk_mut::<TILE>() {
                Some(whole) if self.filled == TILE => {
                    for (u, (re, im)) in whole.iter_mut().zip(self.re.iter().zip(&self.im)) {
                        *u = Complex32::new(re[p], im[p]);
                    }
                }
                _ => {
                    let part = line[first..][..self.filled].iter_mut().enumerate();
                    part.for_each(|(i, u)| *u = Complex32::new(self.re[i][p], self.im[i][p]));
                }
            }
        }
        self.filled = 0;
    }
}
