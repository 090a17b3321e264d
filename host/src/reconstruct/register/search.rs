//! Shifts of any size, by one correlation over a block: candidates for the fit.

use super::feature::Feature;
use super::motion::Motion;
use super::whiten::transpose;
use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::f32::consts::PI;
use std::sync::Arc;

/// Largest searched part of a block (y, x).
const PART: [usize; 2] = [96, 144];
/// Share of an axis over which the part fades at either end.
const FADE: f32 = 0.15;
/// Candidates that are tried.
const CANDIDATES: usize = 3;
/// Candidates closer than this are one, px.
const APART: i64 = 4;
/// Depths that are turned back together, a cache line of them.
const TOGETHER: usize = 8;

/// Transforms of the searched part.
pub struct Search {
    depths: usize,
    block: [usize; 2],
    part: [usize; 2],
    forward: [Arc<dyn Fft<f32>>; 3],
    inverse: [Arc<dyn Fft<f32>>; 3],
}

/// A height of the correlation and its whole-pixel lag.
type Height = (f32, [i64; 3]);

impl Search {
    pub fn new(depths: usize, block: [usize; 2]) -> Self {
        let part = [block[0].min(PART[0]), block[1].min(PART[1])];
        let mut planner = FftPlanner::new();
        let sizes = [depths, part[0], part[1]];
        let forward = sizes.map(|n| planner.plan_fft_forward(n));
        let inverse = sizes.map(|n| planner.plan_fft_inverse(n));
        Self { depths, block, part, forward, inverse }
    }

    /// The highest peaks as motions without rotation.
    pub fn candidates(&self, earlier: &Feature, later: &Feature) -> Vec<Motion> {
        let block = liveliest(&earlier.blocks);
        let planes = self.planes(&earlier.blocks[block], &later.blocks[block]);
        let cross = self.cross(&self.spectra(&planes));
        let deeper = later.first as i64 - earlier.first as i64;
        let mut best: Vec<Height> = Vec::new();
        for height in self.heights(&cross) {
            let apart = |a: [i64; 3], b: [i64; 3]| (0..3).any(|i| (a[i] - b[i]).abs() >= APART);
            if best.len() < CANDIDATES && best.iter().all(|b| apart(b.1, height.1)) {
                best.push(height);
            }
        }
        best.into_iter()
            .map(|(_, [dz, dy, dx])| Motion {
                shift: [(dz + deeper) as f64, dy as f64, dx as f64],
                rotation_rad: 0.0,
            })
            .collect()
    }

    /// Lateral spectra (z, kx, ky) of the faded parts, the earlier as real, the later as imaginary
    /// part.
    fn planes(&self, earlier: &[i16], later: &[i16]) -> Vec<Complex32> {
        let [rows, columns] = self.part;
        let corner = [(self.block[0] - rows) / 2, (self.block[1] - columns) / 2];
        let fades = [self.depths, rows, columns].map(fade);
        let mut planes = vec![Complex32::ZERO; self.depths * rows * columns];
        planes.par_chunks_mut(rows * columns).enumerate().for_each_init(
            || (vec![Complex32::ZERO; rows * columns], self.scratch()),
            |(plane, scratch), (z, turned)| {
                for (y, row) in plane.chunks_mut(columns).enumerate() {
                    let at = (z * self.block[0] + corner[0] + y) * self.block[1] + corner[1];
                    let pairs = earlier[at..].iter().zip(&later[at..]);
                    for ((value, (&a, &b)), fade) in row.iter_mut().zip(pairs).zip(&fades[2]) {
                        let fade = fade * fades[1][y] * fades[0][z];
                        *value = Complex32::new(f32::from(a), f32::from(b)) * fade;
                    }
                }
                self.forward[2].process_with_scratch(plane, scratch);
                transpose(plane, turned, columns);
                self.forward[1].process_with_scratch(turned, scratch);
            },
        );
        planes
    }

    fn scratch(&self) -> Vec<Complex32> {
        let plans = self.forward.iter().chain(&self.inverse);
        vec![Complex32::ZERO; plans.map(|p| p.get_inplace_scratch_len()).max().unwrap_or(0)]
    }

    /// (z, kx, ky) to spectra (kx, ky, kz).
    fn spectra(&self, planes: &[Complex32]) -> Vec<Complex32> {
        let [rows, columns] = self.part;
        let mut spectra = vec![Complex32::ZERO; planes.len()];
        spectra.par_chunks_mut(rows * self.depths).enumerate().for_each_init(
            || self.scratch(),
            |scratch, (kx, lines)| {
                for (z, plane) in planes.chunks(rows * columns).enumerate() {
                    let values = &plane[kx * rows..][..rows];
                    lines
                        .iter_mut()
                        .skip(z)
                        .step_by(self.depths)
                        .zip(values)
                        .for_each(|(to, v)| *to = *v);
                }
                self.forward[0].process_with_scratch(lines, scratch);
            },
        );
        spectra
    }

    /// Cross-spectrum of the earlier and the later part, turned back along depth: (kx, ky, z).
    fn cross(&self, spectra: &[Complex32]) -> Vec<Complex32> {
        let [rows, columns] = self.part;
        let depths = self.depths;
        let mut cross = vec![Complex32::ZERO; spectra.len()];
        cross.par_chunks_mut(rows * depths).enumerate().for_each_init(
            || self.scratch(),
            |scratch, (kx, lines)| {
                for (ky, line) in lines.chunks_mut(depths).enumerate() {
                    let mirrored = (columns - kx) % columns * rows + (rows - ky) % rows;
                    let there = &spectra[mirrored * depths..][..depths];
                    let here = &spectra[(kx * rows + ky) * depths..][..depths];
                    for (kz, value) in line.iter_mut().enumerate() {
                        let conjugate = there[(depths - kz) % depths].conj();
                        let a = here[kz] + conjugate;
                        let b = (here[kz] - conjugate) * -Complex32::I;
                        *value = a.conj() * b;
                    }
                }
                self.inverse[0].process_with_scratch(lines, scratch);
            },
        );
        cross
    }

    /// The highest points of every depth lag, highest first.
    fn heights(&self, cross: &[Complex32]) -> Vec<Height> {
        let mut heights: Vec<Height> = (0..self.depths.div_ceil(TOGETHER))
            .into_par_iter()
            .flat_map_iter(|group| self.heights_of(cross, group * TOGETHER))
            .collect();
        heights.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        heights
    }

    /// The highest points of the depth lags `start` … `start` + [`TOGETHER`].
    fn heights_of(&self, cross: &[Complex32], start: usize) -> Vec<Height> {
        let [rows, columns] = self.part;
        let size = rows * columns;
        let count = TOGETHER.min(self.depths - start);
        let mut turned = vec![Complex32::ZERO; size * count];
        for (i, line) in cross.chunks(self.depths).enumerate() {
            line[start..start + count]
                .iter()
                .enumerate()
                .for_each(|(z, v)| turned[z * size + i] = *v);
        }
        let mut scratch = self.scratch();
        self.inverse[1].process_with_scratch(&mut turned, &mut scratch);
        let mut plane = vec![Complex32::ZERO; size];
        let mut heights = Vec::new();
        for (z, turned) in turned.chunks(size).enumerate() {
            transpose(turned, &mut plane, rows);
            self.inverse[2].process_with_scratch(&mut plane, &mut scratch);
            let lag = |i: usize| {
                [
                    signed(start + z, self.depths),
                    signed(i / columns, rows),
                    signed(i % columns, columns),
                ]
            };
            heights.extend(highest(&plane).into_iter().map(|i| (plane[i].re, lag(i))));
        }
        heights
    }
}

/// Indices of the highest points of a plane, neighbours of a peak among them.
fn highest(plane: &[Complex32]) -> Vec<usize> {
    const KEPT: usize = 8;
    let mut best: Vec<usize> = Vec::with_capacity(KEPT + 1);
    for (i, value) in plane.iter().enumerate() {
        if best.len() < KEPT || value.re > plane[best[KEPT - 1]].re {
            let at = best.partition_point(|&b| plane[b].re >= value.re);
            best.insert(at, i);
            best.truncate(KEPT);
        }
    }
    best
}

/// The lag at index `i` of `n`: the upper half is negative.
fn signed(i: usize, n: usize) -> i64 {
    if 2 * i < n { i as i64 } else { i as i64 - n as i64 }
}

/// 1 with cosine flanks.
fn fade(n: usize) -> Vec<f32> {
    let flank = (FADE * n as f32).max(1.0);
    let edge = |i: usize| (i.min(n - 1 - i) as f32 + 0.5) / flank;
    (0..n).map(|i| if edge(i) < 1.0 { 0.5 - 0.5 * (PI * edge(i)).cos() } else { 1.0 }).collect()
}

/// The block with the largest mean square.
fn liveliest(blocks: &[Vec<i16>]) -> usize {
    const STEP: usize = 7;
    let power = |block: &Vec<i16>| -> i64 {
        block.iter().step_by(STEP).map(|&v| i64::from(v) * i64::from(v)).sum()
    };
    (0..blocks.len()).max_by_key(|&b| power(&blocks[b])).unwrap_or(0)
}
