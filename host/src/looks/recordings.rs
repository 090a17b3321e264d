//! How many independent recordings several ones of the same scene amount to, measured from the frames.
//!
//! The phase error of the sum of C_r = U_r(i) conj U_r(j) over recordings r is, for circular Gaussian speckle and with
//! every C_r turned to the real axis by z_r = C_r/|C_r|, the sum over r, r' of
//!
//! v_rr' = Re(K_ii conj K_jj conj z_r z_r') - Re(K_ij(r,r') K_ij(r',r) conj(z_r z_r')),
//!
//! K_ij(r,r') = mean of U_r(i) conj U_r'(j). With v_rr = P_i P_j - |C_r|^2 the recordings amount to
//!
//! (sum of P_i * sum of P_j - (sum of |C_r|)^2) / sum of v_rr',
//!
//! which is their number if their speckle differs, 1 if they are copies. Of a pattern that never changes the errors
//! are noise, which no two frames share: there v_rr' = 0 though the speckle is the same. The chance agreement of few
//! speckles is the same in both terms of v_rr' and cancels.

use super::{read_usable, spread};
use crate::error::Result;
use crate::io::{Series, Shape};
use crate::progress;
use crate::series::Survey;
use num_complex::{Complex32, Complex64};

/// Side of the squares in which K is taken, pixels: a tilt between recordings, or a phase that differs from place to
/// place, is small across one.
const SQUARE: usize = 32;

/// The number of independent recordings, 1 to all; `recordings` are the depths of a layer in each. Depths are compared
/// in the order that they have there.
///
/// # Errors
/// When the series cannot be read or the user interrupts.
pub fn looks_of_recordings(
    series: &dyn Series,
    survey: &Survey,
    recordings: &[Vec<usize>],
) -> Result<f64> {
    let count = recordings.len();
    if count < 2 {
        return Ok(1.0);
    }
    let Shape { frames, width, .. } = series.shape();
    let depths = recordings.iter().map(Vec::len).min().unwrap_or_default();
    let frames: Vec<usize> = spread(frames).collect();
    let mut sum = Variances::default();
    for (&[i, j], z) in frames.array_windows().flat_map(|pair| (0..depths).map(move |z| (pair, z)))
    {
        progress::check()?;
        let read = |frame| -> Result<Vec<Vec<Complex32>>> {
            recordings.iter().map(|zs| read_usable(series, survey, frame, zs[z])).collect()
        };
        let (earlier, later) = (read(i)?, read(j)?);
        for square in squares(series.shape()) {
            sum.add(&earlier, &later, &square, width);
        }
    }
    let amount = if sum.together > 0.0 { sum.alone / sum.together } else { 1.0 };
    Ok(amount.clamp(1.0, count as f64))
}

/// The first pixel of each square, its rows and its columns.
fn squares(shape: Shape) -> Vec<Square> {
    let Shape { height, width, .. } = shape;
    let starts = |length: usize| (0..length).step_by(SQUARE);
    let side = |start: usize, length: usize| SQUARE.min(length - start);
    let square = |y, x| Square { y, x, rows: side(y, height), columns: side(x, width) };
    starts(height).flat_map(|y| starts(width).map(move |x| square(y, x))).collect()
}

struct Square {
    y: usize,
    x: usize,
    rows: usize,
    columns: usize,
}

/// Sums over squares, depths and pairs of frames.
#[derive(Default)]
struct Variances {
    /// Of one recording as bright and as coherent as all together.
    alone: f64,
    /// Of the sum of all.
    together: f64,
}

impl Variances {
    fn add(
        &mut self,
        earlier: &[Vec<Complex32>],
        later: &[Vec<Complex32>],
        square: &Square,
        width: usize,
    ) {
        let product = |u: &[Complex32], v: &[Complex32]| -> Complex64 {
            let rows = (square.y..square.y + square.rows).map(|y| y * width + square.x);
            let cells = rows.flat_map(|start| start..start + square.columns);
            cells.map(|i| super::double(u[i]) * super::double(v[i]).conj()).sum()
        };
        let n = earlier.len();
        let matrix = |a: &[Vec<Complex32>], b: &[Vec<Complex32>]| -> Vec<Complex64> {
            (0..n * n).map(|place| product(&a[place / n], &b[place % n])).collect()
        };
        let [ii, jj, ij] =
            [(earlier, earlier), (later, later), (earlier, later)].map(|(a, b)| matrix(a, b));
        let diagonal = |matrix: &[Complex64]| -> Vec<Complex64> {
            matrix.iter().step_by(n + 1).copied().collect()
        };
        let own = diagonal(&ij);
        let total = |numbers: Vec<Complex64>| numbers.iter().map(|c| c.norm()).sum::<f64>();
        self.alone += total(diagonal(&ii)) * total(diagonal(&jj)) - total(own.clone()).powi(2);
        let unit = |c: Complex64| if c.norm() > 0.0 { c / c.norm() } else { Complex64::ONE };
        let z: Vec<Complex64> = own.into_iter().map(unit).collect();
        for place in 0..n * n {
            let (r, s) = (place / n, place % n);
            let straight = ii[place] * jj[place].conj() * z[r].conj() * z[s];
            let crossed = ij[place] * ij[s * n + r] * (z[r] * z[s]).conj();
            self.together += straight.re - crossed.re;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::{HeldSeries, survey};

    const SIDE: usize = 48;
    const PIXELS: usize = SIDE * SIDE;
    const FRAMES: usize = 6;

    /// A fixed sequence of complex numbers of unit variance (Box and Muller).
    struct Chance(u64);

    impl Chance {
        fn uniform(&mut self) -> f32 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 40) as f32 + 0.5) / (1 << 24) as f32
        }

        fn speckle(&mut self) -> Complex32 {
            let radius = (-self.uniform().ln()).sqrt();
            Complex32::from_polar(radius, std::f32::consts::TAU * self.uniform())
        }
    }

    /// Amount of three recordings whose frames `field(chance, recording, frame, pixel)` makes; each has a
    /// phase of its own.
    fn amount(mut field: impl FnMut(&mut Chance, usize, usize, usize) -> Complex32) -> f64 {
        let mut chance = Chance(1);
        let mut all = Vec::new();
        for t in 0..FRAMES {
            for r in 0..3 {
                let bulk = Complex32::from_polar(1.0, 0.9 * r as f32 + (r * t) as f32);
                all.extend((0..PIXELS).map(|x| field(&mut chance, r, t, x) * bulk));
            }
        }
        let shape = Shape { frames: FRAMES, depth: 3, height: SIDE, width: SIDE };
        let series = HeldSeries::new(shape, all).unwrap();
        let survey = survey(&series, &[0, 1, 2]).unwrap();
        looks_of_recordings(&series, &survey, &[vec![0], vec![1], vec![2]]).unwrap()
    }

    /// Pairs r, r' of 2304 pixels and five pairs of frames agree by chance to 1/sqrt(11,520) = 1 % each: 3 % is asked
    /// of the six.
    #[test]
    fn other_speckle_counts_fully_and_copies_once() {
        let mut patterns = Chance(7);
        let (rho, fresh) = (0.8_f32, 0.6_f32);
        let mut walk = || -> Vec<Complex32> {
            let mut u: Vec<Complex32> = (0..PIXELS).map(|_| patterns.speckle()).collect();
            let mut frames = u.clone();
            for _ in 1..FRAMES {
                for u in &mut u {
                    *u = *u * rho + patterns.speckle() * fresh;
                }
                frames.extend(&u);
            }
            frames
        };
        let walks = [walk(), walk(), walk()];
        let different = amount(|_, r, t, x| walks[r][t * PIXELS + x]);
        assert!((different / 3.0 - 1.0).abs() < 0.03, "{different}");
        let copies = amount(|_, _, t, x| walks[0][t * PIXELS + x]);
        assert!((copies - 1.0).abs() < 1e-5, "{copies}");
    }

    /// The same speckle in all frames and recordings: noise is what makes errors, and it is new every time.
    #[test]
    fn noise_on_a_pattern_that_stays_counts_fully() {
        let mut pattern = Chance(9);
        let still: Vec<Complex32> = (0..PIXELS).map(|_| pattern.speckle()).collect();
        let noisy = amount(|chance, _, _, x| still[x] + chance.speckle() * 0.5);
        assert!((noisy / 3.0 - 1.0).abs() < 0.03, "{noisy}");
    }
}
