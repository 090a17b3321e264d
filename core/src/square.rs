//! Small dense symmetric matrices in buffers of the caller: factor, inverse, solution.

use crate::scalar::Real;

/// The leading n x n part of a buffer whose rows are `stride` numbers long.
///
/// Rows and columns outside are empty to read and ignored when written, so that no index can panic.
#[derive(Debug)]
pub struct Square<'a, T> {
    data: &'a mut [T],
    n: usize,
    stride: usize,
}

impl<'a, T: Real> Square<'a, T> {
    /// n x n numbers, row after row; n is cut to what `data` holds.
    #[must_use]
    pub fn new(data: &'a mut [T], n: usize) -> Self {
        Self::with_stride(data, n, n)
    }

    /// n rows of n numbers, each row beginning `stride` numbers after the one before.
    #[must_use]
    pub fn with_stride(data: &'a mut [T], n: usize, stride: usize) -> Self {
        let stride = stride.max(1);
        let rows = data.len() / stride;
        Self { data, n: n.min(rows).min(stride), stride }
    }

    /// n.
    #[must_use]
    pub const fn order(&self) -> usize {
        self.n
    }

    /// Row i, n numbers.
    #[must_use]
    pub fn row(&self, i: usize) -> &[T] {
        self.data.get(i * self.stride..).and_then(|rest| rest.get(..self.n)).unwrap_or(&[])
    }

    /// Row i to be written.
    pub fn row_mut(&mut self, i: usize) -> &mut [T] {
        let (n, begin) = (self.n, i * self.stride);
        self.data.get_mut(begin..).and_then(|rest| rest.get_mut(..n)).unwrap_or(&mut [])
    }

    /// Element (i, j), 0 outside.
    #[inline]
    #[must_use]
    pub fn at(&self, i: usize, j: usize) -> T {
        self.row(i).get(j).copied().unwrap_or(T::zero())
    }

    /// Write element (i, j).
    #[inline]
    pub fn set(&mut self, i: usize, j: usize, value: T) {
        if let Some(place) = self.row_mut(i).get_mut(j) {
            *place = value;
        }
    }

    /// Write elements (i, j) and (j, i).
    #[inline]
    pub fn set_both(&mut self, i: usize, j: usize, value: T) {
        self.set(i, j, value);
        self.set(j, i, value);
    }

    /// Every element from its indices.
    pub fn fill_with(&mut self, mut value: impl FnMut(usize, usize) -> T) {
        for i in 0..self.n {
            for (j, place) in self.row_mut(i).iter_mut().enumerate() {
                *place = value(i, j);
            }
        }
    }

    /// Copy the elements of another one.
    pub fn copy_from(&mut self, other: &Square<'_, T>) {
        for i in 0..self.n {
            for (place, &value) in self.row_mut(i).iter_mut().zip(other.row(i)) {
                *place = value;
            }
        }
    }

    /// self = a b^T, which is a b where b is symmetric.
    pub fn product(&mut self, a: &Square<'_, T>, b: &Square<'_, T>) {
        for i in 0..self.n {
            let row = a.row(i);
            for (j, place) in self.row_mut(i).iter_mut().enumerate() {
                *place = dot(row, b.row(j));
            }
        }
    }

    /// Make the diagonal minus the sum of the rest of the row: a graph Laplacian when the
    /// rest is negative.
    pub fn make_laplacian(&mut self) {
        for i in 0..self.n {
            let mut sum = T::zero();
            for (j, place) in self.row_mut(i).iter_mut().enumerate() {
                if j == i {
                    *place = T::zero();
                }
                sum += *place;
            }
            self.set(i, i, -sum);
        }
    }

    /// Replace the lower triangle of a symmetric matrix by A = L D L^T, D in the diagonal of the unit
    /// lower triangle L, and return ln |det A|.
    ///
    /// There is no pivoting: for positive definite matrices and those close to it. Pivots are not taken
    /// for smaller than 1e-12 (f64) or 1e-7 (f32) of the diagonal element.
    pub fn factor(&mut self) -> T {
        let mut log_determinant = T::zero();
        for i in 0..self.n {
            let (above, rest) = self.data.split_at_mut((i * self.stride).min(self.data.len()));
            let row = rest.get_mut(..self.n).unwrap_or(&mut []);
            let pivot = factor_row(above, self.stride, row, i);
            log_determinant += pivot.abs().ln();
        }
        log_determinant
    }

    /// Solve A x = b in place of b; `self` has been through [`Self::factor`].
    pub fn solve_factored(&self, b: &mut [T]) {
        for i in 0..self.n {
            let (done, from_i) = b.split_at_mut(i.min(b.len()));
            let Some(x) = from_i.first_mut() else { return };
            *x = *x - dot(self.row(i), done);
        }
        for i in (0..self.n).rev() {
            let Some((x, later)) = b.get_mut(i..).and_then(<[T]>::split_first_mut) else { return };
            *x = *x / self.at(i, i);
            for (k, &y) in (i + 1..self.n).zip(later.iter()) {
                *x = *x - self.at(k, i) * y;
            }
        }
    }

    /// Replace a symmetric matrix by its inverse and return ln |det A|; see [`Self::factor`].
    pub fn invert(&mut self) -> T {
        let log_determinant = self.factor();
        self.invert_factor();
        self.join_inverse_factors();
        log_determinant
    }

    /// L <- L^-1, row by row: x_ij = -(l_ij + sum over j < k < i of l_ik x_kj); D <- D^-1.
    fn invert_factor(&mut self) {
        for i in 0..self.n {
            for j in 0..i {
                let mut sum = self.at(i, j);
                for (k, &l) in self.row(i).iter().enumerate().take(i).skip(j + 1) {
                    sum += l * self.at(k, j);
                }
                self.set(i, j, -sum);
            }
            let pivot = self.at(i, i);
            self.set(i, i, T::one() / pivot);
        }
    }

    /// A^-1 = X^T D^-1 X with X = L^-1, in both triangles.
    fn join_inverse_factors(&mut self) {
        for i in 0..self.n {
            for j in 0..=i {
                // x_ii = 1, whose place holds 1/d_i.
                let x_ij = if i == j { T::one() } else { self.at(i, j) };
                let mut sum = self.at(i, i) * x_ij;
                for k in i + 1..self.n {
                    sum += self.at(k, i) * self.at(k, k) * self.at(k, j);
                }
                self.set(i, j, sum);
            }
            for j in 0..i {
                let value = self.at(i, j);
                self.set(j, i, value);
            }
        }
    }
}

/// Row i of the factor, with the rows above it done; returns d_i.
fn factor_row<T: Real>(above: &[T], stride: usize, row: &mut [T], i: usize) -> T {
    for j in 0..i {
        let other = above.get(j * stride..).and_then(|rest| rest.get(..j)).unwrap_or(&[]);
        let (done, from_j) = row.split_at_mut(j.min(row.len()));
        if let Some(place) = from_j.first_mut() {
            *place = *place - dot(done, other);
        }
    }
    let (before, from_i) = row.split_at_mut(i.min(row.len()));
    let Some(place) = from_i.first_mut() else { return T::one() };
    let least = place.abs().max(T::from_f64(f64::from(f32::MIN_POSITIVE))) * smallest_pivot();
    for (k, c) in before.iter_mut().enumerate() {
        // So far l_ik d_k.
        let pivot = above.get(k * stride + k).copied().unwrap_or(T::one());
        let l = *c / pivot;
        *place = *place - *c * l;
        *c = l;
    }
    if place.abs() < least {
        *place = least;
    }
    *place
}

/// Sum of a_k b_k over what both have.
#[inline]
pub(crate) fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (&x, &y)| x.mul_add(y, sum))
}

/// sum_k += factor a_k over what both have.
#[inline]
pub(crate) fn add_times<T: Real>(sum: &mut [T], factor: T, a: &[T]) {
    for (place, &x) in sum.iter_mut().zip(a) {
        *place = factor.mul_add(x, *place);
    }
}

/// Share of its element below which a pivot is rounding.
fn smallest_pivot<T: Real>() -> T {
    let exact = T::from_f64(1.0 + 1e-12) - T::one() > T::zero();
    T::from_f64(if exact { 1e-12 } else { 1e-7 })
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 6;

    /// exp(-|i-j|/3) with some noise on the diagonal.
    fn decay<T: Real>(data: &mut [T]) -> Square<'_, T> {
        let mut a = Square::with_stride(data, N, N + 2);
        a.fill_with(|i, j| {
            let lag = (i as f64 - j as f64).abs();
            T::from_f64(libm::exp(-lag / 3.0) + if i == j { 0.1 } else { 0.0 })
        });
        a
    }

    fn inverse_times_matrix_is_one<T: Real>(error: f64) {
        let (mut x, mut y, mut z) = ([T::zero(); 64], [T::zero(); 64], [T::zero(); 64]);
        let (mut a, b) = (decay(&mut x), decay(&mut y));
        a.invert();
        let mut product = Square::new(&mut z, N);
        product.product(&a, &b);
        for i in 0..N {
            for j in 0..N {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product.at(i, j).to_f64() - expected).abs() < error, "({i}, {j})");
            }
        }
    }

    #[test]
    fn inverse() {
        inverse_times_matrix_is_one::<f64>(1e-14);
        inverse_times_matrix_is_one::<f32>(3e-6);
    }

    #[test]
    fn solution_and_determinant() {
        let (mut x, mut y) = ([0.0; 64], [0.0; 64]);
        let (mut a, b) = (decay::<f64>(&mut x), decay(&mut y));
        let log_determinant = a.factor();
        let pivots: f64 = (0..N).map(|i| a.at(i, i)).product();
        assert!((log_determinant - libm::log(pivots)).abs() < 1e-13);
        let right = [1.0, -2.0, 0.5, 3.0, 0.0, 1.0];
        let mut solution = right;
        a.solve_factored(&mut solution);
        for (i, expected) in right.iter().enumerate() {
            assert!((dot(b.row(i), &solution) - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn negative_eigenvalues_are_kept() {
        let mut data = [2.0, 1.0, 1.0, -3.0];
        Square::new(&mut data, 2).invert();
        for (got, expected) in data.iter().zip([3.0, 1.0, 1.0, -2.0]) {
            assert!((got - expected / 7.0_f64).abs() < 1e-15, "{data:?}");
        }
    }

    #[test]
    fn singular_matrices_and_short_buffers_do_no_harm() {
        let mut data = [1.0_f64; 9];
        let mut ones = Square::new(&mut data, 3);
        assert!(ones.invert().is_finite());
        let mut short = [0.0; 3];
        assert_eq!(Square::new(&mut short, 5).order(), 0);
        assert_eq!(Square::new(&mut short, 5).at(7, 7), 0.0);
    }

    #[test]
    fn laplacian_rows_sum_to_zero() {
        let mut data = [0.0; 64];
        let mut a = decay::<f64>(&mut data);
        a.make_laplacian();
        for i in 0..N {
            assert!(a.row(i).iter().sum::<f64>().abs() < 1e-15);
        }
    }
}
