//! Symmetric and Hermitian matrices of nodes that come and go, in buffers of N x N numbers.
//!
//! Elements outside are zero to read and ignored when written; those of nodes that do not exist are 0.

use crate::scalar::Real;
use crate::storage::Matrix;
use num_complex::Complex;

/// A real symmetric matrix.
#[derive(Clone, Copy, Debug)]
pub(super) struct Symmetric<T, const N: usize>(Matrix<T, N, N>);

impl<T: Real, const N: usize> Symmetric<T, N> {
    pub(super) fn new() -> Self {
        Self(Matrix::filled(T::zero()))
    }

    pub(super) fn row(&self, i: usize) -> &[T] {
        self.0.row(i).map_or(&[], |row| row)
    }

    #[inline]
    pub(super) fn at(&self, i: usize, j: usize) -> T {
        self.0.at(i, j).unwrap_or(T::zero())
    }

    /// Write elements (i, j) and (j, i).
    #[inline]
    pub(super) fn set(&mut self, i: usize, j: usize, value: T) {
        self.0.set(i, j, value);
        self.0.set(j, i, value);
    }

    /// Add to elements (i, j) and (j, i); once where they are the same.
    #[inline]
    pub(super) fn add(&mut self, i: usize, j: usize, value: T) {
        self.set(i, j, self.at(i, j) + value);
    }

    /// Delete row and column k.
    pub(super) fn remove(&mut self, k: usize) {
        self.0.remove(k, T::zero());
    }
}

/// A Hermitian matrix, which is N x N real numbers: real parts in the upper triangle and on the diagonal, imaginary
/// parts (of the upper triangle) in the lower one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hermitian<T, const N: usize>(Matrix<T, N, N>);

impl<T: Real, const N: usize> Hermitian<T, N> {
    pub(super) fn new() -> Self {
        Self(Matrix::filled(T::zero()))
    }

    #[inline]
    pub(super) fn at(&self, i: usize, j: usize) -> Complex<T> {
        let part = |i: usize, j: usize| self.0.at(i, j).unwrap_or(T::zero());
        let (first, last) = (i.min(j), i.max(j));
        let (re, im) = (part(first, last), part(last, first));
        match i.cmp(&j) {
            core::cmp::Ordering::Less => Complex { re, im },
            core::cmp::Ordering::Equal => Complex { re, im: T::zero() },
            core::cmp::Ordering::Greater => Complex { re, im: -im },
        }
    }

    /// Write element (i, j) and its conjugate (j, i).
    #[inline]
    pub(super) fn set(&mut self, i: usize, j: usize, value: Complex<T>) {
        let (first, last) = (i.min(j), i.max(j));
        let im = if i < j { value.im } else { -value.im };
        // The real part last: it is the one that a diagonal keeps.
        self.0.set(last, first, im);
        self.0.set(first, last, value.re);
    }

    /// Delete row and column k.
    pub(super) fn remove(&mut self, k: usize) {
        self.0.remove(k, T::zero());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hermitian_elements_survive_removals() {
        let element = |i: usize, j: usize| {
            let im = if i == j { 0.0 } else { i as f64 - j as f64 };
            Complex::new((10 * (i + 1) * (j + 1)) as f64, im)
        };
        let mut matrix = Hermitian::<f64, 4>::new();
        for i in 0..4 {
            for j in 0..=i {
                matrix.set(i, j, element(i, j));
            }
        }
        matrix.remove(1);
        for (i, &from) in [0, 2, 3].iter().enumerate() {
            for (j, &to) in [0, 2, 3].iter().enumerate() {
                assert_eq!(matrix.at(i, j), element(from, to), "({i}, {j})");
            }
        }
        assert_eq!(matrix.at(3, 0), Complex::new(0.0, 0.0));
        assert_eq!(matrix.at(9, 0), Complex::new(0.0, 0.0));
        matrix.remove(9);
    }

    #[test]
    fn symmetric_elements_are_added_once() {
        let mut matrix = Symmetric::<f64, 3>::new();
        matrix.add(1, 1, 2.0);
        matrix.add(0, 1, 3.0);
        assert_eq!((matrix.at(1, 1), matrix.at(1, 0), matrix.at(0, 1)), (2.0, 3.0, 3.0));
        matrix.remove(0);
        assert_eq!(matrix.row(0), [2.0, 0.0, 0.0]);
    }
}
