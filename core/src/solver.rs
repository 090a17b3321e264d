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

use crate::reference::reference_mean;
use crate::scalar::{Scalar, is_number};
use crate::storage::{Link, Matrix, Node};
use core::marker::PhantomData;

/// Frames that are eliminated together in a batch: each link behind them is then read and written once for four.
const PANEL: usize = 4;

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

/// The network of the last frames. `A` holds `rows` x `lags` links, `B` holds `rows` nodes: arrays on a
/// microcontroller, vectors on the desktop.
#[derive(Clone, Copy, Debug)]
pub struct Solver<T, A, B> {
    /// Row of frame t: its links to t+1 ... t+lags.
    links: A,
    nodes: B,
    rows: usize,
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
    /// The links need rows * lags places. `lags` must be below the number of rows (it is cut to that);
    /// a batch solution needs as many rows as frames. Buffers need no clearing.
    #[must_use]
    pub fn with_storage(
        links: A,
        nodes: B,
        lags: usize,
        gauge: usize,
        reference_frames: usize,
    ) -> Self {
        let rows = nodes.as_ref().len();
        Self {
            links,
            nodes,
            rows,
            lags: lags.clamp(1, rows.saturating_sub(1).max(1)),
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
    pub(crate) fn push_frame_with(&mut self, seen: impl FnMut(&Eliminated<'_, T>)) {
        if self.frames > self.lags && self.frames - self.lags > self.eliminated {
            self.eliminate(self.frames - 1, self.gauge, seen);
        }
        let slot = self.slot(self.frames);
        let lags = self.lags;
        self.frames += 1;
        if let Some(row) = self.links.as_mut().get_mut(slot * lags..(slot + 1) * lags) {
            row.fill(Link::new());
        }
        if let Some(node) = self.nodes.as_mut().get_mut(slot) {
            *node = Node::new();
        }
    }

    /// Begin a series all of whose pairs follow by [`Self::set_pair`], each once: their links need no clearing.
    #[inline(always)]
    pub(crate) fn begin_full_batch(&mut self, frames: usize) {
        self.clear();
        self.frames = frames.min(self.rows);
        self.nodes.as_mut().fill(Node::new());
    }

    /// [`Self::add_pair`] to a link that held nothing.
    #[inline(always)]
    pub(crate) fn set_pair(&mut self, t: usize, dt: usize, phase: T, weight: T) {
        if let Some(link) = self.link_mut(t, dt) {
            *link = Link::new();
        }
        self.add_pair(t, dt, phase, weight);
    }

    /// Add the pair (t, t+dt): unwrapped phase c = phi_t - phi_{t+dt} in radians, weight w >= 0. A pair
    /// whose phase or weight is not a number measures nothing.
    /// Both frames must have begun and neither be eliminated; other pairs change nothing.
    #[inline(always)]
    pub fn add_pair(&mut self, t: usize, dt: usize, phase: T, weight: T) {
        let Some(link) = self.link_mut(t, dt) else { return };
        // False for a weight or a phase that is NaN too, which must not enter the network.
        let seen = T::zero().lt(T::select(is_number(phase), weight, T::zero()));
        let conductance = T::select(seen, weight * weight, T::zero());
        link.conductance += conductance;
        link.flux += T::select(seen, conductance * phase, T::zero());
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
            let panel = self.eliminated..self.eliminated + PANEL;
            // With a gauge among them, or where not all reach the end, they differ too much to go together.
            if panel.end <= last && self.lags + panel.start >= last && !panel.contains(&gauge) {
                self.eliminate_panel(last, &mut seen);
            } else {
                self.eliminate(last, gauge, &mut seen);
            }
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
        let slot = self.slot(t);
        self.links.as_ref().get(slot * self.lags..(slot + 1) * self.lags)
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
        self.links.as_mut().get_mut(slot * self.lags + dt - 1)
    }

    /// Eliminate the oldest [`PANEL`] waiting frames, which all reach to the frame `last`, with the same arithmetic in the
    /// same order as one by one, but what lies behind them is read and written once for all of them.
    #[inline(always)]
    fn eliminate_panel(&mut self, last: usize, mut seen: impl FnMut(&Eliminated<'_, T>)) {
        let first = self.eliminated;
        let mut inverses = [T::zero(); PANEL];
        for (i, inverse) in inverses.iter_mut().enumerate() {
            let t = first + i;
            self.eliminated += 1;
            let Some(node) = self.count_reference(t) else { return };
            *inverse = self.ground_neighbours(t, last - t, node);
            for later in t + 1..first + PANEL {
                self.join_row(t, later, last, *inverse);
            }
        }
        for later in first + PANEL..=last {
            self.join_row_to_panel(first, later, last, inverses);
        }
        for t in first..first + PANEL {
            self.show(t, last - t, &mut seen);
        }
    }

    /// Eliminate the oldest waiting frame; `last` is the newest frame, `gauge` the grounded one.
    #[inline(always)]
    fn eliminate(&mut self, last: usize, gauge: usize, mut seen: impl FnMut(&Eliminated<'_, T>)) {
        let t = self.eliminated;
        let reach = self.lags.min(last.saturating_sub(t));
        self.eliminated += 1;
        let Some(node) = self.count_reference(t) else { return };
        if t == gauge {
            self.ground_links(t, reach);
        } else {
            let inverse = self.ground_neighbours(t, reach, node);
            for later in t + 1..=t + reach {
                self.join_row(t, later, t + reach, inverse);
            }
        }
        self.show(t, reach, &mut seen);
    }

    /// Count frame t, which is about to be eliminated, as one of the reference if it is.
    #[inline(always)]
    fn count_reference(&mut self, t: usize) -> Option<Node<T>> {
        let in_reference = t < self.reference_frames;
        let node = self.node_mut(t)?;
        if in_reference {
            node.reference += node.measured;
        }
        let node = *node;
        if in_reference {
            self.reference_count += node.measured;
        }
        Some(node)
    }

    /// Frame t has been eliminated.
    #[inline(always)]
    fn show(&self, t: usize, reach: usize, seen: &mut impl FnMut(&Eliminated<'_, T>)) {
        if let (Some(row), Some(node)) = (self.row(t), self.node(t)) {
            let links = row.get(..reach).unwrap_or(&[]);
            seen(&Eliminated { links, pivot: node.pivot, reference: node.reference });
        }
    }

    /// phi_t is the gauge: its links lead to ground from now on.
    #[inline(always)]
    fn ground_links(&mut self, t: usize, reach: usize) {
        let (rows, lags) = (self.rows.max(1), self.lags);
        let slot = self.slot(t);
        let row = self.links.as_ref().get(slot * lags..slot * lags + reach).unwrap_or(&[]);
        for (dt, link) in (1..).zip(row) {
            if let Some(node) = self.nodes.as_mut().get_mut((t + dt) % rows) {
                node.ground.conductance += link.conductance;
                node.ground.flux = node.ground.flux - link.flux;
            }
        }
    }

    /// Star-mesh transformation: the neighbours j, k of t gain a link of conductance a_j a_k / p and
    /// source c_k - c_j, that is of flux (a_j f_k - f_j a_k) / p. Here for the ground as k; gives 1 / p.
    #[inline(always)]
    fn ground_neighbours(&mut self, t: usize, reach: usize, node: Node<T>) -> T {
        let (rows, lags, slot) = (self.rows.max(1), self.lags, self.slot(t));
        let row = self.links.as_ref().get(slot * lags..slot * lags + reach).unwrap_or(&[]);
        let Link { conductance: mut pivot, flux: mut outflow } = node.ground;
        for link in row {
            pivot += link.conductance;
            outflow += link.flux;
        }
        let inverse = divide_by_pivot(T::one(), pivot);
        self.reference_sum += node.reference * outflow * inverse;
        if let Some(node) = self.nodes.as_mut().get_mut(slot) {
            node.pivot = pivot;
        }
        for (dt, link) in (1..).zip(row) {
            if let Some(neighbour) = self.nodes.as_mut().get_mut((t + dt) % rows) {
                let (share, pull) = shares(*link, inverse);
                neighbour.ground = join(neighbour.ground, node.ground, share, pull);
                neighbour.reference = share.mul_add(node.reference, neighbour.reference);
            }
        }
        inverse
    }

    /// The new links of frame `later` to the frames behind it up to `last` (j and k of [`Self::ground_neighbours`]), from the
    /// eliminated frame t with its 1 / p.
    #[inline(always)]
    fn join_row(&mut self, t: usize, later: usize, last: usize, inverse: T) {
        let Some((row, others)) = self.row_and_others(later, last) else { return };
        let Some((link, farther)) = others.beyond(t) else { return };
        let (share, pull) = shares(link, inverse);
        for (joined, &link) in row.iter_mut().zip(farther) {
            *joined = join(*joined, link, share, pull);
        }
    }

    /// The same of all frames of a panel, one after the other.
    #[inline(always)]
    fn join_row_to_panel(&mut self, first: usize, later: usize, last: usize, inverses: [T; PANEL]) {
        let Some((row, others)) = self.row_and_others(later, last) else { return };
        let parts = [0, 1, 2, 3].map(|i| others.beyond(first + i));
        let [Some((a, row_a)), Some((b, row_b)), Some((c, row_c)), Some((d, row_d))] = parts else {
            return;
        };
        let [a, b, c, d] = [
            shares(a, inverses[0]),
            shares(b, inverses[1]),
            shares(c, inverses[2]),
            shares(d, inverses[3]),
        ];
        let links = row_a.iter().zip(row_b).zip(row_c).zip(row_d);
        for (joined, (((&of_a, &of_b), &of_c), &of_d)) in row.iter_mut().zip(links) {
            let mut sum = join(*joined, of_a, a.0, a.1);
            sum = join(sum, of_b, b.0, b.1);
            sum = join(sum, of_c, c.0, c.1);
            *joined = join(sum, of_d, d.0, d.1);
        }
    }

    /// The links of frame `later` up to frame `last`, to be changed, and those of the others.
    #[inline(always)]
    fn row_and_others(
        &mut self,
        later: usize,
        last: usize,
    ) -> Option<(&mut [Link<T>], Others<'_, T>)> {
        let (rows, lags, slot) = (self.rows.max(1), self.lags, self.slot(later));
        let (before, rest) = self.links.as_mut().split_at_mut_checked(slot * lags)?;
        let (row, after) = rest.split_at_mut_checked(lags)?;
        let others = Others { before, after, rows, lags, later, count: last.checked_sub(later)? };
        Some((row.get_mut(..others.count)?, others))
    }
}

/// The rows of links but that of frame `later`.
struct Others<'a, T> {
    before: &'a [Link<T>],
    after: &'a [Link<T>],
    rows: usize,
    lags: usize,
    later: usize,
    /// Frames behind `later` that are looked at.
    count: usize,
}

impl<'a, T: Scalar> Others<'a, T> {
    /// The link of the earlier frame t to `later`, and those to the frames behind.
    #[inline(always)]
    fn beyond(&self, t: usize) -> Option<(Link<T>, &'a [Link<T>])> {
        let (own, slot) = (self.later % self.rows, t % self.rows);
        let (part, row) =
            if slot < own { (self.before, slot) } else { (self.after, slot.checked_sub(own + 1)?) };
        let start = row * self.lags + self.later.checked_sub(t + 1)?;
        let (link, farther) = part.get(start..=start + self.count)?.split_first()?;
        Some((*link, farther))
    }
}

/// a_j / p and -f_j / p of an eliminated node's link to j, for [`join`].
#[inline(always)]
fn shares<T: Scalar>(link: Link<T>, inverse: T) -> (T, T) {
    (link.conductance * inverse, -(link.flux * inverse))
}

/// `joined` with what the eliminated node's `link` adds: a_j / p and -f_j / p times its a_k, f_k.
#[inline(always)]
fn join<T: Scalar>(joined: Link<T>, link: Link<T>, share: T, pull: T) -> Link<T> {
    Link {
        conductance: share.mul_add(link.conductance, joined.conductance),
        flux: share.mul_add(link.flux, pull.mul_add(link.conductance, joined.flux)),
    }
}

/// `start` plus the sum of a phi + f over the links: what a frame's phase is the quotient of. Loops
/// rather than closures wherever lanes pass: a closure cannot be told to be inlined, and outside
/// its caller it is compiled without the vector instructions.
#[inline(always)]
fn current<T: Scalar>(links: &[Link<T>], later: &[T], start: T) -> T {
    let mut sum = start;
    for (link, &phase) in links.iter().zip(later) {
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
