//! The extended Knox-Thompson solution: banded normal equations, eliminated as frames arrive.
//!
//! The phases minimise (paper lines 850-919, `arg` and sign as settled in the crate's convention)
//!
//! sum over pairs (t,dt), dt <= L, of w(t,dt)^2 (phi_t - phi_{t+dt} - c(t,dt))^2 + mu_2^2 |Gamma_2 phi|^2,
//! phi_g = 0,
//!
//! with c = unwrapped arg ⟨C(t,dt)⟩. The normal matrix S^T W^2 S + mu_2^2 Gamma_2^T Gamma_2 is that of an
//! electrical network: each pair is a link of conductance a = w^2 and source c between the nodes t
//! and t+dt, and the gauge frame g is ground. Eliminating a node (one column of an LDL^T
//! factorisation) joins its neighbours by new links. Two things make this good in `f32`:
//!
//! - Conductances are only ever added, and a pivot is the *sum* of a node's links instead of a
//!   difference of large numbers (Grassmann, Taksar & Heyman 1985).
//! - The right-hand side stays with the links (a and f = a c) instead of being summed at the nodes,
//!   where frames that strong links tie together would have to cancel to the last digit before
//!   the weak links between them and the rest are heard.
//!
//! So errors stay near the rounding of the phases themselves, whatever the weights and mu_1.
//!
//! When frame n arrives it is linked to the frames n-L ... n-1. Frame n-L receives nothing more
//! afterwards and is eliminated: O(L^2) work, and O(L^2) memory if `ROWS` is L + 1. The newest phase
//! needs the elimination of the L frames that still wait, on a copy: O(L^3/6). With more rows the
//! eliminated frames stay and back-substitution gives their smoothed phases; with all of them and
//! L = N - 1 the result is the paper's batch solution.

mod elimination;

use self::elimination::SPARE;
use crate::reference::reference_mean;
use crate::scalar::Scalar;
use crate::storage::{Link, Matrix, Node};
use core::marker::PhantomData;

/// A frame at the moment of its elimination.
pub(crate) struct Eliminated<'a, T> {
    /// Its links to the frames after it.
    pub(crate) links: &'a [Link<T>],
    /// Their sum with the conductance to ground; 0 for the gauge frame.
    pub(crate) pivot: T,
    /// Coefficient of its phase in the sum of the reference frames' phases.
    pub(crate) reference: T,
}

/// Solver in fixed-size buffers: `ROWS` frames of history, of which at least `LAGS` + 1 are needed.
pub type FixedSolver<T, const ROWS: usize, const LAGS: usize> =
    Solver<T, Matrix<Link<T>, ROWS, LAGS>, [Node<T>; ROWS]>;

/// The network of the last frames. `A` holds `rows` rows of at least `lags` links, `B` holds `rows` nodes: arrays on a
/// microcontroller, vectors on the desktop.
#[derive(Clone, Copy, Debug)]
pub struct Solver<T, A, B> {
    /// Row of frame t: its links to t+1 ... t+lags, and links of 0 in the places to spare.
    links: A,
    nodes: B,
    rows: usize,
    /// Places of a row.
    stride: usize,
    lags: usize,
    gauge: usize,
    reference_frames: usize,
    /// Frames seen; the newest is `frames - 1`.
    frames: usize,
    /// Frames eliminated: 0 .. eliminated.
    eliminated: usize,
    /// Constant part of the sum of the reference frames' phases, and how many they are.
    reference_sum: T,
    reference_count: T,
    element: PhantomData<T>,
}

/// Places for the links of `rows` frames to the next `lags` ones each, with those to spare that let several frames be
/// eliminated together; none where every frame reaches the last one.
#[must_use]
pub const fn links_for(rows: usize, lags: usize) -> usize {
    rows * if lags + 1 < rows { lags + SPARE } else { lags }
}

impl<T: Scalar, const ROWS: usize, const LAGS: usize> FixedSolver<T, ROWS, LAGS> {
    /// An empty network for pairs up to `lags` frames apart (at most `LAGS`, which is checked),
    /// with the gauge frame g and N_0 reference frames.
    #[must_use]
    pub fn new(lags: usize, gauge: usize, reference_frames: usize) -> Self {
        const { assert!(ROWS > LAGS && LAGS > 0, "history must be longer than the largest lag") };
        let links = Matrix::filled(Link::new());
        Self::with_storage(links, [Node::new(); ROWS], lags.clamp(1, LAGS), gauge, reference_frames)
    }
}

impl<T, A, B> Solver<T, A, B>
where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    /// A solver in the caller's buffers: rows = number of nodes = the frames of history kept.
    ///
    /// The links need rows * lags places; with as many as [`links_for`] says, long series are solved faster. `lags` must be
    /// below the number of rows (it is cut to that, and to the places there are); a batch solution needs as many rows as
    /// frames. Buffers need no clearing.
    #[must_use]
    pub fn with_storage(
        mut links: A,
        nodes: B,
        lags: usize,
        gauge: usize,
        reference_frames: usize,
    ) -> Self {
        let rows = nodes.as_ref().len();
        let stride = (links.as_ref().len() / rows.max(1)).max(1);
        let lags = lags.clamp(1, rows.saturating_sub(1).clamp(1, stride));
        for row in links.as_mut().chunks_mut(stride) {
            row.iter_mut().skip(lags).for_each(|spare| *spare = Link::new());
        }
        Self {
            links,
            nodes,
            rows,
            stride,
            lags,
            gauge,
            reference_frames,
            frames: 0,
            eliminated: 0,
            reference_sum: T::zero(),
            reference_count: T::zero(),
            element: PhantomData,
        }
    }

    /// Forget all frames, for the next pixel.
    pub fn clear(&mut self) {
        self.frames = 0;
        self.eliminated = 0;
        self.reference_sum = T::zero();
        self.reference_count = T::zero();
    }

    /// Number of frames so far.
    #[must_use]
    pub const fn frames(&self) -> usize {
        self.frames
    }

    /// First frame whose row is still held.
    #[must_use]
    pub const fn first_kept(&self) -> usize {
        self.frames.saturating_sub(self.rows)
    }

    /// Begin a series of `frames` frames whose pairs are all known, in any order; at most as many
    /// frames as rows. [`Self::finish`] and [`Self::phases`] follow.
    #[inline(always)]
    pub fn begin_batch(&mut self, frames: usize) {
        self.clear();
        self.frames = frames.min(self.rows);
        self.links.as_mut().fill(Link::new());
        self.nodes.as_mut().fill(Node::new());
    }

    /// Begin the next frame; the one that can receive nothing more is eliminated.
    #[inline]
    pub fn push_frame(&mut self) {
        self.push_frame_with(|_| {});
    }

    /// The same, showing each frame as it is eliminated.
    #[inline]
    pub(crate) fn push_frame_with(&mut self, mut seen: impl FnMut(&Eliminated<'_, T>)) {
        if self.frames > self.lags && self.frames - self.lags > self.eliminated {
            self.eliminate(self.frames - 1, self.gauge, &mut seen);
        }
        let slot = self.slot(self.frames);
        let stride = self.stride;
        self.frames += 1;
        if let Some(row) = self.links.as_mut().get_mut(slot * stride..(slot + 1) * stride) {
            row.fill(Link::new());
        }
        if let Some(node) = self.nodes.as_mut().get_mut(slot) {
            *node = Node::new();
        }
    }

    /// Begin a series all of whose pairs follow by [`Self::set_row`], each once: their links need no clearing.
    #[inline(always)]
    pub(crate) fn begin_full_batch(&mut self, frames: usize) {
        self.clear();
        self.frames = frames.min(self.rows);
        self.nodes.as_mut().fill(Node::new());
    }

    /// All pairs of frame t of such a series with later frames, as [`Self::add_pair`] takes them: `pair` is called with
    /// dt = 1, 2, ...
    #[inline(always)]
    pub(crate) fn set_row(&mut self, t: usize, mut pair: impl FnMut(usize) -> (T, T)) {
        let (start, last) = (t * self.stride, self.frames.saturating_sub(1));
        let Some(reach) = last.checked_sub(t).map(|left| left.min(self.lags)) else { return };
        let row = self.links.as_mut().get_mut(start..start + self.stride).unwrap_or(&mut []);
        for spare in row.iter_mut().skip(self.lags) {
            // A conductance beyond all numbers in the series before would have left something there.
            *spare = Link::new();
        }
        let links = row.get_mut(..reach).unwrap_or(&mut []);
        let Some((own, later)) = self.nodes.as_mut().get_mut(t..).and_then(<[_]>::split_first_mut)
        else {
            return;
        };
        for (dt, (link, node)) in (1..).zip(links.iter_mut().zip(later)) {
            let (phase, weight) = pair(dt);
            let (new, seen) = Link::of_pair(phase, weight);
            *link = new;
            node.measured = T::select(seen, T::one(), node.measured);
            own.measured = T::select(seen, T::one(), own.measured);
        }
    }

    /// Add the pair (t, t+dt): unwrapped phase c = phi_t - phi_{t+dt} in radians, weight w >= 0. A pair
    /// whose phase or weight is not a number measures nothing.
    /// Both frames must have begun and neither be eliminated; other pairs change nothing.
    #[inline(always)]
    pub fn add_pair(&mut self, t: usize, dt: usize, phase: T, weight: T) {
        let Some(link) = self.link_mut(t, dt) else { return };
        let (new, seen) = Link::of_pair(phase, weight);
        link.conductance += new.conductance;
        link.flux += new.flux;
        for frame in [t, t + dt] {
            let Some(node) = self.node_mut(frame) else { return };
            node.measured = T::select(seen, T::one(), node.measured);
        }
    }

    /// Add a link of the given conductance with phase difference 0 that measures nothing (Gamma_2).
    #[inline(always)]
    pub fn add_prior(&mut self, t: usize, dt: usize, conductance: T) {
        if let Some(link) = self.link_mut(t, dt) {
            link.conductance += conductance;
        }
    }

    /// Eliminate all frames that wait, so that [`Self::phases`] can follow. In a series too short to
    /// hold the gauge frame the last one takes its place.
    #[inline(always)]
    pub fn finish(&mut self) {
        self.finish_with(|_| {});
    }

    /// The same, showing each frame as it is eliminated.
    #[inline(always)]
    pub(crate) fn finish_with(&mut self, mut seen: impl FnMut(&Eliminated<'_, T>)) {
        let Some(last) = self.frames.checked_sub(1) else { return };
        let gauge = self.gauge.min(last);
        while self.eliminated < self.frames {
            self.eliminate_next(last, gauge, &mut seen);
        }
    }

    /// Back-substitution, after [`Self::finish`]: smoothed phases in radians, phi_g = 0, of the
    /// frames that are still held, `phases[0]` being frame [`Self::first_kept`].
    #[inline(always)]
    pub fn phases(&self, phases: &mut [T]) {
        let first = self.first_kept();
        for t in (first..self.frames).rev() {
            let (Some(row), Some(node)) = (self.row(t), self.node(t)) else { return };
            let later = phases.get(t - first + 1..self.frames - first).unwrap_or(&[]);
            let current = current(row, later, node.ground.flux);
            if let Some(phase) = phases.get_mut(t - first) {
                *phase = divide_by_pivot(current, node.pivot);
            }
        }
    }

    /// 1 for each frame held that a pair has measured, 0 for the others.
    #[inline(always)]
    pub fn measured(&self, measured: &mut [T]) {
        for (t, place) in (self.first_kept()..self.frames).zip(measured) {
            *place = self.node(t).map_or(T::zero(), |node| node.measured);
        }
    }

    /// Phase of the newest frame against the mean of the reference frames (paper lines 945-948), in
    /// radians, from all pairs so far; the frames themselves may have been forgotten.
    #[must_use]
    pub fn newest_phase(&self) -> T
    where
        Self: Clone,
    {
        let mut trial = self.clone();
        trial.finish();
        trial.newest_after_finish()
    }

    /// The same, on a solver that has been finished.
    pub(crate) fn newest_after_finish(&self) -> T {
        let Some(node) = self.frames.checked_sub(1).and_then(|last| self.node(last)) else {
            return T::zero();
        };
        let newest = divide_by_pivot(node.ground.flux, node.pivot);
        newest - reference_mean(self.reference_sum, self.reference_count)
    }

    /// Solve for another right-hand side, after [`Self::finish`] and with all frames held:
    /// `values` comes as the right-hand side and leaves as the solution, one entry per frame.
    /// The entry of the gauge frame is ignored and becomes 0.
    #[inline(always)]
    pub(crate) fn solve(&self, values: &mut [T]) {
        for t in 0..self.frames {
            let (Some(row), Some(node)) = (self.row(t), self.node(t)) else { return };
            let Some((&mut value, later)) = values.get_mut(t..).and_then(<[T]>::split_first_mut)
            else {
                return;
            };
            let potential = divide_by_pivot(value, node.pivot);
            for (link, value) in row.iter().zip(later) {
                *value = link.conductance.mul_add(potential, *value);
            }
        }
        for t in (0..self.frames).rev() {
            let (Some(row), Some(node)) = (self.row(t), self.node(t)) else { return };
            let later = values.get(t + 1..).unwrap_or(&[]);
            let start = values.get(t).copied().unwrap_or(T::zero());
            let sum = conducted(row, later, start);
            if let Some(value) = values.get_mut(t) {
                *value = divide_by_pivot(sum, node.pivot);
            }
        }
    }

    /// How many reference frames were measured, after [`Self::finish`].
    pub(crate) const fn reference_count(&self) -> T {
        self.reference_count
    }

    /// Largest lag.
    #[must_use]
    pub const fn lags(&self) -> usize {
        self.lags
    }

    #[inline(always)]
    fn slot(&self, t: usize) -> usize {
        t % self.rows.max(1)
    }

    /// Links of frame t to t+1, t+2, ...; after elimination those it had then.
    #[inline(always)]
    pub(crate) fn row(&self, t: usize) -> Option<&[Link<T>]> {
        let start = self.slot(t) * self.stride;
        self.links.as_ref().get(start..start + self.lags)
    }

    #[inline(always)]
    pub(crate) fn node(&self, t: usize) -> Option<&Node<T>> {
        self.nodes.as_ref().get(self.slot(t))
    }

    #[inline(always)]
    fn node_mut(&mut self, t: usize) -> Option<&mut Node<T>> {
        let slot = self.slot(t);
        self.nodes.as_mut().get_mut(slot)
    }

    #[inline(always)]
    fn link_mut(&mut self, t: usize, dt: usize) -> Option<&mut Link<T>> {
        if t < self.eliminated || dt == 0 || dt > self.lags || t + dt >= self.frames {
            return None;
        }
        let slot = self.slot(t);
        self.links.as_mut().get_mut(slot * self.stride + dt - 1)
    }
}

/// `start` plus the sum of a phi + f over the links: what a frame's phase is the quotient of. Loops
/// rather than closures wherever lanes pass: a closure cannot be told to be inlined, and outside
/// its caller it is compiled without the vector instructions.
#[inline(always)]
fn current<T: Scalar>(links: &[Link<T>], later: &[T], start: T) -> T {
    let mut sum = start;
    // The nearest phases were found last.
    for (link, &phase) in links.iter().zip(later).rev() {
        sum += link.conductance.mul_add(phase, link.flux);
    }
    sum
}

/// The same without sources.
#[inline(always)]
fn conducted<T: Scalar>(links: &[Link<T>], later: &[T], start: T) -> T {
    let mut sum = start;
    for (link, &value) in links.iter().zip(later) {
        sum = link.conductance.mul_add(value, sum);
    }
    sum
}

/// value / pivot, and 0 for the gauge frame, whose pivot is 0 (in every lane alike).
#[inline(always)]
pub(crate) fn divide_by_pivot<T: Scalar>(value: T, pivot: T) -> T {
    let free = T::zero().lt(pivot);
    T::select(free, value / T::select(free, pivot, T::one()), T::zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Conductance and phase of each pair of five frames, from a truth and one wrong pair.
    fn network(solver: &mut impl FnMut(usize, usize, f64, f64)) {
        let truth = [0.3, -0.1, 1.7, 2.0, 5.0];
        for t in 0..5 {
            for dt in 1..5 - t {
                let wrong = if (t, dt) == (1, 2) { 0.5 } else { 0.0 };
                solver(t, dt, truth[t] - truth[t + dt] + wrong, 1.0 / dt as f64);
            }
        }
    }

    #[test]
    fn consistent_pairs_are_met_exactly_and_the_gauge_is_zero() {
        let truth = [0.3, -0.1, 1.7, 2.0, 5.0];
        for gauge in 0..5 {
            let mut solver = FixedSolver::<f64, 5, 4>::new(4, gauge, 5);
            solver.begin_batch(5);
            network(&mut |t, dt, c, w| {
                let wrong = if (t, dt) == (1, 2) { 0.5 } else { 0.0 };
                solver.add_pair(t, dt, c - wrong, w);
            });
            solver.finish();
            let mut phases = [0.0; 5];
            solver.phases(&mut phases);
            for (phase, expected) in phases.iter().zip(truth) {
                assert!((phase - (expected - truth[gauge])).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn normal_equations_hold_for_inconsistent_pairs() {
        let mut solver = FixedSolver::<f64, 5, 4>::new(4, 2, 5);
        solver.begin_batch(5);
        network(&mut |t, dt, c, w| solver.add_pair(t, dt, c, w));
        solver.finish();
        let mut phases = [0.0; 5];
        solver.phases(&mut phases);
        let mut residual = [0.0; 5];
        network(&mut |t, dt, c, w| {
            let misfit = w * w * (phases[t] - phases[t + dt] - c);
            residual[t] += misfit;
            residual[t + dt] -= misfit;
        });
        for r in residual {
            assert!(r.abs() < 1e-14, "{residual:?}");
        }
    }

    /// With every number of lags and of frames that a ring with room for more can have: what is eliminated in panels
    /// and what frame by frame ends in the same newest phase.
    #[test]
    fn a_ring_with_room_for_more_lags_is_the_batch_at_every_frame() {
        const FRAMES: usize = 40;
        let phase = |t: usize, s: usize| libm::sin((7 * t + 3 * s) as f64);
        let weight = |t: usize, s: usize| 1.0 / (1 + (t + s) % 5) as f64;
        for lags in 1..=12 {
            let mut ring = FixedSolver::<f64, 13, 12>::new(lags, 4, 5);
            for frame in 0..FRAMES {
                ring.push_frame();
                let mut batch = FixedSolver::<f64, FRAMES, 39>::new(lags, 4, 5);
                batch.begin_batch(frame + 1);
                for dt in 1..=lags.min(frame) {
                    ring.add_pair(frame - dt, dt, phase(frame - dt, frame), weight(frame - dt, dt));
                }
                for s in 0..=frame {
                    for dt in 1..=lags.min(s) {
                        batch.add_pair(s - dt, dt, phase(s - dt, s), weight(s - dt, dt));
                    }
                }
                let [ring, batch] = [ring.newest_phase(), batch.newest_phase()];
                assert!((ring - batch).abs() < 1e-12, "{lags} lags, frame {frame}: {ring} {batch}");
            }
        }
    }

    /// What a series with a weight beyond all numbers leaves in the rows does not reach the next one.
    #[test]
    fn a_series_is_forgotten_before_the_next() {
        const FRAMES: usize = 12;
        let new = || {
            let links = [Link::new(); links_for(FRAMES, 3)];
            Solver::with_storage(links, [Node::new(); FRAMES], 3, 4, 5)
        };
        let solve = |solver: &mut Solver<f64, _, _>, weight: f64| {
            solver.begin_full_batch(FRAMES);
            for t in 0..FRAMES {
                let weight = |dt| if (t, dt) == (6, 1) { weight } else { 1.0 };
                solver.set_row(t, |dt| (libm::sin((5 * t + dt) as f64), weight(dt)));
            }
            solver.finish();
            let mut phases = [0.0; FRAMES];
            solver.phases(&mut phases);
            phases
        };
        let mut used = new();
        assert!(solve(&mut used, f64::INFINITY).iter().any(|phase| phase.is_nan()));
        assert_eq!(solve(&mut used, 1.0), solve(&mut new(), 1.0));
    }

    #[test]
    fn foreign_pairs_change_nothing() {
        let mut solver = FixedSolver::<f32, 3, 2>::new(2, 0, 1);
        solver.push_frame();
        solver.add_pair(0, 1, 1.0, 1.0);
        solver.add_pair(7, 9, 1.0, 1.0);
        solver.push_frame();
        solver.add_pair(0, 0, 1.0, 1.0);
        assert_eq!(solver.newest_phase(), 0.0);
        assert_eq!(FixedSolver::<f32, 3, 2>::new(2, 0, 1).newest_phase(), 0.0);
    }
}
