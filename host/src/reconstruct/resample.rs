//! Lateral motion undone (paper lines 707-709): each depth plane of a sweep is read at the places where the tissue of sweep 0
//! lies in it.
//!
//! A shift and a rotation are three shears, so that only lines are resampled: along x, along y, along x
//! (without rotation the last is not needed). Lines are read by a windowed sinc; the field is band-limited by the
//! aperture, so twelve taps leave less than 1e-3 below 0.35 cycles per pixel, and unlike a Fourier
//! ramp the kernel carries nothing round the edges. The bulk phase of a sweep is untouched: it is the
//! same in both layers.

use super::register::Motion;
use num_complex::Complex32;
use rayon::prelude::*;

/// Taps of the windowed sinc.
const TAPS: usize = 12;
/// Taps before the place that is read.
const BEFORE: isize = TAPS as isize / 2 - 1;
/// Kaiser window: side lobes against the width of the passband.
const KAISER_BETA: f64 = 7.0;

/// Undo the lateral part of `motion` in planes (z, y, x). What the camera did not see becomes zero,
/// so that it counts in no average.
pub fn undo_lateral(planes: &mut [Complex32], height: usize, width: usize, motion: &Motion) {
    let [_, dy, dx] = motion.shift;
    let (alpha, beta) = (-(motion.rotation_rad / 2.0).tan(), motion.rotation_rad.sin());
    let [cy, cx] = centre([height, width]);
    let kernels = |length: usize, offset: &dyn Fn(f64) -> f64| -> Vec<Kernel> {
        (0..length).map(|i| Kernel::new(offset(i as f64))).collect()
    };
    let first = kernels(height, &|y| dx + alpha * (y - cy) - alpha * dy);
    let second = kernels(width, &|x| dy + beta * (x - cx));
    let third = kernels(height, &|y| alpha * (y - cy));
    let seen = seen(height, width, motion);
    planes.par_chunks_exact_mut(height * width).for_each(|plane| {
        let mut line = vec![Complex32::default(); width + 2 * TAPS];
        shear_rows(plane, width, &first, &mut line);
        shear_columns(plane, height, width, &second);
        if motion.rotation_rad != 0.0 {
            shear_rows(plane, width, &third, &mut line);
        }
        for (value, _) in plane.iter_mut().zip(&seen).filter(|(_, seen)| !**seen) {
            *value = Complex32::default();
        }
    });
}

/// Where the pixel (y, x) of sweep 0 lies in a sweep that has moved.
#[must_use]
pub fn place(motion: &Motion, size: [usize; 2], pixel: [f64; 2]) -> [f64; 2] {
    let [cy, cx] = centre(size);
    let [y, x] = motion.carry([pixel[0] - cy, pixel[1] - cx]);
    [cy + y, cx + x]
}

/// Which pixel of sweep 0 the pixel (y, x) of a sweep that has moved shows.
#[must_use]
pub fn origin(motion: &Motion, size: [usize; 2], pixel: [f64; 2]) -> [f64; 2] {
    place(&motion.inverse(), size, pixel)
}

fn centre(size: [usize; 2]) -> [f64; 2] {
    size.map(|length| (length as f64 - 1.0) / 2.0)
}

/// Pixels of sweep 0 that lie in the image of the moved sweep.
fn seen(height: usize, width: usize, motion: &Motion) -> Vec<bool> {
    let inside = |value: f64, length: usize| value >= 0.0 && value <= (length - 1) as f64;
    let pixels = places(motion, [height, width]);
    pixels.map(|[y, x]| inside(y, height) && inside(x, width)).collect()
}

/// [`place`] of all pixels (y, x) in order: along a row it moves on by the same step.
pub fn places(motion: &Motion, size: [usize; 2]) -> impl Iterator<Item = [f64; 2]> {
    let row = move |y: usize| {
        let at = |x: f64| place(motion, size, [y as f64, x]);
        let (start, next) = (at(0.0), at(1.0));
        let step = [next[0] - start[0], next[1] - start[1]];
        (0..size[1]).map(move |x| [0, 1].map(|i| start[i] + x as f64 * step[i]))
    };
    (0..size[0]).flat_map(row)
}

/// Read every row at x + the offset of its kernel.
fn shear_rows(plane: &mut [Complex32], width: usize, kernels: &[Kernel], line: &mut [Complex32]) {
    for (row, Kernel { whole, taps }) in plane.chunks_exact_mut(width).zip(kernels) {
        for (i, value) in line.iter_mut().enumerate() {
            let source = i as isize - BEFORE + *whole;
            let inside = usize::try_from(source).ok().and_then(|source| row.get(source));
            *value = inside.copied().unwrap_or_default();
        }
        for (value, window) in row.iter_mut().zip(line.windows(TAPS)) {
            *value = window.iter().zip(taps).map(|(u, &tap)| *u * tap).sum();
        }
    }
}

/// Read every column at y + the offset of its kernel.
fn shear_columns(plane: &mut [Complex32], height: usize, width: usize, kernels: &[Kernel]) {
    let source = plane.to_vec();
    plane.fill(Complex32::default());
    for (y, row) in plane.chunks_exact_mut(width).enumerate() {
        let mut from = 0;
        for run in kernels.chunk_by(|a, b| a.whole == b.whole) {
            let columns = from..from + run.len();
            from = columns.end;
            for tap in 0..TAPS {
                let line = y as isize - BEFORE + run[0].whole + tap as isize;
                let Some(line) = usize::try_from(line).ok().filter(|&line| line < height) else {
                    continue;
                };
                let source = &source[line * width..][columns.clone()];
                for ((value, u), kernel) in row[columns.clone()].iter_mut().zip(source).zip(run) {
                    *value += *u * kernel.taps[tap];
                }
            }
        }
    }
}

/// A shift by whole pixels and the taps for the rest.
struct Kernel {
    whole: isize,
    taps: [f32; TAPS],
}

impl Kernel {
    fn new(offset: f64) -> Self {
        let whole = offset.floor();
        let share = offset - whole;
        let mut taps = [0.0; TAPS];
        for (i, tap) in taps.iter_mut().enumerate() {
            let t = i as f64 - BEFORE as f64 - share;
            let window = kaiser(t / (TAPS as f64 / 2.0));
            *tap = sinc(t) * window;
        }
        let sum: f64 = taps.iter().sum();
        Self { whole: whole as isize, taps: taps.map(|tap: f64| (tap / sum) as f32) }
    }
}

fn sinc(t: f64) -> f64 {
    let x = std::f64::consts::PI * t;
    if x.abs() < 1e-9 { 1.0 } else { x.sin() / x }
}

/// Kaiser window at -1..1.
fn kaiser(t: f64) -> f64 {
    bessel_i0(KAISER_BETA * (1.0 - t * t).max(0.0).sqrt()) / bessel_i0(KAISER_BETA)
}

/// Modified Bessel function of order 0, by its power series (all terms positive).
fn bessel_i0(x: f64) -> f64 {
    let quarter = x * x / 4.0;
    let (mut sum, mut term) = (1.0, 1.0);
    for k in 1..60 {
        term *= quarter / f64::from(k * k);
        sum += term;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Plane waves below the aperture's cut-off.
    fn field(y: f64, x: f64) -> Complex32 {
        let waves = [(0.11, 0.23, 0.3), (-0.24, 0.05, 1.1), (0.2, -0.15, 2.0), (0.0, 0.0, 0.7)];
        let sum = waves.iter().map(|&(fy, fx, phase)| {
            let turn = TAU * (fy * y + fx * x) + phase;
            num_complex::Complex64::from_polar(1.0, turn)
        });
        let sum: num_complex::Complex64 = sum.sum();
        Complex32::new(sum.re as f32, sum.im as f32)
    }

    fn check(motion: Motion, largest: f32) {
        let (height, width) = (48, 60);
        // The moved sweep shows at (y,x) what sweep 0 has at origin(y,x).
        let mut planes: Vec<Complex32> = (0..height * width)
            .map(|i| {
                let [y, x] =
                    origin(&motion, [height, width], [(i / width) as f64, (i % width) as f64]);
                field(y, x)
            })
            .collect();
        undo_lateral(&mut planes, height, width, &motion);
        for (i, value) in planes.iter().enumerate() {
            let (y, x) = (i / width, i % width);
            let [py, px] = place(&motion, [height, width], [y as f64, x as f64]);
            let room = 8.0;
            let inside = py >= room
                && px >= room
                && py <= height as f64 - 1.0 - room
                && px <= width as f64 - 1.0 - room;
            if inside {
                let error = (value - field(y as f64, x as f64)).norm();
                assert!(error < largest, "{motion:?} at {y} {x}: {error}");
            }
            if py < 0.0 || px < 0.0 || py > 47.0 || px > 59.0 {
                assert_eq!(*value, Complex32::default());
            }
        }
    }

    #[test]
    fn shifts_are_undone() {
        for (dy, dx) in [(0.0, 0.0), (0.4, -0.3), (3.25, -7.5), (-11.9, 5.01)] {
            check(Motion { shift: [1.0, dy, dx], rotation_rad: 0.0 }, 2e-3);
        }
    }

    #[test]
    fn rotations_are_undone() {
        for rotation_rad in [0.005, -0.02] {
            check(Motion { shift: [0.0, 2.3, -4.6], rotation_rad }, 6e-3);
        }
    }

    #[test]
    fn there_and_back() {
        let motion = Motion { shift: [0.0, 5.5, -2.5], rotation_rad: 0.013 };
        let there = place(&motion, [40, 50], [7.0, 31.0]);
        let back = origin(&motion, [40, 50], there);
        assert!((back[0] - 7.0).abs() < 1e-9 && (back[1] - 31.0).abs() < 1e-9);
    }
}
