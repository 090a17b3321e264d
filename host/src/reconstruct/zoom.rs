//! A few neighbouring depths of a group of pixels: the part of the FFT that they need.
//!
//! With K = 16 R and m = R p + r
//! ```text
//! U(z) = sum over r of exp(-2 pi i r z/K) [sum over p of x(R p + r) exp(-2 pi i p z/16)]
//! ```
//! where the brackets repeat when z grows by 16: up to 16 neighbouring depths take R transforms of
//! 16 points. Pixels lie side by side in the lanes, so that nothing needs to be reordered.

use super::dispersion::band_coordinate;
use super::grid::{BLOCK, STRIP};
use super::turn::GROUP;
use crate::lanes::{LaneTask, Lanes};
use num_complex::Complex32;
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// Most depths, and points of the small transforms.
const POINTS: usize = 16;

/// What is the same for all pixels.
pub struct Zoom<'a> {
    /// Window times dispersion correction.
    table: &'a [Complex32],
    depths: Range<usize>,
    /// exp(-2 pi i r z/K), (r, depth).
    twiddles: Vec<[Complex32; POINTS]>,
}

/// U of a group of pixels at one depth.
#[derive(Clone, Copy, Default)]
pub struct Group {
    /// Real parts.
    pub re: [f32; GROUP],
    /// Imaginary parts.
    pub im: [f32; GROUP],
}

impl Group {
    /// U of its p-th pixel.
    pub fn pixel(&self, p: usize) -> Complex32 {
        Complex32::new(self.re[p], self.im[p])
    }
}

/// U of a group of pixels at each depth.
pub type Zoomed = [Group; POINTS];

impl<'a> Zoom<'a> {
    /// None where the depths are too many, or K is no multiple of 16.
    pub fn new(table: &'a [Complex32], depths: Range<usize>) -> Option<Self> {
        let images = table.len();
        if depths.len() > POINTS || !images.is_multiple_of(POINTS) {
            return None;
        }
        let twiddle = |r: usize, i: usize| {
            let turns = (r * (depths.start + i)) % images;
            let phase = -TAU * turns as f64 / images as f64;
            Complex32::new(phase.cos() as f32, phase.sin() as f32)
        };
        let twiddles = (0..images / POINTS).map(|r| std::array::from_fn(|i| twiddle(r, i)));
        Some(Self { table, twiddles: twiddles.collect(), depths })
    }
}

/// Window, dispersion, axial shift and transform on a group of pixels.
pub struct ZoomTask<'a> {
    /// What is the same for all pixels.
    pub zoom: &'a Zoom<'a>,
    /// From the group's first pixel on, (m, row, x) of a strip.
    pub samples: &'a [f32],
    /// Axial shift of each pixel, in depth pixels.
    pub shifts: &'a [f32; GROUP],
    /// The result.
    pub zoomed: &'a mut Zoomed,
}

impl LaneTask for ZoomTask<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) {
        let Self { zoom: Zoom { table, depths, twiddles }, samples, shifts, zoomed } = self;
        let (images, columns) = (table.len(), twiddles.len());
        for part in (0..GROUP).step_by(L::WIDTH) {
            let own = &shifts[part..part + L::WIDTH];
            let ramp = |phase: &dyn Fn(f64) -> f64| Pair::<L>::unit(own, phase);
            let per_image = |s: f64| -TAU * s / images as f64;
            let mut start = ramp(&|s| -PI * s * band_coordinate(0, images));
            let (step, leap) = (ramp(&per_image), ramp(&|s| columns as f64 * per_image(s)));
            let mut sums = [Pair::<L>::zero(); POINTS];
            for (r, twiddles) in twiddles.iter().enumerate() {
                let mut points = [Pair::<L>::zero(); POINTS];
                let mut turn = start;
                for (p, point) in points.iter_mut().enumerate() {
                    let m = columns * p + r;
                    let at = m * BLOCK * STRIP + part;
                    *point = turn.times(table[m]).scaled(load::<L>(&samples[at..at + L::WIDTH]));
                    turn = turn.by(leap);
                }
                let points = sixteen(&points);
                for (i, (sum, &twiddle)) in sums.iter_mut().zip(twiddles).enumerate() {
                    *sum = sum.plus(points[(depths.start + i) % POINTS].times(twiddle));
                }
                start = start.by(step);
            }
            for (group, sum) in zoomed.iter_mut().zip(sums) {
                group.re[part..part + L::WIDTH].copy_from_slice(L::flat(&[sum.re]));
                group.im[part..part + L::WIDTH].copy_from_slice(L::flat(&[sum.im]));
            }
        }
    }
}

#[inline(always)]
fn load<L: Lanes<Element = f32>>(numbers: &[f32]) -> L {
    let mut vector = [L::zero()];
    L::flat_mut(&mut vector).copy_from_slice(numbers);
    vector[0]
}

/// A complex number in every lane.
#[derive(Clone, Copy)]
struct Pair<L> {
    re: L,
    im: L,
}

impl<L: Lanes<Element = f32>> Pair<L> {
    #[inline(always)]
    fn zero() -> Self {
        Self { re: L::zero(), im: L::zero() }
    }

    /// exp(i phase(shift)) for the shift of each lane.
    #[inline(always)]
    fn unit(shifts: &[f32], phase: &dyn Fn(f64) -> f64) -> Self {
        let (mut re, mut im) = ([L::zero()], [L::zero()]);
        let lanes = L::flat_mut(&mut re).iter_mut().zip(L::flat_mut(&mut im));
        for ((re, im), &shift) in lanes.zip(shifts) {
            let (sin, cos) = phase(f64::from(shift)).sin_cos();
            (*re, *im) = (cos as f32, sin as f32);
        }
        Self { re: re[0], im: im[0] }
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
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
    fn times(self, factor: Complex32) -> Self {
        let all = |number: f32| L::from_f64(f64::from(number));
        self.by(Self { re: all(factor.re), im: all(factor.im) })
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
fn sixteen<L: Lanes<Element = f32>>(x: &[Pair<L>; POINTS]) -> [Pair<L>; POINTS] {
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
