//! The scatterers: where they are, how they walk, what they add to the image.
//!
//! A scatterer is 16 bytes: x and y as fractions of the image's sides and 2kz as a fraction of a
//! turn, all three in 32-bit fixed point, and its amplitude. Periodic edges and the phase modulo 2π
//! are then the wrapping addition of integers. [`BLOCK`] scatterers lie together as four arrays: the
//! loops over them are what the compiler turns into vector code (see `simd.rs`).

use super::philox::philox4x32;
use super::vector_math::{TURN, fixed, normal_pair, rayleigh, sin_cos_turns};
use num_complex::Complex32;

/// Scatterers in a block. A power of two, so that the upper half of the index is one per block.
pub const BLOCK: usize = 256;

/// Last word of the counter: what the random words are for.
const STREAM_START: u32 = 0;
const STREAM_WALK: u32 = 1;

/// Neighbouring scatterers as a structure of arrays.
#[repr(align(64))]
pub struct Block {
    /// x over the width of the image, unit 2⁻³².
    x: [u32; BLOCK],
    /// y over the height of the image, unit 2⁻³².
    y: [u32; BLOCK],
    /// 2kz/2π modulo 1, unit 2⁻³².
    phase: [u32; BLOCK],
    /// A, between 0 and 1.
    amplitude: [f32; BLOCK],
}

impl Block {
    /// Block number `block` at the start: x, y and A uniform (lines 616–621), and so is the phase,
    /// since z uniform between 0 and 10λ is 2kz uniform over exactly 20 turns. Scatterers from the
    /// `count`-th on only fill the last block up: their amplitude is 0.
    pub fn start(block: usize, count: usize, key: [u32; 2]) -> Self {
        let mut start =
            Self { x: [0; BLOCK], y: [0; BLOCK], phase: [0; BLOCK], amplitude: [0.0; BLOCK] };
        let first = block * BLOCK;
        for i in 0..BLOCK.min(count.saturating_sub(first)) {
            let words = philox4x32(counter(first, i, 0, STREAM_START), key);
            [start.x[i], start.y[i], start.phase[i]] = [words[0], words[1], words[2]];
            start.amplitude[i] = (words[3] >> 8) as i32 as f32 * (256.0 / TURN);
        }
        start
    }

    /// The scatterers that are inside the mask now, before their random step, move by `drift`
    /// (fraction of a turn, unit 2⁻³²; lines 635–642).
    #[inline(always)]
    fn drift(&mut self, drift: u32, raster: &Raster) {
        let mut pixels = [0; BLOCK];
        for ((pixel, &x), &y) in pixels.iter_mut().zip(&self.x).zip(&self.y) {
            *pixel = raster.pixel(x, y);
        }
        for (phase, &pixel) in self.phase.iter_mut().zip(&pixels) {
            let inside = raster.mask.get(pixel as usize).is_some_and(|&inside| inside);
            *phase = phase.wrapping_add(u32::from(inside) * drift);
        }
    }

    /// All scatterers take their random step into frame `walk.frame` (lines 629–632).
    #[inline(always)]
    fn walk(&mut self, first: usize, walk: &Walk) {
        let [step_x, step_y, step_phase] = walk.sigma_turns;
        for i in 0..BLOCK {
            let words = philox4x32(counter(first, i, walk.frame, STREAM_WALK), walk.key);
            let [x, y] = normal_pair([words[0], words[1]]);
            let z = rayleigh(words[2]) * sin_cos_turns(words[3]).1;
            self.x[i] = self.x[i].wrapping_add(fixed(step_x * x));
            self.y[i] = self.y[i].wrapping_add(fixed(step_y * y));
            self.phase[i] = self.phase[i].wrapping_add(fixed(step_phase * z));
        }
    }

    /// Add A exp(i 2kz) of every scatterer to the pixel that contains it (lines 621–623).
    #[inline(always)]
    fn add_to(&self, raster: &Raster, sums: &mut [i64]) {
        let mut pixels = [0; BLOCK];
        let mut values = [0; BLOCK];
        for i in 0..BLOCK {
            pixels[i] = raster.pixel(self.x[i], self.y[i]);
            let (sine, cosine) = sin_cos_turns(self.phase[i]);
            let unit = raster.unit * self.amplitude[i];
            values[i] = pack(fixed(unit * cosine) as i32, fixed(unit * sine) as i32);
        }
        for (&pixel, &value) in pixels.iter().zip(&values) {
            if let Some(sum) = sums.get_mut(pixel as usize) {
                *sum = sum.wrapping_add(value);
            }
        }
    }
}

/// The counter of scatterer `first + i`, where `first` is a multiple of [`BLOCK`].
#[inline(always)]
fn counter(first: usize, i: usize, frame: u32, stream: u32) -> [u32; 4] {
    [first as u32 | i as u32, (first as u64 >> 32) as u32, frame, stream]
}

/// The step into one frame.
pub struct Walk {
    /// Key of the random numbers.
    pub key: [u32; 2],
    /// The frame that is being made, ≥ 1.
    pub frame: u32,
    /// Standard deviation of the step in x, in y (fractions of the image's sides) and in phase
    /// (turns).
    pub sigma_turns: [f32; 3],
    /// Systematic movement inside the mask: fraction of a turn, unit 2⁻³².
    pub drift: u32,
}

/// The image the scatterers fall on.
pub struct Raster {
    /// Pixels along x.
    pub width: u32,
    /// Pixels along y.
    pub height: u32,
    /// The region that drifts, shape (y, x).
    pub mask: Vec<bool>,
    /// What amplitude 1 adds to a sum, unit 2³²; see [`Raster::unit_for`].
    pub unit: f32,
}

impl Raster {
    /// Number of the pixel that contains (x, y).
    #[inline(always)]
    fn pixel(&self, x: u32, y: u32) -> u32 {
        let along = |position: u32, length: u32| (u64::from(position) * u64::from(length)) >> 32;
        (along(y, self.height) * u64::from(self.width) + along(x, self.width)) as u32
    }

    /// What amplitude 1 adds to a sum at n scatterers per pixel, as a fraction of 2³²: the greatest
    /// power of two with unit · T ≤ ½, so that sums up to ±T fit in a signed 32-bit integer.
    ///
    /// Re U of a pixel is a compound Poisson sum of terms within ±1 and of variance n/6. By
    /// Bernstein's inequality it exceeds T with a probability below exp(−T²/(2(n/6 + T/3))), which
    /// is e⁻⁷⁰ for the T used here: less than 10⁻¹⁷ for all pixels of 10⁷ images together. (Sums
    /// wrap, so that only the total of a pixel counts, not what was added in between.) For n = 50
    /// amplitude 1 is 2²⁴ integers, and all roundings together are 4·10⁻⁸ of the rms field.
    pub fn unit_for(scatterers_per_pixel: usize) -> f32 {
        const EXPONENT: f64 = 70.0;
        let (a, b) = (EXPONENT / 3.0, EXPONENT / 3.0 * scatterers_per_pixel as f64);
        let bound = a + libm::sqrt(a * a + b);
        libm::exp2(-1.0 - libm::ceil(libm::log2(bound))) as f32
    }

    /// The field of a pixel from its sum.
    pub fn field(&self, sum: i64) -> Complex32 {
        let [re, im] = unpack(sum);
        Complex32::new(re as f32, im as f32) / (self.unit * TURN)
    }
}

/// A complex integer as im·2³² + re: its sums are sums of one 64-bit integer.
#[inline(always)]
fn pack(re: i32, im: i32) -> i64 {
    (i64::from(im) << 32).wrapping_add(i64::from(re))
}

/// The complex integer of a sum of packed ones. `re` borrows from `im` where it is negative.
fn unpack(sum: i64) -> [i32; 2] {
    let re = sum as i32;
    [re, (sum.wrapping_sub(i64::from(re)) >> 32) as i32]
}

/// Take `blocks`, whose first scatterer has the index `first`, into the next frame and add them to
/// `sums` (shape (y, x)). Without `walk` they stay where they are: the first frame.
///
/// This is the body that `simd.rs` compiles once for each instruction set.
#[inline(always)]
pub fn advance(
    blocks: &mut [Block],
    first: usize,
    walk: Option<&Walk>,
    raster: &Raster,
    sums: &mut [i64],
) {
    for (b, block) in blocks.iter_mut().enumerate() {
        if let Some(walk) = walk {
            if walk.drift != 0 {
                block.drift(walk.drift, raster);
            }
            // Without random motion every step is 0, whatever the random numbers.
            if walk.sigma_turns != [0.0; 3] {
                block.walk(first + b * BLOCK, walk);
            }
        }
        block.add_to(raster, sums);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_sums_are_the_sums() {
        let terms = [(3, -5), (-7, 2), (i32::MAX, i32::MIN + 8), (-9, -1), (-1, 0), (0, -1)];
        let sum = terms.iter().fold(0i64, |sum, &(re, im)| sum.wrapping_add(pack(re, im)));
        let expected = terms
            .iter()
            .fold([0i32; 2], |[re, im], term| [re.wrapping_add(term.0), im.wrapping_add(term.1)]);
        assert_eq!(unpack(sum), expected);
        assert_eq!(unpack(pack(-1, -1)), [-1, -1]);
        assert_eq!(unpack(pack(i32::MIN, i32::MIN)), [i32::MIN; 2]);
        assert_eq!(unpack(pack(i32::MAX, i32::MAX)), [i32::MAX; 2]);
    }

    #[test]
    fn the_unit_leaves_room() {
        assert_eq!(Raster::unit_for(50), 1.0 / 256.0);
        for n in [1usize, 50, 1000, 1_000_000, u32::MAX as usize] {
            let limit = 0.5 / f64::from(Raster::unit_for(n));
            let exponent = limit * limit / (2.0 * (n as f64 / 6.0 + limit / 3.0));
            assert!(exponent >= 70.0, "{n} scatterers: e^-{exponent}");
        }
    }

    #[test]
    fn a_position_belongs_to_the_pixel_that_contains_it() {
        let raster = Raster { width: 640, height: 368, mask: Vec::new(), unit: 1.0 };
        assert_eq!(raster.pixel(0, 0), 0);
        assert_eq!(raster.pixel(u32::MAX, u32::MAX), 640 * 368 - 1);
        assert_eq!(raster.pixel(1 << 31, 1 << 31), 184 * 640 + 320);
        assert_eq!(raster.pixel((1 << 31) - 1, (1 << 31) - 1), 183 * 640 + 319);
    }

    /// Uniform over [0, 1): mean ½ and variance 1/12 within five standard deviations.
    #[test]
    fn the_start_is_uniform() {
        let blocks: Vec<Block> = (0..400).map(|b| Block::start(b, 400 * BLOCK, [5, 6])).collect();
        let count = (400 * BLOCK) as f64;
        let check = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, square) = values.fold((0.0, 0.0), |(s, q), v| (s + v, q + v * v));
            let (mean, variance) = (sum / count, square / count - (sum / count).powi(2));
            assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0 / count).sqrt(), "{mean}");
            assert!(
                (variance - 1.0 / 12.0).abs() < 5.0 * (1.0 / 180.0 / count).sqrt(),
                "{variance}"
            );
        };
        let turns = |word: &u32| f64::from(*word) / 4_294_967_296.0;
        check(&mut blocks.iter().flat_map(|b| b.x.iter().map(turns)));
        check(&mut blocks.iter().flat_map(|b| b.y.iter().map(turns)));
        check(&mut blocks.iter().flat_map(|b| b.phase.iter().map(turns)));
        check(&mut blocks.iter().flat_map(|b| b.amplitude.iter().map(|&a| f64::from(a))));
    }

    #[test]
    fn the_last_block_is_filled_up_with_nothing() {
        let block = Block::start(1, BLOCK + 3, [0, 0]);
        assert!(block.amplitude[..3].iter().all(|&a| a > 0.0));
        assert!(block.amplitude[3..].iter().all(|&a| a == 0.0));
    }

    /// Mean 0, the standard deviation asked for, and no correlation between x, y and phase, each
    /// within five standard deviations of n = 102,400 steps.
    #[test]
    fn the_walk_is_gaussian_in_three_directions() {
        let walk = Walk { key: [7, 8], frame: 3, sigma_turns: [0.001, 0.02, 0.125], drift: 0 };
        let (mut moments, mut mixed) = ([[0.0f64; 2]; 3], [0.0f64; 3]);
        let blocks = 400;
        for b in 0..blocks {
            let mut block = Block::start(b, usize::MAX, walk.key);
            let before = [block.x, block.y, block.phase];
            block.walk(b * BLOCK, &walk);
            let after = [block.x, block.y, block.phase];
            for i in 0..BLOCK {
                let step: [f64; 3] = std::array::from_fn(|d| {
                    let turns = after[d][i].wrapping_sub(before[d][i]) as i32;
                    f64::from(turns) / 4_294_967_296.0 / f64::from(walk.sigma_turns[d])
                });
                for d in 0..3 {
                    moments[d][0] += step[d];
                    moments[d][1] += step[d] * step[d];
                    mixed[d] += step[d] * step[(d + 1) % 3];
                }
            }
        }
        let n = (blocks * BLOCK) as f64;
        for d in 0..3 {
            let [mean, square] = moments[d].map(|m| m / n);
            assert!(mean.abs() < 5.0 / n.sqrt(), "mean {mean}");
            assert!((square - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "variance {square}");
            assert!((mixed[d] / n).abs() < 5.0 / n.sqrt(), "correlation {}", mixed[d] / n);
        }
    }

    /// Scatterers are numbered beyond 2³² without repeating themselves.
    #[test]
    fn no_two_scatterers_share_a_counter() {
        let words = |first| philox4x32(counter(first, 1, 2, STREAM_WALK), [1, 2]);
        assert_ne!(words(0), words(BLOCK));
        assert_ne!(words(0), words(1 << 32));
        assert_ne!(words(0), philox4x32(counter(0, 1, 2, STREAM_START), [1, 2]));
    }
}
