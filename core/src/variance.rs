//! Standard deviation of the reported phase, against the mean of the reference frames.
//!
//! The solution is linear in the pairs' phases: the right-hand side of pair (t,s) is w^2 c, so a
//! pair of variance v puts a noise of variance q = w^4 v on the nodes t and s, with opposite signs.
//! With A the normal matrix and f the functional that is reported (newest phase minus mean of
//! the reference frames), var = f^T A^-1 Q A^-1 f, Q being the sum of all pairs' noise.
//!
//! Two forms of the same: [`NoiseStream`] carries Q through the elimination, frame by frame, in
//! fixed memory; [`phase_variance`] computes x = A^-1 f for one frame of a finished batch, and
//! var = sum of q (x_t - x_s)^2.
//!
//! What it is not: pairs are taken as independent, with the variance of `weights::pair_variance`.
//! They share frames, so for a long series of strongly linked frames the true error is larger,
//! by up to the square root of the number of pairs that bridge one step.
//!
//! A prior link (Gamma_2) of conductance a counts as a measurement of variance 1/a, that is
//! (1/mu_2)^2 = (1000 rad)^2: a frame that nothing but Gamma_2 holds reports hundreds of radians. Where
//! no reference frame was measured the standard deviation of all frames is infinite.

use crate::scalar::Scalar;
use crate::solver::{Eliminated, Solver, divide_by_pivot};
use crate::storage::{Link, Matrix, Node};

/// Variance of one frame's phase in a finished batch solution, rad^2.
///
/// `noise` holds q of every link, in rows of `solver.lags()` as the links are: w^4 v for a pair plus a
/// for a prior. `measured` and `reference_frames` as in `reference::subtract_reference`.
/// `sensitivity` is scratch for one number per frame.
#[inline(always)]
pub fn phase_variance<T, A, B>(
    solver: &Solver<T, A, B>,
    noise: &[T],
    measured: &[T],
    reference_frames: usize,
    frame: usize,
    sensitivity: &mut [T],
) -> T
where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    let mut count = T::zero();
    for &m in measured.iter().take(reference_frames) {
        count += m;
    }
    for (t, (value, &m)) in sensitivity.iter_mut().zip(measured).enumerate() {
        let own = if t == frame { T::one() } else { T::zero() };
        let share = if t < reference_frames { divide_by_pivot(m, count) } else { T::zero() };
        *value = own - share;
    }
    solver.solve(sensitivity);
    let mut variance = T::zero();
    for (t, row) in noise.chunks_exact(solver.lags()).enumerate() {
        let Some((&x, later)) = sensitivity.get(t..).and_then(<[T]>::split_first) else { break };
        for (&q, &y) in row.iter().zip(later) {
            let difference = x - y;
            variance = (q * difference).mul_add(difference, variance);
        }
    }
    infinite_without_reference(variance, count)
}

/// The variance, or infinity where no reference frame was measured.
#[inline(always)]
fn infinite_without_reference<T: Scalar>(variance: T, references: T) -> T {
    T::select(T::zero().lt(references), variance, T::from_f64(f64::INFINITY))
}

/// Noise of one frame's right-hand side.
#[derive(Clone, Copy, Debug)]
struct NodeNoise<T> {
    /// Its variance.
    own: T,
    /// Its covariance with the sum of the reference frames' phases.
    with_reference: T,
}

/// Covariance of the right-hand side of the frames that still wait, carried through the
/// elimination; the companion of a `FixedSolver` with the same `LAGS` and `ROWS` >= `LAGS` + 1.
#[derive(Clone, Copy, Debug)]
pub struct NoiseStream<T, const ROWS: usize, const LAGS: usize> {
    /// Covariance of frame t with t+1 ... t+LAGS.
    links: Matrix<T, ROWS, LAGS>,
    nodes: [NodeNoise<T>; ROWS],
    frames: usize,
    eliminated: usize,
    reference_variance: T,
}

impl<T: Scalar, const ROWS: usize, const LAGS: usize> NoiseStream<T, ROWS, LAGS> {
    const SILENT: fn() -> NodeNoise<T> = || NodeNoise { own: T::zero(), with_reference: T::zero() };

    /// No frames, no noise.
    #[must_use]
    pub fn new() -> Self {
        Self {
            links: Matrix::filled(T::zero()),
            nodes: [Self::SILENT(); ROWS],
            frames: 0,
            eliminated: 0,
            reference_variance: T::zero(),
        }
    }

    /// Begin the next frame, after the frame that the solver eliminates for it has been shown to
    /// [`Self::eliminate`].
    pub(crate) fn push_frame(&mut self) {
        let slot = self.frames % ROWS;
        self.frames += 1;
        if let Some(row) = self.links.row_mut(slot) {
            row.fill(T::zero());
        }
        if let Some(node) = self.nodes.get_mut(slot) {
            *node = Self::SILENT();
        }
    }

    /// Noise q = w^4 v of the pair (t, t+dt), or a of a prior.
    pub(crate) fn add_pair(&mut self, t: usize, dt: usize, q: T) {
        if t < self.eliminated || dt == 0 || dt > LAGS || t + dt >= self.frames {
            return;
        }
        if let Some(link) = self.links.row_mut(t % ROWS).and_then(|row| row.get_mut(dt - 1)) {
            *link = *link - q;
        }
        for frame in [t, t + dt] {
            if let Some(node) = self.nodes.get_mut(frame % ROWS) {
                node.own += q;
            }
        }
    }

    /// What the elimination of the oldest waiting frame does to the noise of the others:
    /// b_j <- b_j + s_j b_t with s_j = a_tj / p_t, and reference sum <- sum + (c_t / p_t) b_t.
    pub(crate) fn eliminate(&mut self, done: &Eliminated<'_, T>) {
        let t = self.eliminated;
        self.eliminated += 1;
        let Some(&row) = self.links.row(t % ROWS) else { return };
        let Some(node) = self.nodes.get_mut(t % ROWS) else { return };
        let in_reference = divide_by_pivot(done.reference, done.pivot);
        let share = |link: &Link<T>| divide_by_pivot(link.conductance, done.pivot);
        let before = *node;
        node.with_reference = in_reference.mul_add(before.own, before.with_reference);
        let with_reference = node.with_reference;
        self.reference_variance += in_reference * (before.with_reference + with_reference);
        for (i, (link, &k)) in done.links.iter().zip(&row).enumerate() {
            let s = share(link);
            // Covariance of frame t+i+1 with b_t, after its own share has been added.
            let shared = s.mul_add(before.own, k);
            if let Some(other) = self.nodes.get_mut((t + i + 1) % ROWS) {
                other.own += s * (k + shared);
                other.with_reference += s.mul_add(before.with_reference, in_reference * shared);
            }
            let farther = done.links.iter().zip(&row).skip(i + 1);
            let Some(links) = self.links.row_mut((t + i + 1) % ROWS) else { return };
            for (noise, (link, &k)) in links.iter_mut().zip(farther) {
                *noise += share(link).mul_add(shared, s * k);
            }
        }
    }

    /// Variance of the newest phase against the mean of the reference frames, rad^2, after all
    /// frames have been eliminated in `solver` and here.
    pub(crate) fn newest_after_finish<A, B>(&self, solver: &Solver<T, A, B>) -> T
    where
        A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
        B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
    {
        let Some(last) = self.frames.checked_sub(1) else { return T::zero() };
        let (Some(noise), Some(node)) = (self.nodes.get(last % ROWS), solver.node(last)) else {
            return T::zero();
        };
        let newest = divide_by_pivot(T::one(), node.pivot);
        let mean = divide_by_pivot(T::one(), solver.reference_count());
        let two = T::from_f64(2.0);
        let variance = newest * newest * noise.own - two * newest * mean * noise.with_reference
            + mean * mean * self.reference_variance;
        infinite_without_reference(variance.max(T::zero()), solver.reference_count())
    }
}

impl<T: Scalar, const ROWS: usize, const LAGS: usize> Default for NoiseStream<T, ROWS, LAGS> {
    fn default() -> Self {
        Self::new()
    }
}
