//! Do linked phases close? A goodness of fit from the closure phases of a series.
//!
//! The model says that phase and coherence are separate: ⟨gamma_ij⟩ = Gamma_ij exp(i (phi_i - phi_j)), so that the
//! phase of a frame is the same whichever partner tells it, and around any triangle of frames the phases sum to 0.
//! Where populations of scatterers move differently this fails: pairs that are still coherent tell another phase
//! than those that hardly are. With r_ij = conj(z_i) gamma_ij z_j of the linked phases (De Zan, Zonno & Lopez-Dekker,
//! IEEE TGRS 53, 2015, for closure phases; Guarnieri & Tebaldini, IEEE TGRS 46, 2008, for the likelihood):
//!
//! ```text
//! Y_ij = Im r_ij             mean 0, cov(Y_ij, Y_kl) = (Gamma_ik Gamma_jl - Gamma_il Gamma_jk) / (2 L)
//! T    = L tr(Q Y Q Y^T)     chi^2 with (N-1)(N-2)/2 degrees of freedom, one for each independent closure phase
//! f    = tr(Q R) / N         R_ij = Re r_ij: 1 where Gamma is right, and errors of Gamma scale T with its square
//! misfit = T / (f^2 (N-1)(N-2)/2)
//! ```
//!
//! `misfit` is 1 for noise alone and as exact as L is known. The test asks the question of the first paragraph and
//! needs no L: a phase that depends on the coherence of the pair, to first order
//!
//! ```text
//! arg ⟨gamma_ij⟩ = (phi_i - phi_j) + (psi_i - psi_j) ln Gamma_ij
//! E_k  = D_ij (b_i - b_j) - Gamma_ij (h_i - h_j)    D = Gamma ln Gamma, b_i = cos(pi k (i + 1/2) / N), k = 1 ... 4
//! W_k  = Q E_k Q                                     orthonormal: sum of W_k o E_l = L delta_kl
//! x_k  = sum of W_k o Y                              independent, standard normal
//! q    = sum of x_k^2                                chi^2 with as many degrees of freedom as k
//! ```
//!
//! with h such that E_k is orthogonal to all changes of the phases (information F of `bound`: F h = A b, A the
//! Laplacian of Q o D). Four slow psi gather in a few numbers what T spreads over thousands. The series' own closure,
//! (T - q) / f^2 over its degrees of freedom, scales q: q over it is distributed as F.

use crate::bound::{information, invert_laplacian};
use crate::linking::RANDOM;
use crate::model::take;
use crate::scalar::Real;
use crate::square::{Square, dot};

/// Slow courses of psi that are looked for.
pub const MODES: usize = 4;

/// Least share of the expected noise that counts as noise: what is below is rounding, or a series without noise,
/// whose closure means nothing.
const LEAST_NOISE: f64 = 0.1;

/// Degrees of freedom of a noise that is known.
pub const KNOWN: f64 = 1e9;

/// How well a series closes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure {
    /// Variance of the closure over that of the noise, 1 for noise alone; NaN with fewer than three usable frames.
    pub misfit: f64,
    /// Probability that a series for which the model holds closes as badly; NaN with fewer than four usable frames, and
    /// where all pairs are equally coherent.
    pub p: f64,
}

/// Where [`Contrasts`] are computed, for N frames.
#[derive(Debug)]
pub struct Room<'a, T> {
    /// N x N each; what they hold does not matter.
    pub squares: [Square<'a, T>; 5],
    /// At least [`Room::reals`] numbers.
    pub reals: &'a mut [T],
}

impl<T> Room<'_, T> {
    /// How many numbers `frames` frames need beside the squares.
    #[must_use]
    pub const fn reals(frames: usize) -> usize {
        frames * frames + (2 * MODES + 1) * frames
    }
}

/// The contrasts x_k for one coherence matrix.
#[derive(Debug)]
pub struct Contrasts<'a, T> {
    /// 1 for frames that count, 0 for others.
    usable: &'a [T],
    looks: f64,
    /// Gamma and Q of the frames that count; the others have no coherence with any.
    gamma: Square<'a, T>,
    precision: Square<'a, T>,
    /// D.
    slope: Square<'a, T>,
    /// (F + 1 1^T / N)^-1, then Y.
    inverse: Square<'a, T>,
    scratch: [Square<'a, T>; 2],
    /// b_k, then h_k, of each k.
    courses: &'a mut [T],
    modes: usize,
}

impl<'a, T: Real> Contrasts<'a, T> {
    /// For the model's Gamma, the frames that count (1, and 0 for others), and L looks.
    pub fn new(model: &Square<'_, T>, usable: &'a [T], looks: f64, room: Room<'a, T>) -> Self {
        let n = model.order();
        let mut reals = room.reals;
        let [gamma, precision, inverse, a, b] = room.squares;
        let slope = Square::new(take(&mut reals, n * n), n);
        let courses = take(&mut reals, 2 * MODES * n);
        let scratch = [a, b];
        let mut contrasts =
            Self { usable, looks, gamma, precision, slope, inverse, scratch, courses, modes: 0 };
        contrasts.fill_squares(model);
        contrasts.fill_courses(reals);
        while contrasts.modes < MODES && contrasts.add_mode() {
            contrasts.modes += 1;
        }
        // The tail of an even number is a finite sum.
        contrasts.modes -= contrasts.modes % 2;
        contrasts
    }

    /// How many x_k there are: [`MODES`], or fewer (an even number) where their information is less than of a random phase.
    #[must_use]
    pub const fn modes(&self) -> usize {
        self.modes
    }

    /// Do both frames of the pair count?
    fn counts(&self, i: usize, j: usize) -> bool {
        let usable = |i: usize| self.usable.get(i).is_some_and(|&u| u > T::zero());
        usable(i) && usable(j)
    }

    /// Gamma, Q, F^-1, D, and the Laplacian A in the scratch.
    fn fill_squares(&mut self, model: &Square<'_, T>) {
        for i in 0..model.order() {
            for (j, &g) in model.row(i).iter().enumerate() {
                let own = if i == j || self.counts(i, j) { g } else { T::zero() };
                let known = i != j && own != T::zero();
                self.gamma.set(i, j, own);
                self.slope.set(i, j, if known { own * own.abs().ln() } else { T::zero() });
            }
        }
        let Self { gamma, precision, slope, inverse, scratch: [laplacian, _], .. } = self;
        precision.copy_from(gamma);
        precision.invert();
        information(gamma, precision, inverse);
        invert_laplacian(inverse);
        laplacian.fill_with(|i, j| precision.at(i, j) * slope.at(i, j));
        laplacian.make_laplacian();
    }

    /// b_k as cosines and h_k = F^-1 A b_k.
    fn fill_courses(&mut self, pull: &mut [T]) {
        let n = self.gamma.order();
        let pull = pull.get_mut(..n).unwrap_or(&mut []);
        for (k, both) in self.courses.chunks_exact_mut(2 * n.max(1)).enumerate() {
            let (b, h) = both.split_at_mut(n);
            let turn = core::f64::consts::PI * (k + 1) as f64 / n as f64;
            for (i, place) in b.iter_mut().enumerate() {
                *place = T::from_f64(libm::cos(turn * (i as f64 + 0.5)));
            }
            let [laplacian, _] = &self.scratch;
            for (i, place) in pull.iter_mut().enumerate() {
                *place = dot(laplacian.row(i), b);
            }
            for (i, place) in h.iter_mut().enumerate() {
                *place = dot(self.inverse.row(i), pull);
            }
        }
    }

    /// Make the mode after the last orthogonal to all before and normal (Gram & Schmidt); false where too little is
    /// known of it.
    fn add_mode(&mut self) -> bool {
        let (k, n) = (self.modes, self.gamma.order());
        self.fill_weights(k);
        let share = T::from_f64(1.0 / self.looks);
        let mut rest = self.contrast(k) * share;
        for l in 0..k {
            let common = self.contrast(l) * share;
            rest = rest - common * common;
            let (before, own) = self.courses.split_at_mut(2 * k * n);
            let known = before.get(2 * l * n..).unwrap_or(&[]);
            for (place, &x) in own.iter_mut().zip(known).take(2 * n) {
                *place = *place - common * x;
            }
        }
        // L^2 rest is the information on the amplitude of psi.
        if rest * T::from_f64(self.looks * self.looks) > T::from_f64(RANDOM) {
            let scale = T::one() / rest.sqrt();
            for place in self.courses.iter_mut().skip(2 * k * n).take(2 * n) {
                *place = *place * scale;
            }
            return true;
        }
        false
    }

    /// W_k = Q E_k Q.
    #[must_use]
    pub fn weights(&mut self, k: usize) -> &Square<'a, T> {
        self.fill_weights(k);
        let [weights, _] = &self.scratch;
        weights
    }

    /// W_k into the first scratch.
    fn fill_weights(&mut self, k: usize) {
        let Self { gamma, slope, scratch: [transposed, _], courses, .. } = self;
        let course = course_of(courses, k, gamma.order());
        for i in 0..gamma.order() {
            let row = transposed.row_mut(i).iter_mut();
            for (place, e) in row.zip(tangent(slope.row(i), gamma.row(i), course, i)) {
                *place = -e;
            }
        }
        let Self { precision, scratch: [a, b], .. } = self;
        b.product(precision, a);
        a.product(b, precision);
    }

    /// Sum of E_k o M, M in the first scratch.
    fn contrast(&self, k: usize) -> T {
        let Self { gamma, slope, scratch: [m, _], courses, .. } = self;
        let course = course_of(courses, k, gamma.order());
        let mut sum = T::zero();
        for i in 0..m.order() {
            let row = tangent(slope.row(i), gamma.row(i), course, i);
            for (e, &x) in row.zip(m.row(i)) {
                sum = e.mul_add(x, sum);
            }
        }
        sum
    }

    /// f: how the aligned coherences R fit Gamma, over the frames that count.
    fn fit(&self, aligned: impl Fn(usize, usize) -> T) -> f64 {
        let n = self.gamma.order();
        let (mut sum, mut frames) = (T::zero(), 0.0);
        for i in (0..n).filter(|&i| self.counts(i, i)) {
            frames += 1.0;
            for (j, &q) in self.precision.row(i).iter().enumerate() {
                sum = q.mul_add(aligned(i, j), sum);
            }
        }
        sum.to_f64() / frames
    }

    /// Misfit and p, from the residuals Y_ij and the aligned coherences R_ij of the linked phases.
    pub fn test(
        mut self,
        residual: impl Fn(usize, usize) -> T,
        aligned: impl Fn(usize, usize) -> T,
    ) -> Closure {
        let n = self.gamma.order();
        for i in 0..n {
            for j in 0..n {
                let counts = i != j && self.counts(i, j);
                self.inverse.set(i, j, if counts { residual(i, j) } else { T::zero() });
            }
        }
        let Self { precision, inverse: residuals, scratch: [a, b], .. } = &mut self;
        b.product(precision, residuals);
        // Q Y^T Q, and Y^T = -Y.
        a.product(b, precision);
        let total: f64 = (0..n).map(|i| dot(a.row(i), residuals.row(i)).to_f64()).sum();
        let squares = (0..self.modes).map(|k| self.contrast(k).to_f64());
        let slow = squares.fold(0.0, |sum, x| sum + x * x);
        let frames = (0..n).filter(|&i| self.counts(i, i)).count() as f64;
        let freedom = (frames - 1.0) * (frames - 2.0) / 2.0;
        self.closure(-self.looks * total, slow, freedom, self.fit(aligned))
    }

    /// From T, q, (N-1)(N-2)/2 and f.
    fn closure(&self, total: f64, slow: f64, freedom: f64, fit: f64) -> Closure {
        let rest = freedom - self.modes as f64;
        let noise = |sum: f64, freedom: f64| {
            if freedom > 0.0 { sum / (fit * fit * freedom) } else { f64::NAN }
        };
        let scale = noise(total - slow, rest);
        let p = tail(slow / scale.max(LEAST_NOISE), self.modes, rest);
        Closure { misfit: noise(total, freedom), p: if scale.is_nan() { f64::NAN } else { p } }
    }
}

/// b_k and h_k.
fn course_of<T>(courses: &[T], k: usize, n: usize) -> (&[T], &[T]) {
    let both = courses.get(2 * k * n..2 * (k + 1) * n).unwrap_or(&[]);
    both.split_at(n.min(both.len()))
}

/// Row i of E_k from those of D and Gamma.
fn tangent<'a, T: Real>(
    slope: &'a [T],
    gamma: &'a [T],
    (b, h): (&'a [T], &'a [T]),
    i: usize,
) -> impl Iterator<Item = T> + 'a {
    let own = |x: &[T]| x.get(i).copied().unwrap_or(T::zero());
    let (b_i, h_i) = (own(b), own(h));
    let pairs = slope.iter().zip(gamma).zip(b.iter().zip(h));
    pairs.map(move |((&d, &g), (&b_j, &h_j))| d * (b_i - b_j) - g * (h_i - h_j))
}

/// Probability that the sum of squares of `modes` (an even number) standard normal numbers, over a noise that is
/// known from `freedom` others, exceeds q: with x = freedom / (freedom + q)
///
/// x^(freedom/2) sum over j = 0 ... modes/2 - 1 of (1 - x)^j (freedom/2) (freedom/2 + 1) ... (freedom/2 + j - 1) / j!,
///
/// the tail of F, of chi^2 for [`KNOWN`] noise. NaN for no modes.
#[must_use]
pub fn tail(q: f64, modes: usize, freedom: f64) -> f64 {
    if modes == 0 {
        return f64::NAN;
    }
    let half = freedom / 2.0;
    let share = q / (freedom + q);
    let (mut sum, mut term) = (0.0, 1.0);
    for j in 0..modes / 2 {
        let j = j as f64;
        sum += term;
        term *= (half + j) / (j + 1.0) * share;
    }
    (libm::exp(-half * libm::log1p(q / freedom)) * sum).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 12;
    const LOOKS: f64 = 50.0;

    /// With the contrasts of a Gamma.
    fn with_contrasts(
        check: impl Fn(&mut Contrasts<'_, f64>, &Square<'_, f64>),
        gamma: impl Fn(usize, usize) -> f64,
        usable: &[f64; N],
    ) {
        let mut data = [[0.0; N * N]; 6];
        let [model, rest @ ..] = data.each_mut().map(|data| Square::new(data, N));
        let mut model = model;
        model.fill_with(gamma);
        let mut reals = [0.0; Room::<f64>::reals(N)];
        let room = Room { squares: rest, reals: &mut reals };
        check(&mut Contrasts::new(&model, usable, LOOKS, room), &model);
    }

    /// Frame 7 does not count.
    const USABLE: [f64; N] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0];

    fn decay(i: usize, j: usize) -> f64 {
        let tau = i.abs_diff(j) as f64;
        if i == j { 1.0 } else { 0.7 * libm::exp(-0.2 * tau) + 0.1 }
    }

    /// cov(x_k, x_l) from that of Y, element by element; no x_k sees a change of the phases, or a frame that does not
    /// count.
    #[test]
    fn contrasts_are_independent_and_see_no_phases() {
        let check = |contrasts: &mut Contrasts<'_, f64>, gamma: &Square<'_, f64>| {
            assert_eq!(contrasts.modes(), MODES);
            let weights: [[f64; N * N]; MODES] = core::array::from_fn(|k| {
                let weights = contrasts.weights(k);
                core::array::from_fn(|place| weights.at(place / N, place % N))
            });
            let pairs = || (0..N * N).map(|place| (place / N, place % N));
            let covariance = |k: usize, l: usize| -> f64 {
                let all = pairs().flat_map(|one| pairs().map(move |other| (one, other)));
                let term = |((i, j), (m, n)): ((usize, usize), (usize, usize))| {
                    let both = gamma.at(i, m) * gamma.at(j, n) - gamma.at(i, n) * gamma.at(j, m);
                    weights[k][i * N + j] * weights[l][m * N + n] * both
                };
                all.map(term).sum::<f64>() / (2.0 * LOOKS)
            };
            for (k, own) in weights.iter().enumerate() {
                for l in 0..MODES {
                    let error = covariance(k, l) - f64::from(u8::from(k == l));
                    // The tie of neighbours, 1e-6 of the information, keeps it from being exact.
                    assert!(error.abs() < 1e-4, "{k} {l}: {error}");
                }
                for frame in 0..N {
                    let row = |i: usize| own[frame * N + i] * gamma.at(frame, i);
                    let pull: f64 = (0..N).map(row).sum();
                    assert!(pull.abs() < 1e-4, "{k} {frame}: {pull}");
                    assert!(own[7 * N + frame].abs() < 1e-12);
                }
            }
        };
        with_contrasts(check, decay, &USABLE);
    }

    /// Nothing to compare.
    #[test]
    fn equal_coherences_tell_nothing() {
        with_contrasts(
            |contrasts, _| assert_eq!(contrasts.modes(), 0),
            |i, j| if i == j { 1.0 } else { 0.995 },
            &[1.0; N],
        );
    }

    /// Quantiles from tables.
    #[test]
    fn tails() {
        assert!((tail(9.4877, 4, KNOWN) - 0.05).abs() < 1e-5);
        assert!((tail(18.467, 4, KNOWN) - 0.001).abs() < 1e-5);
        assert!((tail(5.9915, 2, KNOWN) - 0.05).abs() < 1e-5);
        // F(4, 10) = 3.4780, F(4, 6) = 4.5337.
        assert!((tail(4.0 * 3.4780, 4, 10.0) - 0.05).abs() < 1e-5);
        assert!((tail(4.0 * 4.5337, 4, 6.0) - 0.05).abs() < 1e-5);
        assert_eq!(tail(0.0, 4, 6.0), 1.0);
        assert!(tail(1.0, 0, 6.0).is_nan());
    }
}
