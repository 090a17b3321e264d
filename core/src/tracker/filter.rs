//! The information filter: what is known of the phases, as a quadratic form that frames join and leave.
//!
//! With Q the weights of the pairs of nodes, gamma their coherences, Gamma the model, all in units of 1 / (2 L):
//!
//! ```text
//! score        g_i = b_i - sum over j of Q_ij Im(conj(z_i) gamma_ij z_j)
//! information  H_ij = Q_ij Gamma_ij + J_ij   for i != j,   H_ii = 1e-6 + ground_i - sum over j != i of H_ij
//! step         d = H^-1 g cut to -1..=1,   phi <- phi + d,   b <- b - J d
//! ```
//!
//! Pairs are used exactly, with their residual phasors, as long as both frames are in the window. Then they
//! are *frozen* into the quadratic prior (J, b): J_ij += Q_ij Gamma_ij, b_i -= Q_ij Im(conj(z_i) gamma_ij z_j), and
//! the frame is eliminated from that (Schur complement).
//!
//! J is kept as a network: its diagonal follows from the ground, ground_i = sum over j of J_ij, which only what holds
//! the common phase has. A common phase is held by little after many frames, and a diagonal in `f32`
//! would lose it.

use super::matrices::Symmetric;
use super::nodes::Aligned;
use crate::scalar::Real;
use crate::square::Square;
use crate::storage::Matrix;
use heapless::Vec;

/// Holds a node about which nothing is known where it is.
const TIE: f64 = 1e-6;

/// Where less is known of a node than this, nothing is known through it.
const NOTHING: f64 = 1e-9;

/// The same, as a share of its links: a node with links about which little is known is one where rounding or a changed
/// model has made J indefinite, and what divides by that grows without limit.
const LEAST_SHARE: f64 = 0.01;

/// A phase does not move further in one step, rad.
const LONGEST_STEP: f64 = 1.0;

#[derive(Clone, Debug)]
pub(super) struct Filter<T, const N: usize> {
    /// Q_ij; the diagonal is not used.
    pairs: Symmetric<T, N>,
    /// J_ij, and ground_i on the diagonal.
    prior: Symmetric<T, N>,
    /// b_i.
    pull: Vec<T, N>,
}

impl<T: Real, const N: usize> Filter<T, N> {
    pub(super) fn new() -> Self {
        Self { pairs: Symmetric::new(), prior: Symmetric::new(), pull: Vec::new() }
    }

    /// A node about which nothing is known.
    pub(super) fn add_node(&mut self) {
        // Cannot fail: the tracker makes room first.
        let _ = self.pull.push(T::zero());
    }

    /// Q += v v^T / d, for the newest node's regression on the others: v = (-a, 1), d its residual variance.
    pub(super) fn add_regression(&mut self, a: &[T], d: T) {
        let newest = a.len();
        for (i, &a_i) in a.iter().enumerate() {
            for (j, &a_j) in a.iter().enumerate().take(i) {
                self.pairs.add(i, j, a_i * a_j / d);
            }
            self.pairs.add(i, newest, -a_i / d);
        }
    }

    /// The prior (strength / 2) (sum of r_i phi_i - m)^2, whose pull at the present phases is `pull` r: holds the
    /// mean of some phases, or with negative strength no longer.
    pub(super) fn hold_mean(&mut self, shares: &[T], strength: T, pull: T) {
        let total = shares.iter().fold(T::zero(), |sum, &r| sum + r);
        for (i, &r_i) in shares.iter().enumerate() {
            self.prior.add(i, i, strength * r_i * total);
            for (j, &r_j) in shares.iter().enumerate().take(i) {
                self.prior.add(i, j, strength * r_i * r_j);
            }
            self.add_pull(i, pull * r_i);
        }
    }

    /// The prior (strength / 2) (phi_i - phi_j - m)^2, at rest at the present phases.
    pub(super) fn tie(&mut self, i: usize, j: usize, strength: T) {
        self.prior.add(i, j, -strength);
    }

    /// One step of scoring with the model `gamma`; returns the steps, and the variance of the newest node
    /// times 2 L.
    pub(super) fn step(
        &mut self,
        gamma: &Square<'_, T>,
        aligned: &Aligned<'_, T, N>,
    ) -> (Vec<T, N>, T) {
        let mut steps = self.pull.clone();
        each_pair(&self.pairs, self.pull.len(), |i, j, q| {
            add_residual(&mut steps, i, j, q * aligned.residual(i, j));
        });
        let variance = self.with_information(gamma, |information| {
            information.solve_factored(&mut steps);
            let last = information.order().saturating_sub(1);
            T::one() / information.at(last, last)
        });
        let limit = T::from_f64(LONGEST_STEP);
        for step in &mut steps {
            *step = step.max(-limit).min(limit);
        }
        self.follow(&steps);
        (steps, variance)
    }

    /// b <- b - J d.
    fn follow(&mut self, steps: &[T]) {
        for (i, &own) in steps.iter().enumerate() {
            let mut change = self.prior.at(i, i) * own;
            for (&j_ij, &other) in self.prior.row(i).iter().zip(steps) {
                change += j_ij * (other - own);
            }
            self.add_pull(i, -change);
        }
    }

    /// Variance of node k times 2 L.
    pub(super) fn variance(&self, gamma: &Square<'_, T>, k: usize) -> T {
        let mut column = [T::zero(); N];
        if let Some(place) = column.get_mut(k) {
            *place = T::one();
        }
        self.with_information(gamma, |information| information.solve_factored(&mut column));
        column.get(k).copied().unwrap_or(T::zero()).max(T::zero())
    }

    /// Move all pairs of the nodes in `frozen` into the prior.
    pub(super) fn freeze(
        &mut self,
        frozen: impl Fn(usize) -> bool,
        gamma: &Square<'_, T>,
        aligned: &Aligned<'_, T, N>,
    ) {
        let Self { pairs, prior, pull } = self;
        let chosen = |i: usize, j: usize| frozen(i) || frozen(j);
        let nodes = pull.len();
        each_pair(pairs, nodes, |i, j, q| {
            if chosen(i, j) {
                prior.add(i, j, q * gamma.at(i, j));
                add_residual(pull, i, j, q * aligned.residual(i, j));
            }
        });
        for i in 0..nodes {
            for j in (0..i).filter(|&j| chosen(i, j)) {
                pairs.set(i, j, T::zero());
            }
        }
    }

    /// Eliminate node k, whose pairs are frozen: the others know of each other what they knew through it.
    pub(super) fn eliminate(&mut self, k: usize) {
        let links = self.prior.row(k).iter().enumerate().filter(|&(j, _)| j != k);
        let conductance = links.fold(T::zero(), |sum, (_, &link)| sum + link);
        self.eliminate_with(k, self.prior.at(k, k) - conductance);
    }

    /// [`Self::eliminate`] with J_kk given. For a direction of several nodes the ground is J applied to the common phase.
    fn eliminate_with(&mut self, k: usize, pivot: T) {
        let (ground, pull) = (self.prior.at(k, k), self.pull.get(k).copied().unwrap_or(T::zero()));
        let links = self.prior.row(k).iter().enumerate().filter(|&(j, _)| j != k);
        let links = links.fold(T::zero(), |sum, (_, link)| sum + link.abs());
        let least = (links * T::from_f64(LEAST_SHARE)).max(T::from_f64(NOTHING));
        let scale = if pivot > least { T::one() / pivot } else { T::zero() };
        let nodes = self.pull.len();
        for i in (0..nodes).filter(|&i| i != k) {
            let share = self.prior.at(i, k) * scale;
            self.prior.add(i, i, -(share * ground));
            self.add_pull(i, -(share * pull));
            for j in (0..i).filter(|&j| j != k) {
                self.prior.add(i, j, -(share * self.prior.at(k, j)));
            }
        }
        self.prior.remove(k);
        self.pairs.remove(k);
        if k < self.pull.len() {
            self.pull.remove(k);
        }
    }

    /// Nodes 0 and 1, whose pairs are frozen, become their mean (1 - beta) phi_0 + beta phi_1; what is known of
    /// the difference phi_1 - phi_0 is eliminated.
    ///
    /// With phi_0 = mean - beta d and phi_1 = mean + (1 - beta) d, J becomes V^T J V and b becomes V^T b.
    pub(super) fn merge(&mut self, beta: T) {
        let (first, second) = (-beta, T::one() - beta);
        let mix = |zeroth: T, first_: T| first.mul_add(zeroth, second * first_);
        let pivot = self.pivot_of_difference(first, second);
        let (ground_0, ground_1) = (self.prior.at(0, 0), self.prior.at(1, 1));
        let ground = mix(ground_0, ground_1);
        let mut rest = T::zero();
        for j in 2..self.pull.len() {
            let (link_0, link_1) = (self.prior.at(0, j), self.prior.at(1, j));
            let link = mix(link_0, link_1);
            rest += link;
            self.prior.set(0, j, link_0 + link_1);
            self.prior.set(1, j, link);
        }
        self.prior.set(0, 0, ground_0 + ground_1);
        self.prior.set(1, 1, ground);
        self.prior.set(0, 1, ground - rest);
        if let [pull_0, pull_1, ..] = &mut *self.pull {
            (*pull_0, *pull_1) = (*pull_0 + *pull_1, mix(*pull_0, *pull_1));
        }
        self.eliminate_with(1, pivot);
    }

    /// J along d with phi_0 = `first` d and phi_1 = `second` d: the links between both stretch by d, those to others by
    /// their end's share.
    fn pivot_of_difference(&self, first: T, second: T) -> T {
        let mut pivot = -self.prior.at(0, 1);
        for (k, share) in [(0, first), (1, second)] {
            let mut own = self.prior.at(k, k);
            for &link in self.prior.row(k).iter().skip(2) {
                own += -link;
            }
            pivot += share * share * own;
        }
        pivot
    }

    fn add_pull(&mut self, i: usize, value: T) {
        add(&mut self.pull, i, value);
    }

    /// Work with the factor L D L^T of H.
    fn with_information<R>(
        &self,
        gamma: &Square<'_, T>,
        work: impl FnOnce(&Square<'_, T>) -> R,
    ) -> R {
        let mut data = Matrix::<T, N, N>::filled(T::zero());
        let mut information = Square::with_stride(data.as_mut(), self.pull.len(), N);
        for i in 0..self.pull.len() {
            let known = self.pairs.row(i).iter().zip(self.prior.row(i)).zip(gamma.row(i));
            let mut links = T::zero();
            let places = information.row_mut(i).iter_mut().zip(known).enumerate();
            for (_, (place, ((&q, &prior), &gamma))) in places.filter(|&(j, _)| j != i) {
                *place = q.mul_add(gamma, prior);
                links += *place;
            }
            information.set(i, i, self.prior.at(i, i) + T::from_f64(TIE) - links);
        }
        information.factor();
        work(&information)
    }
}

/// Every pair i > j of the first `count` nodes, with its Q_ij.
fn each_pair<T: Real, const N: usize>(
    pairs: &Symmetric<T, N>,
    count: usize,
    mut each: impl FnMut(usize, usize, T),
) {
    for i in 0..count {
        for (j, &q) in pairs.row(i).iter().enumerate().take(i) {
            each(i, j, q);
        }
    }
}

/// A pair pulls its two phases in opposite directions.
fn add_residual<T: Real>(pull: &mut [T], i: usize, j: usize, residual: T) {
    add(pull, i, -residual);
    add(pull, j, residual);
}

fn add<T: Real>(values: &mut [T], i: usize, value: T) {
    if let Some(place) = values.get_mut(i) {
        *place += value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// J in full, from the network.
    fn full(filter: &Filter<f64, 5>) -> [[f64; 5]; 5] {
        let n = filter.pull.len();
        core::array::from_fn(|i| {
            core::array::from_fn(|j| match (i, j) {
                _ if i >= n || j >= n => 0.0,
                _ if i != j => filter.prior.at(i, j),
                _ => {
                    let links: f64 =
                        (0..n).filter(|&k| k != i).map(|k| filter.prior.at(i, k)).sum();
                    filter.prior.at(i, i) - links
                }
            })
        })
    }

    /// Four nodes, the first held, the others tied to it and to each other.
    fn example() -> Filter<f64, 5> {
        let mut filter = Filter::new();
        for _ in 0..4 {
            filter.add_node();
        }
        filter.hold_mean(&[0.7, 0.3], 20.0, 0.4);
        for i in 1..4 {
            for j in 0..i {
                filter.tie(i, j, (1 + i + 3 * j) as f64);
            }
            filter.add_pull(i, 0.3 * i as f64);
        }
        filter
    }

    #[test]
    fn a_held_mean_is_a_rank_one_form() {
        let mut filter = Filter::<f64, 5>::new();
        filter.add_node();
        filter.add_node();
        filter.hold_mean(&[0.75, 0.25], 16.0, 0.0);
        let j = full(&filter);
        assert_eq!((j[0][0], j[0][1], j[1][1]), (9.0, 3.0, 1.0));
        filter.hold_mean(&[0.75, 0.25], -16.0, 0.0);
        assert_eq!(full(&filter), [[0.0; 5]; 5]);
    }

    #[test]
    fn elimination_is_the_schur_complement() {
        let mut filter = example();
        let (before, pull) = (full(&filter), filter.pull.clone());
        filter.eliminate(1);
        let after = full(&filter);
        for (i, &from) in [0, 2, 3].iter().enumerate() {
            let share = before[from][1] / before[1][1];
            assert!((filter.pull[i] - (pull[from] - share * pull[1])).abs() < 1e-13);
            for (j, &to) in [0, 2, 3].iter().enumerate() {
                let expected = before[from][to] - share * before[1][to];
                assert!((after[i][j] - expected).abs() < 1e-13, "({i}, {j})");
            }
        }
    }

    #[test]
    fn merging_is_a_change_of_variables_and_an_elimination() {
        let (mut filter, beta) = (example(), 0.2);
        let (before, pull) = (full(&filter), filter.pull.clone());
        filter.merge(beta);
        let after = full(&filter);
        // Columns: mean, d, nodes 2 and 3.
        let v = [
            [1.0, -beta, 0.0, 0.0],
            [1.0, 1.0 - beta, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ];
        let form = |a: usize, b: usize| -> f64 {
            (0..4).map(|i| (0..4).map(|j| v[i][a] * before[i][j] * v[j][b]).sum::<f64>()).sum()
        };
        let lean = |a: usize| -> f64 { (0..4).map(|i| v[i][a] * pull[i]).sum() };
        for (i, &from) in [0, 2, 3].iter().enumerate() {
            let share = form(from, 1) / form(1, 1);
            assert!((filter.pull[i] - (lean(from) - share * lean(1))).abs() < 1e-13);
            for (j, &to) in [0, 2, 3].iter().enumerate() {
                let expected = form(from, to) - share * form(1, to);
                assert!((after[i][j] - expected).abs() < 1e-13, "({i}, {j})");
            }
        }
    }
}
