//! The fit of the coherence: normal equations of decays and cosines, and whether the cosines are used.
//!
//! ```text
//! v(c)   = b^T c - c^T H c / 2      times L: the log likelihood of the shares c, but for a constant
//! plain  : c_k >= 0 of the decays alone,   with : c_k, a_m >= 0 of decays and cosines
//! used   : v(with) - v(plain) > max(5, 100 / L)
//! ```
//! On coherences that do not come back cosines gain a little as well: by chance, which falls as 1 / L, and where the
//! decorrelation rate changes along the series. As there are more of them than the few lags of a window can fix, they would
//! cost phases that the decays know better; hence the threshold, at which the former keep what they had.

use super::terms::{COSINES, Coherence, DECAYS, Terms};
use crate::coherence::{Normal, RIDGE, limit_sum, nonneg_least_squares};
use crate::scalar::Real;
use crate::square::{Square, add_times, dot};

/// Passes of the non-negative least squares after each frame; the fit goes on with the next one.
const PASSES: usize = 20;

/// Gain of the log likelihood, per look, that says that decays do not follow.
const GAIN: f64 = 5.0;

/// Gain of the log likelihood that chance does not reach.
const CHANCE: f64 = 100.0;

/// Gain v(with) - v(plain) above which cosines are used, at L effective looks.
pub(super) fn gain_for(looks: f64) -> f64 {
    GAIN.max(CHANCE / looks)
}

/// Unknowns at most.
const TERMS: usize = DECAYS + COSINES;

/// Normal equations of all shares: of the decays, and beside them of `M` cosines.
#[derive(Clone, Debug)]
pub(super) struct Equations<T, const M: usize> {
    decays: Normal<T, DECAYS>,
    /// Of each cosine with the decays.
    mixed: [[T; DECAYS]; M],
    /// Of the cosines with each other.
    cosines: [[T; M]; M],
    right: [T; M],
}

impl<T: Real, const M: usize> Equations<T, M> {
    /// No pairs, and each share is held towards 0 as if by a coherence 0 that counts `strength` times.
    pub(super) fn held(strength: T) -> Self {
        const { assert!(M <= COSINES, "at most twelve cosines") };
        let zero = T::zero();
        let diagonal = |m| core::array::from_fn(|n| if m == n { strength } else { zero });
        Self {
            decays: Normal::held(strength),
            mixed: [[zero; DECAYS]; M],
            cosines: core::array::from_fn(diagonal),
            right: [zero; M],
        }
    }

    /// No pairs.
    pub(super) fn new() -> Self {
        Self::held(T::zero())
    }

    /// A coherence `mean` at the lag with these terms counts `weight` times.
    pub(super) fn add(&mut self, terms: &Terms<T, M>, mean: T, weight: T) {
        self.decays.add(&terms.decays, mean, weight);
        let cosines = terms.cosines();
        let rows = self.mixed.iter_mut().zip(&mut self.cosines).zip(&mut self.right);
        for (((mixed, own), right), &cosine) in rows.zip(&cosines) {
            let weighted = weight * cosine;
            add_times(mixed, weighted, &terms.decays);
            add_times(own, weighted, &cosines);
            *right = weighted.mul_add(mean, *right);
        }
    }

    /// All that was added counts `factor` times as much.
    pub(super) fn scale(&mut self, factor: T) {
        self.decays.scale(factor);
        for place in self.beside_mut() {
            *place = *place * factor;
        }
    }

    /// What both have been given.
    pub(super) fn join(&mut self, other: &Self) {
        self.decays.join(&other.decays);
        let (mixed, cosines) = (other.mixed.as_flattened(), other.cosines.as_flattened());
        let added = mixed.iter().chain(cosines).chain(&other.right);
        for (place, &value) in self.beside_mut().zip(added) {
            *place += value;
        }
    }

    /// All numbers that the cosines need beside those of the decays.
    fn beside_mut(&mut self) -> impl Iterator<Item = &mut T> {
        let (mixed, cosines) = (self.mixed.as_flattened_mut(), self.cosines.as_flattened_mut());
        mixed.iter_mut().chain(cosines).chain(&mut self.right)
    }

    /// Fit the shares of `coherence`, going on from what they are; with cosines too, if there is a `gain` above which these
    /// are used ([`gain_for`]).
    pub(super) fn fit(mut self, coherence: &mut Coherence<T, M>, gain: Option<T>) {
        let largest = self.decays.largest();
        self.scale(T::one() / largest);
        coherence.mixture.shares = self.decays.solve(coherence.mixture.shares, PASSES);
        limit_sum(&mut coherence.mixture.shares);
        if let Some(gain) = gain.filter(|_| M > 0) {
            coherence.periodic = largest * self.fit_together(coherence) > gain;
        }
    }

    /// Fit decays and cosines together; returns how much more they explain than the decays of `coherence` alone.
    fn fit_together(&self, coherence: &mut Coherence<T, M>) -> T {
        let mut data = [[T::zero(); TERMS]; TERMS];
        let mut matrix = Square::with_stride(data.as_flattened_mut(), DECAYS + M, TERMS);
        let mut right = [T::zero(); TERMS];
        self.write(&mut matrix, &mut right);
        let right = right.get(..DECAYS + M).unwrap_or(&[]);
        let (mut plain, mut with) = ([T::zero(); TERMS], [T::zero(); TERMS]);
        copy(&mut plain, &coherence.mixture.shares);
        let (decays, cosines) = with.split_at_mut(DECAYS);
        copy(decays, &coherence.together);
        copy(cosines, &coherence.amplitudes);
        nonneg_least_squares(&matrix, right, &mut with, PASSES);
        limit_sum(&mut with);
        let (decays, cosines) = with.split_at(DECAYS);
        copy(&mut coherence.together, decays);
        copy(&mut coherence.amplitudes, cosines);
        explained(&matrix, right, &with) - explained(&matrix, right, &plain)
    }

    /// All equations in one matrix: decays, then cosines.
    fn write(&self, matrix: &mut Square<'_, T>, right: &mut [T]) {
        let decays = self.decays.rows();
        for (k, (row, value)) in decays.enumerate() {
            copy(matrix.row_mut(k), row);
            copy(right.get_mut(k..).unwrap_or(&mut []), &[value]);
        }
        for (m, (mixed, own)) in (DECAYS..).zip(self.mixed.iter().zip(&self.cosines)) {
            for (k, &value) in mixed.iter().enumerate() {
                matrix.set_both(m, k, value);
            }
            copy(matrix.row_mut(m).get_mut(DECAYS..).unwrap_or(&mut []), own);
        }
        copy(right.get_mut(DECAYS..).unwrap_or(&mut []), &self.right);
        for k in 0..matrix.order() {
            matrix.set(k, k, matrix.at(k, k) + T::from_f64(RIDGE));
        }
    }
}

/// v(c) = b^T c - c^T H c / 2.
fn explained<T: Real>(h: &Square<'_, T>, b: &[T], c: &[T]) -> T {
    let half = T::from_f64(0.5);
    let terms = b.iter().zip(c).enumerate();
    terms.fold(T::zero(), |sum, (k, (&b, &share))| sum + share * (b - half * dot(h.row(k), c)))
}

/// The first places become the values, as far as there are both.
fn copy<T: Real>(places: &mut [T], values: &[T]) {
    for (place, &value) in places.iter_mut().zip(values) {
        *place = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bound::{cramer_rao, reported_variance};
    use crate::tracker::testing::{self, FRAMES, Speckle, truth};
    use crate::tracker::{FieldTracker, NODES, TrackerSettings};
    use num_complex::Complex;

    const RUNS: u64 = 100;

    /// Speckle of three parts, with their powers: one that falls apart by `rho` per frame, one that stays, and one that comes
    /// back after `period` frames; and noise of the power `noise`.
    #[derive(Clone, Copy)]
    struct Pattern {
        falling: f64,
        rho: f64,
        staying: f64,
        returning: f64,
        period: f64,
        noise: f64,
    }

    const WALK: Pattern = Pattern {
        falling: 1.0,
        rho: 0.9258,
        staying: 0.0,
        returning: 0.0,
        period: 20.0,
        noise: 0.0,
    };
    const PULSE: Pattern = Pattern { falling: 0.6, staying: 0.2, returning: 0.2, ..WALK };

    fn settings(looks: usize, periodic: bool) -> TrackerSettings {
        TrackerSettings { periodic, ..TrackerSettings::for_looks(looks as f64, 1.0) }
    }

    impl Pattern {
        fn angle(&self, frame: usize) -> f64 {
            core::f64::consts::TAU * frame as f64 / self.period
        }

        /// Standard deviation of the last phase against the first at the bound, rad.
        fn bound(&self, looks: usize) -> f64 {
            let mut data = [[0.0; FRAMES * FRAMES]; 3];
            let [gamma, covariance, scratch] = &mut data;
            let mut gamma = Square::new(gamma, FRAMES);
            gamma.fill_with(|i, j| {
                let lag = i.abs_diff(j);
                let own = if i == j { self.noise } else { 0.0 };
                let falling = self.falling * libm::pow(self.rho, lag as f64);
                own + falling + self.staying + self.returning * libm::cos(self.angle(lag))
            });
            let mut covariance = Square::new(covariance, FRAMES);
            cramer_rao(&gamma, looks as f64, &mut covariance, &mut Square::new(scratch, FRAMES));
            libm::sqrt(reported_variance(&covariance, &[1.0; FRAMES], 1, FRAMES - 1))
        }

        /// The fields of one series.
        fn series<const LOOKS: usize>(
            self,
            seed: u64,
        ) -> impl FnMut(usize) -> [Complex<f64>; LOOKS] {
            let part = |number: u64, power: f64| {
                let field = Speckle::<LOOKS>::new(1000 * number + seed, 0.0).frame::<f64>(0.0, 0.0);
                field.map(|u| u * libm::sqrt(power))
            };
            let (still, cosine) = (part(1, self.staying), part(2, self.returning));
            let sine = part(3, self.returning);
            let mut walk = Speckle::<LOOKS>::new(seed, self.rho);
            move |frame| {
                let (sin, cos) = libm::sincos(self.angle(frame));
                let field = walk.frame::<f64>(0.0, self.noise / self.falling);
                core::array::from_fn(|p| {
                    let u = field[p] * libm::sqrt(self.falling) + still[p];
                    (u + cosine[p] * cos + sine[p] * sin) * Complex::from_polar(1.0, truth(frame))
                })
            }
        }

        /// Rms error of the last phase over the bound, and rms z-score of all.
        fn errors<const LOOKS: usize>(&self, name: &str, periodic: bool) -> (f64, f64) {
            let series = |seed| self.series::<LOOKS>(500 + seed);
            let (error, z) = testing::errors(settings(LOOKS, periodic), RUNS, series);
            let error = error / self.bound(LOOKS);
            std::println!(
                "{name:9} {LOOKS:4} looks, cosines {periodic:5}: {error:.3} of the bound, z {z:.3}"
            );
            (error, z)
        }
    }

    /// Decays alone lose more than half of what can be known; the standard error of an rms over 100 runs is 7 %.
    #[test]
    fn a_pattern_that_comes_back_is_followed() {
        let short = Pattern { period: 9.0, ..PULSE };
        let cases = [
            [false, true].map(|periodic| PULSE.errors::<100>("period 20", periodic)),
            [false, true].map(|periodic| PULSE.errors::<1000>("period 20", periodic)),
            [false, true].map(|periodic| short.errors::<100>("period 9", periodic)),
        ];
        for [without, with] in cases {
            assert!(with.0 < 2.0 && with.0 < 0.85 * without.0, "{with:?} {without:?}");
            assert!((0.75..1.15).contains(&with.1), "{with:?}");
        }
    }

    /// Chance and the distance of the decay rates do not pass for periods: errors change by less than 1 %.
    #[test]
    fn other_patterns_are_left_alone() {
        let cases = [
            ("walk", WALK),
            ("fast", Pattern { rho: 0.7346, ..WALK }),
            ("static", Pattern { falling: 0.8, staying: 0.2, ..WALK }),
            ("noise", Pattern { noise: 1.0, ..WALK }),
        ];
        for (name, pattern) in cases {
            let (without, with) =
                (pattern.errors::<100>(name, false), pattern.errors::<100>(name, true));
            assert!((with.0 / without.0 - 1.0).abs() < 0.01, "{with:?} {without:?}");
            assert!((with.1 / without.1 - 1.0).abs() < 0.01, "{with:?} {without:?}");
        }
    }

    /// The fit is of 21 unknowns there too; rounding moves phases by less than a hundredth of their errors.
    #[test]
    fn single_precision_follows_double_precision() {
        fn run<T: Real>(seed: u64) -> [f64; FRAMES] {
            let mut series = PULSE.series::<100>(seed);
            let mut tracker = FieldTracker::<T, 100, NODES>::new(settings(100, true)).unwrap();
            core::array::from_fn(|frame| {
                let number =
                    |u: Complex<f64>| Complex { re: T::from_f64(u.re), im: T::from_f64(u.im) };
                let field = series(frame).map(number);
                tracker.push(&field, frame as f64, |_| ()).unwrap().phase_rad.to_f64()
            })
        }
        for seed in 0..30 {
            let (double, single) = (run::<f64>(seed), run::<f32>(seed));
            let apart = double.iter().zip(single).map(|(a, b)| (a - b).abs());
            let worst = apart.fold(0.0, f64::max);
            assert!(worst < 1e-3, "seed {seed}: {worst}");
        }
    }

    /// Switched off, they change no bit: as in a tracker that has none.
    #[test]
    fn without_cosines_the_decays_are_alone() {
        fn run<const M: usize>(periodic: bool) -> [u64; FRAMES] {
            let mut series = PULSE.series::<50>(1);
            let mut tracker =
                FieldTracker::<f64, 50, NODES, M>::new(settings(50, periodic)).unwrap();
            core::array::from_fn(|frame| {
                let newest = tracker.push(&series(frame), frame as f64, |_| ()).unwrap();
                newest.phase_rad.to_bits() ^ newest.sigma_rad.to_bits().rotate_left(32)
            })
        }
        assert_eq!(run::<COSINES>(false), run::<0>(false));
        assert_eq!(run::<0>(true), run::<0>(false));
        assert_ne!(run::<COSINES>(true), run::<0>(false));
    }
}
