//! Transforms of 16 points, of pixels that lie side by side in the lanes.
//!
//! ```text
//! Y(r, k) = sum over p of x(R p + r) exp(-2 pi i p k/16),   K = 16 R, m = R p + r
//! ```
//! of the samples x with all their phases: what `zoom` and `whole` have in common. Nothing needs to be
//! reordered.

use super::dispersion::band_coordinate;
use super::grid::{BLOCK, STRIP};
use crate::lanes::Lanes;
use num_complex::Complex32;
use std::f64::consts::{PI, TAU};

/// Pixels that are transformed together.
pub const GROUP: usize = 16;
/// Points of a transform.
pub const POINTS: usize = 16;

/// Background-free samples of one image in a row of a strip.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Line(pub [f32; STRIP]);

/// A complex number for each pixel of a group.
#[derive(Clone, Copy, Default)]
#[repr(align(64))]
pub struct Group {
    /// Real parts.
    pub re: [f32; GROUP],
    /// Imaginary parts.
    pub im: [f32; GROUP],
}

impl Group {
    /// The p-th pixel's.
    pub fn pixel(&self, p: usize) -> Complex32 {
        Complex32::new(self.re[p], self.im[p])
    }
}

/// exp(-2 pi i n/period).
pub fn unit(n: usize, period: usize) -> Complex32 {
    let phase = -TAU * (n % period) as f64 / period as f64;
    Complex32::new(phase.cos() as f32, phase.sin() as f32)
}

/// Samples of a group of pixels and their phases.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Window times dispersion correction, K values.
    pub table: &'a [Complex32],
    /// (m, row) of a strip.
    pub lines: &'a [Line],
    /// Row in the strip.
    pub row: usize,
    /// First pixel in the row.
    pub first: usize,
    /// Axial shift of each pixel, in depth pixels.
    pub shifts: Option<&'a [f32; GROUP]>,
}

impl Samples<'_> {
    /// The counts of all pixels in image m, less their background.
    #[inline(always)]
    pub fn at(&self, m: usize) -> &[f32] {
        &self.lines[m * BLOCK + self.row].0[self.first..]
    }
}

/// Gives Y(r, k), r after r, of the pixels from `part` on, as many as there are lanes.
///
/// All is `#[inline(always)]` and without closures, so that it is compiled for the lanes' instructions.
pub struct Rounds<'a, L> {
    samples: Samples<'a>,
    part: usize,
    /// exp(-i pi s q(r)) for the axial shift s of each pixel.
    start: Pair<L>,
    /// From image to image.
    step: Pair<L>,
    /// Over R images.
    leap: Pair<L>,
}

impl<'a, L: Lanes<Element = f32>> Rounds<'a, L> {
    /// Before the first.
    #[inline(always)]
    pub fn new(samples: Samples<'a>, part: usize) -> Self {
        let images = samples.table.len();
        let shifts = samples.shifts.unwrap_or(&[0.0; GROUP]);
        let (shifts, step) = (&shifts[part..part + L::WIDTH], -TAU / images as f64);
        Self {
            samples,
            part,
            start: Pair::unit(shifts, -PI * band_coordinate(0, images)),
            step: Pair::unit(shifts, step),
            leap: Pair::unit(shifts, step * (images / POINTS) as f64),
        }
    }

    /// Y(r, 0..16); r from 0 to K/16 in order.
    #[inline(always)]
    pub fn next(&mut self, r: usize) -> [Pair<L>; POINTS] {
        let Samples { table, shifts, .. } = self.samples;
        let (rows, mut points) = (table.len() / POINTS, [Pair::zero(); POINTS]);
        if shifts.is_some() {
            let mut turn = self.start;
            for (p, point) in points.iter_mut().enumerate() {
                let m = rows * p + r;
                *point = turn.times(table[m]).scaled(load(&self.samples.at(m)[self.part..]));
                turn = turn.by(self.leap);
            }
            self.start = self.start.by(self.step);
        } else {
            for (p, point) in points.iter_mut().enumerate() {
                let m = rows * p + r;
                *point = Pair::all(table[m]).scaled(load(&self.samples.at(m)[self.part..]));
            }
        }
        sixteen(&points)
    }
}

#[inline(always)]
fn load<L: Lanes<Element = f32>>(numbers: &[f32]) -> L {
    let mut vector = [L::zero()];
    L::flat_mut(&mut vector).copy_from_slice(&numbers[..L::WIDTH]);
    vector[0]
}

/// A complex number in every lane.
#[derive(Clone, Copy)]
pub struct Pair<L> {
    re: L,
    im: L,
}

impl<L: Lanes<Element = f32>> Pair<L> {
    /// 0.
    #[inline(always)]
    pub fn zero() -> Self {
        Self { re: L::zero(), im: L::zero() }
    }

    /// exp(i phase s) for the shift s of each lane.
    #[inline(always)]
    fn unit(shifts: &[f32], phase: f64) -> Self {
        let (mut re, mut im) = ([L::zero()], [L::zero()]);
        let lanes = L::flat_mut(&mut re).iter_mut().zip(L::flat_mut(&mut im));
        for ((re, im), &shift) in lanes.zip(shifts) {
            let (sin, cos) = (phase * f64::from(shift)).sin_cos();
            (*re, *im) = (cos as f32, sin as f32);
        }
        Self { re: re[0], im: im[0] }
    }

    /// The same number in every lane.
    #[inline(always)]
    fn all(number: Complex32) -> Self {
        Self { re: L::from_f64(f64::from(number.re)), im: L::from_f64(f64::from(number.im)) }
    }

    /// The pixels of a group from `part` on.
    #[inline(always)]
    pub fn load(group: &Group, part: usize) -> Self {
        Self { re: load(&group.re[part..]), im: load(&group.im[part..]) }
    }

    /// Put them back.
    #[inline(always)]
    pub fn store(self, group: &mut Group, part: usize) {
        group.re[part..part + L::WIDTH].copy_from_slice(L::flat(&[self.re]));
        group.im[part..part + L::WIDTH].copy_from_slice(L::flat(&[self.im]));
    }

    /// The sum.
    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }

    /// Times -i.
    #[inline(always)]
    fn turned_back(self) -> Self {
        Self { re: self.im, im: -self.re }
    }

    #[inline(always)]
    fn scaled(self, factor: L) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }

    #[inline(always)]
    fn by(self, other: Self) -> Self {
        Self {
            re: self.re.mul_add(other.re, -(self.im * other.im)),
            im: self.re.mul_add(other.im, self.im * other.re),
        }
    }

    /// Times the same number in every lane.
    #[inline(always)]
    pub fn times(self, factor: Complex32) -> Self {
        self.by(Self::all(factor))
    }
}

/// Four-point transform.
#[inline(always)]
fn four<L: Lanes<Element = f32>>([a, b, c, d]: [Pair<L>; 4]) -> [Pair<L>; 4] {
    let (sum, difference) = (a.plus(c), a.minus(c));
    let (others, turned) = (b.plus(d), b.minus(d).turned_back());
    [sum.plus(others), difference.plus(turned), sum.minus(others), difference.minus(turned)]
}

/// cos and sin of pi/8.
const COS: f32 = 0.923_879_5;
const SIN: f32 = 0.382_683_43;
/// cos of pi/4.
const HALF: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// exp(-2 pi i b c/16) for b, c = 1..4.
const INNER: [[Complex32; 3]; 3] = [
    [Complex32::new(COS, -SIN), Complex32::new(HALF, -HALF), Complex32::new(SIN, -COS)],
    [Complex32::new(HALF, -HALF), Complex32::new(0.0, -1.0), Complex32::new(-HALF, -HALF)],
    [Complex32::new(SIN, -COS), Complex32::new(-HALF, -HALF), Complex32::new(-COS, SIN)],
];

/// Sixteen-point transform: p = 4 a + b to k = c + 4 d.
#[inline(always)]
pub fn sixteen<L: Lanes<Element = f32>>(x: &[Pair<L>; POINTS]) -> [Pair<L>; POINTS] {
    let mut columns = [[Pair::zero(); 4]; 4];
    for b in 0..4 {
        columns[b] = four([x[b], x[4 + b], x[8 + b], x[12 + b]]);
    }
    for b in 1..4 {
        for c in 1..4 {
            columns[b][c] = columns[b][c].times(INNER[b - 1][c - 1]);
        }
    }
    let mut out = [Pair::zero(); POINTS];
    for c in 0..4 {
        let column = four([columns[0][c], columns[1][c], columns[2][c], columns[3][c]]);
        for d in 0..4 {
            out[c + 4 * d] = column[d];
        }
    }
    out
}
