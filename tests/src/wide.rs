//! Numbers of about 32 decimal digits (double-double), and Gaussian elimination with them.
//!
//! The paper's normal matrix (line 918) adds μ₂² = 1e−6 to sums of w², and w² reaches 1e8 with
//! Fisher weights. In plain `f64` its solution would lose up to all of its digits wherever frames
//! hang together through the regularisation only. The oracle must not: it solves in [`Wide`].

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number kept as the unevaluated sum `high + low`, with |low| ≤ half a unit in the last place
/// of `high`. Relative precision about 2⁻¹⁰⁴.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wide {
    /// The nearest `f64`.
    pub high: f64,
    /// What `high` leaves over.
    pub low: f64,
}

impl Wide {
    /// Nought.
    pub const ZERO: Wide = Wide { high: 0.0, low: 0.0 };

    /// The exact product `a · b` of two `f64` (barring underflow).
    pub fn product(a: f64, b: f64) -> Wide {
        let high = a * b;
        Wide { high, low: a.mul_add(b, -high) }
    }

    /// The exact sum `a + b` of two `f64`.
    pub fn sum(a: f64, b: f64) -> Wide {
        let high = a + b;
        let b_seen = high - a;
        let a_seen = high - b_seen;
        Wide { high, low: (a - a_seen) + (b - b_seen) }
    }

    /// The nearest `f64`.
    pub fn to_f64(self) -> f64 {
        self.high + self.low
    }
}

impl From<f64> for Wide {
    fn from(value: f64) -> Wide {
        Wide { high: value, low: 0.0 }
    }
}

impl Add for Wide {
    type Output = Wide;
    fn add(self, other: Wide) -> Wide {
        let high = Wide::sum(self.high, other.high);
        let low = Wide::sum(self.low, other.low);
        let first = Wide::sum(high.high, high.low + low.high);
        Wide::sum(first.high, first.low + low.low)
    }
}

impl Neg for Wide {
    type Output = Wide;
    fn neg(self) -> Wide {
        Wide { high: -self.high, low: -self.low }
    }
}

impl Sub for Wide {
    type Output = Wide;
    fn sub(self, other: Wide) -> Wide {
        self + -other
    }
}

impl Mul for Wide {
    type Output = Wide;
    fn mul(self, other: Wide) -> Wide {
        let main = Wide::product(self.high, other.high);
        let cross = self.high * other.low + self.low * other.high;
        Wide::sum(main.high, main.low + cross)
    }
}

impl Div for Wide {
    type Output = Wide;
    fn div(self, other: Wide) -> Wide {
        let first = self.high / other.high;
        let rest = self - other * Wide::from(first);
        let second = rest.high / other.high;
        let rest = rest - other * Wide::from(second);
        let third = rest.high / other.high;
        Wide::sum(first, second) + Wide::from(third)
    }
}

/// Solves A X = B by Gaussian elimination with partial pivoting.
///
/// `matrix` is A, n rows of n; `right` is B, n rows of any one length m. Returns X, n rows of m,
/// or `None` if A is singular (a pivot is zero or not finite).
///
/// # Panics
/// If the shapes do not fit.
pub fn solve(mut matrix: Vec<Vec<Wide>>, mut right: Vec<Vec<Wide>>) -> Option<Vec<Vec<Wide>>> {
    let n = matrix.len();
    assert!(matrix.iter().all(|row| row.len() == n), "A must be square");
    assert_eq!(right.len(), n, "B must have as many rows as A");
    for k in 0..n {
        let size = |row: usize| matrix[row][k].high.abs();
        let best = (k..n).fold(k, |best, row| if size(row) > size(best) { row } else { best });
        matrix.swap(k, best);
        right.swap(k, best);
        let pivot = matrix[k][k];
        if pivot.high == 0.0 || !pivot.high.is_finite() {
            return None;
        }
        let (pivot_row, pivot_right) = (matrix[k].clone(), right[k].clone());
        for i in k + 1..n {
            if matrix[i][k].high == 0.0 {
                continue;
            }
            let factor = matrix[i][k] / pivot;
            for (entry, &above) in matrix[i].iter_mut().zip(&pivot_row).skip(k) {
                *entry = *entry - factor * above;
            }
            for (entry, &above) in right[i].iter_mut().zip(&pivot_right) {
                *entry = *entry - factor * above;
            }
        }
    }
    for k in (0..n).rev() {
        for column in 0..right[k].len() {
            let mut value = right[k][column];
            for (&entry, below) in matrix[k].iter().zip(&right).skip(k + 1) {
                value = value - entry * below[column];
            }
            right[k][column] = value / matrix[k][k];
        }
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_what_f64_drops() {
        let tiny = 1e-25;
        let sum = Wide::from(1.0) + Wide::from(tiny) - Wide::from(1.0);
        assert!((sum.to_f64() - tiny).abs() < 1e-31);
        let third = Wide::from(1.0) / Wide::from(3.0);
        let rest = third * Wide::from(3.0) - Wide::from(1.0);
        assert!(rest.to_f64().abs() < 1e-31);
        let sevenths = Wide::from(22.0) / Wide::from(7.0) * Wide::from(7.0) - Wide::from(22.0);
        assert!(sevenths.to_f64().abs() < 1e-30);
    }

    #[test]
    fn inverts_the_hilbert_matrix() {
        // Condition number 1.6e13; the entries 1/(i+j+1) are made in Wide. The first row of the
        // inverse sums to (−1)^(n+1) n.
        let n = 10;
        let hilbert = (0..n)
            .map(|i| (0..n).map(|j| Wide::from(1.0) / Wide::from((i + j + 1) as f64)).collect())
            .collect();
        let ones = vec![vec![Wide::from(1.0)]; n];
        let x = solve(hilbert, ones).unwrap();
        assert!((x[0][0].to_f64() + 10.0).abs() < 1e-14);
        // The sum of all entries of the inverse is n².
        let sum = x.iter().fold(Wide::ZERO, |sum, row| sum + row[0]);
        assert!((sum.to_f64() - 100.0).abs() < 1e-12);
    }

    #[test]
    fn singular_is_none() {
        let one = Wide::from(1.0);
        assert!(solve(vec![vec![one; 2]; 2], vec![vec![one]; 2]).is_none());
    }
}
