//! How far a speckle reaches: L = 1 / sum over x,x' of w(x) w(x') |mu(x-x')|^2, where mu(d) is the spatial coherence of
//! the field, sum_x U(x) conj U(x+d), normalised by the powers at both ends.

use super::products::{Lines, Products, neighbours};
use super::{Product, SEEN, read_usable, spread};
use crate::error::Result;
use crate::image::Kernel;
use crate::io::{Series, Shape};
use crate::progress;
use crate::series::Survey;
use num_complex::Complex32;
use phasewalk_core::weights::effective_looks;
use rayon::prelude::*;
use std::ops::Range;

/// Depths of each of the frames: they are held in memory.
const DEPTHS: usize = 4;
/// Usable pixels of each of the frames that are enough: of twice as many, every other row is passed over.
const PIXELS: usize = 1 << 16;
/// The widest distance looked at first, pixels; doubled while the coherence is still above
/// [`STILL_COHERENT`] there.
const FIRST_REACH: usize = 6;
const STILL_COHERENT: f64 = 0.02;
const LAST_REACH: usize = 48;
/// Fields that have so many times more in common over long distances than the first quarter of them have it from something
/// else than the aperture; two standard deviations of chance are less.
const MORE: f64 = 1.5;

/// A rectangle of pixels over which a cross-spectrum is averaged: a square, where the image is wide enough both ways.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Rows and columns.
    pub sides: [usize; 2],
    /// Independent looks of the mean.
    pub looks: f64,
}

impl Block {
    /// Its number of pixels.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.sides[0] * self.sides[1]
    }
}

/// |mu(d)|^2 for -reach <= d <= reach along y and x.
pub struct SpatialCoherence {
    reach: [isize; 2],
    /// (dy, dx), row after row.
    squared: Vec<f64>,
    /// The same of the fields without those in which something reaches further than the aperture spreads light (a
    /// reflection, side lobes of a bright layer).
    of_aperture: Vec<f64>,
}

impl SpatialCoherence {
    /// Estimate from the usable pixels of up to eight frames spread over the series, at up to four of the given depths.
    ///
    /// # Errors
    /// When the series cannot be read or the user interrupts.
    pub fn estimate(series: &dyn Series, survey: &Survey, depths: &[usize]) -> Result<Self> {
        let Shape { frames, width, .. } = series.shape();
        let window = Window::around(&survey.valid, width);
        if window.rows.is_empty() {
            return Ok(Self::of_independent_pixels());
        }
        let sample = |frame: usize| {
            progress::check()?;
            let read = |&depth: &usize| -> Result<Vec<Complex32>> {
                Ok(window.cut(&read_usable(series, survey, frame, depth)?, width))
            };
            depths.iter().take(DEPTHS).map(read).collect::<Result<Vec<_>>>()
        };
        let chosen: Vec<usize> = spread(frames).collect();
        let sampled = chosen.into_par_iter().map(sample).collect::<Result<Vec<_>>>()?;
        let fields: Vec<_> =
            with_speckle(sampled, window.columns.len())?.into_iter().flatten().collect();
        let sides = [window.rows.len(), window.columns.len()];
        // Pairs further apart than half of the image are few, and more chance than coherence.
        let furthest = |side: usize| FIRST_REACH.max(LAST_REACH.min(side / 2));
        let limits = sides.map(|side| furthest(side).min(side.saturating_sub(1)) as isize);
        let mut reach = limits.map(|limit| limit.min(FIRST_REACH as isize));
        loop {
            progress::check()?;
            let (coherence, chance) = Self::of_fields(&fields, sides[1], reach)?;
            if reach == limits || coherence.at_the_rim(limits) < STILL_COHERENT.max(2.0 * chance) {
                return Ok(coherence);
            }
            reach = [0, 1].map(|axis| (2 * reach[axis]).min(limits[axis]));
        }
    }

    /// What is left to say where no pixel can be used.
    fn of_independent_pixels() -> Self {
        Self { reach: [0, 0], squared: vec![1.0], of_aperture: vec![1.0] }
    }

    /// And what chance adds to it, which is left out already.
    fn of_fields(
        fields: &[Vec<Complex32>],
        width: usize,
        reach: [isize; 2],
    ) -> Result<(Self, f64)> {
        let step = (fields.first().map_or(0, |field| usable(field)) / PIXELS).max(1);
        let products = Products::of(fields, Lines { width, step }, reach)?;
        let mut fields: Vec<usize> = (0..fields.len()).collect();
        let (squared, chance) = products.squared(&fields);
        let far: Vec<f64> = fields.iter().map(|&field| products.far(field)).collect();
        fields.sort_by(|&a, &b| far[a].total_cmp(&far[b]));
        let most = fields.get(fields.len() / 4).map_or(0.0, |&field| MORE * far[field]);
        fields.retain(|&field| far[field] <= most);
        let (of_aperture, _) = products.squared(&fields);
        Ok((Self { reach, squared, of_aperture }, chance))
    }

    /// Largest |mu|^2 on the rim of the window, where the image still reaches further.
    fn at_the_rim(&self, limits: [isize; 2]) -> f64 {
        let ends =
            |axis: usize, d: isize| d.abs() == self.reach[axis] && self.reach[axis] < limits[axis];
        let rim = self.distances().filter(|&(dy, dx, _)| ends(0, dy) || ends(1, dx));
        rim.fold(0.0, |max, (_, _, s)| s.max(max))
    }

    /// |mu|^2 as a function of (dy, dx), as far as `reach`.
    #[cfg(test)]
    pub(crate) fn from_function(reach: isize, squared: impl Fn(isize, isize) -> f64) -> Self {
        let none = vec![0.0; (2 * reach as usize + 1).pow(2)];
        let mut of = Self { reach: [reach; 2], squared: none, of_aperture: Vec::new() };
        of.squared = of.distances().map(|(dy, dx, _)| squared(dy, dx)).collect();
        of.of_aperture.clone_from(&of.squared);
        of
    }

    /// (dy, dx, |mu|^2) of the aperture alone, and how far along both axes it is known.
    pub(super) fn of_aperture(&self) -> (Vec<(isize, isize, f64)>, isize) {
        let all: Vec<_> =
            self.places().zip(&self.of_aperture).map(|((y, x), &s)| (y, x, s)).collect();
        let known = self.reach[0].min(self.reach[1]);
        let at_the_rim = |reach: isize| {
            let rim = all.iter().filter(|&&(dy, dx, _)| dy.abs().max(dx.abs()) == reach);
            rim.fold(0.0, |max: f64, &(_, _, s)| s.max(max))
        };
        let mut reach = known.min(FIRST_REACH as isize);
        while reach < known && at_the_rim(reach) > STILL_COHERENT {
            reach = (2 * reach).min(known);
        }
        (all, reach)
    }

    fn places(&self) -> impl Iterator<Item = (isize, isize)> + use<> {
        let ([tall, wide], [y, x]) = (self.reach.map(|reach| 2 * reach + 1), self.reach);
        (0..tall * wide).map(move |i| (i / wide - y, i % wide - x))
    }

    /// (dy, dx, |mu|^2).
    fn distances(&self) -> impl Iterator<Item = (isize, isize, f64)> + '_ {
        self.places().zip(&self.squared).map(|((dy, dx), &s)| (dy, dx, s))
    }

    /// Effective looks of the mean over a mask (y, x).
    #[must_use]
    pub fn looks_of_mask(&self, mask: &[bool], width: usize) -> f64 {
        let weights: Vec<f64> = mask.iter().map(|&m| f64::from(u8::from(m))).collect();
        self.looks_of_weights(&weights, width)
    }

    /// Effective looks of the mean with these weights (y, x), some of which may be negative.
    #[must_use]
    pub fn looks_of_weights(&self, weights: &[f64], width: usize) -> f64 {
        let chosen: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] != 0.0).collect();
        let sum: f64 = chosen.iter().map(|&i| weights[i]).sum();
        let height = weights.len() / width;
        let partners = |dy: isize, dx: isize| -> f64 {
            let partner = |&i: &usize| {
                let (y, x) = ((i / width) as isize + dy, (i % width) as isize + dx);
                let contained =
                    (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
                if contained { weights[i] * weights[y as usize * width + x as usize] } else { 0.0 }
            };
            chosen.iter().map(partner).sum()
        };
        self.looks_of(|dy, dx| partners(dy, dx) / (sum * sum))
    }

    /// The smallest square whose mean has at least `looks` independent looks, where each pixel counts as `of_pixel` looks
    /// (the depths of a layer); in an image that is narrower than that, a rectangle as wide as the image.
    #[must_use]
    pub fn block_of_looks(&self, looks: f64, of_pixel: f64, shape: Shape) -> Block {
        let limits = [shape.height, shape.width];
        let block = |side: usize| {
            let sides = limits.map(|limit| limit.min(side));
            Block { sides, looks: self.looks_of_rectangle(sides) * of_pixel }
        };
        let largest = limits[0].max(limits[1]).max(1);
        (1..largest).map(block).find(|block| block.looks >= looks).unwrap_or(block(largest))
    }

    /// Effective looks of the mean over a rectangle.
    fn looks_of_rectangle(&self, sides: [usize; 2]) -> f64 {
        let count = (sides[0] * sides[1]) as f64;
        let left = |axis: usize, d: isize| sides[axis].saturating_sub(d.unsigned_abs()) as f64;
        self.looks_of(|dy, dx| left(0, dy) * left(1, dx) / (count * count))
    }

    /// Effective looks of the mean under a Gaussian that reaches over the edges to the other side, in the mean over the
    /// image: of its pairs at a distance d round the image, a share |d| / side are really side - |d| apart.
    #[must_use]
    pub fn looks_of_kernel(&self, kernel: &Kernel) -> f64 {
        let overlap = |reach: isize, side: usize| -> Vec<f64> {
            let apart = |d: usize| side.saturating_sub(d) as f64 / side as f64;
            (0..=reach as usize).map(|d| apart(d) * kernel.autocorrelation(d, side)).collect()
        };
        let along_y = overlap(self.reach[0], kernel.height);
        let along_x = overlap(self.reach[1], kernel.width);
        self.looks_of(|dy, dx| along_y[dy.unsigned_abs()] * along_x[dx.unsigned_abs()])
    }

    /// Looks of a mean with the autocorrelation `overlap` of its weights. What chance adds to and takes from |mu|^2 at
    /// the single distances cancels in the sum, which must not fall below that of independent pixels.
    fn looks_of(&self, overlap: impl Fn(isize, isize) -> f64) -> f64 {
        let (mut own, mut others) = (0.0, 0.0);
        for (dy, dx, s) in self.distances() {
            let sum = if (dy, dx) == (0, 0) { &mut own } else { &mut others };
            *sum += overlap(dy, dx) * s;
        }
        effective_looks([own, others.max(0.0)].into_iter())
    }
}

/// The rows and columns that hold all usable pixels.
struct Window {
    rows: Range<usize>,
    columns: Range<usize>,
}

impl Window {
    fn around(valid: &[bool], width: usize) -> Self {
        let places = (0..valid.len()).filter(|&i| valid[i]).map(|i| [i / width, i % width]);
        let span = |axis: usize| {
            let along = places.clone().map(|place| place[axis]);
            along.clone().min().map_or(0..0, |first| first..along.max().unwrap_or(first) + 1)
        };
        Self { rows: span(0), columns: span(1) }
    }

    fn cut(&self, field: &[Complex32], width: usize) -> Vec<Complex32> {
        let rows = self.rows.clone().map(|y| &field[y * width..][self.columns.clone()]);
        rows.flatten().copied().collect()
    }
}

/// Leave out frames that hold noise only, or nothing: their pixels are independent whatever the aperture does. Where
/// neighbours have anything in common at all, it is less than half as much in them as in the middle one of the frames.
fn with_speckle(
    mut frames: Vec<Vec<Vec<Complex32>>>,
    width: usize,
) -> Result<Vec<Vec<Vec<Complex32>>>> {
    let lit = |fields: &Vec<Vec<Complex32>>| fields.iter().flatten().any(|u| u.norm_sqr() > 0.0);
    if frames.iter().any(lit) {
        frames.retain(lit);
    }
    let common = |fields: &Vec<Vec<Complex32>>| -> Result<f64> {
        let lines = Lines { width, step: 1 };
        let mut sum = 0.0;
        for field in fields {
            let beside = neighbours(field, lines, &[(0, 1), (1, 0)])?;
            sum += beside.iter().map(Product::above_chance).sum::<f64>();
        }
        Ok(sum / fields.len().max(1) as f64)
    };
    let common: Vec<f64> = frames.par_iter().map(common).collect::<Result<_>>()?;
    let mut sorted = common.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
    let pixels = frames.first().and_then(|fields| fields.first()).map_or(0, |field| usable(field));
    if middle * pixels as f64 > SEEN {
        let mut common = common.into_iter();
        frames.retain(|_| common.next().is_some_and(|common| common > middle / 2.0));
    }
    Ok(frames)
}

/// Pixels that are not 0.
fn usable(field: &[Complex32]) -> usize {
    field.iter().filter(|u| u.norm_sqr() > 0.0).count()
}

#[cfg(test)]
mod tests {
    use super::super::FRAMES;
    use super::super::testing::noise;
    use super::*;

    /// |mu|^2 = 1/4 between neighbours along x, nothing further.
    fn coherence(reach: [isize; 2]) -> SpatialCoherence {
        let mut squared = vec![0.0; ((2 * reach[0] + 1) * (2 * reach[1] + 1)) as usize];
        let middle = squared.len() / 2;
        squared[middle - 1..=middle + 1].copy_from_slice(&[0.25, 1.0, 0.25]);
        SpatialCoherence { reach, of_aperture: squared.clone(), squared }
    }

    #[test]
    fn a_rectangle_has_the_looks_of_its_mask() {
        let coherence = coherence([2, 3]);
        for sides in [[1, 9], [9, 1], [4, 6]] {
            let mask = vec![true; sides[0] * sides[1]];
            let wanted = coherence.looks_of_mask(&mask, sides[1]);
            assert!((coherence.looks_of_rectangle(sides) - wanted).abs() < 1e-12, "{sides:?}");
        }
    }

    /// Noise and darkness in some of the frames say nothing of the speckle's size.
    #[test]
    fn noise_and_darkness_are_no_speckle() {
        const SIDE: usize = 64;
        let number = |seed: usize, i: usize| {
            // Weyl's sequence: an irrational angle for each place.
            let angle = ((seed * 7919 + i) as f64 * 0.754_877_666_246_692_7).fract();
            Complex32::from_polar(1.0, (std::f64::consts::TAU * angle * i as f64) as f32)
        };
        let noise = |seed: usize| (0..SIDE * SIDE).map(|i| number(seed, i)).collect::<Vec<_>>();
        // Neighbours along x share half of what they are.
        let speckle = |seed: usize| {
            let white = noise(seed);
            (0..white.len()).map(|i| white[i] + white[(i + 1) % white.len()]).collect::<Vec<_>>()
        };
        let dark = vec![Complex32::default(); SIDE * SIDE];
        let good: Vec<_> = (1..=3).map(|seed| vec![speckle(seed)]).collect();
        let mut mixed = good.clone();
        mixed.insert(0, vec![dark.clone()]);
        mixed.insert(2, vec![noise(4)]);
        assert_eq!(with_speckle(mixed, SIDE).unwrap(), good);
        let only_noise: Vec<_> = (1..=4).map(|seed| vec![noise(seed)]).collect();
        assert_eq!(with_speckle(only_noise.clone(), SIDE).unwrap(), only_noise);
        assert_eq!(with_speckle(vec![vec![dark.clone()]], SIDE).unwrap(), [[dark]]);
    }

    /// |mu|^2 = 1 everywhere: one look. Weights that reach over the edges must not count twice.
    #[test]
    fn a_single_speckle_is_one_look() {
        let everywhere = |[tall, wide]: [isize; 2]| SpatialCoherence {
            reach: [tall, wide],
            squared: vec![1.0; ((2 * tall + 1) * (2 * wide + 1)) as usize],
            of_aperture: Vec::new(),
        };
        for (sigma, sides) in [(1.5, [16, 8]), (3.0, [9, 30]), (0.4, [5, 5])] {
            let kernel = Kernel::new(sigma, sides[0], sides[1], true).unwrap();
            let looks = everywhere(sides.map(|side| side as isize - 1)).looks_of_kernel(&kernel);
            assert!((looks - 1.0).abs() < 1e-12, "{looks}");
        }
    }

    /// Independent pixels of a small image count one each, whatever chance correlates.
    #[test]
    fn looks_of_a_small_image_have_no_bias() {
        const SIDE: usize = 20;
        let mut state = 1_u64;
        let mut number = || noise(&mut state);
        let runs = 20;
        let mut looks = 0.0;
        for _ in 0..runs {
            let mut field = || (0..SIDE * SIDE).map(|_| number()).collect::<Vec<_>>();
            let fields: Vec<Vec<Complex32>> = (0..FRAMES).map(|_| field()).collect();
            let (coherence, _) = SpatialCoherence::of_fields(&fields, SIDE, [6, 6]).unwrap();
            looks += coherence.looks_of_mask(&[true; SIDE * SIDE], SIDE) / f64::from(runs);
        }
        // The sum over 84 distances has a standard deviation of 1.5 %, and what falls below 0 is cut off; clamped
        // one by one, chance took a seventh.
        let share = looks / (SIDE * SIDE) as f64;
        assert!((0.97..=1.0).contains(&share), "{share}");
    }

    #[test]
    fn blocks_run_along_a_narrow_image() {
        let coherence = coherence([0, 3]);
        let of = |height, width| {
            let shape = Shape { frames: 2, depth: 1, height, width };
            coherence.block_of_looks(16.0, 1.0, shape)
        };
        // n pixels of a row have n / (1 + 2 (n - 1) / (4 n)) looks.
        assert_eq!(of(1, 100).sides, [1, 24]);
        assert_eq!(of(2, 100).sides, [2, 12]);
        assert_eq!(of(50, 100).sides, [5, 5]);
        assert!(of(100, 1).sides[1] == 1 && of(1, 100).looks >= 16.0);
        assert_eq!(of(1, 7).sides, [1, 7], "no more than there is");
    }
}
