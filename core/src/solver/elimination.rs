//! Elimination of frames from the network (the solution of paper lines 916-921): which links it leaves between the others,
//! one frame at a time or several.
//!
//! Frame t with the links (a_j, f_j) to later frames j and the pivot p = sum of the a_j joins every two of them, j and k,
//! by a link of conductance a_j a_k / p and flux (a_j f_k - f_j a_k) / p.

use super::{Eliminated, Solver, divide_by_pivot};
use crate::scalar::Scalar;
use crate::storage::{Link, Node};

/// Frames that are eliminated together in a batch. What they need for two rows of links fits 32 registers, and they
/// themselves, of 70 frames, the first cache.
const PANEL: usize = 4;

impl<T, A, B> Solver<T, A, B>
where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    /// Eliminate the frames that wait from the oldest on, at least one: a whole panel where that can be. `last` is the
    /// newest frame, `gauge` the grounded one.
    #[inline(always)]
    pub(super) fn eliminate_next(
        &mut self,
        last: usize,
        gauge: usize,
        seen: &mut impl FnMut(&Eliminated<'_, T>),
    ) {
        let panel = self.eliminated..self.eliminated + PANEL;
        // With a gauge among them, or where not all reach the end, they differ too much to go together.
        if panel.end <= last && self.lags + panel.start >= last && !panel.contains(&gauge) {
            self.eliminate_panel(last, seen);
        } else {
            self.eliminate(last, gauge, seen);
        }
    }

    /// Eliminate the oldest [`PANEL`] waiting frames, which all reach to the frame `last`, with the same arithmetic in the
    /// same order as one by one, but what lies behind them is read and written once for all of them, and they are
    /// read once for two frames behind them.
    #[inline(always)]
    fn eliminate_panel(&mut self, last: usize, seen: &mut impl FnMut(&Eliminated<'_, T>)) {
        let first = self.eliminated;
        let mut inverses = [T::zero(); PANEL];
        for (t, inverse) in (first..).zip(&mut inverses) {
            self.eliminated += 1;
            let Some(node) = self.count_reference(t) else { return };
            *inverse = self.ground_neighbours(t, last - t, node);
            for later in t + 1..first + PANEL {
                self.join_row(t, later, last, *inverse);
            }
        }
        let mut later = first + PANEL;
        while later <= last {
            if self.join_two_rows(first, later, last, inverses).is_some() {
                later += 2;
                continue;
            }
            for (t, &inverse) in (first..).zip(&inverses) {
                self.join_row(t, later, last, inverse);
            }
            later += 1;
        }
        for t in first..first + PANEL {
            self.show(t, last - t, seen);
        }
    }

    /// Eliminate the oldest waiting frame; `last` is the newest frame, `gauge` the grounded one.
    #[inline(always)]
    pub(super) fn eliminate(
        &mut self,
        last: usize,
        gauge: usize,
        seen: &mut impl FnMut(&Eliminated<'_, T>),
    ) {
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
        self.show(t, reach, seen);
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

    /// The same from the panel that begins with `first`, for the rows of `later` and of the frame behind it; nothing is
    /// done where there is none, or its row does not lie behind that of `later`.
    #[inline(always)]
    fn join_two_rows(
        &mut self,
        first: usize,
        later: usize,
        last: usize,
        inverses: [T; PANEL],
    ) -> Option<()> {
        let ([row, next_row], others) = self.two_rows_and_others(later, last)?;
        let (between, row) = row.split_first_mut()?;
        let [p, q, r, s] = [0, 1, 2, 3].map(|i| others.beyond(first + i));
        let [(p, beyond_p), (q, beyond_q), (r, beyond_r), (s, beyond_s)] = [p?, q?, r?, s?];
        let (&next_p, beyond_p) = beyond_p.split_first()?;
        let (&next_q, beyond_q) = beyond_q.split_first()?;
        let (&next_r, beyond_r) = beyond_r.split_first()?;
        let (&next_s, beyond_s) = beyond_s.split_first()?;
        let next = [next_p, next_q, next_r, next_s];
        let of = panel_shares([p, q, r, s], inverses);
        let next_of = panel_shares(next, inverses);
        *between = join_panel(*between, next, of);
        let links = beyond_p.iter().zip(beyond_q).zip(beyond_r).zip(beyond_s);
        for ((joined, next), (((&p, &q), &r), &s)) in row.iter_mut().zip(next_row).zip(links) {
            *joined = join_panel(*joined, [p, q, r, s], of);
            *next = join_panel(*next, [p, q, r, s], next_of);
        }
        Some(())
    }

    /// The links of frame `later` up to frame `last`, to be changed, and those of the others.
    #[inline(always)]
    fn row_and_others(
        &mut self,
        later: usize,
        last: usize,
    ) -> Option<(&mut [Link<T>], Others<'_, T>)> {
        let (lags, slot) = (self.lags, self.slot(later));
        let count = last.checked_sub(later)?;
        let (before, rest) = self.links.as_mut().split_at_mut_checked(slot * lags)?;
        let (row, after) = rest.split_at_mut_checked(lags)?;
        let others = Others { before, after, rows: self.rows, lags, later, taken: 1, count };
        Some((row.get_mut(..count)?, others))
    }

    /// The same of frame `later` and the one behind it.
    #[inline(always)]
    fn two_rows_and_others(
        &mut self,
        later: usize,
        last: usize,
    ) -> Option<(TwoRows<'_, T>, Others<'_, T>)> {
        let (lags, slot) = (self.lags, self.slot(later));
        // Behind the last row of the ring comes the first one, whatever else the buffer holds.
        if slot + 1 >= self.rows {
            return None;
        }
        let count = last.checked_sub(later)?;
        let (before, rest) = self.links.as_mut().split_at_mut_checked(slot * lags)?;
        let (row, rest) = rest.split_at_mut_checked(lags)?;
        let (next_row, after) = rest.split_at_mut_checked(lags)?;
        let others = Others { before, after, rows: self.rows, lags, later, taken: 2, count };
        Some(([row.get_mut(..count)?, next_row.get_mut(..count.checked_sub(1)?)?], others))
    }
}

/// The links of a frame and of the one behind it, to be changed.
type TwoRows<'a, T> = [&'a mut [Link<T>]; 2];

/// The rows of links but those that are changed.
struct Others<'a, T> {
    before: &'a [Link<T>],
    after: &'a [Link<T>],
    rows: usize,
    lags: usize,
    later: usize,
    /// Rows that are changed, from that of `later` on.
    taken: usize,
    /// Frames behind `later` that are looked at.
    count: usize,
}

impl<'a, T: Scalar> Others<'a, T> {
    /// The link of the earlier frame t to `later`, and those to the frames behind.
    #[inline(always)]
    fn beyond(&self, t: usize) -> Option<(Link<T>, &'a [Link<T>])> {
        let (own, slot) = (self.later % self.rows.max(1), t % self.rows.max(1));
        let (part, row) = if slot < own {
            (self.before, slot)
        } else {
            (self.after, slot.checked_sub(own + self.taken)?)
        };
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

/// [`shares`] of the frames of a panel.
#[inline(always)]
fn panel_shares<T: Scalar>(
    [p, q, r, s]: [Link<T>; PANEL],
    [of_p, of_q, of_r, of_s]: [T; PANEL],
) -> [(T, T); PANEL] {
    [shares(p, of_p), shares(q, of_q), shares(r, of_r), shares(s, of_s)]
}

/// `joined` with what the links of a panel's frames add, one after the other.
#[inline(always)]
fn join_panel<T: Scalar>(
    joined: Link<T>,
    [p, q, r, s]: [Link<T>; PANEL],
    [of_p, of_q, of_r, of_s]: [(T, T); PANEL],
) -> Link<T> {
    let joined = join(joined, p, of_p.0, of_p.1);
    let joined = join(joined, q, of_q.0, of_q.1);
    let joined = join(joined, r, of_r.0, of_r.1);
    join(joined, s, of_s.0, of_s.1)
}
