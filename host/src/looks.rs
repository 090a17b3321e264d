//! Effective looks: how many independent speckles an average holds, estimated from the frames.
//!
//! ```text
//! spatial.rs       how far a speckle reaches, and the looks of a mask, a rectangle, a Gaussian
//! products.rs      what fields have in common with themselves at each distance
//! point_spread.rs  where the light of a pixel comes from
//! speckled.rs      where in the image there is speckle at all
//! recordings.rs    how many independent recordings several ones amount to
//! ```
//! What is measured is measured on the usable pixels of a [`Survey`]: pixels of noise only are independent of each
//! other whatever the aperture does, so they must not be among them ([`Survey::within`], [`speckled()`]).

mod point_spread;
mod products;
mod recordings;
mod spatial;
mod speckled;
#[cfg(test)]
mod testing;

pub use point_spread::PointSpread;
pub use recordings::looks_of_recordings;
pub use spatial::{Block, SpatialCoherence};
pub use speckled::speckled;

use crate::allocate::zeros;
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::progress;
use crate::series::Survey;
use num_complex::{Complex32, Complex64};

/// Frames that are looked at: enough for a noise of |mu|^2 far below 1 %.
const FRAMES: usize = 8;
/// What few pixels may owe to chance at most.
const MOST_CHANCE: f64 = 0.5;
/// What neighbours have in common is not chance, which leaves 1/pixels, if it is so many times that.
const SEEN: f64 = 30.0;

/// Which number of looks sets the weights' threshold and debiasing (paper lines 800-820).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Looks {
    /// Pixels, as the paper has it: too many where a speckle covers several, and then noise passes.
    Nominal,
    /// Speckles, estimated from the frames.
    Effective,
    /// A number of at least 1.
    Number(f64),
}

impl std::str::FromStr for Looks {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "nominal" => Ok(Self::Nominal),
            "effective" => Ok(Self::Effective),
            _ => match text.parse::<f64>() {
                Ok(looks) if looks >= 1.0 && looks.is_finite() => Ok(Self::Number(looks)),
                _ => Err(format!("'{text}' is not nominal, effective or a number of at least 1")),
            },
        }
    }
}

impl Looks {
    /// The number that counts.
    #[must_use]
    pub fn choose(self, nominal: f64, effective: f64) -> f64 {
        match self {
            Self::Nominal => nominal,
            Self::Effective => effective,
            Self::Number(looks) => looks,
        }
    }
}

/// Independent looks that the sum over the depths of a layer adds to every pixel: (sum of P_z)^2 / sum over z,z' of
/// |C_zz'|^2 with C_zz' = sum over x of U_z(x) conj U_z'(x) and P_z = C_zz, in the mean over up to eight frames. 1 for
/// a single depth. Of the |C_zz'|^2 of two depths, what chance adds is left out: P_z P_z' / L if they are independent,
/// L being the `looks` of the pixels that can be used.
///
/// # Errors
/// When the series cannot be read or the user interrupts.
pub fn looks_of_depths(
    series: &dyn Series,
    survey: &Survey,
    depths: &[usize],
    looks: f64,
) -> Result<f64> {
    if depths.len() < 2 {
        return Ok(1.0);
    }
    let chance = 1.0 / looks.max(MOST_CHANCE.recip());
    let (mut whole, mut own, mut others) = (0.0, 0.0, 0.0);
    for frame in spread(series.shape().frames) {
        progress::check()?;
        let read = |&depth: &usize| read_usable(series, survey, frame, depth);
        let planes: Vec<_> = depths.iter().map(read).collect::<Result<_>>()?;
        let cross = |(u, v): (&Vec<Complex32>, &Vec<Complex32>)| -> Complex64 {
            u.iter().zip(v).map(|(u, v)| double(*u) * double(*v).conj()).sum()
        };
        let powers: Vec<f64> = planes.iter().map(|plane| cross((plane, plane)).re).collect();
        whole += powers.iter().sum::<f64>().powi(2);
        own += powers.iter().map(|power| power * power).sum::<f64>();
        for (i, j) in (1..planes.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let squared = cross((&planes[i], &planes[j])).norm_sqr();
            others += 2.0 * (squared - chance * powers[i] * powers[j]) / (1.0 - chance);
        }
    }
    Ok(if own > 0.0 { whole / (own + others.max(0.0)) } else { 1.0 })
}

/// A frame at one depth, scaled, 0 where it is not usable.
fn read_usable(
    series: &dyn Series,
    survey: &Survey,
    frame: usize,
    depth: usize,
) -> Result<Vec<Complex32>> {
    let Shape { height, width, .. } = series.shape();
    let mut field = zeros::<Complex32>(height * width, "frames for the number of looks")?;
    series.read_rows(frame, depth, 0..height, &mut field)?;
    for (u, &valid) in field.iter_mut().zip(&survey.valid) {
        *u = if valid { *u * survey.scale } else { Complex32::default() };
    }
    Ok(field)
}

/// Up to eight frames spread over the series.
fn spread(frames: usize) -> impl Iterator<Item = usize> {
    let chosen = frames.min(FRAMES);
    (0..chosen).map(move |i| i * (frames - 1) / (chosen - 1).max(1))
}

fn double(u: Complex32) -> Complex64 {
    Complex64::new(f64::from(u.re), f64::from(u.im))
}

/// sum of U conj V over the pairs of which neither is 0 (not usable, or dark), and what normalises it.
#[derive(Clone, Copy, Default)]
struct Product {
    cross: Complex64,
    powers: [f64; 2],
    pairs: usize,
}

impl Product {
    #[inline(always)]
    fn add(&mut self, u: Complex32, v: Complex32) {
        let (u, v) = (double(u), double(v));
        let [p, q] = [u, v].map(|u| u.norm_sqr());
        let there = p > 0.0 && q > 0.0;
        self.cross += u * v.conj();
        self.powers[0] += if there { p } else { 0.0 };
        self.powers[1] += if there { q } else { 0.0 };
        self.pairs += usize::from(there);
    }

    /// |cross|^2 / (P Q), which is 1/L if U and V are independent; 0 without pairs.
    fn coherence_squared(&self) -> f64 {
        let [p, q] = self.powers;
        if p * q > 0.0 { self.cross.norm_sqr() / (p * q) } else { 0.0 }
    }

    /// The same less what independent pixels have.
    fn above_chance(&self) -> f64 {
        self.coherence_squared() - 1.0 / self.pairs.max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::testing::noise;
    use super::*;
    use crate::series::{HeldSeries, survey};

    /// In however few pixels: chance correlates them, too.
    #[test]
    fn independent_depths_count_one_each() {
        const DEPTH: usize = 10;
        let shape = Shape { frames: FRAMES, depth: DEPTH, height: 6, width: 6 };
        let depths: Vec<usize> = (0..DEPTH).collect();
        let (mut state, runs) = (3, 10);
        let mut looks = 0.0;
        for _ in 0..runs {
            let numbers = (0..FRAMES * DEPTH * 36).map(|_| noise(&mut state)).collect();
            let series = HeldSeries::new(shape, numbers).unwrap();
            let all = survey(&series, &depths).unwrap();
            looks += looks_of_depths(&series, &all, &depths, 36.0).unwrap() / f64::from(runs);
        }
        // With the chance of 1/36 for each of the 90 pairs it would be 8. Each field's power differs by a sixth.
        assert!((looks / 10.0 - 1.0).abs() < 0.05, "{looks}");
    }

    #[test]
    fn depths_that_are_alike_count_once() {
        let mut state = 4;
        let shape = Shape { frames: 2, depth: 3, height: 5, width: 5 };
        let mut field = || {
            let plane: Vec<_> = (0..25).map(|_| noise(&mut state)).collect();
            plane.repeat(3)
        };
        let series = HeldSeries::new(shape, [field(), field()].concat()).unwrap();
        let all = survey(&series, &[0, 1, 2]).unwrap();
        let looks = looks_of_depths(&series, &all, &[0, 1, 2], 25.0).unwrap();
        assert!((looks - 1.0).abs() < 1e-6, "{looks}");
        assert_eq!(looks_of_depths(&series, &all, &[1], 25.0).unwrap(), 1.0);
    }
}
