//! Nelder and Mead's simplex for a function of two variables.
//!
//! J. A. Nelder, R. Mead: *A simplex method for function minimization*, Computer Journal 7, 308
//! (1965), with their coefficients: reflect 1, expand 2, contract and shrink 1/2. It needs no
//! gradient, so the rounding of single-precision transforms does not stop it.

/// Where the search ended.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Minimum {
    /// The best point.
    pub(crate) point: [f64; 2],
    /// How often the function was asked.
    pub(crate) evaluations: usize,
}

/// A point and the function there.
type Vertex = ([f64; 2], f64);

/// The minimum near `start`, whose first simplex spans `step`, until the simplex is smaller than
/// `tolerance` along both axes or `most` evaluations are used.
pub(crate) fn minimise(
    function: impl Fn([f64; 2]) -> f64,
    start: [f64; 2],
    step: [f64; 2],
    tolerance: [f64; 2],
    most: usize,
) -> Minimum {
    let at = |point| (point, function(point));
    let [x, y] = start;
    let mut simplex = [at(start), at([x + step[0], y]), at([x, y + step[1]])];
    let mut evaluations = 3;
    loop {
        simplex.sort_by(|a, b| a.1.total_cmp(&b.1));
        if is_small(&simplex, tolerance) || evaluations >= most {
            return Minimum { point: simplex[0].0, evaluations };
        }
        evaluations += advance(&mut simplex, &at);
    }
}

/// Replace the worst vertex of a sorted simplex; the evaluations that took are returned.
fn advance(simplex: &mut [Vertex; 3], at: &impl Fn([f64; 2]) -> Vertex) -> usize {
    let [best, second, worst] = *simplex;
    let middle = blend(best.0, second.0, 0.5);
    let reflected = at(blend(middle, worst.0, -1.0));
    if reflected.1 < best.1 {
        let expanded = at(blend(middle, worst.0, -2.0));
        simplex[2] = if expanded.1 < reflected.1 { expanded } else { reflected };
        return 2;
    }
    if reflected.1 < second.1 {
        simplex[2] = reflected;
        return 1;
    }
    let outside = reflected.1 < worst.1;
    let contracted = at(blend(middle, worst.0, if outside { -0.5 } else { 0.5 }));
    if contracted.1 < worst.1.min(reflected.1) {
        simplex[2] = contracted;
        return 2;
    }
    simplex[1] = at(blend(best.0, second.0, 0.5));
    simplex[2] = at(blend(best.0, worst.0, 0.5));
    4
}

/// The point at `share` of the way from `from` to `to`.
fn blend(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]))
}

fn is_small(simplex: &[Vertex; 3], tolerance: [f64; 2]) -> bool {
    let [best, others @ ..] = simplex;
    let near = |vertex: &Vertex| {
        (0..2).all(|axis| (vertex.0[axis] - best.0[axis]).abs() <= tolerance[axis])
    };
    others.iter().all(near)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_floor_of_a_bent_valley() {
        // Rosenbrock's function, minimum at (1, 1).
        let function = |[x, y]: [f64; 2]| (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2);
        let found = minimise(function, [-1.2, 1.0], [0.5, 0.5], [1e-6; 2], 500);
        assert!(found.point.iter().all(|x| (x - 1.0).abs() < 1e-4), "{found:?}");
        assert!(found.evaluations < 300, "{found:?}");
    }

    #[test]
    fn stops_at_the_limit_and_where_nothing_is_finite() {
        let found = minimise(|[x, _]| -x, [0.0; 2], [1.0; 2], [1e-3; 2], 50);
        assert!((50..54).contains(&found.evaluations), "{found:?}");
        let found = minimise(|_| f64::NAN, [0.0; 2], [1.0; 2], [1e-3; 2], 200);
        assert!(found.evaluations <= 204, "{found:?}");
    }
}
