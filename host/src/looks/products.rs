//! What the fields have in common with themselves at each distance, and what of that is chance.

use super::{MOST_CHANCE, Product};
use crate::error::Result;
use crate::lanes::{LaneTask, Lanes, Path};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

/// Sums of U(x) conj U(x + d) of each field, at the distances d up to `reach` along y and x: half of them, as mu(-d) is the
/// conjugate of mu(d).
pub(super) struct Products {
    /// (field, distance), d = 0 first.
    of: Vec<Vec<Product>>,
    reach: [isize; 2],
    step: usize,
}

impl Products {
    /// # Errors
    /// When the path of the vector instructions cannot be taken.
    pub(super) fn of(fields: &[Vec<Complex32>], lines: Lines, reach: [isize; 2]) -> Result<Self> {
        let mut products = Self { of: Vec::new(), reach, step: lines.step };
        let distances: Vec<_> = (0..=products.half()).map(|i| products.distance(i)).collect();
        let of = |field: &Vec<Complex32>| neighbours(field, lines, &distances);
        products.of = fields.par_iter().map(of).collect::<Result<_>>()?;
        Ok(products)
    }

    /// Number of the last distance.
    fn half(&self) -> usize {
        let [tall, wide] = self.reach.map(|reach| 2 * reach + 1);
        (tall * wide / 2) as usize
    }

    /// (dy, dx); dy >= 0.
    fn distance(&self, i: usize) -> (isize, isize) {
        let wide = 2 * self.reach[1] + 1;
        let place = (self.half() + i) as isize;
        (place / wide - self.reach[0], place % wide - self.reach[1])
    }

    /// |mu(d)|^2 of the `chosen` fields, (dy, dx) row after row, without what chance adds; and that.
    pub(super) fn squared(&self, chosen: &[usize]) -> (Vec<f64>, f64) {
        let half = self.half();
        let at = |i: usize| {
            let products = chosen.iter().map(|&field| &self.of[field][i]);
            Measured::of(products, self.step)
        };
        let measured: Vec<Measured> = (0..=half).map(at).collect();
        let chance = chance(&measured);
        let pixels = measured[0].pairs;
        let squared = |i: usize| measured[i.abs_diff(half)].without(chance, pixels);
        ((0..=2 * half).map(squared).collect(), chance)
    }

    /// Sum of |mu(d)|^2 of a field over the outer half of the distances.
    pub(super) fn far(&self, field: usize) -> f64 {
        let is_far = |i: usize| {
            let (dy, dx) = self.distance(i);
            2 * dy.abs() > self.reach[0] || 2 * dx.abs() > self.reach[1]
        };
        let far = self.of[field].iter().enumerate().filter(|&(i, _)| is_far(i));
        far.map(|(_, product)| product.coherence_squared()).sum()
    }
}

/// |mu|^2 at one distance, as it comes out.
struct Measured {
    /// Averaged over the fields, each by itself: a phase ramp that changes with time must not cancel.
    raw: f64,
    /// Pairs of pixels, in the mean over the fields, about; of rows that are passed over too.
    pairs: f64,
}

impl Measured {
    /// From the fields' products, for which one of `step` rows was taken.
    fn of<'a>(products: impl ExactSizeIterator<Item = &'a Product>, step: usize) -> Self {
        let count = products.len().max(1) as f64;
        let (mut raw, mut pairs) = (0.0, 0);
        for product in products {
            raw += product.coherence_squared();
            pairs += product.pairs;
        }
        Self { raw: raw / count, pairs: (step * pairs) as f64 / count }
    }

    /// (raw - b) / (1 - b) with what chance adds, b = 1/L_d, where as many of the looks are left as of the pairs:
    /// L_d = L pairs_d / n. By chance it may be negative.
    fn without(&self, chance: f64, pixels: f64) -> f64 {
        if self.pairs == 0.0 {
            return 0.0;
        }
        let added = (chance * pixels / self.pairs).min(MOST_CHANCE);
        1.0 - (1.0 - self.raw) / (1.0 - added)
    }
}

/// What a finite number of speckles adds to |mu|^2, q = 1/L with the L looks of the mean over all n pixels that are
/// measured; the first of `measured` is the distance 0. With D other distances and o_d = pairs_d / n^2
///
/// q = 1/n + sum over d of o_d (raw_d - q n / pairs_d), or q = (1/n + sum over d of o_d raw_d) / (1 + D/n).
fn chance(measured: &[Measured]) -> f64 {
    let [itself, others @ ..] = measured else { return 0.0 };
    let n = itself.pairs;
    if n == 0.0 {
        return 0.0;
    }
    let seen: f64 = others.iter().map(|d| 2.0 * d.pairs / (n * n) * d.raw).sum();
    let distances = 2.0 * others.iter().filter(|d| d.pairs > 0.0).count() as f64;
    (1.0 / n + seen) / (1.0 + distances / n)
}

/// Every `step`-th row of an image whose rows are `width` long.
#[derive(Clone, Copy)]
pub(super) struct Lines {
    pub width: usize,
    pub step: usize,
}

/// Those rows of the field and their neighbours at each of the `distances` (dy, dx); dy >= 0.
///
/// # Errors
/// As [`Products::of`].
pub(super) fn neighbours(
    field: &[Complex32],
    lines: Lines,
    distances: &[(isize, isize)],
) -> Result<Vec<Product>> {
    Path::best()?.run(Neighbours { field, lines, distances })
}

/// [`neighbours`], in whatever vectors: the compiler makes them of [`Product::add_row`].
struct Neighbours<'a> {
    field: &'a [Complex32],
    lines: Lines,
    distances: &'a [(isize, isize)],
}

impl LaneTask for Neighbours<'_> {
    type Output = Vec<Product>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Vec<Product> {
        let Self { field, lines: Lines { width, step }, distances } = self;
        let mut products = vec![Product::default(); distances.len()];
        // All distances of a row before the next: the cache then holds the rows.
        for (y, row) in field.chunks_exact(width).enumerate().step_by(step) {
            for (product, &(dy, dx)) in products.iter_mut().zip(distances) {
                let place = (y + dy as usize) * width;
                let Some(partner) = field.get(place..place + width) else { continue };
                let own = (-dx).max(0) as usize..(width as isize - dx.max(0)) as usize;
                let shifted = (own.start as isize + dx) as usize..;
                product.add_row(&row[own], &partner[shifted]);
            }
        }
        products
    }
}

#[inline(always)]
fn sum(of: [f32; SIDE_BY_SIDE]) -> f64 {
    let mut sum = 0.0;
    for number in of {
        sum += f64::from(number);
    }
    sum
}

/// Pixels whose products are summed side by side, in single precision: the compiler does several at a time.
const SIDE_BY_SIDE: usize = 16;

impl Product {
    /// Take pair after pair of a row in; what is longer than the other has no partner.
    #[inline(always)]
    pub(super) fn add_row(&mut self, u: &[Complex32], v: &[Complex32]) {
        let length = u.len().min(v.len());
        let (u, u_rest) = u[..length].as_chunks::<SIDE_BY_SIDE>();
        let (v, v_rest) = v[..length].as_chunks::<SIDE_BY_SIDE>();
        let [mut re, mut im, mut p_sum, mut q_sum, mut pairs] = [[0.0_f32; SIDE_BY_SIDE]; 5];
        for (u, v) in u.iter().zip(v) {
            for i in 0..SIDE_BY_SIDE {
                let ([a, b], [c, d]) = ([u[i].re, u[i].im], [v[i].re, v[i].im]);
                let (p, q) = (a * a + b * b, c * c + d * d);
                let there = p > 0.0 && q > 0.0;
                re[i] += a * c + b * d;
                im[i] += b * c - a * d;
                p_sum[i] += if there { p } else { 0.0 };
                q_sum[i] += if there { q } else { 0.0 };
                pairs[i] += if there { 1.0 } else { 0.0 };
            }
        }
        self.cross += Complex64::new(sum(re), sum(im));
        self.powers[0] += sum(p_sum);
        self.powers[1] += sum(q_sum);
        self.pairs += sum(pairs) as usize;
        for (&u, &v) in u_rest.iter().zip(v_rest) {
            self.add(u, v);
        }
    }
}
