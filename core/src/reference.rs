//! The initial value: the mean phase of the first frames is taken for zero.

use crate::scalar::{Real, Scalar};

/// phi_i <- phi_i - 1/N_0 * sum over j < N_0 of phi_j (paper lines 945-948).
///
/// `phases` in radians, one per frame; `valid` is 1 for frames that some pair has measured and 0
/// for the others, which do not count in the mean (0 everywhere: the mean is taken for 0).
/// A series shorter than `reference_frames` is its own reference.
#[inline(always)]
pub fn subtract_reference<T: Scalar>(phases: &mut [T], valid: &[T], reference_frames: usize) {
    let mut sum = T::zero();
    let mut count = T::zero();
    for (&phase, &counts) in phases.iter().zip(valid).take(reference_frames) {
        sum = counts.mul_add(phase, sum);
        count += counts;
    }
    let mean = reference_mean(sum, count);
    for phase in phases {
        *phase = *phase - mean;
    }
}

/// How many leading frames hold the reference: N_0 of them, or, where none of these is usable (`usable` is 1 for
/// frames that are, 0 for others), as many as hold the first N_0 usable ones. Without any usable frame N_0.
#[must_use]
pub fn reference_span<T: Real>(usable: &[T], reference_frames: usize) -> usize {
    let counts = |u: &T| *u > T::zero();
    if usable.iter().take(reference_frames).any(counts) {
        return reference_frames;
    }
    let ends = usable.iter().enumerate().filter(|(_, u)| counts(u)).map(|(frame, _)| frame + 1);
    ends.take(reference_frames).last().unwrap_or(reference_frames)
}

/// sum / count, and 0 where nothing was counted.
#[inline(always)]
#[must_use]
pub fn reference_mean<T: Scalar>(sum: T, count: T) -> T {
    let some = T::zero().lt(count);
    T::select(some, sum / T::select(some, count, T::one()), T::zero())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_valid_frames_count() {
        let mut phases = [1.0, 2.0, 90.0, 4.0, 5.0, 6.0];
        subtract_reference(&mut phases, &[1.0, 1.0, 0.0, 1.0, 1.0, 1.0], 5);
        assert_eq!(phases, [-2.0, -1.0, 87.0, 1.0, 2.0, 3.0]);
        let mut short = [1.0_f32, 3.0];
        subtract_reference(&mut short, &[1.0, 1.0], 5);
        assert_eq!(short, [-1.0, 1.0]);
        let mut none = [1.0_f32, 3.0];
        subtract_reference(&mut none, &[0.0, 0.0], 5);
        assert_eq!(none, [1.0, 3.0]);
    }

    #[test]
    fn without_a_usable_frame_the_next_usable_ones_are_the_reference() {
        assert_eq!(reference_span(&[1.0, 0.0, 1.0, 1.0], 2), 2);
        assert_eq!(reference_span(&[0.0, 1.0, 1.0, 1.0], 2), 2);
        assert_eq!(reference_span(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0], 2), 5);
        assert_eq!(reference_span(&[0.0, 0.0, 0.0, 1.0, 0.0], 2), 4);
        assert_eq!(reference_span(&[0.0; 4], 2), 2);
    }
}
