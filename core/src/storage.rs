//! What the solver keeps: links between frames, the frames themselves, and fixed-size buffers.

use crate::scalar::{Scalar, is_number};

/// A link from frame t to a later frame s: all pairs and priors between them, and what eliminated
/// frames have left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link<T> {
    /// a: the sum of w^2.
    pub(crate) conductance: T,
    /// f: the sum of w^2 c, c being the phase phi_t - phi_s that each of them wants.
    pub(crate) flux: T,
}

impl<T: Scalar> Link<T> {
    /// No connection.
    #[inline(always)]
    #[must_use]
    pub fn new() -> Self {
        Self { conductance: T::zero(), flux: T::zero() }
    }

    /// That of a pair with the phase c and the weight w, and where it has measured anything: not where one of them is not
    /// a number.
    #[inline(always)]
    pub(crate) fn of_pair(phase: T, weight: T) -> (Self, T::Mask) {
        // False for a weight or a phase that is NaN too, which must not enter the network.
        let seen = T::zero().lt(T::select(is_number(phase), weight, T::zero()));
        let conductance = T::select(seen, weight * weight, T::zero());
        (Self { conductance, flux: T::select(seen, conductance * phase, T::zero()) }, seen)
    }
}

impl<T: Scalar> Default for Link<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// What the network knows of one frame, beside its links.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node<T> {
    /// Link to the gauge frame, once that has been eliminated.
    pub(crate) ground: Link<T>,
    /// Sum of all links when it was eliminated; 0 for the gauge frame.
    pub(crate) pivot: T,
    /// Coefficient of phi_t in the sum of the reference frames' phases.
    pub(crate) reference: T,
    /// 1 if a pair with weight above 0 has touched the frame.
    pub(crate) measured: T,
}

impl<T: Scalar> Node<T> {
    /// A frame without links.
    #[inline(always)]
    #[must_use]
    pub fn new() -> Self {
        let zero = T::zero();
        Self { ground: Link::new(), pivot: zero, reference: zero, measured: zero }
    }
}

impl<T: Scalar> Default for Node<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// `ROWS` rows of `LAGS` numbers that count as one slice.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<T, const ROWS: usize, const LAGS: usize>([[T; LAGS]; ROWS]);

impl<T: Copy, const ROWS: usize, const LAGS: usize> Matrix<T, ROWS, LAGS> {
    /// The same number everywhere.
    pub(crate) const fn filled(value: T) -> Self {
        Self([[value; LAGS]; ROWS])
    }

    pub(crate) fn row(&self, row: usize) -> Option<&[T; LAGS]> {
        self.0.get(row)
    }

    pub(crate) fn row_mut(&mut self, row: usize) -> Option<&mut [T; LAGS]> {
        self.0.get_mut(row)
    }

    /// Element (row, column), if there is one.
    #[inline]
    pub(crate) fn at(&self, row: usize, column: usize) -> Option<T> {
        self.row(row).and_then(|row| row.get(column)).copied()
    }

    /// Write element (row, column), if there is one.
    #[inline]
    pub(crate) fn set(&mut self, row: usize, column: usize, value: T) {
        if let Some(place) = self.row_mut(row).and_then(|row| row.get_mut(column)) {
            *place = value;
        }
    }

    /// Delete row k and column k; what follows moves up, and the end is filled with `empty`.
    pub(crate) fn remove(&mut self, k: usize, empty: T) {
        shift_out(&mut self.0, k, [empty; LAGS]);
        for row in &mut self.0 {
            shift_out(row, k, empty);
        }
    }
}

/// Delete element k: each element behind it moves up, and `last` becomes the last one.
#[inline(always)]
pub(crate) fn shift_out<T>(line: &mut [T], k: usize, mut last: T) {
    for place in line.iter_mut().skip(k).rev() {
        core::mem::swap(place, &mut last);
    }
}

impl<T, const ROWS: usize, const LAGS: usize> AsRef<[T]> for Matrix<T, ROWS, LAGS> {
    fn as_ref(&self) -> &[T] {
        self.0.as_flattened()
    }
}

impl<T, const ROWS: usize, const LAGS: usize> AsMut<[T]> for Matrix<T, ROWS, LAGS> {
    fn as_mut(&mut self) -> &mut [T] {
        self.0.as_flattened_mut()
    }
}
