//! Symmetric positive definite matrices whose entries lie near the diagonal.

/// The lower half of a symmetric matrix, `band` entries left of the diagonal.
pub struct Banded {
    band: usize,
    /// Row by row: the entries of columns i − band … i.
    rows: Vec<f64>,
}

impl Banded {
    /// Zeros, `size` × `size`.
    pub fn new(size: usize, band: usize) -> Self {
        Self { band, rows: vec![0.0; size * (band + 1)] }
    }

    /// Adds to the entry of `row` and `column` ≤ `row`, and to its mirror image.
    pub fn add(&mut self, row: usize, column: usize, value: f64) {
        let at = self.at(row, column);
        self.rows[at] += value;
    }

    fn at(&self, row: usize, column: usize) -> usize {
        row * (self.band + 1) + self.band + column - row
    }

    /// Solves for `right` by Cholesky's factors; `None` if the matrix is not positive definite.
    pub fn solve(mut self, right: &[f64]) -> Option<Vec<f64>> {
        let size = right.len();
        for i in 0..size {
            for j in i.saturating_sub(self.band)..=i {
                let start = i.saturating_sub(self.band).max(j.saturating_sub(self.band));
                let sum: f64 =
                    (start..j).map(|k| self.rows[self.at(i, k)] * self.rows[self.at(j, k)]).sum();
                let (here, diagonal) = (self.at(i, j), self.at(j, j));
                let rest = self.rows[here] - sum;
                self.rows[here] = if i == j {
                    if rest.is_nan() || rest <= 0.0 {
                        return None;
                    }
                    rest.sqrt()
                } else {
                    rest / self.rows[diagonal]
                };
            }
        }
        let mut x = right.to_vec();
        for i in 0..size {
            let sum: f64 =
                (i.saturating_sub(self.band)..i).map(|k| self.rows[self.at(i, k)] * x[k]).sum();
            x[i] = (x[i] - sum) / self.rows[self.at(i, i)];
        }
        for i in (0..size).rev() {
            let end = (i + self.band + 1).min(size);
            let sum: f64 = (i + 1..end).map(|k| self.rows[self.at(k, i)] * x[k]).sum();
            x[i] = (x[i] - sum) / self.rows[self.at(i, i)];
        }
        Some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_band() {
        let mut matrix = Banded::new(4, 2);
        let entries = [
            (0, 0, 4.0),
            (1, 0, 1.0),
            (1, 1, 5.0),
            (2, 0, -1.0),
            (2, 1, 2.0),
            (2, 2, 6.0),
            (3, 2, 1.5),
            (3, 3, 3.0),
        ];
        entries.iter().for_each(|&(i, j, v)| matrix.add(i, j, v));
        let x = [1.0, -2.0, 0.5, 3.0];
        let mut right = [0.0; 4];
        for &(i, j, v) in &entries {
            right[i] += v * x[j];
            if i != j {
                right[j] += v * x[i];
            }
        }
        let found = matrix.solve(&right).unwrap();
        assert!(found.iter().zip(x).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    }

    #[test]
    fn refuses_what_is_not_definite() {
        let mut matrix = Banded::new(2, 1);
        [(0, 0, 1.0), (1, 0, 2.0), (1, 1, 1.0)].iter().for_each(|&(i, j, v)| matrix.add(i, j, v));
        assert!(matrix.solve(&[1.0, 1.0]).is_none());
    }
}
