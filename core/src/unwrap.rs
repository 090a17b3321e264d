//! Unwrapping the phase of the cross-spectrum along dt, robust against single outliers.

use crate::params::UNWRAP_NEIGHBOURS;
use crate::scalar::{Mask, Scalar, is_number};
use crate::storage::shift_out;
use core::f64::consts::{PI, TAU};

/// One row arg⟨C(t, dt)⟩, dt = 0, 1, 2, ... of one t, unwrapped as it arrives (paper lines 834-842).
///
/// The first D phases, dt = 0 (phase 0) included, are taken to be free of wrapping. Each later one
/// is moved by 2 pi up or down as long as that lowers the sum of its absolute differences to the
/// D phases before it.
#[derive(Clone, Copy, Debug)]
pub struct Unwrapper<T, const D: usize = UNWRAP_NEIGHBOURS> {
    /// The last D phases, the newest last.
    recent: [T; D],
    /// How many phases are known, dt = 0 included.
    known: usize,
}

impl<T: Scalar, const D: usize> Unwrapper<T, D> {
    /// A row that knows dt = 0 only.
    #[inline(always)]
    #[must_use]
    pub fn new() -> Self {
        const { assert!(D > 0, "unwrapping needs at least one neighbour") };
        Self { recent: [T::zero(); D], known: 1 }
    }

    /// Take the wrapped phase of the next dt, give the unwrapped one; radians. In place of one that is
    /// not a number the phase before it is remembered (and given).
    #[inline(always)]
    pub fn push(&mut self, wrapped: T) -> T {
        let before = self.recent.last().copied().unwrap_or(T::zero());
        let wrapped = T::select(is_number(wrapped), wrapped, before);
        let phase = if self.known < D { wrapped } else { nearest_branch(wrapped, &self.recent) };
        self.known += 1;
        shift_out(&mut self.recent, 0, phase);
        phase
    }
}

impl<T: Scalar, const D: usize> Default for Unwrapper<T, D> {
    fn default() -> Self {
        Self::new()
    }
}

/// The one of `wrapped` + 2 pi k with the smallest sum of absolute differences to `recent`, reached from the one nearest
/// to their mean in steps of 2 pi that each lower the sum (the sum is convex in k, so this is the minimum).
#[inline(always)]
fn nearest_branch<T: Scalar, const D: usize>(wrapped: T, recent: &[T; D]) -> T {
    let turns = turns_to_mean(wrapped, recent);
    let mut phase = turns.round().mul_add(T::from_f64(TAU), wrapped);
    let mut least = distance(phase, recent);
    // A step changes the sum to 2 pi D - least at the very least: no step helps up to pi D.
    if !T::from_f64(PI * D as f64).lt(least).any() {
        return phase;
    }
    // A convex sum falls in one direction at most, and goes on in it.
    let turn = T::from_f64(TAU);
    let falls_below = distance(phase - turn, recent).lt(least);
    let turn = T::select(falls_below, -turn, turn);
    loop {
        let moved = phase + turn;
        let sum = distance(moved, recent);
        let lower = sum.lt(least);
        if !lower.any() {
            return phase;
        }
        phase = T::select(lower, moved, phase);
        least = T::select(lower, sum, least);
    }
}

/// How many turns `wrapped` is below the mean of `recent`. The newest of them enters last: all else can be computed before
/// it is known.
#[inline(always)]
fn turns_to_mean<T: Scalar, const D: usize>(wrapped: T, recent: &[T; D]) -> T {
    let Some((&newest, others)) = recent.split_last() else { return T::zero() };
    let mut sum = T::zero();
    for &other in others {
        sum += other;
    }
    let share = T::from_f64(1.0 / (TAU * D as f64));
    newest.mul_add(share, sum * share - wrapped * T::from_f64(1.0 / TAU))
}

/// Sum of the absolute differences.
#[inline(always)]
fn distance<T: Scalar, const D: usize>(phase: T, recent: &[T; D]) -> T {
    let mut sum = T::zero();
    for &other in recent {
        sum += (phase - other).abs();
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrap(x: f64) -> f64 {
        x - TAU * libm::rint(x / TAU)
    }

    #[test]
    fn a_ramp_that_is_free_of_wrapping_at_first_is_followed_anywhere() {
        let mut row = Unwrapper::<f64>::new();
        for dt in 1..200 {
            let truth = 0.3 * f64::from(dt);
            assert!((row.push(wrap(truth)) - truth).abs() < 1e-9, "dt = {dt}");
        }
    }

    #[test]
    fn one_outlier_does_not_move_what_follows() {
        let mut row = Unwrapper::<f64>::new();
        for dt in 1..60 {
            let truth = -0.25 * f64::from(dt);
            let outlier = dt == 30;
            let phase = row.push(wrap(if outlier { truth + 3.0 } else { truth }));
            assert!(outlier || (phase - truth).abs() < 1e-9, "dt = {dt}");
        }
    }

    #[test]
    fn the_first_d_phases_are_left_alone() {
        let mut row = Unwrapper::<f32>::new();
        for dt in 1..10 {
            let phase = if dt % 2 == 0 { 3.0 } else { -3.0 };
            assert_eq!(row.push(phase), phase);
        }
        // Five neighbours at -3, four at 3, one at 0: one turn down lowers the sum from 33 to 29.8.
        assert_eq!(row.push(3.0), 3.0 - core::f32::consts::TAU);
    }

    #[test]
    fn anything_ends() {
        let mut row = Unwrapper::<f32>::new();
        for x in [f32::NAN, f32::INFINITY, 1e30, -1e30].into_iter().cycle().take(40) {
            row.push(x);
        }
    }
}
