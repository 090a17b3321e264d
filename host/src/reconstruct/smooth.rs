//! Least-squares polynomials, by recurrence of orthogonal ones.
//!
//! G. E. Forsythe, *J. Soc. Ind. Appl. Math.* 5, 74 (1957): monic polynomials orthogonal on the
//! given points under the given weights. No system of equations, so nothing is ill-conditioned.

/// A fitted polynomial.
pub(crate) struct Fit {
    /// Its values at the points.
    pub(crate) values: Vec<f64>,
    /// Weighted root mean square of what is left.
    pub(crate) residual: f64,
    /// Coefficients of the monic orthogonal polynomials.
    coefficients: Vec<f64>,
    /// Zero of the factor by which each polynomial is raised to the next.
    centres: Vec<f64>,
}

impl Fit {
    /// The polynomial of degree `degree` nearest to `values` at the points `x`.
    pub(crate) fn new(x: &[f64], values: &[f64], weights: &[f64], degree: usize) -> Self {
        let product = |a: &[f64], b: &[f64]| -> f64 {
            weights.iter().zip(a).zip(b).map(|((w, a), b)| w * a * b).sum()
        };
        let (mut last, mut norm_of_last) = (vec![0.0; x.len()], 1.0);
        let mut current = vec![1.0; x.len()];
        let mut fit = Self {
            values: vec![0.0; x.len()],
            residual: 0.0,
            coefficients: Vec::new(),
            centres: Vec::new(),
        };
        for _ in 0..=degree {
            let norm = product(&current, &current);
            let coefficient = product(&current, values) / norm;
            fit.values.iter_mut().zip(&current).for_each(|(v, p)| *v += coefficient * p);
            let raised: Vec<f64> = current.iter().zip(x).map(|(p, x)| p * x).collect();
            let centre = product(&raised, &current) / norm;
            let share = norm / norm_of_last;
            let terms = raised.iter().zip(&current).zip(&last);
            let next = terms.map(|((raised, p), last)| raised - centre * p - share * last);
            let next = next.collect();
            last = std::mem::replace(&mut current, next);
            norm_of_last = norm;
            fit.coefficients.push(coefficient);
            fit.centres.push(centre);
        }
        let left: Vec<f64> = values.iter().zip(&fit.values).map(|(a, b)| a - b).collect();
        fit.residual = (product(&left, &left) / weights.iter().sum::<f64>()).sqrt();
        fit
    }

    /// Coefficients of x^2 and x^3 of a polynomial of degree 3.
    pub(crate) fn square_and_cube(&self) -> Option<[f64; 2]> {
        let ([_, _, square, cube], [a, b, c, _]) = (&self.coefficients[..], &self.centres[..])
        else {
            return None;
        };
        // The monic cubic is (x - a)(x - b)(x - c) less multiples of x and 1.
        Some([square - cube * (a + b + c), *cube])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_found_under_uneven_weights() {
        let x: Vec<f64> = (0..50).map(|n| f64::from(n) / 25.0 - 1.0).collect();
        let cubic: Vec<f64> =
            x.iter().map(|x| 3.0 - 40.0 * x + 2.0 * x * x - 0.5 * x.powi(3)).collect();
        let weights: Vec<f64> = x.iter().map(|x| (1.2 + x).powi(2)).collect();
        let fit = Fit::new(&x, &cubic, &weights, 3);
        let [square, cube] = fit.square_and_cube().unwrap();
        assert!((square - 2.0).abs() < 1e-10 && (cube + 0.5).abs() < 1e-10, "{square} {cube}");
        assert!(fit.residual < 1e-11);
        assert!(Fit::new(&x, &cubic, &weights, 5).residual < 1e-11);
        assert!(Fit::new(&x, &cubic, &weights, 2).residual > 0.01);
    }
}
