//! Effective looks: how many independent speckles an average holds, estimated from the frames.
//!
//! L = 1 / sum over x,x' of w(x) w(x') |mu(x-x')|^2, where mu(d) is the spatial coherence of the field,
//! sum_x U(x) conj U(x+d), normalised by the powers at both ends. Of several recordings, `recordings` finds out how many
//! independent ones they are.

mod recordings;

pub use recordings::looks_of_recordings;

use crate::allocate::zeros;
use crate::error::Result;
use crate::image::Kernel;
use crate::io::{Series, Shape};
use crate::progress;
use crate::series::Survey;
use num_complex::{Complex32, Complex64};
use phasewalk_core::weights::effective_looks;
use rayon::prelude::*;

/// Frames that the coherence is estimated from: enough for a noise of |mu|^2 far below 1 %.
const FRAMES: usize = 8;
/// Depths of each of them: they are held in memory.
const DEPTHS: usize = 4;
/// The widest distance looked at first, pixels; doubled while the coherence is still above
/// [`STILL_COHERENT`] there.
const FIRST_REACH: usize = 6;
const STILL_COHERENT: f64 = 0.02;
const LAST_REACH: usize = 48;
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
}

impl SpatialCoherence {
    /// Estimate from up to eight frames spread over the series, at up to four of the given depths.
    ///
    /// # Errors
    /// When the series cannot be read or the user interrupts.
    pub fn estimate(series: &dyn Series, survey: &Survey, depths: &[usize]) -> Result<Self> {
        let Shape { frames, height, width, .. } = series.shape();
        let mut sampled = Vec::new();
        for frame in spread(frames) {
            progress::check()?;
            let read = |&depth: &usize| read_usable(series, survey, frame, depth);
            sampled.push(depths.iter().take(DEPTHS).map(read).collect::<Result<Vec<_>>>()?);
        }
        let fields: Vec<_> = with_speckle(sampled, width).into_iter().flatten().collect();
        let limits = [height, width].map(|side| LAST_REACH.min((side - 1) / 2) as isize);
        let mut reach = limits.map(|limit| limit.min(FIRST_REACH as isize));
        loop {
            progress::check()?;
            let coherence = Self::of_fields(&fields, width, reach);
            if reach == limits || coherence.at_the_rim(limits) < STILL_COHERENT {
                return Ok(coherence);
            }
            reach = [0, 1].map(|axis| (2 * reach[axis]).min(limits[axis]));
        }
    }

    fn of_fields(fields: &[Vec<Complex32>], width: usize, reach: [isize; 2]) -> Self {
        // mu(-d) is the conjugate of mu(d): the upper half is enough.
        let [tall, wide] = reach.map(|reach| 2 * reach + 1);
        let squared: Vec<f64> = (0..tall * wide)
            .into_par_iter()
            .map(|i| {
                let (dy, dx) = (i / wide - reach[0], i % wide - reach[1]);
                if (dy, dx) < (0, 0) {
                    return 0.0;
                }
                squared_coherence(fields, width, dy as usize, dx)
            })
            .collect();
        let half = squared.len() / 2;
        let mirrored = (0..squared.len()).map(|i| squared[i.max(2 * half - i)]).collect();
        Self { reach, squared: mirrored }
    }

    /// Largest |mu|^2 on the rim of the window, where the image still reaches further.
    fn at_the_rim(&self, limits: [isize; 2]) -> f64 {
        let ends =
            |axis: usize, d: isize| d.abs() == self.reach[axis] && self.reach[axis] < limits[axis];
        let rim = self.distances().filter(|&(dy, dx, _)| ends(0, dy) || ends(1, dx));
        rim.fold(0.0, |max, (_, _, s)| s.max(max))
    }

    fn distances(&self) -> impl Iterator<Item = (isize, isize, f64)> + '_ {
        let [tall, wide] = self.reach.map(|reach| 2 * reach + 1);
        (0..tall * wide)
            .zip(&self.squared)
            .map(move |(i, &s)| (i / wide - self.reach[0], i % wide - self.reach[1], s))
    }

    /// Effective looks of the mean over a mask (y, x).
    #[must_use]
    pub fn looks_of_mask(&self, mask: &[bool], width: usize) -> f64 {
        let chosen: Vec<usize> = (0..mask.len()).filter(|&i| mask[i]).collect();
        let count = chosen.len() as f64;
        let height = mask.len() / width;
        let partners = |dy: isize, dx: isize| {
            let inside = |&&i: &&usize| {
                let (y, x) = ((i / width) as isize + dy, (i % width) as isize + dx);
                let contained =
                    (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
                contained && mask[(y as usize) * width + x as usize]
            };
            chosen.iter().filter(inside).count() as f64
        };
        self.looks_of(|dy, dx| partners(dy, dx) / (count * count))
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

    /// Effective looks of the mean under a Gaussian.
    #[must_use]
    pub fn looks_of_kernel(&self, kernel: &Kernel) -> f64 {
        let overlap = |reach: isize, side: usize| -> Vec<f64> {
            (0..=reach as usize).map(|d| kernel.autocorrelation(d, side)).collect()
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

/// Independent looks that the sum over the depths of a layer adds to every pixel: (sum of P_z)^2 / sum over z,z' of
/// |C_zz'|^2 with C_zz' = sum over x of U_z(x) conj U_z'(x) and P_z = C_zz, in the mean over up to eight frames. 1 for
/// a single depth.
///
/// # Errors
/// When the series cannot be read or the user interrupts.
pub fn looks_of_depths(series: &dyn Series, survey: &Survey, depths: &[usize]) -> Result<f64> {
    let (mut whole, mut parts) = (0.0, 0.0);
    for frame in spread(series.shape().frames) {
        progress::check()?;
        let read = |&depth: &usize| read_usable(series, survey, frame, depth);
        let planes: Vec<_> = depths.iter().map(read).collect::<Result<_>>()?;
        let cross = |(u, v): (&Vec<Complex32>, &Vec<Complex32>)| -> Complex64 {
            u.iter().zip(v).map(|(u, v)| double(*u) * double(*v).conj()).sum()
        };
        let power: f64 = planes.iter().map(|plane| cross((plane, plane)).re).sum();
        whole += power * power;
        let pairs = planes.iter().flat_map(|u| planes.iter().map(move |v| (u, v)));
        parts += pairs.map(cross).map(|c| c.norm_sqr()).sum::<f64>();
    }
    Ok(if parts > 0.0 { whole / parts } else { 1.0 })
}

/// Leave out frames that hold noise only, or nothing: their pixels are independent whatever the aperture does. Where
/// neighbours have anything in common at all, it is less than half as much in them as in the middle one of the frames.
fn with_speckle(mut frames: Vec<Vec<Vec<Complex32>>>, width: usize) -> Vec<Vec<Vec<Complex32>>> {
    let lit = |fields: &Vec<Vec<Complex32>>| fields.iter().flatten().any(|u| u.norm_sqr() > 0.0);
    if frames.iter().any(lit) {
        frames.retain(lit);
    }
    let common = |fields: &Vec<Vec<Complex32>>| -> f64 {
        let of = |field: &Vec<Complex32>| {
            squared_coherence_of(field, width, 0, 1) + squared_coherence_of(field, width, 1, 0)
        };
        fields.iter().map(of).sum::<f64>() / fields.len().max(1) as f64
    };
    let mut sorted: Vec<f64> = frames.iter().map(common).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or_default();
    let pixels = frames.first().and_then(|fields| fields.first()).map_or(0, Vec::len);
    if middle * pixels as f64 > SEEN {
        frames.retain(|fields| common(fields) > middle / 2.0);
    }
    frames
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

/// |mu(dy, dx)|^2 over all pixels x whose partner x + d lies in the image, averaged over the fields (each
/// by itself: a phase ramp that changes with time must not cancel) and freed of the 1/pixels that
/// random phases leave, so that by chance it may be negative; dy >= 0.
fn squared_coherence(fields: &[Vec<Complex32>], width: usize, dy: usize, dx: isize) -> f64 {
    if (dy, dx) == (0, 0) {
        return 1.0;
    }
    let sum: f64 = fields.iter().map(|field| squared_coherence_of(field, width, dy, dx)).sum();
    sum / fields.len().max(1) as f64
}

fn squared_coherence_of(field: &[Complex32], width: usize, dy: usize, dx: isize) -> f64 {
    let columns = (-dx).max(0) as usize..(width as isize - dx.max(0)) as usize;
    let (mut cross, mut here, mut there) = (Complex64::default(), 0.0, 0.0);
    let mut places = 0;
    for (row, partner) in field.chunks_exact(width).zip(field.chunks_exact(width).skip(dy)) {
        let shifted = (columns.start as isize + dx) as usize..;
        places += columns.len();
        for (u, v) in row[columns.clone()].iter().zip(&partner[shifted]) {
            let (u, v) = (double(*u), double(*v));
            cross += u * v.conj();
            here += u.norm_sqr();
            there += v.norm_sqr();
        }
    }
    if here * there <= 0.0 {
        return 0.0;
    }
    cross.norm_sqr() / (here * there) - 1.0 / places as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |mu|^2 = 1/4 between neighbours along x, nothing further.
    fn coherence(reach: [isize; 2]) -> SpatialCoherence {
        let mut squared = vec![0.0; ((2 * reach[0] + 1) * (2 * reach[1] + 1)) as usize];
        let middle = squared.len() / 2;
        squared[middle - 1..=middle + 1].copy_from_slice(&[0.25, 1.0, 0.25]);
        SpatialCoherence { reach, squared }
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
        assert_eq!(with_speckle(mixed, SIDE), good);
        let only_noise: Vec<_> = (1..=4).map(|seed| vec![noise(seed)]).collect();
        assert_eq!(with_speckle(only_noise.clone(), SIDE), only_noise);
        assert_eq!(with_speckle(vec![vec![dark.clone()]], SIDE), [[dark]]);
    }

    /// Independent pixels of a small image count one each, whatever chance correlates.
    #[test]
    fn looks_of_a_small_image_have_no_bias() {
        const SIDE: usize = 20;
        let mut state = 1_u64;
        let mut number = || {
            // splitmix64, then Box and Muller.
            let mut uniform = || {
                state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
                let mut z = state;
                z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
                ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
            };
            let radius = (-(1.0 - uniform()).ln()).sqrt();
            let u = Complex64::from_polar(radius, std::f64::consts::TAU * uniform());
            Complex32::new(u.re as f32, u.im as f32)
        };
        let runs = 20;
        let mut looks = 0.0;
        for _ in 0..runs {
            let mut field = || (0..SIDE * SIDE).map(|_| number()).collect::<Vec<_>>();
            let fields: Vec<Vec<Complex32>> = (0..FRAMES).map(|_| field()).collect();
            let coherence = SpatialCoherence::of_fields(&fields, SIDE, [6, 6]);
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
