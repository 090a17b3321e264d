//! A whole series at once: all pairs of one ensemble in, one phase per frame out.

use crate::params::Params;
use crate::reference::subtract_reference;
use crate::regularize::add_differences;
use crate::scalar::Scalar;
use crate::solver::Solver;
use crate::storage::{Link, Node};
use crate::unwrap::Unwrapper;

/// Phases of a series against the mean of its reference frames (paper lines 850-948), radians.
///
/// `pair(t, dt)` gives (arg ⟨C(t,dt)⟩ wrapped, weight w) and is called with t ascending and, within
/// t, dt = 1, 2, ... up to the largest lag. `times` are the N acquisition times, ascending. Results go
/// to `phases` and `measured` (1 where some pair has a weight above 0), N entries each; `solver`
/// holds at least N rows and is left finished, for `variance::phase_variance`.
#[inline(always)]
pub fn solve_series<T, A, B>(
    solver: &mut Solver<T, A, B>,
    params: &Params,
    times: &[f64],
    pair: impl FnMut(usize, usize) -> (T, T),
    phases: &mut [T],
    measured: &mut [T],
) where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    assemble_series(solver, params, times, pair);
    finish_series(solver, params, phases, measured);
}

/// The first half of [`solve_series`]: unwrap, and set up the equations.
#[inline(always)]
pub fn assemble_series<T, A, B>(
    solver: &mut Solver<T, A, B>,
    params: &Params,
    times: &[f64],
    mut pair: impl FnMut(usize, usize) -> (T, T),
) where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    let frames = times.len();
    solver.begin_full_batch(frames);
    for t in 0..frames {
        let mut row = Unwrapper::<T>::new();
        solver.set_row(t, |dt| {
            let (wrapped, weight) = pair(t, dt);
            (row.push(wrapped), weight)
        });
    }
    add_differences(solver, params, times);
}

/// The second half: eliminate, substitute back, subtract the reference.
#[inline(always)]
pub fn finish_series<T, A, B>(
    solver: &mut Solver<T, A, B>,
    params: &Params,
    phases: &mut [T],
    measured: &mut [T],
) where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    solver.finish();
    solver.phases(phases);
    solver.measured(measured);
    subtract_reference(phases, measured, params.reference_frames);
}
