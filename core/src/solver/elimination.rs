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

/// Places behind the links of each frame that let those go together which reach to different frames.
pub(super) const SPARE: usize = PANEL - 1;

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
        // Those that reach to different frames take the rows' spare places for links that are not there.
        let alike = self.lags + panel.start >= last || self.stride >= self.lags + SPARE;
        let in_turn = self.slot(panel.start) + PANEL <= self.rows;
        if panel.end <= last && alike && in_turn && !panel.contains(&gauge) {
            self.eliminate_panel(last, seen);
        } else {
            self.eliminate(last, gauge, seen);
        }
    }

    /// Eliminate the oldest [`PANEL`] waiting frames with the same arithmetic in the same order as one by one, but what
    /// lies behind them is read and written once for all of them, and they are read once for two frames behind them.
    #[inline(always)]
    fn eliminate_panel(&mut self, last: usize, seen: &mut impl FnMut(&Eliminated<'_, T>)) {
        let first = self.eliminated;
        // All go as far as the one that reaches furthest: of the others, links of 0 are added there.
        let end = last.min(first + PANEL - 1 + self.lags);
        let mut inverses = [T::zero(); PANEL];
        for (t, inverse) in (first..).zip(&mut inverses) {
            self.eliminated += 1;
            let Some(node) = self.count_reference(t) else { return };
            *inverse = self.ground_neighbours(t, self.lags.min(last - t), node);
            self.join_rows(t, end - t, first + PANEL - 1 - t, *inverse);
        }
        self.join_rows_behind(first, end, inverses);
        for t in first..first + PANEL {
            self.show(t, self.lags.min(last - t), seen);
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
            self.join_rows(t, reach, reach, inverse);
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
        let rows = self.rows.max(1);
        let start = self.slot(t) * self.stride;
        let row = self.links.as_ref().get(start..start + reach).unwrap_or(&[]);
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
        let slot = self.slot(t);
        let start = slot * self.stride;
        let row = self.links.as_ref().get(start..start + reach).unwrap_or(&[]);
        let Link { conductance: mut pivot, flux: mut outflow } = node.ground;
        for link in row {
            pivot += link.conductance;
            outflow += link.flux;
        }
        let inverse = divide_by_pivot(T::one(), pivot);
        self.reference_sum += node.reference * outflow * inverse;
        let Some((before, rest)) = self.nodes.as_mut().split_at_mut_checked(slot) else {
            return inverse;
        };
        let Some((own, after)) = rest.split_first_mut() else { return inverse };
        own.pivot = pivot;
        let mut links = row;
        for part in [after, before] {
            for neighbour in part {
                let Some((&link, farther)) = links.split_first() else { return inverse };
                let (share, pull) = shares(link, inverse);
                neighbour.ground = join(neighbour.ground, node.ground, share, pull);
                neighbour.reference = share.mul_add(node.reference, neighbour.reference);
                links = farther;
            }
        }
        inverse
    }

    /// The new links between the frames up to t + `reach`, from the eliminated frame t with its 1 / p (j and k of
    /// [`Self::ground_neighbours`]), for the rows of the next `count` frames.
    #[inline(always)]
    fn join_rows(&mut self, t: usize, reach: usize, count: usize, inverse: T) {
        let stride = self.stride;
        let Some((own, behind)) = self.rows_and_behind(t, 1) else { return };
        let mut links = own.get(..reach).unwrap_or(&[]);
        let mut left = count;
        for part in behind {
            for row in part.chunks_exact_mut(stride) {
                let Some((&link, farther)) = links.split_first() else { return };
                if left == 0 {
                    return;
                }
                let (share, pull) = shares(link, inverse);
                for (joined, &link) in row.iter_mut().zip(farther) {
                    *joined = join(*joined, link, share, pull);
                }
                (links, left) = (farther, left - 1);
            }
        }
    }

    /// The same from all frames of the panel that begins with `first`, between the frames behind it up to `end`.
    #[inline(always)]
    fn join_rows_behind(&mut self, first: usize, end: usize, inverses: [T; PANEL]) {
        let stride = self.stride;
        let Some((panel, behind)) = self.rows_and_behind(first, PANEL) else { return };
        let mut links = [&[] as &[Link<T>]; PANEL];
        for (i, links) in links.iter_mut().enumerate() {
            let row = panel.get(i * stride..i * stride + end - first - i);
            *links = row.and_then(|row| row.get(PANEL - 1 - i..)).unwrap_or(&[]);
        }
        for part in behind {
            for rows in part.chunks_mut(2 * stride) {
                let left = join_two_rows(rows, stride, links, inverses);
                links = match left.or_else(|| join_row(rows, links, inverses)) {
                    Some(left) => left,
                    None => return,
                };
            }
        }
    }

    /// The links of frame t and of those up to `count` with it, and the rows of the others in two parts: in the ring they
    /// come in this order.
    #[inline(always)]
    fn rows_and_behind(&mut self, t: usize, count: usize) -> Option<RowsAndBehind<'_, T>> {
        let (start, end) = (self.slot(t) * self.stride, self.rows * self.stride);
        let (before, rest) = self.links.as_mut().get_mut(..end)?.split_at_mut_checked(start)?;
        let (rows, after) = rest.split_at_mut_checked(count * self.stride)?;
        Some((rows, [after, before]))
    }
}

/// The links of some frames, and those of the frames behind them.
type RowsAndBehind<'a, T> = (&'a [Link<T>], [&'a mut [Link<T>]; 2]);

/// The links of a panel's frames to the frames behind it.
type Panel<'a, T> = [&'a [Link<T>]; PANEL];

/// Join what a panel's `links` lead to, for the frame that they lead to first, which `row` begins with; gives the links to
/// those behind it.
#[inline(always)]
fn join_row<'a, T: Scalar>(
    row: &mut [Link<T>],
    [p, q, r, s]: Panel<'a, T>,
    inverses: [T; PANEL],
) -> Option<Panel<'a, T>> {
    let [(to_p, p), (to_q, q)] = [p.split_first()?, q.split_first()?];
    let [(to_r, r), (to_s, s)] = [r.split_first()?, s.split_first()?];
    let of = panel_shares([*to_p, *to_q, *to_r, *to_s], inverses);
    let links = p.iter().zip(q).zip(r).zip(s);
    for (joined, (((&p, &q), &r), &s)) in row.iter_mut().zip(links) {
        *joined = join_panel(*joined, [p, q, r, s], of);
    }
    Some([p, q, r, s])
}

/// The same for the first two frames; nothing is done where `rows` or `links` have only one.
#[inline(always)]
fn join_two_rows<'a, T: Scalar>(
    rows: &mut [Link<T>],
    stride: usize,
    [p, q, r, s]: Panel<'a, T>,
    inverses: [T; PANEL],
) -> Option<Panel<'a, T>> {
    let (row, next_row) = rows.split_at_mut_checked(stride)?;
    let (between, row) = row.split_first_mut()?;
    let [([to_p, next_p], p), ([to_q, next_q], q)] =
        [p.split_first_chunk()?, q.split_first_chunk()?];
    let [([to_r, next_r], r), ([to_s, next_s], s)] =
        [r.split_first_chunk()?, s.split_first_chunk()?];
    if next_row.is_empty() {
        return None;
    }
    let next = [*next_p, *next_q, *next_r, *next_s];
    let of = panel_shares([*to_p, *to_q, *to_r, *to_s], inverses);
    let next_of = panel_shares(next, inverses);
    *between = join_panel(*between, next, of);
    let links = p.iter().zip(q).zip(r).zip(s);
    for ((joined, next), (((&p, &q), &r), &s)) in row.iter_mut().zip(next_row).zip(links) {
        *joined = join_panel(*joined, [p, q, r, s], of);
        *next = join_panel(*next, [p, q, r, s], next_of);
    }
    Some([p, q, r, s])
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
