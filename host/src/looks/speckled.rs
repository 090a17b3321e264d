//! Where in the image there is speckle at all: squares of pixels whose neighbouring frames agree.
//!
//! |gamma|^2 of a square, |sum of U_t conj U_(t+1)|^2 / (P_t P_(t+1)), is 1/L and no more where there is only noise,
//! or where speckle has fallen apart from one frame to the next.

use super::{Product, read_usable, spread};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::lanes::{LaneTask, Lanes, Path};
use crate::progress;
use crate::series::Survey;
use num_complex::Complex32;
use rayon::prelude::*;

/// Side of the squares, pixels.
const SIDE: usize = 32;
/// Pixels that a rectangle holds at least, along an image that is lower or narrower than a square.
const PIXELS: usize = 128;
/// Squares that are usable to a smaller share are not looked at.
const USABLE: f64 = 0.25;
/// What frames have in common is seen if it is so many times what chance leaves, 1/pixels.
const SEEN: f64 = 8.0;
/// Squares count as speckle down to this share of the middle one's |gamma|^2: of pixels half of which are noise it is a
/// quarter.
const ENOUGH: f64 = 0.5;

/// The survey of the squares that hold speckle, as up to eight frames and their neighbours show at one depth; where
/// frames do not agree anywhere, or there is only one, all squares.
///
/// # Errors
/// When the series cannot be read or the user interrupts.
pub fn speckled(series: &dyn Series, survey: &Survey, depth: usize) -> Result<Survey> {
    let shape = series.shape();
    let (mut squares, path) = (Squares::new(shape), Path::best()?);
    let products = |frame: usize| {
        progress::check()?;
        let read = |frame| read_usable(series, survey, frame, depth);
        let (earlier, later) = (read(frame)?, read(frame + 1)?);
        path.run(FramePair { squares: &squares, earlier: &earlier, later: &later })
    };
    let frames: Vec<usize> = spread(shape.frames.saturating_sub(1)).collect();
    let all: Vec<Vec<Product>> = frames.into_par_iter().map(products).collect::<Result<_>>()?;
    for products in all {
        squares.add(products);
    }
    let chosen = squares.chosen();
    let mask: Vec<bool> = (0..survey.valid.len()).map(|i| chosen[squares.of(i)]).collect();
    Ok(survey.within(&mask))
}

/// What the squares of an image have in common from frame to frame.
struct Squares {
    width: usize,
    /// Rows and columns of a square.
    sides: [usize; 2],
    columns: usize,
    squares: Vec<Square>,
}

#[derive(Clone, Copy, Default)]
struct Square {
    /// Pixels of the image in it, and those that are usable.
    pixels: usize,
    usable: usize,
    /// Sum over the pairs of frames of |gamma|^2 less what independent pixels have, and their number.
    agreement: f64,
    pairs: usize,
}

impl Square {
    fn add(&mut self, product: Product) {
        if product.pairs > 0 {
            self.agreement += product.above_chance();
            self.usable = self.usable.max(product.pairs);
            self.pairs += 1;
        }
    }

    /// Mean |gamma|^2, where it is more than chance.
    fn seen(&self) -> Option<f64> {
        let agreement = self.agreement / self.pairs.max(1) as f64;
        let usable = self.usable as f64;
        let large = usable >= USABLE * self.pixels as f64;
        (large && agreement * usable > SEEN).then_some(agreement)
    }
}

impl Squares {
    fn new(Shape { height, width, .. }: Shape) -> Self {
        let along = |across: usize, length: usize| SIDE.max(PIXELS.div_ceil(across)).min(length);
        let sides = [along(width.min(SIDE), height), along(height.min(SIDE), width)];
        let columns = width.div_ceil(sides[1]);
        let count = height.div_ceil(sides[0]) * columns;
        let mut new = Self { width, sides, columns, squares: vec![Square::default(); count] };
        for i in 0..height * width {
            let square = new.of(i);
            new.squares[square].pixels += 1;
        }
        new
    }

    /// The square of pixel i.
    const fn of(&self, i: usize) -> usize {
        let [rows, columns] = self.sides;
        i / self.width / rows * self.columns + i % self.width / columns
    }

    fn add(&mut self, products: Vec<Product>) {
        for (square, product) in self.squares.iter_mut().zip(products) {
            square.add(product);
        }
    }

    /// Which of them hold speckle.
    fn chosen(&self) -> Vec<bool> {
        let seen: Vec<Option<f64>> = self.squares.iter().map(Square::seen).collect();
        let least = ENOUGH * middle(seen.iter().flatten().copied().collect());
        seen.iter().map(|seen| seen.map_or(least == 0.0, |agreement| agreement >= least)).collect()
    }
}

/// Two frames, whose products are found square by square.
struct FramePair<'a> {
    squares: &'a Squares,
    earlier: &'a [Complex32],
    later: &'a [Complex32],
}

impl LaneTask for FramePair<'_> {
    type Output = Vec<Product>;

    #[inline(always)]
    fn run<L: Lanes<Element = f32>>(self) -> Vec<Product> {
        let Squares { width, sides, columns, ref squares } = *self.squares;
        let mut products = vec![Product::default(); squares.len()];
        let rows = self.earlier.chunks(width).zip(self.later.chunks(width));
        for (y, (earlier, later)) in rows.enumerate() {
            let squares = &mut products[y / sides[0] * columns..];
            let pieces = earlier.chunks(sides[1]).zip(later.chunks(sides[1]));
            for (product, (u, v)) in squares.iter_mut().zip(pieces) {
                product.add_row(u, v);
            }
        }
        products
    }
}

/// Half of the agreement is in squares that agree better than this one, 0 of none.
fn middle(mut agreements: Vec<f64>) -> f64 {
    agreements.sort_unstable_by(f64::total_cmp);
    let mut left = agreements.iter().sum::<f64>() / 2.0;
    for agreement in agreements {
        left -= agreement;
        if left <= 0.0 {
            return agreement;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::looks::SpatialCoherence;
    use crate::looks::testing::noise;
    use crate::series::{HeldSeries, survey};

    const SIDES: [usize; 2] = [128, 128];
    const FRAMES: usize = 6;

    /// Speckle of two pixels along x that stays as it is, at some (y, x); noise of one pixel elsewhere; some frames are
    /// dark.
    fn scene(
        [height, width]: [usize; 2],
        is_speckle: impl Fn(usize, usize) -> bool,
        dark: &[usize],
    ) -> HeldSeries {
        let mut state = 5;
        let mut white = || (0..height * width).map(|_| noise(&mut state)).collect::<Vec<_>>();
        let speckle = white();
        let mut frames = Vec::new();
        for frame in 0..FRAMES {
            let light = if dark.contains(&frame) { 0.0 } else { 1.0 };
            frames.extend(white().into_iter().enumerate().map(|(i, noise)| {
                let next = speckle[(i + 1) % speckle.len()];
                let here = is_speckle(i / width, i % width);
                (if here { (speckle[i] + next) * 0.5_f32.sqrt() } else { noise }) * light
            }));
        }
        HeldSeries::new(Shape { frames: FRAMES, depth: 1, height, width }, frames).unwrap()
    }

    /// Pixels for each look in a long row, 1 + 2 / 4 of such speckle.
    fn pixels_per_look(series: &HeldSeries) -> f64 {
        let survey = survey(series, &[0]).unwrap();
        let chosen = speckled(series, &survey, 0).unwrap();
        let coherence = SpatialCoherence::estimate(series, &chosen, &[0]).unwrap();
        1600.0 / coherence.looks_of_mask(&[true; 1600], 1600)
    }

    fn all(_: usize, _: usize) -> bool {
        true
    }

    /// Chance leaves 1 % in 1024 pixels.
    fn assert_is_speckle(name: &str, series: &HeldSeries) {
        let found = pixels_per_look(series);
        assert!((found / 1.5 - 1.0).abs() < 0.05, "{name}: {found}");
    }

    #[test]
    fn noise_beside_the_speckle_does_not_change_its_looks() {
        assert_is_speckle("speckle everywhere", &scene(SIDES, all, &[]));
        assert_is_speckle("half of it", &scene(SIDES, |_, x| x < 64, &[]));
        assert_is_speckle("an edge within squares", &scene(SIDES, |_, x| x < 48, &[]));
        assert_is_speckle("one square", &scene(SIDES, |y, x| y < 32 && x < 32, &[]));
        let at = |from: usize| from..from + 40;
        let island = |y: usize, x: usize| at(20).contains(&y) && at(20).contains(&x);
        let found = pixels_per_look(&scene(SIDES, island, &[]));
        // The best square is noise to a quarter, whose coherence is 0: (3/4)^2 of 0.5.
        assert!((1.25..1.5).contains(&found), "an island: {found}");
    }

    #[test]
    fn dark_frames_say_nothing() {
        assert_is_speckle("dark frames", &scene(SIDES, |_, x| x < 64, &[2, 4]));
    }

    #[test]
    fn line_scans_have_noise_beside_speckle_too() {
        for sides in [[1, 4096], [6, 512]] {
            let series = scene(sides, |_, x| x < sides[1] / 2, &[]);
            assert_is_speckle(&format!("{sides:?}"), &series);
        }
        let tall = Squares::new(Shape { frames: 2, depth: 1, height: 300, width: 2 });
        assert_eq!((tall.sides, tall.squares.len()), ([64, 2], 5));
    }

    #[test]
    fn where_no_frames_agree_all_squares_count() {
        let mut state = 9;
        let shape = Shape { frames: 3, depth: 1, height: 40, width: 70 };
        let series =
            HeldSeries::new(shape, (0..3 * 40 * 70).map(|_| noise(&mut state)).collect()).unwrap();
        let all = survey(&series, &[0]).unwrap();
        assert_eq!(speckled(&series, &all, 0).unwrap().valid, vec![true; 40 * 70]);
    }
}
