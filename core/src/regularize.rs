//! Tikhonov terms: Gamma_1 fixes the gauge, Gamma_2 bridges frames whose weights are all zero.
//!
//! Gamma_1 (paper lines 922-927) is one entry, mu_1^2 phi_g^2. The rest of the problem knows
//! differences only, so the sum of all normal equations reads mu_1^2 phi_g = 0: whatever
//! mu_1 > 0, it sets phi_g = 0 and changes no difference. The solver therefore leaves phi_g out as
//! a known zero (`Solver::with_storage`'s gauge), which is the same solution without the digits
//! that a small mu_1 costs in `f32`.
//!
//! Gamma_2 is written here, as links between neighbouring frames with phase difference 0:
//! |r . phi|^2 with coefficients r that sum to 0 is the sum over i < j of -r_i r_j (phi_i - phi_j)^2.

use crate::params::{Difference, Params};
use crate::scalar::Scalar;
use crate::solver::Solver;
use crate::storage::{Link, Node};

/// The links (frames back from the newest, dt, conductance) of mu_2^2 |Gamma_2 phi|^2 for the one
/// difference that ends at the newest frame.
///
/// `times` are the acquisition times up to the newest frame, oldest first, of which the last two or
/// three are used (fewer: no links), and `interval` the interval, in the same unit, at which
/// the difference has the paper's scale:
///
/// first:  mu_2 * (phi_b - phi_a) * interval / (t_b - t_a); evenly spaced: phi_i - phi_{i-1} (paper lines 929-935)
/// second: mu_2 * 2 [(phi_c - phi_b)/(t_c - t_b) - (phi_b - phi_a)/(t_b - t_a)] / (t_c - t_a) * interval^2;
///         evenly spaced: phi_i - 2 phi_{i-1} + phi_{i-2}
#[inline]
#[must_use]
pub fn difference_links(params: &Params, times: &[f64], interval: f64) -> [(usize, usize, f64); 3] {
    let mu = params.difference_strength;
    match (params.difference, times) {
        (Difference::First, &[.., a, b]) => {
            let slope = mu * interval / (b - a);
            [(1, 1, slope * slope), (0, 0, 0.0), (0, 0, 0.0)]
        }
        (Difference::Second, &[.., a, b, c]) => {
            let scale = 2.0 * mu * interval * interval / (c - a);
            let (at_a, at_c) = (scale / (b - a), scale / (c - b));
            let at_b = -(at_a + at_c);
            [(2, 1, -at_a * at_b), (1, 1, -at_b * at_c), (2, 2, -at_a * at_c)]
        }
        _ => [(0, 0, 0.0); 3],
    }
}

/// Add Gamma_2 to a batch of `times.len()` frames.
#[inline(always)]
pub fn add_differences<T, A, B>(solver: &mut Solver<T, A, B>, params: &Params, times: &[f64])
where
    T: Scalar,
    A: AsRef<[Link<T>]> + AsMut<[Link<T>]>,
    B: AsRef<[Node<T>]> + AsMut<[Node<T>]>,
{
    for (t, dt, conductance) in batch_links(params, times) {
        solver.add_prior(t, dt, T::from_f64(conductance));
    }
}

/// All links (t, dt, conductance) of Gamma_2 for a series; the paper's scale holds at the mean interval.
pub fn batch_links<'a>(
    params: &'a Params,
    times: &'a [f64],
) -> impl Iterator<Item = (usize, usize, f64)> + 'a {
    let interval = mean_interval(times);
    (1..times.len())
        .flat_map(move |newest| {
            let known = times.get(..=newest).unwrap_or(times);
            let links = difference_links(params, known, interval);
            links.map(|(back, dt, conductance)| (newest - back.min(newest), dt, conductance))
        })
        .filter(|&(_, dt, _)| dt > 0)
}

/// Mean time between frames; 1 for fewer than two.
#[must_use]
pub fn mean_interval(times: &[f64]) -> f64 {
    match times {
        [first, .., last] => (last - first) / (times.len() - 1) as f64,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::solve_series;
    use crate::solver::FixedSolver;

    /// phi at six frames when only the links 0-1, 1-2 and 4-5 are measured, on the given times.
    fn bridge(difference: Difference, times: [f64; 6]) -> [f64; 6] {
        let params = Params { difference, reference_frames: 1, ..Params::paper(2) };
        let mut solver = FixedSolver::<f64, 6, 2>::new(2, 0, 1);
        let (mut phases, mut measured) = ([0.0; 6], [0.0; 6]);
        let pair = |t: usize, dt: usize| {
            let known = dt == 1 && [0, 1, 4].contains(&t);
            (times[t] - times[t + dt], if known { 1.0 } else { 0.0 })
        };
        solve_series(&mut solver, &params, &times, pair, &mut phases, &mut measured);
        assert_eq!(measured, [1.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
        phases
    }

    #[test]
    fn first_differences_bridge_a_gap_with_a_level_line() {
        let phases = bridge(Difference::First, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        for (phase, expected) in phases.into_iter().zip([0.0, 1.0, 2.0, 2.0, 2.0, 3.0]) {
            assert!((phase - expected).abs() < 1e-5, "{phases:?}");
        }
    }

    #[test]
    fn second_differences_bridge_a_gap_with_a_straight_line_in_real_time() {
        for times in [[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], [0.0, 1.0, 1.5, 3.0, 7.0, 8.0]] {
            let phases = bridge(Difference::Second, times);
            for (phase, expected) in phases.into_iter().zip(times) {
                assert!((phase - expected).abs() < 1e-4, "{phases:?}");
            }
        }
    }
}
