//! Where in the image there is speckle at all: squares of pixels whose neighbouring frames agree.
//!
//! |gamma|^2 of a square, |sum of U_t conj U_(t+1)|^2 / (P_t P_(t+1)), is 1/L and no more where there is only noise,
//! or where speckle has fallen apart from one frame to the next.

use super::{Product, SEEN, read_usable, spread};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::progress;
use crate::series::Survey;
use num_complex::Complex32;

/// Side of the squares, pixels.
const SIDE: usize = 32;
/// Squares that are usable to a smaller share are not looked at.
const USABLE: f64 = 0.25;
/// Of ten squares, one agrees better than this one.
const BEST: f64 = 0.9;
/// Squares count as speckle down to this share of the best ones' |gamma|^2.
const ENOUGH: f64 = 0.25;

/// The survey of the squares that hold speckle, as up to eight frames and their neighbours show at one depth; where
/// frames do not agree anywhere, or there is only one, all squares.
///
/// # Errors
/// When the series cannot be read or the user interrupts.
pub fn speckled(series: &dyn Series, survey: &Survey, depth: usize) -> Result<Survey> {
    let shape = series.shape();
    let mut squares = Squares::new(shape);
    for frame in spread(shape.frames.saturating_sub(1)) {
        progress::check()?;
        let read = |frame| read_usable(series, survey, frame, depth);
        squares.add(&read(frame)?, &read(frame + 1)?);
    }
    let chosen = squares.chosen();
    let mask: Vec<bool> = (0..survey.valid.len()).map(|i| chosen[squares.of(i)]).collect();
    Ok(survey.within(&mask))
}

/// What the squares of an image have in common from frame to frame.
struct Squares {
    width: usize,
    columns: usize,
    /// Sum over the pairs of frames of |gamma|^2 less what independent pixels have.
    agreement: Vec<f64>,
    /// Usable pixels.
    pixels: Vec<usize>,
    frames: usize,
}

impl Squares {
    fn new(Shape { height, width, .. }: Shape) -> Self {
        let columns = width.div_ceil(SIDE);
        let count = height.div_ceil(SIDE) * columns;
        Self { width, columns, agreement: vec![0.0; count], pixels: vec![0; count], frames: 0 }
    }

    /// The square of pixel i.
    const fn of(&self, i: usize) -> usize {
        i / self.width / SIDE * self.columns + i % self.width / SIDE
    }

    fn add(&mut self, earlier: &[Complex32], later: &[Complex32]) {
        let mut products = vec![Product::default(); self.agreement.len()];
        for (i, (&u, &v)) in earlier.iter().zip(later).enumerate() {
            products[self.of(i)].add(u, v);
        }
        for (place, product) in products.iter().enumerate() {
            let chance = 1.0 / product.pairs.max(1) as f64;
            self.agreement[place] += product.coherence_squared() - chance;
            self.pixels[place] = self.pixels[place].max(product.pairs);
        }
        self.frames += 1;
    }

    /// Which of them hold speckle.
    fn chosen(&self) -> Vec<bool> {
        let large = |&place: &usize| self.pixels[place] as f64 >= USABLE * (SIDE * SIDE) as f64;
        let mut sorted: Vec<f64> =
            (0..self.pixels.len()).filter(large).map(|place| self.agreement[place]).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let best = sorted.get((sorted.len() as f64 * BEST) as usize).copied().unwrap_or_default();
        let seen = best * (SIDE * SIDE) as f64 > SEEN * self.frames as f64;
        let holds = |place| !seen || large(&place) && self.agreement[place] >= ENOUGH * best;
        (0..self.pixels.len()).map(holds).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::looks::SpatialCoherence;
    use crate::series::{HeldSeries, survey};

    const SIDES: usize = 128;
    const FRAMES: usize = 6;

    /// splitmix64, then Box and Muller.
    fn noise(state: &mut u64) -> Complex32 {
        let mut uniform = || {
            *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = *state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f32 / (1_u64 << 53) as f32
        };
        let radius = (-(1.0 - uniform()).ln()).sqrt();
        Complex32::from_polar(radius, std::f32::consts::TAU * uniform())
    }

    /// Speckle of two pixels that stays as it is, in the left half only if `half`; noise of one pixel elsewhere.
    fn scene(half: bool) -> HeldSeries {
        let mut state = 5;
        let mut white = || (0..SIDES * SIDES).map(|_| noise(&mut state)).collect::<Vec<_>>();
        let speckle = white();
        let mut frames = Vec::new();
        for _ in 0..FRAMES {
            frames.extend(white().into_iter().enumerate().map(|(i, noise)| {
                let next = speckle[(i + 1) % speckle.len()];
                let is_noise = half && i % SIDES >= SIDES / 2;
                if is_noise { noise } else { (speckle[i] + next) * 0.5_f32.sqrt() }
            }));
        }
        let shape = Shape { frames: FRAMES, depth: 1, height: SIDES, width: SIDES };
        HeldSeries::new(shape, frames).unwrap()
    }

    #[test]
    fn noise_beside_the_speckle_does_not_change_its_looks() {
        let looks = |half: bool| {
            let series = scene(half);
            let survey = survey(&series, &[0]).unwrap();
            let chosen = speckled(&series, &survey, 0).unwrap();
            for (i, &chosen) in chosen.valid.iter().enumerate() {
                assert_eq!(chosen, !half || i % SIDES < SIDES / 2, "pixel {i}");
            }
            let coherence = SpatialCoherence::estimate(&series, &chosen, &[0]).unwrap();
            coherence.looks_of_mask(&[true; 1600], 40)
        };
        // 1 + 2 / 4 pixels a look; the coherence of the 64 x 128 pixels has a chance of its own of 1 %.
        let (pure, mixed) = (looks(false), looks(true));
        assert!((pure * 1.5 / 1600.0 - 1.0).abs() < 0.04, "{pure}");
        assert!((mixed / pure - 1.0).abs() < 0.04, "{mixed} {pure}");
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
