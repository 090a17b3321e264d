//! How exactly a phase can be known at all, and how exactly an estimate that uses a model knows it.

use crate::scalar::Real;
use crate::square::{Square, dot};

/// Conductance, beside the information, between neighbouring frames: a frame without any information is
/// tied to its neighbours, so that matrices can be inverted.
const TIE: f64 = 1e-6;

/// Coherence below which there is none to divide between layers.
const LEAST: f64 = 1e-9;

/// Fisher information of the phases per 2 looks: F = Laplacian with the off-diagonal elements
/// Q_ij Gamma_ij, Q = Gamma^-1 (its rows sum to 0: only phase differences are seen).
///
/// For L independent looks the Cramer-Rao bound is var(e^T phi) >= e^T (2 L F)^+ e
/// (Guarnieri & Tebaldini, IEEE Signal Process. Lett. 14, 2007; X = 2 L (Gamma o Gamma^-1 - 1)).
pub fn information<T: Real>(
    gamma: &Square<'_, T>,
    precision: &Square<'_, T>,
    out: &mut Square<'_, T>,
) {
    out.fill_with(|i, j| precision.at(i, j) * gamma.at(i, j));
    out.make_laplacian();
    tie_neighbours(out, T::from_f64(TIE));
}

/// Add a conductance between each frame and the next.
pub(crate) fn tie_neighbours<T: Real>(laplacian: &mut Square<'_, T>, conductance: T) {
    for i in 1..laplacian.order() {
        for (a, b, sign) in [(i, i, 1), (i - 1, i - 1, 1), (i, i - 1, -1), (i - 1, i, -1)] {
            let add = if sign > 0 { conductance } else { -conductance };
            let value = laplacian.at(a, b) + add;
            laplacian.set(a, b, value);
        }
    }
}

/// Replace a Laplacian by (F + 1 1^T / N)^-1, which gives the same variance of every difference as its
/// pseudo-inverse.
pub fn invert_laplacian<T: Real>(laplacian: &mut Square<'_, T>) {
    let n = laplacian.order();
    let share = T::from_f64(1.0 / n.max(1) as f64);
    for i in 0..n {
        for place in laplacian.row_mut(i) {
            *place += share;
        }
    }
    laplacian.invert();
}

/// Cramer-Rao bound: `covariance` becomes that of the best possible phases, rad^2, up to a constant
/// common to all (only differences have a meaning), for a coherence matrix Gamma (1 on the
/// diagonal, positive definite) and `looks` independent looks. `scratch` as large as `gamma`.
pub fn cramer_rao<T: Real>(
    gamma: &Square<'_, T>,
    looks: f64,
    covariance: &mut Square<'_, T>,
    scratch: &mut Square<'_, T>,
) {
    scratch.copy_from(gamma);
    scratch.invert();
    information(gamma, scratch, covariance);
    invert_laplacian(covariance);
    scale(covariance, 0.5 / looks);
}

/// Multiply every element.
pub(crate) fn scale<T: Real>(matrix: &mut Square<'_, T>, factor: f64) {
    let factor = T::from_f64(factor);
    for i in 0..matrix.order() {
        for place in matrix.row_mut(i) {
            *place = *place * factor;
        }
    }
}

/// Covariance of the phases that solve the score equations of the precision Q when the coherence really is R
/// (the aligned sample coherence): A^-1 B A^-1 with
/// A = Laplacian of 2 Q o R and B = (2/L) (R o (Q R Q) - (R Q) o (Q R)), rad^2 up to a constant.
///
/// It stays honest where the model is wrong. The result is in `out`; `a` and `b` are scratch. All
/// have the same order.
pub fn sandwich<T: Real>(
    precision: &Square<'_, T>,
    aligned: &Square<'_, T>,
    looks: f64,
    out: &mut Square<'_, T>,
    a: &mut Square<'_, T>,
    b: &mut Square<'_, T>,
) {
    b.fill_with(|_, _| T::zero());
    add_score_covariance(precision, aligned, looks, b, a, out);
    enclose(precision, aligned, out, a, b);
}

/// Share of the first of two layers in the decay of the product of their coherences, from their squared
/// coherences in neighbouring frames: Gamma_1 = Gamma^share with share = ln gamma_1^2 / (ln gamma_1^2 + ln gamma_2^2).
#[must_use]
pub fn share_of_layers(neighbours: [f64; 2]) -> f64 {
    // Beyond, chance and rounding decide.
    let [first, second] = neighbours.map(|square| -libm::log(square.clamp(1e-3, 1.0 - 1e-4)));
    first / (first + second)
}

/// Covariance of the phases of the difference of two layers, linked with the precision Q of Gamma from the products of
/// their mean cross-spectra in sub-windows of l looks: A^-1 B A^-1 with A = Laplacian of 2 Q o Gamma and
///
/// B = B(Q o Gamma_2, Gamma_1, L) + B(Q o Gamma_1, Gamma_2, L) + B(Q, Gamma, L l),
/// B(P, R, L) = (2/L) (R o (P R P) - (R P) o (P R)):
///
/// the noise of each layer, seen through the coherence of the other, and the product of both noises. Gamma =
/// Gamma_1 o Gamma_2 is divided between the layers as Gamma_1 = Gamma^share, Gamma_2 = Gamma^(1 - share). The result is
/// in `out`; the rest is scratch. All have the same order.
pub fn layered_sandwich<T: Real>(
    precision: &Square<'_, T>,
    gamma: &Square<'_, T>,
    share: f64,
    [looks, window_looks]: [f64; 2],
    out: &mut Square<'_, T>,
    [a, b, seen, own]: [&mut Square<'_, T>; 4],
) {
    let power = |i: usize, j: usize, exponent: f64| {
        let positive = gamma.at(i, j).max(T::from_f64(LEAST));
        (positive.ln() * T::from_f64(exponent)).exp()
    };
    b.fill_with(|_, _| T::zero());
    for (own_share, other_share) in [(share, 1.0 - share), (1.0 - share, share)] {
        own.fill_with(|i, j| power(i, j, own_share));
        seen.fill_with(|i, j| precision.at(i, j) * power(i, j, other_share));
        add_score_covariance(seen, own, looks, b, a, out);
    }
    add_score_covariance(precision, gamma, looks * window_looks, b, a, out);
    enclose(precision, gamma, out, a, b);
}

/// sum <- sum + (2/L) (R o (P R P) - (R P) o (P R)); `a` and `c` are scratch.
fn add_score_covariance<T: Real>(
    precision: &Square<'_, T>,
    coherence: &Square<'_, T>,
    looks: f64,
    sum: &mut Square<'_, T>,
    a: &mut Square<'_, T>,
    c: &mut Square<'_, T>,
) {
    a.product(precision, coherence); // P R; R P is its transpose
    c.product(a, precision); // P R P
    let share = T::from_f64(2.0 / looks);
    for i in 0..sum.order() {
        for j in 0..sum.order() {
            let add = coherence.at(i, j) * c.at(i, j) - a.at(j, i) * a.at(i, j);
            let value = sum.at(i, j) + share * add;
            sum.set(i, j, value);
        }
    }
}

/// out = A^-1 B A^-1 with A = Laplacian of 2 Q o R; `a` and `b`, which holds B, are scratch afterwards.
fn enclose<T: Real>(
    precision: &Square<'_, T>,
    coherence: &Square<'_, T>,
    out: &mut Square<'_, T>,
    a: &mut Square<'_, T>,
    b: &mut Square<'_, T>,
) {
    let two = T::from_f64(2.0);
    a.fill_with(|i, j| two * precision.at(i, j) * coherence.at(i, j));
    a.make_laplacian();
    tie_neighbours(a, T::from_f64(2.0 * TIE));
    invert_laplacian(a);
    out.product(a, b); // A^-1 B, b being symmetric
    b.copy_from(out);
    out.product(b, a);
}

/// Variance of phi_i minus the mean phase of the reference frames: with v = e_i - r, r_j = 1/n for the n
/// usable reference frames, v^T S v. Infinite without any.
///
/// `usable` is 1 for frames that count, 0 for others.
#[must_use]
pub fn reported_variance<T: Real>(
    covariance: &Square<'_, T>,
    usable: &[T],
    reference_frames: usize,
    frame: usize,
) -> T {
    let references = usable.get(..reference_frames.min(usable.len())).unwrap_or(&[]);
    let count = references.iter().fold(T::zero(), |sum, &u| sum + u);
    if count <= T::zero() {
        return T::from_f64(f64::INFINITY);
    }
    let mean_with = |i: usize| dot(references, covariance.row(i)) / count;
    let mut within = T::zero();
    for (i, &u) in references.iter().enumerate() {
        within += u * mean_with(i) / count;
    }
    let variance = covariance.at(frame, frame) - T::from_f64(2.0) * mean_with(frame) + within;
    variance.max(T::zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 12;

    fn decay(rho: f64, data: &mut [f64]) -> Square<'_, f64> {
        let mut gamma = Square::new(data, N);
        gamma.fill_with(|i, j| libm::pow(rho, i.abs_diff(j) as f64));
        gamma
    }

    /// For a random walk the bound is (N - 1)(1 - rho^2) / (2 L rho^2), exactly.
    #[test]
    fn random_walk_has_the_closed_form() {
        let (mut x, mut y, mut z) = ([0.0; N * N], [0.0; N * N], [0.0; N * N]);
        for rho in [0.9258, 0.7346] {
            let gamma = decay(rho, &mut x);
            let (mut bound, mut scratch) = (Square::new(&mut y, N), Square::new(&mut z, N));
            cramer_rao(&gamma, 300.0, &mut bound, &mut scratch);
            let mut usable = [0.0; N];
            usable[0] = 1.0;
            for frame in 0..N {
                let expected = frame as f64 * (1.0 - rho * rho) / (600.0 * rho * rho);
                let got = reported_variance(&bound, &usable, 5, frame);
                assert!((got - expected).abs() < 2e-5 * expected + 1e-12, "{frame}: {got}");
            }
        }
    }

    /// Where the model is true the sandwich is the bound.
    #[test]
    fn sandwich_of_the_truth_is_the_bound() {
        let mut data = [[0.0; N * N]; 6];
        let [x, y, z, u, v, w] = &mut data;
        let gamma = decay(0.8, x);
        let (mut bound, mut precision) = (Square::new(y, N), Square::new(z, N));
        cramer_rao(&gamma, 50.0, &mut bound, &mut precision);
        let (mut out, mut a, mut b) = (Square::new(u, N), Square::new(v, N), Square::new(w, N));
        sandwich(&precision, &gamma, 50.0, &mut out, &mut a, &mut b);
        let usable = [1.0; N];
        for frame in 0..N {
            let expected = reported_variance(&bound, &usable, 5, frame);
            let got = reported_variance(&out, &usable, 5, frame);
            assert!((got - expected).abs() < 1e-5 * expected, "{frame}: {got} of {expected}");
        }
    }

    /// A second layer that stays the same adds nothing; two alike have the variance of both, and a little more because
    /// the product of their coherences is not that of Gaussian fields; products of noises add to it.
    #[test]
    fn layers_add_up() {
        let mut data = [[0.0; N * N]; 8];
        let [g, q, bound, out, rest @ ..] = &mut data;
        let [mut a, mut b, mut c, mut d] = rest.each_mut().map(|data| Square::new(data, N));
        let (mut out, mut bound, mut q) =
            (Square::new(out, N), Square::new(bound, N), Square::new(q, N));
        let usable = [1.0; N];
        let mut over = |rho: f64, of_one: f64, share: f64, window: f64| {
            let gamma = decay(of_one, g);
            cramer_rao(&gamma, 50.0, &mut bound, &mut q);
            let one = reported_variance(&bound, &usable, 1, N - 1);
            let gamma = decay(rho, g);
            q.copy_from(&gamma);
            q.invert();
            let scratch = [&mut a, &mut b, &mut c, &mut d];
            layered_sandwich(&q, &gamma, share, [50.0, window], &mut out, scratch);
            reported_variance(&out, &usable, 1, N - 1) / one
        };
        let still = over(0.95, 0.95, 1.0, 1e12);
        assert!((still - 1.0).abs() < 1e-5, "{still}");
        let alike = over(0.95 * 0.95, 0.95, 0.5, 1e12);
        assert!((1.999..2.02).contains(&alike), "{alike}");
        let small_windows = over(0.95 * 0.95, 0.95, 0.5, 4.0);
        assert!(small_windows > alike + 0.01, "{small_windows}");
    }

    #[test]
    fn nothing_to_refer_to_means_infinity() {
        let mut x = [0.0; N * N];
        let gamma = decay(0.8, &mut x);
        assert_eq!(reported_variance(&gamma, &[0.0; N], 5, 3), f64::INFINITY);
    }
}
